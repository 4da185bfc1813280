"""Batches in several processes give what one process gives; errors come back, the dead are named, nothing stays."""

from __future__ import annotations

import functools
import os
import signal
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from conftest import two_rooms
from hand_worlds import grid_world
from handmade import HandCatalogue, furnished
from test_gym_pixels import NODES, ROOMS, env_of

from embodied.envs.base import ActionError
from embodied.gym.env import HelpGymEnv
from embodied.gym.eyes import Closed, PanoramaStore, PictureEyes, ViewSettings
from embodied.gym.in_parts import InParts, SharedArrays
from embodied.gym.in_step import InStep
from embodied.gym.spaces import SpaceLayout
from embodied.navigation.graph import graph_of
from embodied.world import open_world

MOVES = SpaceLayout().candidates


def part_of(cache: Path, strict: bool, num_envs: int, threads: int) -> InStep:
    """A batch in a small house, whose panoramas are drawn where they are not yet."""
    graph = graph_of(NODES, np.array([[0, 1], [1, 2]]), ("a", "b", "c"), ROOMS)
    world = open_world(furnished(two_rooms()), HandCatalogue(), cache, graph=graph, size=48)
    eyes = PictureEyes(PanoramaStore({world.name: world}), ("rgb", "depth"), ViewSettings(height=16, width=16))

    def one() -> HelpGymEnv:
        env = env_of(world, Closed())
        env._strict = strict
        return env

    return InStep(one, num_envs, eyes, threads=threads)


def same(a, b) -> bool:
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    return a.dtype == b.dtype and np.array_equal(a, b)


@pytest.mark.gl
@pytest.mark.slow
def test_two_processes_give_what_one_gives(tmp_path):
    one = part_of(tmp_path, False, 5, 1)
    two = InParts(functools.partial(part_of, tmp_path, False), 5, 2)
    assert two.observation_space == one.observation_space and two.action_space == one.action_space
    assert two.single_observation_space == one.single_observation_space
    a, b = one.reset(seed=3), two.reset(seed=3)
    for k in range(45):
        assert same(a[0], b[0]) and same(a[-1], b[-1]) and all(map(same, a[1:-1], b[1:-1])), k
        moves = np.where(a[0]["action_mask"][:, k % 3], k % 3, MOVES)
        earlier, kept = b[0]["rgb"], b[0]["rgb"].copy()
        a, b = one.step(moves), two.step(moves)
        assert (earlier == kept).all(), "what was handed out stays"
    a, b = one.step(np.full(5, MOVES)), two.step(np.full(5, MOVES))
    assert "success" in b[-1] and same(a[-1], b[-1]), "what is known at the end"
    assert two.get_attr("render_mode") == two.render() == one.render() == (None,) * 5
    for which in ([0, 1, 0, 0, 1], [0, 0, 0, 1, 0]):
        mask = np.array(which, bool)
        a, b = (envs.reset(seed=9, options={"reset_mask": mask}) for envs in (one, two))
        assert same(a[0], b[0]) and same(a[1], b[1]), which
    with pytest.raises(ValueError, match="some of them true"):
        two.reset(options={"reset_mask": np.zeros(5, bool)})
    with pytest.raises(ValueError, match="4 seeds for 5 environments"):
        two.reset(seed=[1, 2, 3, 4])
    one.close(), two.close()


@pytest.mark.gl
@pytest.mark.slow
def test_errors_come_back_as_themselves_and_a_killed_process_is_named(tmp_path):
    envs = InParts(functools.partial(part_of, tmp_path, True), 4, 2)
    envs.reset(seed=0)
    wrong = np.array([MOVES, MOVES, MOVES, MOVES - 1])
    with pytest.raises(ActionError):
        envs.step(wrong)
    o, _ = envs.reset(seed=0)
    assert o["rgb"].any(), "the line is clear again"
    os.kill(envs._parts[1]._process.pid, signal.SIGKILL)
    with pytest.raises(RuntimeError, match=r"ended \(exit code -9\).*make the batch anew"):
        envs.step(np.full(4, MOVES))
    memory = Path("/dev/shm") / envs._board.memory.name
    assert memory.exists()
    envs.close()
    assert not memory.exists() and not any(p._process.is_alive() for p in envs._parts)


@pytest.mark.slow
def test_make_vec_splits_slots_among_processes(tmp_path):
    made = functools.partial(
        gym.make_vec, "embodied/Find-v0", num_envs=3, sees="oracle", worlds={"grid": grid_world()}, cache=str(tmp_path)
    )
    one, many = made(), made(workers=8)
    assert isinstance(many, InParts) and len(many._parts) == 3, "no more processes than slots"
    assert same(one.reset(seed=4)[0], many.reset(seed=4)[0])
    many.close()
    with pytest.raises(ValueError, match="workers should be at least 1, got 0"):
        made(workers=0)
    with pytest.raises(ValueError, match="threads is for one process"):
        made(workers=2, threads=2)
    with pytest.raises(ValueError, match="sees should be one or several of"):
        made(workers=2, sees="smell")


def test_shared_arrays_lie_every_array_apart():
    space = gym.spaces.Dict(
        {"a": gym.spaces.Box(0, 255, (3,), np.uint8), "b": gym.spaces.Box(0, 1, (2, 2), np.float32)}
    )
    board = SharedArrays(space, 5)
    other = SharedArrays(space, 5, board.memory.name)
    board.arrays["a"][:], board.arrays["b"][:] = 7, 0.5
    assert (other.arrays["a"] == 7).all() and (other.arrays["b"] == 0.5).all()
    assert other.arrays["a"].shape == (5, 3) and other.arrays["b"].dtype == np.float32
    other.close()
    board.close(unlink=True)

"""Agents that find things: their map, what a teacher wants of a decision, and that sight is what they learn by."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from hand_worlds import grid_world, line_world

from embodied.agents.common.imitation import Supervised
from embodied.agents.common.vocabulary import build_vocabulary
from embodied.agents.find.network import AROUND, READ, Explorer, SeekNetwork
from embodied.agents.find.policy import STOP, WORDS, Search, WayMap, costs_of
from embodied.agents.find.study import Finder, FinderAbout, FindLearner, Labels, new_finder, tasks_in
from embodied.agents.learners.find import FinderConfig
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vision.sighted_study import Split
from embodied.evaluation.evaluate import play
from embodied.interface import Move, Sight
from embodied.kinds import metrics
from embodied.kinds.shipped.find import FIND
from embodied.kinds.task_kind import EnvInputs

torch.set_num_threads(1)
SIZE = 24


def split_of(world, marked: bool = True) -> Split:
    """Features that tell places apart; one number for each thing tells where it can be reached."""
    tasks = tasks_in({world.house.name: world}, 40, ("bed", "lamp", "mug", "sofa", "towel"))
    features = np.random.default_rng(0).normal(size=(len(world.graph.positions), 36, SIZE)).astype(np.float32)
    requests = sorted({t.request for t in tasks})
    features[:, :, : len(requests)] = 0
    for t in tasks:
        features[list(t.goal_nodes), :, requests.index(t.request)] = 5.0 * marked
    bank = FeatureBank({world.house.name: features}, "hand")
    return Split({world.house.name: world}, tasks, FIND.environments(EnvInputs({world.house.name: world})), bank)


def finder_for(split: Split, **settings) -> Finder:
    config = FinderConfig(
        hidden_size=32, dropout=0.0, **{"batch": 16, "learning_rate": 1e-2, "cooldown": 0.2, **settings}
    )
    words = build_vocabulary(t.request for t in split.tasks)
    requests = np.stack([words.encode(r, WORDS) for r in sorted({t.request for t in split.tasks})])
    about = FinderAbout(config=config, encoder="hand", feature_size=SIZE, words=words.words)
    return new_finder(about, torch.from_numpy(requests))


def labels_for(split: Split, finder: Finder) -> Labels:
    """What can be reached can be seen in all views; ways are not told about."""
    (world,) = split.worlds.values()
    requests, n = sorted({t.request for t in split.tasks}), len(world.graph.positions)
    read = torch.zeros(n, 36, len(READ), len(requests), dtype=torch.bool)
    for t in split.tasks:
        read[list(t.goal_nodes), :, :2, requests.index(t.request)] = True
    seen = finder.policy(split.bank).bank.gather([Sight("grid", v) for v in range(n)])
    return Labels(seen, read, torch.zeros(n, 36, dtype=torch.bool), torch.ones(n, len(requests), dtype=torch.bool))


def success(finder: Finder, split: Split) -> float:
    finder.network.eval()
    episodes = play(split.make_env, finder.policy(split.bank), split.tasks, seed=1, batch=20)
    return sum(metrics.success(e, split.worlds[e.task.world].graph) for e in episodes) / len(episodes)


def test_a_place_is_known_again_by_its_looks_and_never_in_the_dark():
    split = split_of(line_world())
    env, places = split.make_env(), WayMap()
    dark = WayMap()
    o = env.reset(split.tasks[0])
    for first in (True, True, False):  # there, and back to where it began
        look = split.bank.features(o.sight)
        assert places.arrive(o, look) is first
        assert dark.arrive(o, np.zeros_like(look))
        (towards,) = np.flatnonzero(np.abs(np.cos(o.candidates.bearing + o.turn * math.pi / 6)) > 0.9)[:1]
        if first and places.here == 1:  # half a turn
            back = places.spots[1].way(float(places.spots[0].ways[0]) + math.pi)
            assert places.spots[1].leads[back] == 0
            towards = int(back)
        places.leave(int(towards))
        dark.leave(int(towards))
        o = env.step(Move(int(towards)))
    assert places.here == 0 and places.spots[0].leads == [1] and len(dark.spots) == 3
    assert places.reach()[1] == (1, 0)


def test_a_teacher_counts_the_metres_that_are_left_after_each_option():
    split = split_of(line_world())
    task = next(t for t in split.tasks if t.start.node == 0)
    env = split.make_env()
    env.reset(task)
    search = Search(np.zeros(1))
    search.nodes, search.ends = [0], [(1,)]
    costs = costs_of(search, np.array([[0, STOP], [0, 0]]), env.situation)
    nearest = min(task.goal_nodes)
    assert costs[0] == math.inf and costs[1] == pytest.approx(2.0 * nearest)


def test_who_sees_learns_to_find_things_and_who_is_blind_does_not(tmp_path, monkeypatch):
    monkeypatch.setattr("embodied.agents.find.study.SINGLE_VIEWS", 0.9)
    split = split_of(grid_world(4))
    finder, blind = finder_for(split, iterations=60), finder_for(split, sees="nothing", iterations=50)
    for agent in (finder, blind):
        learner = FindLearner(agent, split, labels_for(split, agent))
        numbers = [learner.learn(update) for update in range(agent.about.config.iterations)]
        assert numbers[-1]["reading"] < numbers[0]["reading"]
    assert success(finder, split) > success(blind, split) + 0.3
    finder.save(tmp_path / "agent.safetensors")
    assert success(Finder.load(tmp_path / "agent.safetensors"), split) == success(finder, split)


def test_a_lesson_never_stops_at_a_wrong_place():
    split = split_of(grid_world(4))
    env = play(split.make_env, Supervised(finder_for(split).policy(split.bank)), split.tasks[:8], seed=0, batch=8)
    assert all(e.ended == "limit" or e.steps[-1].pose.node in e.task.goal_nodes for e in env)


def test_the_explorer_stops_at_what_is_within_reach_and_goes_to_what_it_sees():
    requests = torch.tensor([[3, 4], [3, 5]])
    explorer = Explorer(4, requests, 8, 0.0).eval()
    read = torch.full((2, 36, len(READ), 2), -3.0)
    read[:, 12, :2, 1] = 3.0  # the second class can be seen, and is within reach, in view 12
    explorer.wanted = lambda seen, request: (torch.stack([read[0, :, :, 0], read[1, :, :, 1]]), None, None)
    ways, stops = explorer(torch.zeros(2, 36, 4), requests, torch.tensor([[12, 18], [12, 18]]))
    assert ways[1, 0] > ways[1, 1] and ways[0, 0] == ways[0, 1]
    assert stops[1] > 0 > stops[0]
    assert AROUND[12].tolist() == [11, 0, 1, 23, 12, 13, 35, 24, 25]


def test_what_is_read_for_a_request_is_what_is_read_for_its_class():
    requests, seen = torch.tensor([[3, 4], [3, 5]]), torch.randn(2, 36, 4, generator=torch.Generator().manual_seed(0))
    network = SeekNetwork(4, requests, 8, 0.0).eval()
    read, kind, _ = network.wanted(seen, requests[[1, 0]])
    assert kind.tolist() == [1, 0]
    assert torch.allclose(read[0], network.read(seen)[0, :, :, 1], atol=1e-6)
    assert not network.wanted(seen, torch.tensor([[3, 9], [9, 9]]))[0].any()  # nobody taught it that

"""The HARI agent that ships: it loads, and asks and finds its way in a house it has never seen."""

from __future__ import annotations

import re

import pytest
import torch
from hand_worlds import grid_world

from embodied.agents.common.settings import SHIPPED_HARI, WEIGHTS
from embodied.agents.common.weights import origin_of
from embodied.agents.hari.networks import HariAgent, load_agent
from embodied.agents.hari.policy import policy_of
from embodied.evaluation.evaluate import play
from embodied.kinds import metrics
from embodied.kinds.shipped.hari import HARI, hari_pool, hari_task
from embodied.kinds.task_kind import EnvInputs
from embodied.language.plain_language import PlainLanguage


@pytest.mark.parametrize("path", sorted(WEIGHTS.glob("*.safetensors")), ids=lambda p: p.stem)
def test_shipped_weights_name_what_they_were_trained_with_or_say_that_it_is_lost(path):
    origin = origin_of(path)
    assert origin is not None and origin["settings"]
    drawn = r"([a-z]+_)+\d+"
    for part in ("data", "pictures", "code"):
        assert re.fullmatch(rf"[0-9a-f]{{12,}}|(lost|none): .+|{drawn}(, {drawn})*", origin[part]), (part, origin[part])


@pytest.fixture(scope="module")
def agent() -> HariAgent:
    return load_agent(SHIPPED_HARI)


def test_it_is_small_and_says_what_it_was_trained_as(agent):
    assert SHIPPED_HARI.stat().st_size < 10e6
    assert (agent.config.stack, agent.config.horizon, agent.config.cooperative) == (3, 30, True)
    assert "object/sofa" in agent.executor.words.names


@pytest.mark.slow
def test_it_plays_asks_and_ends(agent):
    world, pool = grid_world(), hari_pool(grid_world(), seed=0)
    tasks = [hari_task(pool, i, seed=0, language=PlainLanguage()) for i in range(min(16, len(pool)))]
    with torch.inference_mode():
        make = HARI.environments(EnvInputs({"grid": world}))
        episodes = play(make, policy_of(agent), tasks, seed=0, batch=8)
    assert all(e.ended in ("stop", "limit") and len(e.steps) <= 30 for e in episodes)
    assert sum(e.requests for e in episodes) > len(episodes), "it asks"
    assert any(metrics.success(e, world.graph) for e in episodes), "and finds what it was asked for"

"""The VNLA agent that ships: it loads, keeps to its budget, and what it is told moves it towards the goal."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hand_vnla import tasks_of
from hand_worlds import grid_world

from embodied.agents.common.settings import SHIPPED_ENCODER, SHIPPED_VNLA
from embodied.agents.vision.encoder import load_encoder
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vnla.study import LEARNED, VnlaAgent
from embodied.evaluation.evaluate import play
from embodied.interface import Episode
from embodied.kinds.shipped.vnla import VNLA
from embodied.kinds.task_kind import EnvInputs


@pytest.fixture(scope="module")
def agent() -> VnlaAgent:
    return VnlaAgent.load(SHIPPED_VNLA)


def test_it_is_small_and_says_what_it_was_trained_as(agent):
    assert SHIPPED_VNLA.stat().st_size < 6e6
    assert agent.config.rules == "indirect" and agent.about.pictures
    assert agent.about.encoder == load_encoder(SHIPPED_ENCODER).digest
    assert {"find", "forward", "steps", "left"} <= set(agent.vocabulary.words)


def played(agent: VnlaAgent, row: str = LEARNED) -> list[Episode]:
    """Sixteen tasks of a house by hand, whose pictures tell nothing: all it knows it was told."""
    world = grid_world()
    blank = FeatureBank({"grid": np.zeros((len(world.graph.ids), 36, agent.about.feature_size))}, agent.about.encoder)
    make = VNLA.environments(EnvInputs({"grid": world}))
    with torch.inference_mode():
        return play(make, agent.player(blank, row), tasks_of(world, 16), seed=0, batch=8)


@pytest.mark.slow
def test_it_plays_asks_within_its_budget_and_ends(agent):
    episodes = played(agent)
    assert all(e.requests <= e.budget and e.ended in ("stop", "limit") for e in episodes)
    assert any(e.requests for e in episodes)


@pytest.mark.slow
def test_it_does_what_it_is_told(agent):
    """Of the moves that follow a request, as many as were spoken of, most are those that were said."""
    said = done = 0
    for e in played(agent, "learned, asks first"):
        words: list[str] = []
        for step in e.steps:
            if step.reply is not None:
                words = list(step.reply.subtask.words)
            elif words:
                word, *words = words
                said, done = said + 1, done + (word == _word(step))
    assert said > 30 and done / said > 0.6


def _word(step) -> str:
    from embodied.action_spaces import WORDS

    return WORDS[step.action.candidate] if hasattr(step.action, "candidate") else "stop"

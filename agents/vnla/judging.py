"""Judging a VNLA agent beside other askers, direct intervention and agents without learning."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import torch

from agents.common.lessons import Lessons
from agents.vision.bank import FeatureBank
from agents.vnla.agent import VnlaAgent
from embodied.datasets.store import SplitData
from embodied.evaluation.evaluate import agent as agent_without_learning
from embodied.evaluation.evaluate import evaluate
from embodied.evaluation.tables import Row
from embodied.interface import Agent, Episode

COLUMNS = ("success", "strict success", "room success", "navigation error", "requests", "oracle success", "steps")
"""Those of the first paper, and how far the agents came."""
WITHOUT_LEARNING = ("random walk", "listener, teacher", "shortest")
TEACHER = "learned, asks as its teacher"
ASKED = {
    "learned, asks never": "none",
    "learned, asks first": "first",
    "learned, asks at random": "random",
    TEACHER: "teacher",
}
"""Rows that put another asker in front of the same networks (docs/sources.md, S39), and that asker."""
DIRECT = "learned, direct intervention"
"""The advisor carries out what it said: direct with sub-goals in the paper."""
LEARNED = "learned"


def row_names(agent: VnlaAgent) -> tuple[str, ...]:
    """All rows that an agent gives; direct intervention is that of one which learned to read what the advisor says."""
    direct = (DIRECT,) if agent.config.rules == "indirect" else ()
    return (LEARNED, *ASKED, *direct, *WITHOUT_LEARNING)


def rules_of_row(agent: VnlaAgent, name: str) -> str:
    """The rule of play that the row `name` is judged under."""
    return "direct" if name == DIRECT else agent.config.rules


def player(agent: VnlaAgent, bank: FeatureBank, name: str) -> Agent:
    """Who plays the row `name`."""
    if name in WITHOUT_LEARNING:
        return agent_without_learning("vnla", name, rules=agent.config.rules)
    return agent.player(bank, ASKED.get(name))


@torch.inference_mode()
def judge(
    lessons: Lessons,
    agent: VnlaAgent,
    splits: Sequence[str],
    *,
    seed: int = 0,
    limit: int | None = None,
    batch: int = 32,
    only: Sequence[str] = (),
    keep: Callable[[str, str, Sequence[Episode]], None] | None = None,
    watch: Callable[[Iterable[str]], Iterable[str]] = iter,
    instead: Callable[[SplitData], SplitData] = lambda split: split,
) -> list[Row]:
    """One row per player and split, over the same tasks, under the rule of play that the agent is judged under.

    Args:
      seed: of everything that is drawn, budgets included.
      limit: at most so many tasks per split, from all houses alike.
      only: names of rows; none for all.
      keep: is given split, name and episodes (to save them).
      watch: wraps the iterator over rows (a progress bar).
      instead: gives a split another assistant.

    Raises:
      ValueError: an unknown row.
    """
    if unknown := sorted(set(only) - set(row_names(agent))):
        raise ValueError(f"unknown rows {unknown}; there are {list(row_names(agent))}")
    rows = []
    for split in splits:
        bank = lessons.split(split).bank
        kept = None if keep is None else lambda name, episodes, split=split: keep(split, name, episodes)
        for name in watch(only or row_names(agent)):
            players: Mapping[str, Agent] = {name: player(agent, bank, name)}
            whole = instead(lessons.data.split(split, vnla=rules_of_row(agent, name)))
            rows += evaluate(whole, players, seed=seed, limit=limit, batch=batch, keep=kept)
    return rows

"""Judging a VNLA agent beside other askers, direct intervention and agents without learning."""

from __future__ import annotations

from embodied.agents.vision.bank import FeatureBank
from embodied.agents.vnla.agent import VnlaAgent
from embodied.interface import Agent
from embodied.kinds.shipped.vnla import VNLA

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
        return VNLA.agent(name)
    return agent.player(bank, ASKED.get(name))

"""Success against realism: agents that learned from one kind of pictures, judged in houses drawn in others (no
counterpart in the dissertation).

    embodied features --data DATA --encoder ENCODER --pictures reference --split test_unseen --houses 8
    embodied study realism --data DATA --out STUDY --houses 8 --agents unlit=A.safetensors lit=B.safetensors

Each agent looks through the encoder it learned with, or through another that sees alike. Which way of drawing ranks
agents as path-traced pictures do is told by Spearman's rank correlation over all agents.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import scipy.stats

from agents.common.lessons import drawings, split_of
from agents.common.session import Note
from agents.common.weights import weights_digest
from agents.hanna.agent import HannaAgent, load_agent
from agents.studies.engine import StudyRow, StudyTable
from agents.studies.episodes import JUDGES, EpisodeStudy
from agents.vision.encoder import load_encoder
from embodied.datasets.store import SplitData, dataset_of
from embodied.interface import Agent

LEAST = 3
"""Agents of which a rank correlation is told."""


@dataclass(frozen=True, kw_only=True)
class RealismStudy(EpisodeStudy):
    """Who is judged, where, and how that is drawn; rows are kinds of agents, whose files are their training seeds."""

    arms: Mapping[str, Sequence[Path]]
    """Kind of agent to the files of its training seeds."""
    pictures: tuple[str, ...]
    """Keys of agents.vision.config.RENDER_PRESETS; the last is what the others are ranked against."""
    split: str = "test_unseen"
    houses: int | None = None
    """The first so many houses of the split; None: all."""
    encoders: Mapping[str, Sequence[Path]] = field(default_factory=dict)
    """Kind of agent to the encoder that all of its agents look through, or to one for each of them; those without look
    through the one they learned with."""

    name = "realism"
    judges = (*JUDGES, "agents.hanna.agent")

    def __post_init__(self) -> None:
        if unknown := [*(self.encoders.keys() - self.arms.keys())]:
            raise ValueError(f"encoders are given for {sorted(unknown)}, agents for {sorted(self.arms)}")
        for arm, paths in self.encoders.items():
            if len(paths) not in (1, len(self.arms[arm])):
                raise ValueError(
                    f"{arm!r} has {len(self.arms[arm])} agents and {len(paths)} encoders; give one or each"
                )

    def watched(self, arm: str) -> list[tuple[Path, Path | None]]:
        """The agents of a kind, each with what it looks through if that is not what it learned with."""
        paths, through = self.arms[arm], self.encoders.get(arm, (None,))
        return [*zip(paths, through if len(through) > 1 else [*through] * len(paths), strict=True)]

    def tables(self) -> Mapping[str, StudyTable]:
        """One split per way of drawing, named by it."""
        rows = tuple(StudyRow(arm, {"arm": arm}) for arm in self.arms)
        return {"realism": StudyTable("Success against realism", rows, ("success", "requests"), self.pictures)}

    def seeds(self, row: StudyRow) -> Sequence[int]:
        return range(len(self.arms[(row.train or {})["arm"]]))

    def settings(self, train: Mapping[str, Any], seed: int) -> object:
        agent, encoder = self.watched(train["arm"])[seed]
        return {"agent": weights_digest(agent), "encoder": encoder and weights_digest(encoder)}

    def depends(self, train: Mapping[str, Any]) -> Mapping[str, object]:
        return {}

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Features that are missing are told, with the command that makes them."""
        for way in self.pictures:
            for arm in self.arms:
                for seed in range(len(self.arms[arm])):
                    self._bank(arm, seed, way)

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        return self.watched(train["arm"])[seed][0]

    def load(self, weights: Path) -> HannaAgent:
        return load_agent(weights)

    def judge(self, weights: Path | None, row: StudyRow, split: str, seed: int, folder: Path, keep: Path) -> Any:
        seen = StudyRow(row.label, row.train, {"arm": (row.train or {})["arm"], "seed": seed})
        return super().judge(weights, seen, split, seed, folder, keep)

    def policies(self, agent: HannaAgent, judge: Mapping[str, Any], split: str) -> Agent:
        return agent.policy(self._bank(judge["arm"], judge["seed"], split))

    def where(self, agent: HannaAgent, judge: Mapping[str, Any], split: str) -> SplitData:
        return dataset_of(self.data, "hanna").split(self.split, houses=self.houses)

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        data = dataset_of(self.data, "hanna")
        drawn = drawings(data, data.names(self.split)[: self.houses], split)
        return {**super().judged(row, split), "houses": self.houses, "of": self.split, "pictures": drawn}

    def about(self) -> str:
        houses = len(dataset_of(self.data, "hanna").names(self.split)[: self.houses])
        return f"{super().about()} Judged in {houses} houses of {self.split}, drawn in several ways."

    def _bank(self, arm: str, seed: int, way: str) -> Any:
        agent, encoder = self.watched(arm)[seed]
        digest = load_encoder(encoder).digest if encoder else load_agent(agent).encoder_digest
        return split_of(dataset_of(self.data, "hanna"), self.split, digest, houses=self.houses, picture_kind=way).bank


def ranks(body: Mapping[str, Any], ways: Sequence[str]) -> list[str]:
    """How each way of drawing ranks the rows of a stored table as the last way does, in words."""
    of = lambda way: [row["values"][f"success_{way}"]["mean"] for row in body["rows"]]
    told = [(way, rank_correlation(of(way), of(ways[-1]))) for way in ways[:-1]]
    return [f"Rank correlation of {way} with {ways[-1]}: {r:.2f}." for way, r in told if not math.isnan(r)]


def rank_correlation(first: Sequence[float], second: Sequence[float]) -> float:
    """Spearman's, ties sharing their ranks; NaN for fewer than LEAST agents, or where all are equal."""
    if len(first) < LEAST or len({*first}) == 1 or len({*second}) == 1:
        return math.nan
    return float(scipy.stats.spearmanr(first, second).statistic)

"""Navigation from ratings as data for the engine: gain against granularity, noise and skew, in houses that were not
rated."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from agents.bandit.navigation import learn_from_stars, score_of
from agents.bandit.rating_config import DECISIONS, RatingConfig
from agents.bandit.ratings import CLEAN, Rater, rater_of
from agents.common.checkpoint import read_checkpoint
from agents.common.session import Note
from agents.common.weights import weights_digest
from agents.hanna.agent import HannaAgent
from agents.hanna.asking import RULES
from agents.hanna.policy import for_training
from agents.studies.engine import Figure, Measured, StudyRow, StudyTable
from agents.studies.episodes import JUDGES, EpisodeStudy
from agents.vision.encoder import Encoder
from agents.vision.lessons import Lessons, Split
from embodied.datasets.store import Dataset, SplitData, dataset_of
from embodied.evaluation import metrics
from embodied.evaluation.tables import Samples
from embodied.interface import Agent, Episode

SWEEPS: Mapping[str, Sequence[float]] = {
    "granularity": (1, 2, 4, 9),
    "variance": (0.5, 1, 2, 5),
    "skew": (0.25, 0.5, 2, 4),
}
"""A granularity of 4 is one to five stars, of 9 one to ten."""
RISE = "score where rated, last quarter less the updates before anything is learned"
BEFORE = StudyRow("before", {"rater": "none"})


def raters() -> dict[str, Rater]:
    """By name: 'clean', and each perturbation at each strength."""
    swept = {f"{name} {value:g}": rater_of(name, value) for name, values in SWEEPS.items() for value in values}
    return {"clean": CLEAN, **swept}


def _rows() -> tuple[StudyRow, ...]:
    gains = [StudyRow("clean", {"rater": "clean"}, minus=BEFORE)]
    for name, values in SWEEPS.items():
        for v in values:
            gains.append(StudyRow(f"{name} {v:g}", {"rater": f"{name} {v:g}"}, minus=BEFORE, x=v, series=name))
    return (BEFORE, *gains)


@dataclass(frozen=True, kw_only=True)
class StarsStudy(EpisodeStudy):
    """A HANNA agent that learns from ratings of its walks."""

    agent: Path
    """The imitation-trained agent that all begin with."""
    encoder: Encoder
    """Whose features it knows."""
    config: RatingConfig
    split: str = "test_unseen"
    """Whose houses are judged in; nobody rated an episode there."""
    rated: str = "train"
    """Whose houses and tasks are rated in."""
    decisions: str = "drawn"
    """Judged with moves and questions 'drawn' from the networks, as they are while they are rated, or with the
    'usual' ones of `embodied evaluate`, which asks where that is likelier than not."""
    rater: Rater | None = None
    """Who rates in the row 'people': the rater that people were found to resemble."""

    name = "stars"
    makers = ("agents.bandit.navigation",)
    judges = (*JUDGES, "agents.bandit.stars_study")

    def __post_init__(self) -> None:
        if self.decisions not in DECISIONS:
            raise ValueError(f"decisions must be one of {DECISIONS}, got {self.decisions!r}")

    def tables(self) -> Mapping[str, StudyTable]:
        figure = Figure(("success",), "strength of the perturbation", "Δ success (points)", log=True)
        title = "Navigation from ratings: gain in houses that were not rated"
        people = StudyRow("people", {"rater": dataclasses.asdict(self.rater)}, minus=BEFORE) if self.rater else None
        rows = (*_rows(), people) if people else _rows()
        return {"stars": StudyTable(title, rows, ("success", "SDTW", "requests", RISE), (self.split,), figure=figure)}

    def settings(self, train: Mapping[str, Any], seed: int) -> RatingConfig:
        return dataclasses.replace(self.config, seed=seed)

    def depends(self, train: Mapping[str, Any]) -> Mapping[str, object]:
        data = Dataset(self.data).digest
        return {"data": data, "rated": self.rated, "begin": weights_digest(self.agent), "rater": train["rater"]}

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Houses that are both rated and judged in, and missing features, are refused."""
        data = dataset_of(self.data, "hanna")
        if both := set(data.names(self.rated)) & set(data.names(self.split)):
            raise ValueError(
                f"{len(both)} houses of {self.split!r} are rated in, too ({self.rated!r}); judge in others"
            )
        for name in (self.rated, self.split):
            self._split(name)

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        if train["rater"] == "none":
            return self.agent
        rated, begun = self._split(self.rated), weights_digest(self.agent)
        who, config = train["rater"], self.settings(train, seed)
        rater = Rater(**who) if isinstance(who, dict) else raters()[who]
        learn_from_stars(HannaAgent.load(self.agent), rated, rater, config, home, begun_with=begun, note=note)
        return home / "best.safetensors"

    def load(self, weights: Path) -> HannaAgent:
        return HannaAgent.load(weights)

    def policies(self, agent: HannaAgent, judge: Mapping[str, Any], split: str) -> Agent:
        policy = agent.policy(self._split(split).bank)
        if self.decisions == "usual":
            return policy
        return dataclasses.replace(for_training(policy, RULES[agent.config.ask_rule][0]), keep_moments=False)

    def _split(self, name: str) -> Split:
        return Lessons(dataset_of(self.data, "hanna"), self.encoder).split(name)

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {**super().judged(row, split), "decisions": self.decisions, "untaught": self.config.critic_updates}

    def judge(self, weights: Path | None, row: StudyRow, split: str, seed: int, folder: Path, keep: Path) -> Measured:
        found = dict(super().judge(weights, row, split, seed, folder, keep))
        history = (
            []
            if weights is None or weights == self.agent
            else read_checkpoint(weights.parent / "checkpoint.pt")["history"]
        )
        return found | {RISE: Samples((rise([h["score"] for h in history], self.config.critic_updates),))}

    def count(self, episodes: Sequence[Episode], split: SplitData, judge: Mapping[str, Any]) -> Measured:
        pairs, houses = [(e, split.worlds[e.task.world].graph) for e in episodes], tuple(e.task.world for e in episodes)
        return {
            "success": Samples(tuple(metrics.success(e, g) for e, g in pairs), houses, share=True),
            "SDTW": Samples(tuple(100 * score_of(e, g, "SDTW") for e, g in pairs), houses),
            "requests": Samples(tuple(float(e.requests) for e in episodes), houses),
        }

    def about(self) -> str:
        c = self.config
        return (
            f"{super().about()} {c.updates} updates of {c.batch} episodes, each rated once by its {c.score}; learning "
            f"rate {c.learning_rate:g}; decisions {self.decisions}."
        )


def rise(scores: Sequence[float], untaught: int) -> float:
    """How much the last quarter of the updates scores more than the first `untaught` ones, before anything is learned,
    in points of 100; 0 where nothing was rated.

    Args:
      scores: the mean true score of each update's episodes.
    """
    if not scores:
        return 0.0
    return 100 * float(np.mean(scores[-max(len(scores) // 4, 1) :]) - np.mean(scores[: max(untaught, 1)]))

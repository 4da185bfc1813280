"""Studies of agents that see features: what is common to them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from embodied.agents.common.settings import EvaluationSettings, ImitationSettings
from embodied.agents.common.sighted import SightedAgent
from embodied.agents.studies.episodes import EpisodeStudy
from embodied.agents.studies.tables import StudyRow, StudyTable
from embodied.agents.studies.wordings import SPEAKERS, code_of, hearing
from embodied.agents.vision.lessons import Lessons
from embodied.agents.vision.run import encoder_of
from embodied.assets.cache import default_cache
from embodied.datasets.store import Dataset, dataset_of
from embodied.evaluation.evaluate import agent as agent_without_learning
from embodied.interface import Agent

SPLITS = ("test_seen", "test_unseen")
NOTHING: Mapping[str, Any] = {}


@dataclass(frozen=True, kw_only=True)
class SightedStudy(EpisodeStudy):
    """A study of agents that see features. A learner says its tables, `agent_kind` and `train`."""

    encoder: Path
    network: str | None = None
    """Torchvision network of `encoder`, or 'random'; None for one of our own encoders."""
    config: ImitationSettings
    """Where the rows start from."""
    evaluation: EvaluationSettings = EvaluationSettings()
    pictures: str | None = None
    """Of the pictures that features come from; as the data set holds them where not given."""
    cache: Path = field(default_factory=default_cache)
    others: int | None = None
    """Training seeds of every row but those of the unchanged settings; None: as many."""

    agent_kind: ClassVar[type[SightedAgent]]
    all_tables: ClassVar[Mapping[str, StudyTable]]

    def tables(self) -> Mapping[str, StudyTable]:
        """The splits out of distribution that there are come beside the others."""
        ood = self.lessons().data.ood
        return {name: dataclasses.replace(t, splits=(*t.splits, *ood)) for name, t in self.all_tables.items()}

    def seeds(self, row: StudyRow) -> Sequence[int]:
        return self.repeats[: self.others] if row.train else super().seeds(row)

    def settings(self, train: Mapping[str, Any], seed: int) -> Any:
        return dataclasses.replace(self.config, seed=seed, **train)

    def depends(self, train: Mapping[str, Any]) -> Mapping[str, object]:
        return self.lessons(train).identity()

    def load(self, weights: Path) -> Any:
        agent = self.agent_kind.load(weights)
        return dataclasses.replace(agent, about=dataclasses.replace(agent.about, evaluation=self.evaluation))

    def policies(self, agent: Any, judge: Mapping[str, Any], split: str) -> Agent:
        if agent is None:
            return agent_without_learning(self.name, judge["played"])
        return self.heard(agent, agent.policy(self.judged_lessons(judge).split(split).bank), judge)

    def heard(self, agent: Any, policy: Any, judge: Mapping[str, Any]) -> Agent:
        """The policy of an agent, to which everything is said as the row has it."""
        return hearing(policy, judge, agent.about.words, self.cache)

    def judged_in(self, judge: Mapping[str, Any]) -> Dataset:
        return self.judged_lessons(judge).data

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        drawn = self.judged_lessons(row.judge).pictures(split)
        return {**super().judged(row, split), "evaluation": self.evaluation, "pictures": drawn, **code_of(row.judge)}

    def lessons(self, how: Mapping[str, Any] = NOTHING) -> Lessons:
        """What the agents of a row learn from, by what differs in it.

        Raises:
          DatasetError: a data set of another kind.
        """
        return self.lessons_in(self.data)

    def judged_lessons(self, judge: Mapping[str, Any]) -> Lessons:
        """What they are judged in."""
        return spoken(self.lessons(judge), judge)

    def lessons_in(self, folder: Path) -> Lessons:
        """A data set with features."""
        data = dataset_of(folder, self.name)
        return Lessons(data, encoder_of(self.encoder, self.network), self.pictures, cache=self.cache)

    def about(self) -> str:
        c, drawn = self.config, self.lessons().pictures("train")
        return f"{super().about()} Trained {c.iterations} updates of {c.batch} episodes on pictures {drawn}."


def spoken(lessons: Lessons, judge: Mapping[str, Any]) -> Lessons:
    """Lessons in which those people describe routes whom a row says."""
    return lessons.said_by(judge[SPEAKERS]) if SPEAKERS in judge else lessons

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
from embodied.agents.vision.encoder import load_encoder
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vision.training_data import TrainingData
from embodied.assets.cache import default_cache
from embodied.datasets.store import dataset_of
from embodied.evaluation.evaluate import agent as agent_without_learning
from embodied.interface import Agent

TEST_SPLITS = ("test_seen", "test_unseen")


@dataclass(frozen=True, kw_only=True)
class FeatureStudy(EpisodeStudy):
    """A study of agents that see features. A learner says its tables, `train`, `load` and `policy`."""

    encoder: Path
    config: Any
    """Settings where the rows start from."""
    pictures: str | None = None
    """Of the pictures that features come from; as the data set holds them where not given."""
    cache: Path = field(default_factory=default_cache)

    task_kind: ClassVar[str] = ""
    """Kind of the tasks; the learner's name where not given."""
    all_tables: ClassVar[Mapping[str, StudyTable]]

    def tables(self) -> Mapping[str, StudyTable]:
        """The splits out of distribution that there are come beside the others."""
        ood = self.training_data().data.ood
        return {name: dataclasses.replace(t, splits=(*t.splits, *ood)) for name, t in self.all_tables.items()}

    def settings(self, train: Mapping[str, Any], seed: int) -> Any:
        return dataclasses.replace(self.config, seed=seed, **train)

    def depends(self, train: Mapping[str, Any]) -> Mapping[str, object]:
        return self.training_data().identity()

    def policy(self, agent: Any, bank: FeatureBank) -> Agent:
        """A trained agent as it plays, with features that it sees."""
        return agent.policy(bank)

    def policies(self, agent: Any, judge: Mapping[str, Any], split: str) -> Agent:
        if agent is None:
            return agent_without_learning(self.task_kind or self.name, judge["played"])
        return self.policy(agent, self.training_data().split(split).bank)

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {**super().judged(row, split), "pictures": self.training_data().pictures(split)}

    def training_data(self) -> TrainingData:
        """The data set with features.

        Raises:
          DatasetError: a data set of another kind.
        """
        data = dataset_of(self.data, self.task_kind or self.name)
        return TrainingData(data, load_encoder(self.encoder), self.pictures, cache=self.cache)


@dataclass(frozen=True, kw_only=True)
class SightedStudy(FeatureStudy):
    """A study of agents that learn by imitation. A learner says its tables, `agent_kind` and `train`."""

    config: ImitationSettings
    evaluation: EvaluationSettings = EvaluationSettings()
    others: int | None = None
    """Training seeds of every row but those of the unchanged settings; None: as many."""

    agent_kind: ClassVar[type[SightedAgent]]

    def seeds(self, row: StudyRow) -> Sequence[int]:
        return self.repeats[: self.others] if row.train else super().seeds(row)

    def load(self, weights: Path) -> Any:
        agent = self.agent_kind.load(weights)
        return dataclasses.replace(agent, about=dataclasses.replace(agent.about, evaluation=self.evaluation))

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {**super().judged(row, split), "evaluation": self.evaluation}

    def about(self) -> str:
        c, drawn = self.config, self.training_data().pictures("train")
        return f"{super().about()} Trained {c.iterations} updates of {c.batch} episodes on pictures {drawn}."

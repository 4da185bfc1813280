"""Training data of learners by imitation: a split of a data set, ready to be played with features; and what is
common to studies of agents that see features."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, TypeVar, Unpack

from embodied.agents.common import imitation
from embodied.agents.common.imitation import About, SightedAgent
from embodied.agents.common.session import Note, Options, Progress
from embodied.agents.common.settings import EvaluationSettings, ImitationSettings
from embodied.agents.common.vocabulary import Vocabulary
from embodied.agents.common.weights import load_into
from embodied.agents.learner import PlaySettings, learner_named
from embodied.agents.options import training_data
from embodied.agents.studies.episodes import EpisodeStudy
from embodied.agents.studies.tables import StudyRow, StudyTable
from embodied.agents.vision.config import SAME_TIME
from embodied.agents.vision.encoder import Encoder, load_encoder
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vision.live import LiveFeatures
from embodied.agents.vision.run import drawings_of, drawn_world, house_features, pictures_of
from embodied.assets.cache import default_cache
from embodied.datasets.store import Dataset, TaskSet
from embodied.envs.base import DoorRule
from embodied.evaluation.evaluate import agent as agent_without_learning
from embodied.evaluation.evaluate import spread, with_doors
from embodied.gym.sensors import PanoramaStore
from embodied.interface import Agent
from embodied.records import identity_of

A = TypeVar("A", bound=About)


@dataclass(frozen=True, eq=False)
class Split(TaskSet):
    """Tasks of some houses, the environment they are played in, and what is seen there."""

    bank: FeatureBank


@dataclass(frozen=True, eq=False)
class TrainingData:
    """A data set with features, from which an agent learns, and the device."""

    data: Dataset
    encoder: Encoder
    picture_kind: str | None = None
    """Of the pictures that the features come from, as in embodied.agents.vision.run.pictures_of."""
    device: str = "cpu"
    goal_image: str = SAME_TIME
    """One of embodied.agents.vision.config.GOAL_IMAGES."""
    cache: Path = field(default_factory=default_cache)
    """Folder of the furniture, for other pictures than the agent sees."""

    def split(self, name: str, *, limit: int | None = None, houses: int | None = None, rules: Any = None) -> Split:
        """At most `limit` tasks of a split, from its first `houses` houses; `rules` as in Dataset.split.

        Raises:
          ValueError: more houses than there are.
          FileNotFoundError: features are missing.
        """
        data, encoder, kind = self.data, self.encoder.digest, self.picture_kind
        if houses is not None and houses > (there := len(data.names(name))):
            raise ValueError(f"{houses} houses of {name!r} are wanted, {data.folder} has {there}; ask for fewer")
        split = data.split(name, houses=houses, rules=rules)
        tasks = split.tasks if limit is None else spread(split.tasks, limit)
        features = functools.partial(house_features, data, list(split.worlds), encoder, kind, self.cache)
        live = functools.cache(functools.partial(self._live, list(split.worlds)))
        bank = FeatureBank(features(), encoder, lambda sight: live().features(sight)).to(self.device)
        if self.goal_image != SAME_TIME:
            bank = bank.with_goal_images(features(self.goal_image))
        return Split(split.worlds, tasks, split.make_env, bank)

    def _live(self, names: Sequence[str]) -> LiveFeatures:
        """Features of houses as their doors are."""
        pictures = {n: pictures_of(self.data, n, self.picture_kind) for n in names}
        worlds = {n: drawn_world(self.data, n, self.cache, pictures[n]) for n in names}
        return LiveFeatures(self.encoder, PanoramaStore(worlds))

    def identity(self) -> dict[str, str]:
        """Everything that an agent depends on besides its settings: the data set, the encoder, how its houses were
        drawn."""
        shown = {} if self.goal_image == SAME_TIME else {"shown": self.goal_image}
        return {"data": self.data.digest, "encoder": self.encoder.digest, "pictures": self.pictures("train"), **shown}

    def about(self, kind: type[A], config: ImitationSettings, evaluation: EvaluationSettings, words: Vocabulary) -> A:
        """Metadata beside the weights of an agent that learns here."""
        encoder, pictures = self.encoder, self.pictures("train")
        return kind(
            config=config,
            evaluation=evaluation,
            encoder=encoder.digest,
            feature_size=encoder.size,
            words=words.words,
            pictures=pictures,
        )

    def pictures(self, name: str) -> str:
        """How the pictures of a split's houses were drawn, in words: 'unlit_192', or several of them."""
        return drawings_of(self.data, self.data.names(name), self.picture_kind)


def evaluation_data(data: Dataset, how: PlaySettings) -> TrainingData:
    """A data set as a trained agent is evaluated in it."""
    encoder = load_encoder(how.encoder)
    return TrainingData(data, encoder, how.pictures, goal_image=how.goal_image, cache=how.cache)


class SightedLearner(imitation.ImitationLearner):
    """An agent that sees features in training; who derives from it says `agent_kind` and `words_of`, too."""

    agent_kind: ClassVar[type[SightedAgent]]

    @classmethod
    def splits(cls, source: TrainingData, config: Any) -> tuple[Split, Split]:
        """Tasks to learn from, and to validate with."""
        training = source.split("train", houses=config.training_houses or None)
        return training, source.split("val_unseen", limit=config.validation_tasks)

    @classmethod
    def words_of(cls, data: Dataset, training: Split) -> Vocabulary:
        """The words that it learns."""
        raise NotImplementedError

    @classmethod
    def train(
        cls, source: TrainingData, config: Any, evaluation: Any, folder: Path, **options: Unpack[Options]
    ) -> Progress:
        """Train, or go on training, the agent of a run folder; other arguments as in agents.common.imitation.train."""
        training, validation = cls.splits(source, config)
        if config.closed_doors:
            training = with_doors(training, config.closed_doors, DoorRule.WALK, seed=config.seed)
        file = learner_named(cls.agent_kind.kind).shipped if config.start == "shipped" else Path(config.start)
        assert file, "such agents ship"
        start = cls.agent_kind.load(file) if config.start else None
        words = start.vocabulary if start else cls.words_of(source.data, training)
        agent = cls.agent_kind.new(source.about(cls.agent_kind.about_kind, config, evaluation, words))
        if start:
            load_into(agent.network, start.network.state_dict(), file)
        agent.network.to(source.device)
        identity = identity_of(cls.__module__, settings=config, **source.identity())
        return imitation.train(cls(agent, training), validation, folder, identity, **options)


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
    device: str = "cpu"

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
        """The data set with features."""
        return training_data(self, self.task_kind or self.name, self.device)


@dataclass(frozen=True, kw_only=True)
class SightedStudy(FeatureStudy):
    """A study of agents that learn by imitation. A learner says its tables, `agent_kind` and `learner` (or `train`)."""

    config: ImitationSettings
    evaluation: EvaluationSettings = EvaluationSettings()
    others: int | None = None
    """Training seeds of every row but those of the unchanged settings; None: as many."""

    agent_kind: ClassVar[type[SightedAgent]]
    learner: ClassVar[type[SightedLearner]]

    def seeds(self, row: StudyRow) -> Sequence[int]:
        return self.repeats[: self.others] if row.train else super().seeds(row)

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        self.learner.train(self.training_data(), self.settings(train, seed), self.evaluation, home, note=note)
        return home / "best.safetensors"

    def load(self, weights: Path) -> Any:
        agent = self.agent_kind.load(weights)
        return dataclasses.replace(agent, about=dataclasses.replace(agent.about, evaluation=self.evaluation))

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {**super().judged(row, split), "evaluation": self.evaluation}

    def about(self) -> str:
        c, drawn = self.config, self.training_data().pictures("train")
        return f"{super().about()} Trained {c.iterations} updates of {c.batch} episodes on pictures {drawn}."

"""The steps of NAV's commands: a data set becomes eyes, teacher and student, and these a problem of ILIAD."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from embodied.agents.common.more_paths import SaidBy
from embodied.agents.common.paraphrases import varied
from embodied.agents.common.session import Note
from embodied.agents.common.vocabulary import build_vocabulary
from embodied.agents.common.word_vectors import vocabulary_with
from embodied.agents.iliad.config import LearnerConfig
from embodied.agents.iliad.nav.config import NavConfig
from embodied.agents.iliad.nav.data import NAV_SPLITS, NavData, each_wording, house_trips, nav_data
from embodied.agents.iliad.nav.stages import new_follower, save_walker, teach_describer, teach_executor
from embodied.agents.iliad.nav.student import LoopFree, NavStudent
from embodied.agents.iliad.nav.teacher import LearnedNavTeacher, OtherWords, PeopleNavTeacher
from embodied.agents.iliad.nav.world import NavMarginal, NavWorld
from embodied.agents.iliad.protocol import DescribingTeacher
from embodied.agents.iliad.training import IliadProblem, train
from embodied.assets.catalogue import load_catalogue
from embodied.datasets.store import Dataset, dataset_of
from embodied.identity import identity_of
from embodied.interface import SeenPlace
from embodied.language.people_language import People, RouteDescriber

VALIDATION_TRIPS = 300
"""Trips of each validation, from all houses alike; judging takes all."""


@dataclass(frozen=True)
class NavSource:
    """Sources of the houses and of what is seen of them."""

    folder: Path
    """A data set of `embodied dataset vln` (or hanna, whose assistants know such paths) with features."""
    encoder: str
    """Digest of the encoder that made them."""
    picture_kind: str | None
    """Of the pictures, as in embodied.agents.vision.run.pictures_of."""
    cache: Path

    def data(self, config: NavConfig) -> NavData:
        """
        Raises:
          FileNotFoundError, ValueError: a data set of another kind, or without such features.
        """
        return nav_data(
            dataset_of(self.folder, "vln", "hanna"), config, self.encoder, self.picture_kind, cache=self.cache
        )


@dataclass(frozen=True, eq=False)
class NavGrounds:
    """Data and networks that all students of a study share."""

    config: NavConfig
    data: NavData
    teacher: DescribingTeacher
    cache: Path
    """The cache with the catalogue."""


def prepare(config: NavConfig, source: NavSource, folder: Path, *, note: Note = print) -> NavGrounds:
    """Data and teacher, trained into `folder` unless it is there.

    Raises:
      FileNotFoundError, ValueError: as NavSource.data.
    """
    data = source.data(config)
    counts = ", ".join(f"{len(v)} {part}" for part, v in data.splits.items())
    words = len(data.eyes.vocabulary)
    note(f"trips: {counts}; {len(data.eyes.places)} houses, {words} words, pictures {data.pictures}")
    return NavGrounds(config, data, _teacher(config, data, source.cache, Path(folder), note), source.cache)


def _teacher(config: NavConfig, data: NavData, cache: Path, folder: Path, note: Note) -> DescribingTeacher:
    world = NavWorld(data.eyes.places)
    if config.teacher != "learned":
        wording = People().route if config.teacher == "people" else RouteDescriber().describe
        return PeopleNavTeacher(world, seen_places(data.source, cache), wording)
    executor = teach_executor(data, config, folder, note=note)
    describer = teach_describer(data, config, executor, folder, note=note)
    return LearnedNavTeacher(world, describer, executor, config.candidates, config.pragmatics)


def seen_places(source: Dataset, cache: Path) -> dict[str, SeenPlace]:
    """The houses to learn from and to test in, with what can be seen from every node of them."""
    catalogue = load_catalogue(cache)
    names = [name for split in NAV_SPLITS.values() for name in source.names(split)]
    return {name: source.open_world(name, catalogue, cache) for name in names}


def reworded(grounds: NavGrounds, say: Callable[[str], str]) -> NavGrounds:
    """With the test requests in other words."""
    data = grounds.data
    test = [dataclasses.replace(t, requests=tuple(map(say, t.requests))) for t in data.splits["test"]]
    return dataclasses.replace(grounds, data=dataclasses.replace(data, splits={**data.splits, "test": test}))


def spoken(grounds: NavGrounds, novelty: str, cache: Path) -> NavGrounds:
    """With the test requests of somebody of a novelty."""
    data = grounds.data
    people = SaidBy(novelty, data.source, cache=cache)
    trips = [trip for name in data.source.names(NAV_SPLITS["test"]) for trip in house_trips(people, name)]
    test = [one for trip in trips for one in each_wording(trip)]
    return dataclasses.replace(grounds, data=dataclasses.replace(data, splits={**data.splits, "test": test}))


def problem_of(grounds: NavGrounds, seed: int) -> IliadProblem:
    """A student of this seed with everything around it."""
    c, data = grounds.config, grounds.data
    eyes, splits, teacher = data.eyes.blind() if c.blind else data.eyes, data.splits, grounds.teacher
    if c.varied_words:
        say = varied(load_catalogue(grounds.cache))
        both = [dataclasses.replace(t, requests=(*t.requests, *map(say, t.requests))) for t in splits["train"]]
        splits, teacher = {**splits, "train": both}, OtherWords(teacher, say)
    words = build_vocabulary(request for trip in splits["train"] for request in trip.requests).words
    eyes = dataclasses.replace(eyes, vocabulary=vocabulary_with(words, c.word_vectors))
    student = NavStudent(new_follower(c, eyes, seed, "student"), eyes, c)
    explorer = LoopFree(new_follower(c, eyes, seed, "student"), eyes, c)
    validation = splits["validation"][:: max(1, len(splits["validation"]) // VALIDATION_TRIPS)]
    identity = identity_of(
        "embodied.agents.iliad.nav.run", world="nav", data=data.digest, pictures=data.pictures, teacher=c
    )
    return IliadProblem(
        NavWorld(eyes.places), teacher, NavMarginal(eyes.places), student, explorer,
        splits["train"], validation, identity,
    )  # fmt: skip


def learn(
    grounds: NavGrounds, learner: LearnerConfig, folder: Path, *, minutes: float | None = None, note: Note = print
) -> list[dict[str, float]]:
    """Train, or go on training, the student of a run folder; keeps the best one as best.safetensors."""
    problem = problem_of(grounds, learner.seed)
    student = problem.student
    assert isinstance(student, NavStudent)
    keep = lambda path, identity: save_walker(path, student.network, grounds.config, student.eyes, identity)
    return train(problem, learner, folder, keep, minutes=minutes, note=note)

"""NAV as its commands run it: a data set becomes eyes, teacher and student, and these a problem of ILIAD."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from embodied.agents.common.more_paths import more_routes
from embodied.agents.common.session import Note
from embodied.agents.common.vocabulary import build_vocabulary
from embodied.agents.common.weights import save_weights
from embodied.agents.common.word_vectors import vocabulary_with
from embodied.agents.iliad.nav.config import NavConfig
from embodied.agents.iliad.nav.data import NAV_SPLITS, NavData
from embodied.agents.iliad.nav.stages import (
    about_follower,
    load_follower,
    new_follower,
    teach_describer,
    teach_executor,
)
from embodied.agents.iliad.nav.student import LoopFree, NavEyes, NavStudent
from embodied.agents.iliad.nav.teacher import GrammarNavTeacher, LearnedNavTeacher
from embodied.agents.iliad.nav.world import NavMarginal, NavWorld, trips_of
from embodied.agents.iliad.protocol import DescribingTeacher
from embodied.agents.iliad.training import IliadProblem, successes
from embodied.agents.vision.bank import FeatureBank
from embodied.agents.vision.capture import house_features
from embodied.agents.vision.drawn import drawings_of
from embodied.assets.catalogue import load_catalogue
from embodied.datasets.store import Dataset, dataset_of
from embodied.evaluation.tables import Samples
from embodied.interface import SeenPlace
from embodied.language.people_language import RouteDescriber
from embodied.records import identity_of
from embodied.seeds import stream

VALIDATION_TRIPS = 300
"""Trips of each validation, from all houses alike; judging takes all."""


@dataclass(frozen=True)
class NavSetup:
    """Settings, and the sources of the houses and of what is seen of them; small, so that it can be sent to other
    processes."""

    config: NavConfig
    folder: Path
    """A data set of `embodied dataset vln` (or hanna, whose assistants know such paths) with features."""
    encoder: str
    """Digest of the encoder that made them."""
    picture_kind: str | None
    """Of the pictures, as in embodied.agents.vision.drawn.pictures_of."""
    cache: Path
    """The cache with the catalogue."""

    name = "nav"
    updates = 25_000
    """Of the dissertation: after how many of them lambda is annealed is scaled to other numbers of updates
    (docs/sources.md, S99)."""

    def source(self) -> Mapping[str, object]:
        """The origin of data and teacher, as part of an identity."""
        digest = Dataset(self.folder).digest
        return {"teacher": self.config, "data": digest, "encoder": self.encoder, "pictures": self.picture_kind}

    def data(self) -> NavData:
        """
        Raises:
          FileNotFoundError, ValueError: a data set of another kind, or without such features.
        """
        config, source = self.config, dataset_of(self.folder, "vln", "hanna")
        houses = {part: source.names(name) for part, name in NAV_SPLITS.items()}
        splits = {part: [t for n in names for t in trips_of(n, source.routes(n))] for part, names in houses.items()}
        for name in houses["train"] if config.more_paths else ():
            more = more_routes(source, name, config.more_paths, seed=config.data_seed, cache=self.cache)
            splits["train"] += trips_of(name, more)
        for part in ("validation", "test"):
            splits[part] = [dataclasses.replace(trip, requests=(r,)) for trip in splits[part] for r in trip.requests]
        names = tuple(name for many in houses.values() for name in many)
        places = {name: source.place(name) for name in names}
        vocabulary = build_vocabulary(request for trip in splits["train"] for request in trip.requests)
        words = vocabulary_with(vocabulary.words, config.word_vectors)
        features = house_features(source, names, self.encoder, self.picture_kind, self.cache)
        eyes = NavEyes(places, FeatureBank(features, self.encoder), words)
        return NavData(source, eyes, splits, drawings_of(source, names, self.picture_kind))

    def prepare(self, folder: Path, note: Note) -> NavGrounds:
        """Data and teacher, trained into `folder` unless it is there.

        Raises:
          FileNotFoundError, ValueError: as `data`.
        """
        config, data = self.config, self.data()
        counts = ", ".join(f"{len(v)} {part}" for part, v in data.splits.items())
        words, world = len(data.eyes.vocabulary), NavWorld(data.eyes.places)
        note(f"trips: {counts}; {len(data.eyes.places)} houses, {words} words, pictures {data.pictures}")
        if config.teacher == "grammar":
            places = seen_places(data.source, self.cache)
            teacher: DescribingTeacher = GrammarNavTeacher(world, places, RouteDescriber().describe)
        else:
            executor = teach_executor(data, config, folder, note=note)
            describer = teach_describer(data, config, executor, folder, note=note)
            teacher = LearnedNavTeacher(world, describer, executor, config.candidates)
        return NavGrounds(config, data, teacher)

    def about(self) -> str:
        """Data, networks and teacher in words."""
        c, data = self.config, Dataset(self.folder)
        return (
            f"Paths of {data.digest[:16]} and {c.more_paths} more a house, {len(data.names('train'))} training houses; "
            f"hidden size {c.hidden_size}; teacher: {c.teacher}."
        )


@dataclass(frozen=True, eq=False)
class NavGrounds:
    """Data and networks that all students of a study share."""

    config: NavConfig
    data: NavData
    teacher: DescribingTeacher

    def problem(self, seed: int, folder: Path, note: Note) -> IliadProblem:
        """A student of this seed with everything around it; it begins with random weights, `folder` stays empty."""
        c, eyes, splits = self.config, self.data.eyes, self.data.splits
        eyes = eyes.blind() if c.blind else eyes
        student = NavStudent(new_follower(c, eyes, seed, "student"), eyes, c)
        explorer = LoopFree(new_follower(c, eyes, seed, "student"), eyes, c)
        validation = splits["validation"][:: max(1, len(splits["validation"]) // VALIDATION_TRIPS)]
        about = {"world": "nav", "data": self.data.digest, "pictures": self.data.pictures, "teacher": c}
        identity = identity_of("embodied.agents.iliad.nav.run", **about)
        save = lambda path, identity: save_weights(
            path, "nav", student.network.state_dict(), about_follower(c, eyes), identity
        )
        return IliadProblem(
            NavWorld(eyes.places), self.teacher, NavMarginal(eyes.places), student, explorer,
            splits["train"], validation, identity, save,
        )  # fmt: skip

    def judge(self, best: Path, split: str) -> Samples:
        """Which requests of a split a trained student fulfils."""
        trips, student = self.data.splits[split], load_follower(best, self.data.eyes)
        good = successes(NavWorld(self.data.eyes.places), student, trips)
        return Samples(tuple(map(float, good)), tuple(t.world for t in trips), share=True)

    def chance(self, split: str, seed: int) -> Samples:
        """Which requests of a split are fulfilled by walks of the marginal, which knows nothing of requests."""
        trips, places = self.data.splits[split], self.data.eyes.places
        walks = NavMarginal(places).draw(trips, rng=stream(seed, "nav", "chance", split))
        good = [NavWorld(places).success(t, w) for t, w in zip(trips, walks, strict=True)]
        return Samples(tuple(map(float, good)), tuple(t.world for t in trips), share=True)


def seen_places(source: Dataset, cache: Path) -> dict[str, SeenPlace]:
    """The houses to learn from and to test in, with what can be seen from every node of them."""
    catalogue = load_catalogue(cache)
    names = [name for split in NAV_SPLITS.values() for name in source.names(split)]
    return {name: source.open_world(name, catalogue, cache) for name in names}

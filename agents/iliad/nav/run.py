"""NAV as its commands run it: a data set becomes eyes, teacher and student, and these a problem of ILIAD. Before a
student learns, the teacher's executor and describer are trained."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from embodied.agents.common.session import Note
from embodied.agents.common.tensors import greedy_choice
from embodied.agents.common.vocabulary import Vocabulary, build_vocabulary
from embodied.agents.common.weights import check_features, load_into, load_weights, save_weights
from embodied.agents.iliad.nav.student import NAV_SPLITS, LoopFree, NavData, NavEyes, NavStudent
from embodied.agents.iliad.nav.teacher import (
    LONGEST_DESCRIPTION,
    GrammarNavTeacher,
    LearnedNavTeacher,
    WalkDescriber,
    arrives,
    encoded_walks,
)
from embodied.agents.iliad.nav.world import HORIZON, NavMarginal, NavWorld, Trip, trips_of, walk_along
from embodied.agents.iliad.protocol import DescribingTeacher
from embodied.agents.iliad.training import IliadProblem, asked, begun, drawn, success_rate, successes, teach
from embodied.agents.iliad.writing import likelihood_loss
from embodied.agents.learners.iliad import NavConfig
from embodied.agents.learners.vln import FollowerSettings
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vision.run import drawings_of, house_features
from embodied.agents.vln.policy import FollowerNetwork
from embodied.agents.vln.study import more_routes
from embodied.assets.catalogue import load_catalogue
from embodied.datasets.store import Dataset, dataset_of
from embodied.evaluation.tables import Samples
from embodied.interface import SeenPlace
from embodied.language.people_language import RouteDescriber
from embodied.records import identity_of
from embodied.seeds import stream

NAV_REMEDY = "train it again with `embodied train iliad nav`"
JUDGED = 128
"""Trips that a stage is judged on between its updates."""


@dataclass(frozen=True)
class NavAbout:
    """Metadata beside the weights in a file."""

    config: NavConfig
    words: tuple[str, ...]
    """Of requests."""
    encoder: str
    """Digest of the encoder whose features it wants."""


def new_follower(config: NavConfig, eyes: NavEyes, seed: int, name: str) -> FollowerNetwork:
    """An untrained follower, which is VLN's; its weights follow from seed and name."""
    c = FollowerSettings(hidden_size=config.hidden_size, dropout=config.dropout)
    with begun("nav", seed, name):
        return FollowerNetwork(c, len(eyes.vocabulary), eyes.bank.size)


def teach_executor(data: NavData, config: NavConfig, folder: Path, *, note: Note) -> NavStudent:
    """pi_T (3.2.4.1): imitation, walking where it would itself and shown the shortest path from there."""
    eyes, world = data.eyes, NavWorld(data.eyes.places)
    executor = NavStudent(new_follower(config, eyes, config.data_seed, "executor"), eyes, config)
    trips = data.splits["train"]

    def loss_of(rng: np.random.Generator) -> Tensor:
        chosen = drawn(trips, config.teacher_batch, rng)
        requests = asked(chosen, rng)
        done = executor.rollout_for_dagger(chosen, requests, rng=rng)
        shown = [world.demonstrate(q, e) for q, e in zip(chosen, done, strict=True)]
        return -executor.scores(chosen, requests, done, shown).objective.sum() / len(chosen)

    judge = lambda: {"success": success_rate(world, executor, _sample(data))}
    how = _settings(folder, config.executor_iterations, config, data)
    teach(executor.network, "executor", loss_of, judge, note=note, **how)
    return executor


def teach_describer(
    data: NavData, config: NavConfig, executor: NavStudent, folder: Path, *, note: Note
) -> WalkDescriber:
    """P~_T(d | e) (3.2.4.1): the walk along a path to one of its requests; judged by who follows what it says."""
    eyes, world = data.eyes, NavWorld(data.eyes.places)
    with begun("nav", config.data_seed, "describer"):
        describer = WalkDescriber(len(eyes.vocabulary), config.hidden_size, config.heads, eyes.size, HORIZON)
    trips = data.splits["train"]

    def loss_of(rng: np.random.Generator) -> Tensor:
        chosen = drawn(trips, config.teacher_batch, rng)
        wanted = eyes.words(asked(chosen, rng))[:, :LONGEST_DESCRIPTION]
        logits = describer(*encoded_walks(eyes, chosen, [walk_along(t.path) for t in chosen]), wanted)
        return likelihood_loss(logits, wanted)

    judge = lambda: {"followed": followed(world, describer, executor, _sample(data))}
    how = _settings(folder, config.describer_iterations, config, data)
    return teach(describer, "describer", loss_of, judge, note=note, **how)


def followed(world: NavWorld, describer: WalkDescriber, executor: NavStudent, trips: Sequence[Trip]) -> float:
    """Share of paths whose likeliest description leads the executor to their end."""
    walks = [walk_along(t.path) for t in trips]
    numbers = describer.write(*encoded_walks(executor.eyes, trips, walks), greedy_choice, LONGEST_DESCRIPTION)
    done = executor.greedy(trips, executor.eyes.vocabulary.texts(numbers.tolist()))
    return float(np.mean([arrives(world, t, e.nodes, t.path) for t, e in zip(trips, done, strict=True)]))


def load_follower(path: Path, eyes: NavEyes) -> NavStudent:
    """A follower as training saved it, with its settings and the words that it knows.

    Args:
      eyes: what is seen; its words are replaced.

    Raises:
      FileNotFoundError, ValueError: missing, damaged, of another format, or taught with features of another encoder.
    """
    tensors, about = load_weights(path, "nav", NavAbout, NAV_REMEDY)
    check_features(eyes.bank.digest, about.encoder)
    c = about.config
    own = NavEyes(eyes.places, eyes.bank, Vocabulary(about.words))
    follower = new_follower(c, own, 0, "loaded")
    load_into(follower, tensors, path)
    return NavStudent(follower.eval(), own.blind() if c.blind else own, c)


def about_follower(config: NavConfig, eyes: NavEyes) -> NavAbout:
    """Metadata of a follower with these eyes."""
    return NavAbout(config, eyes.vocabulary.words, eyes.bank.digest)


def _settings(folder: Path, updates: int, config: NavConfig, data: NavData) -> dict[str, Any]:
    """How a network of the teacher is taught, and what it depends on."""
    how = {"world": "nav", "folder": folder, "updates": updates, "seed": config.data_seed, "config": config}
    return {**how, "about": about_follower(config, data.eyes), "data": data.digest}


def _sample(data: NavData) -> Sequence[Trip]:
    return data.splits["validation"][:: max(1, len(data.splits["validation"]) // JUDGED)]


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
    """Of the pictures, as in embodied.agents.vision.run.pictures_of."""
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
        features = house_features(source, names, self.encoder, self.picture_kind, self.cache)
        eyes = NavEyes(places, FeatureBank(features, self.encoder), vocabulary)
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

"""Tables 3.4, 3.5 and C.1 and Figure 3.7 as data, REGEX and NAV; ILIAD as a learner of agents.studies.engine."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.common.checkpoint import read_checkpoint
from embodied.agents.common.session import Note
from embodied.agents.iliad.config import LearnerConfig
from embodied.agents.iliad.nav import run as nav
from embodied.agents.iliad.nav.config import NavConfig
from embodied.agents.iliad.nav.stages import load_follower
from embodied.agents.iliad.nav.world import NavMarginal, NavWorld
from embodied.agents.iliad.regex import run as regex
from embodied.agents.iliad.regex.config import RegexConfig
from embodied.agents.iliad.regex.world import RegexWorld
from embodied.agents.iliad.training import episodes_to, successes
from embodied.agents.studies.engine import Measured, StudyLearner
from embodied.agents.studies.tables import Figure, StudyRow, StudyTable
from embodied.agents.studies.wordings import SPEAKERS, WORDING, code_of, saying, speakers_table, words_table
from embodied.assets.cache import digest
from embodied.datasets.store import Dataset
from embodied.evaluation.tables import Samples
from embodied.identity import identity_of, key_of
from embodied.seeds import stream

NEEDED = "thousand episodes to the threshold"
LEARNING_ROWS = (
    StudyRow("DAgger", {"learner": "dagger"}),
    StudyRow("REINFORCE, binary", {"learner": "binary"}),
    StudyRow("REINFORCE, continuous", {"learner": "continuous"}),
    StudyRow("ADEL"),
)
DAGGER, BLIND_STUDENT = LEARNING_ROWS[0], StudyRow("DAgger, blind", {"learner": "dagger", "blind": True})
OWN = ("blind", "word_vectors", "varied_words")
"""Settings of NAV's students in which rows differ."""
CHANCE = StudyRow("chance: a random shortest path of 2 to 6 edges", None)


def _table(title: str, *rows: StudyRow) -> StudyTable:
    return StudyTable(title, rows, ("success",), ("test",), pooled=(NEEDED,))


ILIAD_TABLES: Mapping[str, StudyTable] = {
    "3.4": _table("Learning from descriptions, demonstrations and rewards", *LEARNING_ROWS),
    "3.5": _table(
        "The mixing weight", StudyRow("λ = 0", {"mixing": 0.0}), StudyRow("λ = 1", {"mixing": 1.0}), StudyRow("λ = 0.5")
    ),
    "C.1": _table(
        "Annealing the mixing weight",
        StudyRow("every 2000", {"annealed": 2000}),
        StudyRow("every 5000", {"annealed": 5000}),
        StudyRow("never"),
    ),
    "algorithms": _table(
        "The algorithms of the text (docs/sources.md, S176)",
        StudyRow("Algorithm 4, executions of the marginal", {"learner": "mixture", "mixing": 1.0}),
        StudyRow(
            "Algorithm 5, mixture annealed to 0",
            {"learner": "mixture", "mixing": 1.0, "annealed": 5000, "least_mixing": 0.0},
        ),
        StudyRow("Algorithm 8, own executions", {"learner": "mixture", "mixing": 0.0}),
        StudyRow("Algorithm 9, ADEL"),
    ),
    "figure 3.7": StudyTable(
        "Success over the course of training",
        tuple(dataclasses.replace(row, judge={"curve": True}) for row in LEARNING_ROWS),
        splits=("validation",),
        figure=Figure(("success_at",), "training episodes", "success (share)", share=True),
    ),
}


@dataclass(frozen=True)
class RegexStudyWorld:
    """The study's view of REGEX; small, so that it can be sent to other processes."""

    config: RegexConfig
    words: Path | None = None
    templates: Path | None = None

    name = "regex"
    updates = 30_000
    """Of the dissertation: after how many of them lambda is annealed is scaled to other numbers of updates
    (docs/sources.md, S99)."""

    def source(self) -> Mapping[str, object]:
        """The origin of its data, as part of an identity."""
        own = {"words": self.words, "templates": self.templates}
        return {"teacher": self.config, **{k: digest(path) for k, path in own.items() if path}}

    def prepare(self, folder: Path, note: Note) -> regex.RegexGrounds:
        """Data and teacher, made into `folder` unless they are there."""
        return regex.prepare(self.config, folder, words=self.words, templates=self.templates, note=note)

    def begin(self, grounds: regex.RegexGrounds, seed: int, folder: Path, note: Note) -> None:
        """Make what all students of a seed begin with."""
        regex.problem_of(grounds, seed, folder, note=note)

    def learn(self, grounds: regex.RegexGrounds, learner: LearnerConfig, home: Path, begun: Path, note: Note) -> None:
        """Train a student, or go on."""
        regex.learn(grounds, learner, home, begun, note=note)

    def judge(self, grounds: regex.RegexGrounds, best: Path, split: str) -> Samples:
        """Which requests of a split a trained student fulfils."""
        good = successes(RegexWorld(), regex.load_student(best)[0], grounds.data.splits[split])
        return Samples(tuple(map(float, good)), share=True)

    def about(self) -> str:
        """Data, networks and teacher in words."""
        c = self.config
        return (
            f"{c.items:,} data points with three requests each, {c.held_out_items:,} for validation and for test, in "
            f"wordings that nobody learned from. Hidden size {c.hidden_size}, {c.pretraining_iterations:,} updates of "
            f"pre-training on rules alone; teacher: {c.teacher}; marginal: {c.marginal}, {c.unlabeled:,} rules."
        )


@dataclass(frozen=True)
class NavStudyWorld:
    """The study's view of NAV, as RegexStudyWorld."""

    config: NavConfig
    houses: nav.NavSource

    name = "nav"
    updates = 25_000

    def source(self) -> Mapping[str, object]:
        data, where = Dataset(self.houses.folder), self.houses
        return {"teacher": self.config, "data": data.digest, "encoder": where.encoder, "pictures": where.picture_kind}

    def prepare(self, folder: Path, note: Note) -> nav.NavGrounds:
        return nav.prepare(self.config, self.houses, folder, note=note)

    def begin(self, grounds: nav.NavGrounds, seed: int, folder: Path, note: Note) -> None:
        """Students of NAV begin with random weights."""

    def learn(self, grounds: nav.NavGrounds, learner: LearnerConfig, home: Path, begun: Path, note: Note) -> None:
        nav.learn(grounds, learner, home, note=note)

    def judge(self, grounds: nav.NavGrounds, best: Path, split: str) -> Samples:
        trips, student = grounds.data.splits[split], load_follower(best, grounds.data.eyes)
        good = successes(NavWorld(grounds.data.eyes.places), student, trips)
        return Samples(tuple(map(float, good)), tuple(t.world for t in trips), share=True)

    def with_judged_wording(self, grounds: nav.NavGrounds, judge: Mapping[str, Any], best: Path) -> nav.NavGrounds:
        """With the test requests as a row has them said to a trained student."""
        cache, how = self.houses.cache, judge.get(WORDING)
        if speakers := judge.get(SPEAKERS):
            grounds = nav.spoken(grounds, speakers, cache)
        if how:
            grounds = nav.reworded(
                grounds, saying(how, load_follower(best, grounds.data.eyes).eyes.vocabulary.words, cache)
            )
        return grounds

    def chance(self, grounds: nav.NavGrounds, split: str, seed: int) -> Samples:
        """Which requests of a split are fulfilled by walks of the marginal, which knows nothing of requests."""
        trips, places = grounds.data.splits[split], grounds.data.eyes.places
        walks = NavMarginal(places).draw(trips, rng=stream(seed, "nav", "chance", split))
        good = [NavWorld(places).success(t, w) for t, w in zip(trips, walks, strict=True)]
        return Samples(tuple(map(float, good)), tuple(t.world for t in trips), share=True)

    def about(self) -> str:
        c, data = self.config, Dataset(self.houses.folder)
        return (
            f"Paths of {data.digest[:16]} and {c.more_paths} more a house, {len(data.names('train'))} training houses; "
            f"hidden size {c.hidden_size}; teacher: {c.teacher}."
        )


StudyWorld = RegexStudyWorld | NavStudyWorld


@dataclass(frozen=True)
class IliadStudy(StudyLearner):
    """Tables 3.4, 3.5 and C.1 and Figure 3.7."""

    world: StudyWorld
    config: LearnerConfig
    repeats: tuple[int, ...]
    threads: int = 1

    judges = ("embodied.agents.iliad.training", "embodied.agents.iliad.regex.run", "embodied.agents.iliad.nav.run")

    @property
    def name(self) -> str:
        return f"iliad-{self.world.name}"

    def tables(self) -> Mapping[str, StudyTable]:
        """REGEX is judged on its validation split, too; NAV's is that of which the best of many students was kept. In
        NAV one can be blind, arrive by chance, and hear what one never heard."""
        if self.world.name == "nav":
            rows = (*LEARNING_ROWS, BLIND_STUDENT, CHANCE)
            seen = dataclasses.replace(ILIAD_TABLES["3.4"], rows=rows, compared=((DAGGER, BLIND_STUDENT),))
            heard = {"words": words_table, "speakers": speakers_table}
            made = {name: table(_reader, ("success",), ("test",)) for name, table in heard.items()}
            return {**ILIAD_TABLES, "3.4": seen, **made}
        both = lambda t: dataclasses.replace(t, splits=("validation", "test")) if t.pooled else t
        return {name: both(table) for name, table in ILIAD_TABLES.items()}

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Data and teachers."""
        for world in {self._world(row.train): None for row in rows}:
            world.prepare(_shared(world, folder), note)

    def prepare_seed(self, rows: Sequence[StudyRow], seed: int, folder: Path, note: Note) -> None:
        """Settings of the students' pre-training."""
        for world in {self._world(row.train): None for row in rows}:
            world.begin(_grounds(world, folder), seed, _shared(world, folder) / f"seed_{seed}", note)

    def settings(self, train: Mapping[str, Any], seed: int) -> LearnerConfig:
        changes = {name: value for name, value in train.items() if name not in (*OWN, SPEAKERS)}
        annealed = changes.pop("annealed", 0)
        every = max(1, round(annealed / self.world.updates * self.config.iterations)) if annealed else 0
        return dataclasses.replace(self.config, seed=seed, anneal_every=every, **changes)

    def trained(self, train: Mapping[str, Any], seed: int, folder: Path) -> Mapping[str, Any]:
        makers, settings = f"embodied.agents.iliad.{self.world.name}.run", self.settings(train, seed)
        return identity_of(makers, settings=settings, **{**self._world(train).source(), **_of(train, OWN)})

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        world = self._world(train)
        grounds, begun = _grounds(world, folder), _shared(world, folder) / f"seed_{seed}"
        grounds = dataclasses.replace(grounds, config=dataclasses.replace(grounds.config, **_of(train, OWN)))
        world.learn(grounds, self.settings(train, seed), home, begun, note)
        return home / "best.safetensors"

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {"threshold": self.config.threshold, **self._world(row.train).source(), **code_of(row.judge)}

    def judge(self, weights: Path | None, row: StudyRow, split: str, seed: int, folder: Path, keep: Path) -> Measured:
        if weights is None:
            assert isinstance(self.world, NavStudyWorld), "every row of REGEX learns"
            return {"success": self.world.chance(_grounds(self.world, folder), split, seed)}
        history = read_checkpoint(weights.parent / "checkpoint.pt")["history"]
        if row.judge.get("curve"):
            return {f"success at {h['episodes']:g}": Samples((h["success"],)) for h in history}
        needed = episodes_to(history, self.config.threshold) / 1000
        world, grounds = self._world(row.train), _grounds(self._world(row.train), folder)
        if isinstance(world, NavStudyWorld):
            grounds = world.with_judged_wording(grounds, row.judge, weights)
        values = {"success": world.judge(grounds, weights, split)}
        return values | ({NEEDED: Samples((math.nan if math.isinf(needed) else needed,))} if split == "test" else {})

    def _world(self, train: Mapping[str, Any] | None) -> StudyWorld:
        """The data that a row learns in."""
        world = self.world
        if not train or not isinstance(world, NavStudyWorld):
            return world
        return dataclasses.replace(world, config=dataclasses.replace(world.config, **_of(train, (SPEAKERS,))))

    def about(self) -> str:
        x = self.config
        return (
            f"{self.world.about()} {x.iterations:,} updates of {x.batch} episodes, learning rate {x.learning_rate:g} "
            f"(REINFORCE a tenth); seeds {', '.join(map(str, self.repeats))}. The threshold is a validation success of "
            f"{100 * x.threshold:g} %; n seeds reached it."
        )


def _reader(label: str, **train: Any) -> StudyRow:
    return StudyRow(label, {"learner": "dagger", **train})


def _of(train: Mapping[str, Any], names: Collection[str]) -> dict[str, Any]:
    """The changes that a row makes to these settings."""
    return {name: value for name, value in train.items() if name in names}


def _shared(world: StudyWorld, folder: Path) -> Path:
    """Folder of data and teacher."""
    return folder / f"shared_{key_of(identity_of(**world.source()))}"


@functools.lru_cache(maxsize=4)
def _grounds(world: StudyWorld, folder: Path) -> Any:
    return world.prepare(_shared(world, folder), lambda line: None)

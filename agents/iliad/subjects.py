"""What a study needs of a world, so that one study makes the tables of REGEX and of NAV."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, Self

from agents.common.session import Note
from agents.iliad.config import LearnerConfig
from agents.iliad.nav import run as nav
from agents.iliad.nav.config import NavConfig, nav_students_of
from agents.iliad.nav.stages import load_follower
from agents.iliad.nav.world import NavWorld
from agents.iliad.regex import run as regex
from agents.iliad.regex.config import RegexConfig, students_of
from agents.iliad.regex.world import RegexWorld
from agents.iliad.training import success_rate


class Subject(Protocol):
    """A world with its settings; small, so that it can be sent to other processes."""

    @property
    def name(self) -> str:
        """'REGEX' or 'NAV'."""

    @property
    def updates(self) -> int:
        """Of the dissertation: after how many of them lambda is annealed is scaled to other numbers of updates
        (docs/sources.md, S99)."""

    @property
    def students(self) -> str:
        """Folder of the students of this teacher."""

    def erring(self, wrong: float) -> Self:
        """The same with a teacher that is consistent but for a share of wrong descriptions."""

    def without(self, speaker: str) -> Self:
        """The same with four speakers of whom one is heard in tests only, or 'none'."""

    def prepare(self, folder: Path, note: Note) -> Any:
        """Data and teacher, made into `folder` unless they are there."""

    def learn(self, grounds: Any, learner: LearnerConfig, home: Path, note: Note) -> None:
        """Train a student, or go on."""

    def judge(self, grounds: Any, best: Path) -> dict[str, float]:
        """Success of a trained student on 'validation', 'test' and whatever else it is tested on."""

    def told(self) -> str:
        """Data, networks and teacher in words."""


@dataclass(frozen=True)
class RegexSubject:
    """REGEX."""

    config: RegexConfig
    words: Path | None = None
    templates: Path | None = None

    name = "REGEX"
    updates = 30_000

    @property
    def students(self) -> str:
        return students_of(self.config)

    def erring(self, wrong: float) -> Self:
        return dataclasses.replace(self, config=dataclasses.replace(self.config, teacher="grammar", wrong=wrong))

    def without(self, speaker: str) -> Self:
        config = dataclasses.replace(self.config, teacher="grammar", unheard=speaker)
        return dataclasses.replace(self, config=config)

    def prepare(self, folder: Path, note: Note) -> regex.Grounds:
        return regex.prepare(self.config, folder, words=self.words, templates=self.templates, note=note)

    def learn(self, grounds: regex.Grounds, learner: LearnerConfig, home: Path, note: Note) -> None:
        regex.learn(grounds, learner, home, note=note)

    def judge(self, grounds: regex.Grounds, best: Path) -> dict[str, float]:
        student, world = regex.load_student(best)[0], RegexWorld()
        parts = [part for part in grounds.data.splits if part != "train"]
        return {part: success_rate(world, student, grounds.data.splits[part]) for part in parts}

    def told(self) -> str:
        c = self.config
        teacher = (
            "the grammar that makes the requests"
            if c.teacher == "grammar"
            else f"describer and executor of {c.describer_iterations:,} and {c.executor_iterations:,} updates"
        )
        return (
            f"{c.items:,} data points with three requests each, {c.held_out_items:,} for validation and for test, in "
            f"wordings that nobody learned from. Hidden size {c.hidden_size}, {c.pretraining_iterations:,} updates of "
            f"pre-training on rules alone; teacher: {teacher}; marginal: {c.marginal}, {c.unlabeled:,} rules."
        )


@dataclass(frozen=True)
class NavSubject:
    """NAV."""

    config: NavConfig
    source: nav.NavSource

    name = "NAV"
    updates = 25_000

    @property
    def students(self) -> str:
        return nav_students_of(self.config)

    def erring(self, wrong: float) -> Self:
        raise ValueError("descriptions err in REGEX only; leave 'describer' out with --world nav")

    def without(self, speaker: str) -> Self:
        raise ValueError("speakers are told apart in REGEX only; leave 'speakers' out with --world nav")

    def prepare(self, folder: Path, note: Note) -> nav.NavGrounds:
        return nav.prepare(self.config, self.source, folder, note=note)

    def learn(self, grounds: nav.NavGrounds, learner: LearnerConfig, home: Path, note: Note) -> None:
        nav.learn(grounds, learner, home, note=note)

    def judge(self, grounds: nav.NavGrounds, best: Path) -> dict[str, float]:
        student, world = load_follower(best, grounds.data.eyes)[0], NavWorld(grounds.data.eyes.places)
        return {part: success_rate(world, student, grounds.data.splits[part]) for part in ("validation", "test")}

    def told(self) -> str:
        c, data = self.config, self.source.data(self.config)
        houses = {part: len({t.world for t in trips}) for part, trips in data.splits.items()}
        count = {part: f"{len(trips):,}" for part, trips in data.splits.items()}
        teacher = (
            "whoever words routes here"
            if c.teacher == "grammar"
            else f"describer and executor of {c.describer_iterations:,} and {c.executor_iterations:,} updates"
        )
        return (
            f"{count['train']} paths of {houses['train']} houses with up to three wordings each; validation: "
            f"{count['validation']} wordings of other paths of these houses, test: {count['test']} in "
            f"{houses['test']} other houses. Pictures: {data.pictures}. Hidden size {c.hidden_size}; teacher: "
            f"{teacher}."
        )

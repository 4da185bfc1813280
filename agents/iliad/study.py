"""ILIAD, REGEX and NAV, as a learner of agents.studies.engine."""

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.common.session import Note
from embodied.agents.common.weights import read_checkpoint
from embodied.agents.iliad.nav.run import NavSetup
from embodied.agents.iliad.regex.run import RegexSetup
from embodied.agents.iliad.training import episodes_to
from embodied.agents.iliad.training import train as learn
from embodied.agents.learners.iliad import LearnerConfig
from embodied.agents.studies.engine import Measured, StudyLearner
from embodied.agents.studies.tables import StudyRow, StudyTable, study_tables
from embodied.evaluation.tables import Samples
from embodied.records import identity_of, key_of

NEEDED = "thousand episodes to the threshold"
OWN = ("blind",)
"""Settings of NAV's students in which rows differ."""
Setup = RegexSetup | NavSetup


@dataclass(frozen=True)
class IliadStudy(StudyLearner):
    """Tables 3.4, 3.5 and C.1 and Figure 3.7."""

    setup: Setup
    config: LearnerConfig
    repeats: tuple[int, ...]
    threads: int = 1

    @property
    def name(self) -> str:
        return f"iliad-{self.setup.name}"

    def tables(self) -> Mapping[str, StudyTable]:
        """REGEX is judged on its validation split, too; NAV's is that of which the best of many students was kept. In
        NAV one can be blind, and arrive by chance."""
        return study_tables(self.name)

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Data and teachers."""
        self.setup.prepare(_shared(self.setup, folder), note)

    def prepare_seed(self, rows: Sequence[StudyRow], seed: int, folder: Path, note: Note) -> None:
        """The students' pre-training."""
        _grounds(self.setup, folder).problem(seed, _begun(self.setup, seed, folder), note)

    def settings(self, train: Mapping[str, Any], seed: int) -> LearnerConfig:
        changes = {name: value for name, value in train.items() if name not in OWN}
        annealed = changes.pop("annealed", 0)
        every = max(1, round(annealed / self.setup.updates * self.config.iterations)) if annealed else 0
        return dataclasses.replace(self.config, seed=seed, anneal_every=every, **changes)

    def trained(self, train: Mapping[str, Any], seed: int, folder: Path) -> Mapping[str, Any]:
        makers, settings = f"embodied.agents.iliad.{self.setup.name}.run", self.settings(train, seed)
        return identity_of(makers, settings=settings, **{**self.setup.source(), **_own(train)})

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        grounds = _grounds(self.setup, folder)
        grounds = dataclasses.replace(grounds, config=dataclasses.replace(grounds.config, **_own(train)))
        problem = grounds.problem(seed, _begun(self.setup, seed, folder), note)
        learn(problem, self.settings(train, seed), home, note=note)
        return home / "best.safetensors"

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {"threshold": self.config.threshold, **self.setup.source()}

    def judge(self, weights: Path | None, row: StudyRow, split: str, seed: int, folder: Path, keep: Path) -> Measured:
        grounds = _grounds(self.setup, folder)
        if weights is None:
            return {"success": grounds.chance(split, seed)}
        history = read_checkpoint(weights.parent / "checkpoint.pt")["history"]
        if row.judge.get("curve"):
            return {f"success at {h['episodes']:g}": Samples((h["success"],)) for h in history}
        needed = episodes_to(history, self.config.threshold) / 1000
        values = {"success": grounds.judge(weights, split)}
        return values | ({NEEDED: Samples((math.nan if math.isinf(needed) else needed,))} if split == "test" else {})

    def about(self) -> str:
        x = self.config
        return (
            f"{self.setup.about()} {x.iterations:,} updates of {x.batch} episodes, learning rate {x.learning_rate:g} "
            f"(REINFORCE a tenth); seeds {', '.join(map(str, self.repeats))}. The threshold is a validation success of "
            f"{100 * x.threshold:g} %; n seeds reached it."
        )


def _own(train: Mapping[str, Any]) -> dict[str, Any]:
    """The changes that a row makes to the settings of students."""
    return {name: value for name, value in train.items() if name in OWN}


def _shared(setup: Setup, folder: Path) -> Path:
    """Folder of data and teacher."""
    return folder / f"shared_{key_of(identity_of(**setup.source()))}"


def _begun(setup: Setup, seed: int, folder: Path) -> Path:
    """Folder of what all students of a seed begin with."""
    return _shared(setup, folder) / f"seed_{seed}"


@functools.lru_cache(maxsize=4)
def _grounds(setup: Setup, folder: Path) -> Any:
    return setup.prepare(_shared(setup, folder), lambda line: None)

"""Learners: a record each, registered where it is defined. The commands know no learner by name.

A learner is one file: `agents/learners/hanna.py`, or a module of your own (examples/my_learner.py). Wherever commands
name a learner, one of your own is 'module:NAME': the name of an importable module, which may lie in the current folder,
and of the `Learner` in it. Free of torch, as the files of agents/learners are, so that --help answers at once.

    LEARNER = Learner(name="my_learner:LEARNER", train=(TrainOptions, train))

    embodied train my_learner:LEARNER --data DATA --out RUN
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from embodied.agents.common.settings import SHIPPED_ENCODER
from embodied.agents.vision.config import SAME_TIME
from embodied.assets.cache import default_cache
from embodied.kinds.plugins import Registry

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset, SplitData
    from embodied.interface import Agent

Command = tuple[type, Callable[..., Any]]
"""A record of options, whose docstring describes the command, and a function that takes it (embodied/options.py)."""
Commands = Command | tuple[str, Mapping[str, Any]]
"""One command, or several by name with what they have in common."""


@dataclass(frozen=True, kw_only=True)
class PlaySettings:
    """How a trained agent sees the houses that it is evaluated in."""

    encoder: Path = SHIPPED_ENCODER
    pictures: str | None = None
    """Of the pictures that features come from; as the data set holds them where not given."""
    goal_image: str = SAME_TIME
    """One of embodied.agents.vision.config.GOAL_IMAGES."""
    cache: Path = field(default_factory=default_cache)
    seed: int = 0
    rules: str | None = None
    """Of play, as `--rules` names them; VNLA's rows have their own."""


@dataclass(frozen=True)
class Players:
    """The agents that can play a split."""

    agents: Mapping[str, tuple[SplitData, Agent]]
    """By row of a table, with the split under the rules that the row is judged by."""
    blind: Collection[str] = ()
    """Rows whose agents need no pictures."""
    about: str = ""
    """A line about the trained agent."""


PlayersOfSplit = Callable[[str], Players]


@dataclass(frozen=True, kw_only=True, eq=False)
class Learner:
    """All that the commands know of a learner; what it leaves out cannot be done with it."""

    name: str
    """As commands name it. The agents of a shipped learner play tasks of the kind of this name."""
    train: Commands | None = None
    """`embodied train NAME`: options, and train(options, note=, on_validation=). `note` is told what goes on;
    `on_validation` is passed where the options have `rrd` set, and is called with update and episodes."""
    study: Commands | None = None
    """`embodied study NAME`: options, of agents.options.StudyOptions, and what makes a StudyLearner of them."""
    players: Callable[[Path, Dataset, PlaySettings], PlayersOfSplit] | None = None
    """(weights or run folder, data set, how it sees) -> split -> who plays."""
    columns: tuple[str, ...] = ()
    """Measures of the table of its agents; none for those of the kind of task."""
    shipped: Path | None = None
    """Weights that come with the program."""


def shipped_learners() -> list[str]:
    """Names of the learners that come with the program, without importing them: the files of agents/learners."""
    return sorted(f.stem for f in (Path(__file__).parent / "learners").glob("[!_]*.py"))


LEARNERS = Registry(Learner, "embodied.agents.learners", shipped_learners)
register_learner = LEARNERS.add
"""Make a learner known by its name; returns it. Call it where the learner is defined."""
learner_named = LEARNERS.named


def playing_learner(kind: str) -> Learner | None:
    """The shipped learner whose agents play tasks of a kind, if there is one."""
    learner = learner_named(kind) if kind in shipped_learners() else None
    return learner if learner is not None and learner.players is not None else None

"""Options of `embodied evaluate`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from embodied.agents.language_models.options import WithModel
from embodied.agents.options import GOAL_IMAGES, Encoded, Threaded
from embodied.cli.common import Furnished, Printed
from embodied.options import Count, InputFolder, InputPath, Option, OutputFolder

MODEL_SEES = ("names", "strip", "panorama", "nothing")
TEMPLATE = "template"


@dataclass(frozen=True, kw_only=True)
class TaskOptions:
    """Tasks."""

    data: InputFolder | None = None
    """The data set, a folder that `embodied dataset` built (default: one generated flat)."""
    split: tuple[Annotated[str, Option(metavar="SPLIT")], ...] = ()
    """Splits of the data set (default: test_unseen; hari: its three test splits)."""
    tasks: Count | None = None
    """Evaluate on at most N tasks of a split, spread over its houses (default: all, or 20 for a language model or
    without --data)."""
    steps: Count | None = None
    """Longest episode in steps (default: its task's)."""
    seed: int = 0
    """Random seed."""
    assistant: Annotated[str, Option(metavar="WHO")] = TEMPLATE
    """Who answers requests: template (the kind's own assistant), llm, person, or MODULE:CLASS of your own."""
    batch: Count | None = None
    """Play N episodes at a time, which does not change results (default: 32 for trained agents, else 8)."""
    rules: Annotated[str | None, Option(metavar="WORD")] = None
    """Rules of play of the kind of task. vnla: help in words (indirect, the default), the advisor acts and says it
    (direct) or does not (direct-mute), Algorithm 6 as printed (algorithm-6)."""
    seed_file: InputPath | None = None
    """Without --data: seeds of the houses to play in, one per line."""
    part: Annotated[str | None, Option(metavar="NAME")] = None
    """With --seed-file: the part of each house's tasks (ask: unseen_classes, those held out from training)."""


@dataclass(frozen=True, kw_only=True)
class Results(Printed):
    """Results."""

    out: OutputFolder | None = None
    """Folder for the table and the episodes."""


@dataclass(frozen=True, kw_only=True)
class OfTrained:
    """Trained agents."""

    rows: tuple[Annotated[str, Option(metavar="NAME")], ...] = ()
    """Rows of the table of a trained agent, such as 'learned' or 'learned, no ask' (default: all, or 'learned' where
    other agents are named)."""
    goal_image: Annotated[str, Option(words=GOAL_IMAGES)] = "same"
    """How goal images differ from what the agent sees there; same: not at all; camera: taken by a robot's camera; hour:
    at another hour; day: on another day, with people elsewhere and small things moved; later: at another hour of
    another day; -camera: also by a robot's camera; -view: that, and only one view of 60 degrees."""


@dataclass(frozen=True, kw_only=True)
class EvaluateOptions(TaskOptions, Results, OfTrained, WithModel, Encoded, Threaded, Furnished):
    kind: Annotated[str, Option(metavar="KIND", name="kind")]
    """The kind of task: find, vln, vnla, hanna, hari, ask, or MODULE:NAME of your own."""
    agent: tuple[Annotated[str, Option(metavar="NAME")], ...] = ()
    """Agents to evaluate: baselines by name, 'shipped', a file or run folder of `embodied train`, 'llm', MODULE:CLASS
    of your own policy, MODULE:LEARNER=RUN of your own learner, a folder with an agent.py, or the http:// address
    of an agent (default: shipped, else all baselines)."""
    threads: Count = 2
    sees: Annotated[str, Option(words=MODEL_SEES)] = "names"
    """Input of a language model: the true names of what is visible (an oracle), the candidate views as one strip,
    the panorama with markers, or nothing."""

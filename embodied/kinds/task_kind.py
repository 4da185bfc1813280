"""Kinds of tasks: a record each, registered where it is defined. The rest of the program knows no kind by name.

A kind is one file: `embodied/kinds/shipped/hanna.py`, or a module of your own that calls `register_kind`
(examples/my_task.py). Wherever a kind is named, in commands, in data sets and for Gymnasium, a kind of your own is
'module:NAME': the name of an importable module, which may lie in the current folder, and of the `TaskKind` in it.

    KIND = register_kind(TaskKind(name="my_task:KIND", title="MyTask", tasks=tasks))

Only `name`, `title` and `tasks` are needed. What else a kind may say, and who reads it:

    its rule of play, assistant and options     environment, rules, fitted, help    envs, gym, serve
    who plays it without learning               baselines, looking, expert          evaluate, export
    how it is judged                            success, needs_stop, metrics, columns, test_splits
    what its observation adds                   extras (Observation.extras)         gym
    its data sets                               splits, paper, routes, people, pictures, time_limits
    how an episode is told                      story, monocular                    viz
"""

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from embodied import interface
from embodied.action_spaces import PanoramicMoves
from embodied.envs.base import HelpEnv
from embodied.kinds.plugins import Registry, announce_kind, shipped_kinds
from embodied.kinds.splits import Splits, SplitSizes, seen_and_unseen
from embodied.navigation.graph import NavGraph
from embodied.policies.baselines import Forward10, RandomWalk, Shortest

Measure = Callable[[interface.Episode, NavGraph], float]
"""A number of one finished episode, given the graph of its house."""
SIXTEENTHS = {"main": range(14), "val": range(14, 15), "test": range(15, 16)}
"""Positions of a house's pool of tasks, modulo 16, that belong to each part: seen splits hold out tasks."""


UNBOUNDED = 1e6
"""Bound of array values that have no natural one (metres, counts, word numbers); Gymnasium wants it finite."""


# Tasks ------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class TaskInputs:
    """Inputs of the tasks of one house."""

    world: interface.Place
    routes: Sequence[interface.Route]
    """Worded routes through the house; empty where the kind asks for none."""
    seed: int
    language: interface.Language
    rooms: bool = True
    """False: requests name no room, where the kind can do without."""


Parts = Sequence[tuple[str, int]]
"""Parts of a house's pool, with the number of tasks wanted of each."""
PartTasks = dict[str, list[interface.Task]]


def parts_of_pool(size: int, task: Callable[[int], interface.Task], parts: Parts) -> PartTasks:
    """The first tasks of each part of a pool: of every sixteen, fourteen are to train, one to validate, one to test.

    Args:
      size: how many tasks the pool has.
      task: task i of the pool, a pure function of i.
    """
    places = {part: [i for i in range(size) if i % 16 in SIXTEENTHS[part]] for part, _ in parts}
    return {part: [task(i) for i in places[part][:n]] for part, n in parts}


@dataclass(frozen=True)
class TimeLimits:
    """Time limits that are learned from the training tasks of a data set and hold in its other splits."""

    learn: Callable[[Sequence[interface.Task], Callable[[str], interface.Place]], Any]
    """(training tasks, house of a name) -> what `apply` needs."""
    apply: Callable[[interface.Task, interface.Place, Any], interface.Task]


# Play -------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class EnvInputs:
    """Inputs that all environments of one maker share."""

    worlds: Mapping[str, interface.Place]
    """By House.name."""
    routes: Callable[[str], Sequence[interface.Route]] = lambda world: ()
    """Worded routes of a house, for the assistants who know them."""
    wording: str = "test"
    """The split of the routes that is spoken."""
    language: interface.Language | None = None
    """Voice of an assistant; plain words where not given."""
    training: Callable[[], Iterable[interface.Place]] | None = None
    """Houses to learn from, where an assistant counts what is common; `worlds` where not given."""
    rules: Any = None
    """Rules of play, of the type of TaskKind.rules; those where not given."""
    assistant: interface.Assistant | None = None
    """Who answers, instead of the kind's own assistant."""


EnvMaker = Callable[[], HelpEnv]


def plain_navigation(inputs: EnvInputs) -> EnvMaker:
    """Moves move, stop ends, and nobody can be asked."""
    moves = PanoramicMoves()
    return lambda: HelpEnv(inputs.worlds, moves=moves)


@dataclass(frozen=True)
class ArraySpec:
    """An array of a Gymnasium observation."""

    shape: tuple[int, ...]
    low: float
    high: float
    dtype: str = "float32"
    """With the shape () and whole numbers from 0 it becomes a Discrete space."""


@dataclass(frozen=True)
class ExtraArrays:
    """Arrays of Observation.extras in a Gymnasium observation."""

    specs: Callable[[int, Any], Mapping[str, ArraySpec]]
    """(number of candidates, rules of play) -> array by name."""
    encode: Callable[[interface.Observation, Mapping[str, ArraySpec]], Mapping[str, Any]]
    """(observation, specs) -> the values, of the shapes of the specs."""


# Judging and telling ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Metric:
    """A number of an episode that only one kind of task reports."""

    of: Measure
    percent: bool = False
    """Shown in per cent."""
    share: bool = False
    """0 or 1 of an episode."""
    per: Measure | None = None
    """Number that `of` is out of; the column is the ratio of both sums over the episodes."""


@dataclass(frozen=True)
class StoryStyle:
    """How the viewer tells an episode."""

    dialogue: bool = True
    """The dialogue is shown even where nobody asked."""
    goal_stack: bool = False
    """Goals lie on each other and steps have costs; both are shown."""
    leaving: str = ""
    """Line for the moment in which the agent leaves a sub-task for the task, whose goal it is then shown."""


# The record -------------------------------------------------------------------------------------

PLAIN_AGENTS: Mapping[str, Callable[[], interface.Agent]] = {
    "random walk": RandomWalk,
    "forward 10": Forward10,
    "shortest": Shortest,
}
INTENTIONS = (interface.Intention.HELP, interface.Intention.CUR, interface.Intention.GOAL, interface.Intention.SUB)
"""Questions of a kind that does not say otherwise."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TaskKind:
    """All that the program knows of a kind of task."""

    name: str
    """Of a kind of your own: 'module:NAME', where it is found. Task.kind, and where a data set says its kind."""
    title: str
    """Its Gymnasium environment is 'embodied/TITLE-v0'."""
    tasks: Callable[[TaskInputs, Parts], PartTasks]
    """Up to so many tasks of one house for each part of its pool: pure, and the first n are the same however many are
    wanted (see `parts_of_pool`)."""

    environment: Callable[[EnvInputs], EnvMaker] = plain_navigation
    """A maker of environments: the rule of play with its assistant. Use the method `environments`."""
    rules: Any = None
    """The usual rules of play: a frozen record or a word; None where there is nothing to choose."""
    fitted: Callable[[interface.Task, interface.Place, Any], interface.Task] | None = None
    """(task, house, rules) -> the task with as much time as the rules need."""
    help: Literal["none", "words", "descriptions"] = "none"
    """How its assistant helps: in words, which a person can say instead, by descriptions, or not at all."""

    baselines: Mapping[str, Callable[[], interface.Agent]] = field(default_factory=lambda: PLAIN_AGENTS)
    """Agents that do not learn."""
    looking: Mapping[str, Callable[[Mapping[str, interface.SeenPlace]], interface.Agent]] = field(default_factory=dict)
    """More of them, which look around: made for worlds with sightings, not only houses and graphs."""
    expert: str = "shortest"
    """The baseline that shows how a task is done; it asks where help can be had."""

    success: Measure | None = None
    """1 for a success; by default an episode that ends within the radius of a goal."""
    shortest: Measure | None = None
    """Metres of the shortest way that succeeds, for SPL; by default to the goal nearest the end."""
    needs_stop: bool = False
    """No success without the agent saying that it is done."""
    metrics: Mapping[str, Metric] = field(default_factory=dict)
    """Numbers that only this kind reports, by column."""
    columns: tuple[str, ...] = ("success", "strict success", "spl", "navigation error", "requests", "steps")
    """Of a table of agents that do not learn."""
    test_splits: tuple[str, ...] = ("test_unseen",)
    """Splits to evaluate in unless somebody says otherwise."""

    intentions: tuple[interface.Intention, ...] = INTENTIONS
    """Questions that may be asked, in the order of the actions' numbers."""
    extras: ExtraArrays | None = None
    """Of a kind whose environments fill in Observation.extras."""
    opens_doors: bool = False
    """Opening and closing doors are among its agents' actions."""
    monocular: bool = False
    """Agents turn on the spot and see one view at a time, not a panorama."""

    splits: Callable[[SplitSizes], Splits] | None = seen_and_unseen
    """None: there are no data sets of this kind."""
    paper: Splits | None = None
    """Houses and splits of the scale 'paper'."""
    unseen_part: str = "main"
    """The part of the pool of a house that nobody learned in."""
    routes: bool = False
    """Its houses have worded routes, for requests or assistants."""
    from_routes: bool = False
    """Its tasks are routes, so every data set with routes holds some."""
    people: bool = False
    """Its assistants stand in the houses as figures, where the routes begin."""
    roomless: bool = False
    """Its requests can do without naming a room (DatasetConfig.rooms)."""
    pictures: bool = True
    """Its agents look at pictures; data sets are drawn unless somebody says otherwise."""
    time_limits: TimeLimits | None = None

    story: StoryStyle = StoryStyle()

    def environments(self, inputs: EnvInputs) -> EnvMaker:
        """A maker of environments; all that it makes share assistant and caches.

        Raises:
          ValueError: rules of another kind, or an assistant where nobody is asked.
        """
        if inputs.assistant is not None and self.help == "none":
            raise ValueError(f"nobody is asked in tasks of kind {self.name!r}; leave the assistant out")
        return self.environment(dataclasses.replace(inputs, rules=self.checked_rules(inputs.rules)))

    def checked_rules(self, rules: Any) -> Any:
        """The rules of play that were given, or the usual ones for None.

        Raises:
          ValueError: they are another kind's.
        """
        if rules is None:
            return self.rules
        if self.rules is None:
            raise ValueError(f"tasks of kind {self.name!r} have no rules to choose, got {rules!r}; leave them out")
        if type(rules) is not type(self.rules):
            raise ValueError(f"rules of {self.name!r} should be of the kind of {self.rules!r}, got {rules!r}")
        return rules

    def tasks_under(
        self, tasks: Iterable[interface.Task], worlds: Mapping[str, interface.Place], rules: Any
    ) -> tuple[interface.Task, ...]:
        """The tasks with as much time as rules of play need.

        Raises:
          ValueError: as `checked_rules`.
        """
        rules = self.checked_rules(rules)
        return tuple(tasks if self.fitted is None else (self.fitted(t, worlds[t.world], rules) for t in tasks))

    def agent(self, name: str, worlds: Mapping[str, interface.SeenPlace] | None = None) -> interface.Agent:
        """A fresh agent that does not learn, by name.

        Args:
          worlds: what agents that look around look at.

        Raises:
          ValueError: unknown, or one that looks and was given no worlds.
        """
        if name in self.baselines:
            return self.baselines[name]()
        if name not in self.looking:
            raise ValueError(f"unknown agent {name!r} for {self.name}; use one of {sorted(self.agent_names)}")
        if worlds is None:
            raise ValueError(f"agent {name!r} looks around; give it the worlds that it plays in")
        return self.looking[name](worlds)

    @property
    def agent_names(self) -> list[str]:
        """All agents that do not learn."""
        return [*self.baselines, *self.looking]


# The registry -----------------------------------------------------------------------------------

KINDS = Registry(TaskKind, "embodied.kinds.shipped", shipped_kinds)
kind_named = KINDS.named


def register_kind(kind: TaskKind) -> TaskKind:
    """Make a kind known by its name, and to Gymnasium; returns it. Call it where the kind is defined.

    A kind of the same name is replaced, so that a notebook's cell can be run again.

    Raises:
      ValueError: its name does not say where it is found, or its title is another kind's.
    """
    announce_kind(kind.name, kind.title)
    return KINDS.add(kind)

"""The nouns of play: tasks, observations, actions, situations, replies, steps, episodes. Read this first.

An episode is a task played in a world: the policy sees an `Observation`, takes an `Action`
(move, ask or stop), an assistant may answer with a `Reply`, and a `Step` is written down.
Whoever knows more than the policy (assistants, teachers, metrics) is given a `Situation`.

Angles of a pose are multiples of 30 degrees (dissertation 4.2.2) and are kept as integers:
`turn` counts 30-degree steps of yaw counter-clockwise from +x, `tilt` is -1, 0 or +1 above the
horizon. View k of the 36 views looks along turn k % 12 and tilt k // 12 - 1.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeVar, runtime_checkable

import numpy as np

from embodied.people.strolls import Stroll

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.house.house import House
    from embodied.navigation.graph import NavGraph

STEP = math.pi / 6
"""The angle of one turn or tilt, radians."""
TURNS = 12
VIEWS = 36
VIEW_YAWS = np.arange(VIEWS) % TURNS * STEP
VIEW_PITCHES = (np.arange(VIEWS) // TURNS - 1) * STEP
"""(36,) float64: along which yaw and pitch each view looks, radians."""


# Where an agent is and what it can see ----------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Pose:
    """(v, psi, omega) of dissertation 4.2.2. An agent knows its angles, never its node."""

    node: int
    turn: int = 0
    """Yaw in steps of 30 degrees, 0..11, counter-clockwise from +x."""
    tilt: int = 0
    """Pitch in steps of 30 degrees, -1, 0 or 1."""

    @property
    def yaw(self) -> float:
        """Radians counter-clockwise from +x, in [0, 2 pi)."""
        return self.turn * STEP

    @property
    def pitch(self) -> float:
        """Radians above the horizon."""
        return self.tilt * STEP

    @property
    def view(self) -> int:
        """Which of the 36 views it looks into."""
        return TURNS * (self.tilt + 1) + self.turn


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """The place of a picture. Privileged: for assistants, renderers, recordings and sources of features."""

    world: str
    node: int


class Sight:
    """View at one step, or a picture that is shown, as a token that tells nothing by itself.

    A policy hands it to a `FeatureSource` and gets numbers. Every observation has new ones, which can neither be
    compared nor hashed, so a place is known again only by what it looks like.
    """

    __slots__ = ("__picture", "__viewpoint")

    def __init__(self, world: str, node: int, *, picture: bool = False) -> None:
        """`picture`: it was taken at another time, by whoever shows it (`is_picture`)."""
        self.__viewpoint, self.__picture = Viewpoint(world, node), picture

    def __repr__(self) -> str:
        return "Sight(...)"

    def __eq__(self, other: object) -> bool:
        raise TypeError("sights cannot be compared; compare what a FeatureSource gives for them")

    __hash__ = None  # type: ignore[assignment]


def viewpoint(sight: Sight) -> Viewpoint:
    """Viewpoint of a sight: for renderers, recordings and sources of features, never for a policy."""
    return sight._Sight__viewpoint  # type: ignore[attr-defined]


def is_picture(sight: Sight) -> bool:
    """True for a picture that was taken at another time, False for what the agent sees now; as `viewpoint`."""
    return sight._Sight__picture  # type: ignore[attr-defined]


@dataclass(frozen=True, slots=True)
class Sighting:
    """One object as seen from one node."""

    placement: str
    object_class: str
    yaw: float
    """Direction of what is visible of it, radians counter-clockwise from +x."""
    pitch: float
    """Radians above the horizon."""
    distance: float
    """Mean length of the rays that meet it, metres."""
    pixels: int
    """How many pixels of the six 64 x 64 faces around the node show it; all six have 24576."""


class Place(Protocol):
    """A house and where one can go in it: enough to play, judge and word."""

    @property
    def name(self) -> str:
        """House.name."""

    @property
    def house(self) -> House: ...

    @property
    def graph(self) -> NavGraph: ...


class SeenPlace(Place, Protocol):
    """A place of which is known, besides, what can be seen from every node; embodied.world.World is one."""

    @property
    def catalogue(self) -> Catalogue: ...

    def sightings(self, node: int) -> tuple[Sighting, ...]:
        """The objects that can be seen from a node, the largest in view first."""

    def with_doors(self, openness: Mapping[str, float]) -> Self:
        """The place with some doors at another openness, 0 to 1, by opening."""


PlaceT = TypeVar("PlaceT", bound=Place)
PlaceT_contra = TypeVar("PlaceT_contra", bound=Place, contravariant=True)


class FeatureSource(Protocol):
    """Turns a Sight into numbers: CNN features of the panorama, or cheap semantic ones."""

    size: int
    """D, the length of one feature vector."""

    def features(self, sight: Sight) -> np.ndarray:
        """(36, D) float32; row k belongs to view k, in absolute order (not turned to the agent)."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """The moves an agent may choose from, sorted by |bearing|: (n,) arrays that share an index.

    In the panoramic action space each candidate is a neighbouring node: the agent turns towards
    it and goes there. In VNLA's monocular action space the candidates are the five of `words`.
    """

    bearing: np.ndarray
    """(n,) float32, radians in [-pi, pi): exact direction relative to the agent's yaw, left positive."""
    slope: np.ndarray
    """(n,) float32, radians above the horizon."""
    view: np.ndarray
    """(n,) int64, absolute view 0..35 whose centre is nearest to the candidate."""
    allowed: np.ndarray
    """(n,) bool; a Move to a candidate that is not allowed is an error."""
    words: tuple[str, ...] = ()
    """VNLA: ('forward', 'left', 'right', 'up', 'down'); empty in the panoramic action space."""

    def __len__(self) -> int:
        return len(self.bearing)

    def __eq__(self, other: object) -> bool:
        alike = lambda name: np.array_equal(getattr(self, name), getattr(other, name))
        return isinstance(other, Candidates) and all(map(alike, Candidates.__slots__))


# What an agent is asked to do -------------------------------------------------------------------


@dataclass(frozen=True)
class FindObject:
    """Find an object of a class, in a room of a kind when one is named."""

    object_class: str
    room_kind: str | None = None
    placements: tuple[str, ...] = ()
    """The placements in the house that satisfy it, at least one."""


@dataclass(frozen=True)
class FollowRoute:
    """Follow a route instruction to its end (R2R)."""

    route: str
    """Id of the route."""
    path: tuple[int, ...]
    """Nodes from start to end."""


@dataclass(frozen=True)
class FindDescribed:
    """Find one object among its like (Ask-v0): the one that the requester has in mind."""

    object_class: str
    placement: str
    """The one that is meant. Privileged, as the next two are."""
    fitting: tuple[str, ...]
    """All placements that the request describes, the one that is meant included."""
    similar: tuple[str, ...] = ()
    """Further placements of its class."""
    words: tuple[str, ...] = ()
    """Words of colour and material in the request."""
    room_kind: str | None = None
    """The kind of room in the request."""


@dataclass(frozen=True)
class GoTo:
    """Go to rooms or things of the house: the goal of a kind of task of one's own, which says what that means."""

    rooms: tuple[str, ...] = ()
    """Ids of rooms."""
    placements: tuple[str, ...] = ()
    """Ids of things."""


@dataclass(frozen=True)
class NextGoal:
    """One goal of a sequence (GOAT-Bench)."""

    form: str
    """'object', 'description' or 'image': how the agent is told."""
    category: str
    """Noun of the thing, as the agent is told."""
    placements: tuple[str, ...]
    nodes: tuple[int, ...]
    """Nodes where it counts as found."""
    words: str
    picture: int | None = None
    """Node of the picture that is shown."""


@dataclass(frozen=True)
class FindInTurn:
    """Find one thing after the other, in the same episode."""

    goals: tuple[NextGoal, ...]

    @property
    def placements(self) -> tuple[str, ...]:
        return tuple(p for goal in self.goals for p in goal.placements)


@dataclass(frozen=True)
class AnswerQuestion:
    """Find out something about the house and answer one of several options (embodied question answering)."""

    form: str
    """Kind of question."""
    noun: str
    """Class of the thing that it is about."""
    options: tuple[str, ...]
    answer: int
    """Index of the right option."""
    placements: tuple[str, ...]
    """Things that the answer rests on."""


@dataclass(frozen=True)
class AmongPeople:
    """Go to the goal node without touching anybody."""

    strolls: tuple[Stroll, ...]
    """Who walks about meanwhile."""


Goal = FindObject | FollowRoute | FindDescribed | GoTo | FindInTurn | AnswerQuestion | AmongPeople


@dataclass(frozen=True)
class Task:
    """One thing to do: where it starts, what is asked, and what counts as success.

    Examples:
      >>> request = split.tasks[0].request
    """

    id: str
    """Unique in a data set: '<world>/<kind>/<number>'."""
    kind: str
    """Name of its TaskKind: 'find', 'vln', 'vnla', 'hanna', 'hari', 'ask', 'doors', or 'module:NAME' of your own."""
    world: str
    """Name of the house (House.name)."""
    start: Pose
    goal: Goal
    goal_nodes: tuple[int, ...]
    """Success is to end within `radius` of one of these, along the graph."""
    request: str
    """Words of the requester, d* in the dissertation."""
    radius: float
    """Metres along the graph, inclusive."""
    horizon: int
    """Most steps of any kind, H in the dissertation."""
    budget: float | None = None
    """Most requests for help; None is without limit. An episode rounds a fraction up with that
    probability (VNLA; docs/sources.md, S46)."""
    closed: tuple[str, ...] = field(default=(), metadata={"unless_default": True})
    """Doors that are closed at the start, besides those that the house has closed, in the order of the house."""


@dataclass(frozen=True)
class Route:
    """A language-assisted route xi = (psi, omega, p, d) of dissertation 4.2.2."""

    id: str
    path: tuple[int, ...]
    turn: int
    tilt: int
    """Camera angles on entering, in steps of 30 degrees."""
    instruction: str
    split: str = "train_seen"
    """'train_seen', 'train_unseen', 'val' or 'test': who may hear this wording."""


# What an agent may do ---------------------------------------------------------------------------


class Intention(enum.Enum):
    """Purpose of a request for help.

    Examples:
      >>> embodied.Intention('help')
      <Intention.HELP: 'help'>
    """

    HELP = "help"
    """VNLA and HANNA: the assistant decides what to say."""
    CUR = "cur"
    """HARI: describe where I am."""
    GOAL = "goal"
    """HARI: describe where I should go."""
    SUB = "sub"
    """HARI: give me a nearer goal."""
    CONFIRM = "confirm"
    """Ask-v0, as all below: say if this is the thing that is meant."""
    APPEARANCE = "appearance"
    """Describe what it looks like."""
    REGION = "region"
    """Name its room."""
    ROUTE = "route"
    """Describe the way."""
    DISAMBIGUATE = "disambiguate"
    """Say which of those that I see is meant."""
    FREE = "free"
    """A question in the agent's own words (Ask.question)."""


@dataclass(frozen=True, slots=True)
class Usage:
    """Calls of language models for one step."""

    calls: int = 0
    tokens_in: int = 0
    tokens_out: int = 0
    price: float = 0.0
    """In the currency of the rates that were given; answers from the cache count what they first cost."""
    invalid: int = 0
    """Answers that were none: not the wanted JSON, an unknown action, HTML, too long."""
    refusals: int = 0
    """Answers in which the model declines."""

    def __add__(self, other: Usage) -> Usage:
        return Usage(*(getattr(self, n) + getattr(other, n) for n in Usage.__dataclass_fields__))


@dataclass(frozen=True, slots=True, eq=False)
class Thought:
    """Thought of a policy when it acted. The environment never reads it; teachers and viz may."""

    moves: np.ndarray | None = None
    """(n + 1,) float32 probabilities over the candidates and, last, stop."""
    asks: Mapping[str, float] | None = None
    """Probability of each help action: {'help': 0.2, 'nothing': 0.8}."""
    reasons: tuple[float, ...] | None = None
    """HANNA: probabilities of (lost, uncertain_wrong, never_asked)."""
    usage: Usage | None = None
    """Calls of a language model; None where there is none."""
    words: str = ""
    """The reason that a language model gave."""
    match: float | None = None
    """HANNA: how well the picture that it was shown matches what it sees, up to 1."""


@dataclass(frozen=True, slots=True)
class Move:
    """Turn to a candidate and go there.

    Examples:
      >>> observation = play.step(embodied.Move(0))
    """

    candidate: int
    """Index into Observation.candidates."""
    thought: Thought | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Ask:
    """Ask the assistant; possible only when Observation.can_ask holds the intention.

    Examples:
      >>> embodied.Ask(embodied.Intention.FREE, question='Which door?').question
      'Which door?'
    """

    intention: Intention = Intention.HELP
    thought: Thought | None = field(default=None, compare=False, repr=False)
    question: str | None = None
    """The question in words, where a person or a language model put it."""


@dataclass(frozen=True, slots=True)
class Stop:
    """Say that the current task or sub-task is done (HARI: DONE).

    Examples:
      >>> play.step(embodied.Stop()) is None  # the episode has ended
      True
    """

    thought: Thought | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Open:
    """Open the closed doors between here and a candidate; the agent stays where it is.

    Examples:
      >>> Open(0).candidate
      0
    """

    candidate: int
    """Index into Observation.candidates, one of Observation.can_open."""
    thought: Thought | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Close:
    """Close the open doors between here and a candidate; the agent stays where it is."""

    candidate: int
    """Index into Observation.candidates, one of Observation.can_close."""
    thought: Thought | None = field(default=None, compare=False, repr=False)


Action = Move | Ask | Open | Close | Stop


# What an agent is told --------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Feature:
    """One feature set of HARI's bag-of-features descriptions (appendix E)."""

    kind: str
    """'object', 'room' or 'action'."""
    name: str
    """Object class, room kind, 'go' or 'stop'."""
    horizontal: int = 0
    """Direction in steps of 30 degrees, 0..11, counter-clockwise from +x; 0 for rooms."""
    vertical: int = 0
    """-1, 0 or 1 steps of 30 degrees; of rooms 1 for those upstairs."""
    distance: int = 0
    """Metres rounded down, 0..4."""


Description = tuple[Feature, ...]


class Mode(enum.Enum):
    MAIN = "main"
    """Working on the task request."""
    SUB = "sub"
    """Working on what the assistant said."""


@dataclass(frozen=True, slots=True)
class Subtask:
    """Meaning of a reply. Privileged: for the environment, teachers and metrics.

    Examples:
      >>> embodied.Subtask('subgoal', target=3).target
      3
    """

    id: str
    """Route id in HANNA, 'subgoal' elsewhere."""
    target: int
    """Node where the assistant wants it to end: v_depart (4.6), a subgoal in HARI."""
    start: Pose | None = None
    """HANNA: where the route is entered and with which angles; None stays put. VNLA: where `words` begin."""
    goal: int | None = None
    """HANNA: g* (4.7), whose image is shown after departing."""
    path: tuple[int, ...] = ()
    """Nodes that the text talks about."""
    words: tuple[str, ...] = ()
    """VNLA: the teacher's next k actions as words, 'stop' included, for direct intervention."""


@dataclass(frozen=True, slots=True)
class Reply:
    """Answer of the assistant: a text, an image, a description, or several of them.

    Examples:
      >>> embodied.Reply(text='Turn left.').text
      'Turn left.'
    """

    text: str | None = None
    image: Viewpoint | None = None
    """Viewpoint of the picture that it shows; the agent gets a Sight of it."""
    description: Description | None = None
    intention: Intention = Intention.HELP
    """Question that was answered; an uncooperative assistant may answer another."""
    subtask: Subtask | None = None
    """Privileged; never shown to a policy."""
    usage: Usage | None = None
    """Calls of a language model for it; None where there is none."""
    ruled_out: tuple[str, ...] = ()
    """Ask-v0: placements that the answer tells are not meant. Privileged."""


@dataclass(frozen=True, slots=True)
class Detection:
    """Something that looks like what was asked for, as a simulated detector reports it."""

    bearing: float
    """Radians in [-pi, pi), relative to the agent's yaw, left positive."""
    distance: float
    """Metres."""
    score: float
    """0..1: how well it fits all that was said, to two digits."""


class Extras:
    """Part of an observation that a kind of task adds; each kind derives a frozen record from it."""

    def lines(self, turn: int) -> tuple[str, ...]:
        """It in words, for language models and people; directions as seen along `turn` (Observation.turn)."""
        return ()


@dataclass(frozen=True, slots=True)
class Observation:
    """Everything a policy may know at one step, and nothing else.

    Examples:
      >>> play = split.make_env()
      >>> observation = play.reset(split.tasks[0], seed=0)
      >>> observation.time, len(observation.candidates) > 0
      (0, True)
    """

    sight: Sight = field(compare=False)
    """The panorama around the agent, for a FeatureSource."""
    turn: int
    """The agent's own yaw in steps of 30 degrees, 0..11."""
    tilt: int
    candidates: Candidates
    instruction: str
    """d+: the text being executed: the request, or what the assistant said."""
    target: Sight | None = field(compare=False)
    """The image being looked for (HANNA), if any."""
    mode: Mode
    can_ask: tuple[Intention, ...]
    """The intentions that may be asked now; empty where nobody can be asked."""
    requests_left: int | None
    """Remaining request budget; None without a budget."""
    time: int
    """Steps since the episode began."""
    time_on_task: int
    """Steps since the instruction last changed; 0 tells a policy that it just did."""
    moved: bool = False
    """The last step led to another node."""
    extras: Any = None
    """The kind's own part, an `Extras`: what HARI's and Ask's agents are told besides (embodied/envs)."""
    can_open: tuple[int, ...] = ()
    """Candidates behind a closed door that may be opened now; in tasks without closed doors there are none."""
    can_close: tuple[int, ...] = ()
    """Candidates behind a door that was closed and is open now."""


@dataclass(frozen=True, slots=True)
class Situation:
    """The privileged view of one step: for assistants, teachers and metrics, never for a policy.

    Examples:
      >>> node = play.situation.pose.node
    """

    world: Place
    task: Task
    pose: Pose
    mode: Mode
    targets: tuple[int, ...]
    """Nodes the current task or sub-task wants: all goals, g* after departing, or the sub-goal."""
    subtask: Subtask | None
    """Meaning of the last reply; None before any reply and, in HANNA, after departing."""
    candidate_nodes: tuple[int, ...]
    """Node of each candidate in the observation of this step."""
    candidates: Candidates
    time: int
    requests: int
    """Requests made so far."""
    requests_left: int | None = None
    """Remaining request budget; None without a budget."""
    trail: tuple[int, ...] = ()
    """Node at the beginning of every navigation step so far, the current one last."""
    question: str = ""
    """Of a free question that is being answered: its words."""
    extras: Any = None
    """The kind's own part: a record of what else its assistant knows (embodied/envs)."""
    closed: frozenset[str] = frozenset()
    """Doors that are closed now, and parts of furniture that are open."""


# What is written down ---------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Step:
    """One step as it was taken. Everything privileged is here, pixels are not."""

    pose: Pose
    """Before the action."""
    mode: Mode
    instruction: str
    targets: tuple[int, ...]
    subtask: str
    """Id of the sub-task, 'none' for every stretch of the main task (docs/sources.md, S18)."""
    can_ask: tuple[Intention, ...]
    candidate_nodes: tuple[int, ...]
    action: Action
    reply: Reply | None
    next_pose: Pose
    cost: float = 0.0
    """HARI: the cost of this step, shaping excluded; Ask-v0 and with people: the price of the question."""
    seconds: float | None = None
    """When it was taken, since the episode began; None where no person took part."""
    moved: tuple[str, ...] = field(default=(), metadata={"unless_default": True})
    """Parts of furniture that it opened or closed."""


@dataclass(frozen=True)
class Episode:
    """A task as it was played, step by step.

    Examples:
      >>> episodes[0].ended, episodes[0].steps[-1].action
      ('stop', Stop())
    """

    task: Task
    steps: tuple[Step, ...]
    ended: str
    """'stop' when the agent stopped, 'limit' when the horizon cut it short."""
    seed: int = 0
    agent: str = ""
    budget: int | None = None
    """The whole number of requests that this episode was given; None without a budget."""
    house: str = ""
    """The start of the digest of the house it was played in: houses of other data sets have the same names."""

    @property
    def nodes(self) -> tuple[int, ...]:
        """Nodes visited, the start first, repeats kept: len(steps) + 1 of them."""
        return (self.task.start.node, *(s.next_pose.node for s in self.steps))

    @property
    def requests(self) -> int:
        return sum(isinstance(s.action, Ask) for s in self.steps)


@dataclass(frozen=True)
class SuccessRule:
    """Settings in which the successes of graph, continuous and driven play differ."""

    radius: float
    """Metres from a goal within which an episode should end."""
    strict: bool = False
    """An end at the radius is too far, as in Habitat; on graphs (docs/sources.md, S3) and in Drive-v0 it is not."""
    needs_stop: bool = True
    """The agent has to say that it is done."""

    def near(self, metres: Any) -> Any:
        """True for a place, or an array of places, that is near enough to a goal."""
        return metres < self.radius if self.strict else metres <= self.radius + 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class Trajectory:
    """An episode as it is judged, whether it was played on a graph, over a floor or on wheels."""

    rule: SuccessRule
    distances: np.ndarray
    """(n,) metres to the nearest goal at the places where it could have ended, of which the last is where it did."""
    lengths: np.ndarray
    """(n,) metres gone until then."""
    shortest: float
    """Metres of the shortest way that succeeds."""
    stopped: bool
    """The agent said that it is done."""
    achieved: float | None = None
    """Verdict of a kind of task that judges by more than the distance to a goal."""

    @property
    def success(self) -> float:
        """1 if it ended near enough to a goal, or as its kind of task wants it; else 0."""
        good = self.rule.near(self.distances[-1]) if self.achieved is None else self.achieved
        return float(good and (self.stopped or not self.rule.needs_stop))

    @property
    def spl(self) -> float:
        """Success weighted by path length (Anderson et al. 2018; one term of dissertation 4.17)."""
        return self.success * self._share_of_way(-1)

    @property
    def oracle_success(self) -> float:
        """1 if any place was near enough."""
        return float(self._near.any())

    @property
    def oracle_spl(self) -> float:
        """SPL of an episode that ends at the first place that is near enough."""
        return self._share_of_way(int(np.argmax(self._near))) if self._near.any() else 0.0

    @property
    def _near(self) -> np.ndarray:
        return np.asarray(self.rule.near(self.distances))

    def _share_of_way(self, at: int) -> float:
        """The shortest way over the longer of it and the way gone until place `at`; where the shortest way is 0, 1 for
        who did not move and 0 for who moved."""
        longest = max(self.shortest, float(self.lengths[at]))
        return self.shortest / longest if longest > 0 else 1.0


# Who takes part ---------------------------------------------------------------------------------


class Assistant(Protocol):
    """Part of the world, present at test time too. Sees the situation and answers requests."""

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        """Questions that may be asked here and now."""

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply: ...


@dataclass(frozen=True, slots=True)
class Label:
    """Judgement of a teacher about one step."""

    move: Move | Open | Stop | None
    """The reference navigation action; None: not to be learned from."""
    ask: bool | None = None
    """True where it should have asked; None: not to be learned from (no zone, or no such teacher)."""
    reasons: tuple[bool, bool, bool] | None = None
    """HANNA: (lost, uncertain_wrong, never_asked)."""
    negatives: tuple[Move | Stop, ...] = ()
    """HANNA: past mistakes at this node under this instruction, the set of (4.12)."""


class Teacher(Protocol):
    """Sees everything, labels training data, never speaks to the agent."""

    def label(self, situation: Situation) -> Label:
        """The reference action now."""

    def relabel(self, episode: Episode, world: Place) -> tuple[Label, ...]:
        """Labels of every step of a finished episode (the retrospective mode of 4.2.3)."""


Observations = Sequence[Observation | None]
"""Of a batch of episodes; None where one has ended."""
Situations = Sequence[Situation | None]
Actions = list[Action | None]
Rngs = Sequence[np.random.Generator]
"""One for each episode of a batch."""


class Policy(Protocol):
    """Acts for a batch of episodes at once.

    Position i of every call belongs to the same episode; its observation is None once it has ended, and so must its
    action be. The memory is the policy's own business: None on the first call of a batch, then whatever it returned. It
    may draw only from rngs[i] for episode i, so that an episode does not depend on the batch around it.
    """

    def act(self, observations: Observations, memory: Any, *, rngs: Rngs) -> tuple[Actions, Any]: ...


@runtime_checkable
class PrivilegedPolicy(Protocol):
    """A skyline or baseline that is shown the situations as well; otherwise as Policy."""

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Rngs
    ) -> tuple[Actions, Any]: ...


Agent = Policy | PrivilegedPolicy
"""Whoever can play an episode."""


def act(
    agent: Agent, observations: Observations, situations: Situations, memory: Any, *, rngs: Rngs
) -> tuple[Actions, Any]:
    """Actions of an agent; it is shown the situations only if it says that it needs them."""
    if isinstance(agent, PrivilegedPolicy):
        return agent.act_privileged(observations, situations, memory, rngs=rngs)
    return agent.act(observations, memory, rngs=rngs)


class Language(Protocol[PlaceT_contra]):
    """The voice of requesters and assistants; embodied.language implements it.

    Language[SeenPlace] speaks of what can be seen, Language[Place] does without.
    """

    def request(self, goal: FindObject, *, rng: np.random.Generator) -> str:
        """The words of a task: 'find a mug in the kitchen'."""

    def route(self, world: PlaceT_contra, path: Sequence[int], yaw: float, *, rng: np.random.Generator) -> str:
        """How a person describes walking along `path` (nodes), starting to look along `yaw` (radians)."""

    def subgoal(self, words: Sequence[str]) -> str:
        """VNLA: primitive actions ('left', 'left', 'forward', 'stop') as a sentence."""

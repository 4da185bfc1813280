"""Ask-v0's rule of play: every question costs a step and a price; stopping ends the episode."""

from collections.abc import Mapping
from dataclasses import dataclass

from embodied import interface
from embodied.action_spaces import Moves
from embodied.assistants.ask import in_view
from embodied.assistants.descriptions import Describer, features_in_words, side
from embodied.envs.base import HelpEnv
from embodied.geometry import wrap
from embodied.seeds import stream

FITS, OTHER, DENIED = 0.75, 0.35, 0.1
"""Mean scores of what fits all that was said, of other things of the class, and of a thing of which was said that it is
not it."""
SCORE_NOISE = 0.15
"""Standard deviation of a score."""


@dataclass(frozen=True)
class Prices:
    """Price of each question, where a success is worth 1."""

    confirm: float = 0.05
    appearance: float = 0.05
    region: float = 0.05
    route: float = 0.2
    disambiguate: float = 0.1
    free: float = 0.1

    def __post_init__(self) -> None:
        if not all(0 <= getattr(self, f) < float("inf") for f in self.__dataclass_fields__):
            raise ValueError(f"prices should be numbers from 0 on, got {self}")

    def of(self, question: interface.Intention) -> float:
        return float(getattr(self, question.value))


@dataclass(frozen=True)
class AskSettings:
    """Rules of play that may be varied."""

    prices: Prices = Prices()
    grounded: bool = True
    """The detector takes in what was answered, and the next step of a route is shown while it is followed. False leaves
    the agent with the words alone."""


@dataclass(frozen=True)
class AskExtras(interface.Extras):
    """Observation of the agent besides what all kinds see."""

    state_description: interface.Description
    """The room and what is near."""
    detections: tuple[interface.Detection, ...]
    """The best first."""
    advised: interface.Move | interface.Stop | None
    """The next action of the route that was told; None where none is being followed."""

    def lines(self, turn: int) -> tuple[str, ...]:
        parts = [f"here: {features_in_words(self.state_description, turn)}"] if self.state_description else []
        for d in self.detections:
            parts.append(f"perhaps it: {side(d.bearing)}, {d.distance:.1f} m, score {d.score:.2f}")
        if self.advised is not None:
            advice = "stop here" if isinstance(self.advised, interface.Stop) else f"go {self.advised.candidate}"
            parts.append(f"the route that you were told says: {advice}")
        return tuple(parts)


@dataclass(frozen=True)
class AskTruth:
    """Knowledge of the assistant besides the situation."""

    possible: tuple[str, ...]
    """Placements that fit all that was said so far."""


class AskEnv(HelpEnv):
    """Find what somebody has in mind. The detector's noise belongs to thing and place, so looking again does not help;
    whether a thing is the one that is meant never reaches its score."""

    def __init__(
        self,
        worlds: Mapping[str, interface.Place],
        assistant: interface.Assistant,
        moves: Moves | None = None,
        rules: AskSettings = AskSettings(),
        describer: Describer | None = None,
    ) -> None:
        super().__init__(worlds, assistant, moves)
        self.rules, self._describer = rules, describer or Describer(())

    def facts(self) -> dict[str, float]:
        """The price of the questions so far."""
        return {"price": sum(s.cost for s in self._steps)}

    def _begin(self) -> None:
        if not isinstance(self.task.goal, interface.FindDescribed):
            raise TypeError(f"{self.task.id!r} is of kind {self.task.kind!r}, here 'ask' is played")
        self._goal = self.task.goal
        self._fitting: tuple[str, ...] = self._goal.fitting
        self._denied: set[str] = set()
        self._way: tuple[int, ...] = ()
        """Nodes of the route that is being followed, the present one first."""
        self._arrives = False
        """It leads to a goal node, not only towards one."""

    def _replied(self, reply: interface.Reply) -> None:
        self._fitting = tuple(p for p in self._fitting if p not in reply.ruled_out)
        self._denied |= set(reply.ruled_out)
        if reply.subtask is not None:
            self._way = reply.subtask.path
            self._arrives = self._way[-1] in self.task.goal_nodes
            self._moved()
        self.instruction = f"{self.instruction} . {reply.text}"
        self.time_on_task = 0

    def _moved(self) -> None:
        if self.pose.node in self._way:
            self._way = self._way[self._way.index(self.pose.node) :]
        if self.pose.node not in self._way or (len(self._way) == 1 and not self._arrives):
            self._way = ()

    def _cost(self, action: interface.Action) -> float:
        return self.rules.prices.of(action.intention) if isinstance(action, interface.Ask) else 0.0

    def _truth(self) -> AskTruth:
        return AskTruth(self._fitting)

    def _extras(self) -> AskExtras:
        here = self._describer.dense(self.world, self.pose.node)
        return AskExtras(here, self._detections(), self._advised())

    def _advised(self) -> interface.Move | interface.Stop | None:
        if not self.rules.grounded or not self._way:
            return None
        if len(self._way) == 1:
            return interface.Stop()
        return interface.Move(self.situation.candidate_nodes.index(self._way[1]))

    def _detections(self) -> tuple[interface.Detection, ...]:
        known = self._fitting if self.rules.grounded else self._goal.fitting
        denied = self._denied if self.rules.grounded else ()
        detections = []
        for name, yaw, distance in in_view(self.world, self.pose.node, self._goal):
            rng = stream(0, "detector", self.task.world, name, self.pose.node)
            mean = DENIED if name in denied else FITS if name in known else OTHER
            score = min(max(mean + SCORE_NOISE * float(rng.standard_normal()), 0.0), 1.0)
            detections.append(
                interface.Detection(float(wrap(yaw - self.pose.yaw)), round(distance, 2), round(score, 2))
            )
        return tuple(sorted(detections, key=lambda d: (-d.score, d.distance)))

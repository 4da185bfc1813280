"""Ask-v0's baselines: one way to explore, and rules of when to ask what.

All explore alike: they remember where they have been (a robot's odometry; that is all they use of the Situation, but
for the oracle), walk up to what looks like the thing, and follow a route while it is shown. They do not read.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from embodied.geometry import wrap
from embodied.interface import Action, Ask, Detection, Intention, Move, Observation, Situation, Stop
from embodied.policies.baselines import PerEpisodePolicy, step_on_known_way

REACH = 2.0
"""Metres within which a thing has been reached."""
LIKELY = 0.55
"""Score from which a thing is walked up to."""


@dataclass
class EpisodeMemory:
    """Memory of one episode."""

    visits: dict[int, int] = field(default_factory=dict)
    asked: dict[Intention, int] = field(default_factory=dict)
    """How often each question was asked."""
    asked_at: dict[Intention, int] = field(default_factory=dict)
    """At which `moment` each question was asked last."""
    before: float = 0.0
    """The score of the thing when it was asked last whether this is it."""

    @property
    def moment(self) -> int:
        """A number that every move changes."""
        return len(self.visits) + sum(self.visits.values())

    def ask(self, question: Intention, thing: Detection | None) -> Ask:
        """Remember a question that is asked now, and of which thing that was reached."""
        self.asked[question], self.asked_at[question] = self.asked.get(question, 0) + 1, self.moment
        if question is Intention.CONFIRM and thing is not None:
            self.before = thing.score
        return Ask(question)


PricedAskRule = Callable[[Observation, Detection | None, EpisodeMemory], Action | None]
"""Decision about what is known: an Ask, a Stop, or None to go on. It is given the thing that was reached, if any, the
one nearest."""


class Asker(PerEpisodePolicy):
    """Explores, and asks by a rule."""

    def __init__(self, rule: PricedAskRule) -> None:
        self.rule = rule

    def new_memory(self) -> Any:
        return EpisodeMemory()

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        action = self.rule(o, reached(o), memory)
        if isinstance(action, Ask) and action.intention in o.can_ask:
            return memory.ask(action.intention, reached(o))
        if isinstance(action, Stop):
            return action
        return onward(o, s, memory, rng)


def reached(o: Observation) -> Detection | None:
    """The nearest thing of the class within reach."""
    near = [d for d in o.extras.detections if d.distance <= REACH]
    return min(near, key=lambda d: d.distance) if near else None


def onward(o: Observation, s: Situation, trail: EpisodeMemory, rng: np.random.Generator) -> Action:
    """Notes the visit, and goes on: along the route that is shown, else towards what looks like the thing, else where
    it has been least."""
    trail.visits[s.pose.node] = trail.visits.get(s.pose.node, 0) + 1
    if o.extras.advised is not None:
        return o.extras.advised
    visits = np.array([trail.visits.get(v, 0) for v in s.candidate_nodes])
    if not len(visits):
        return Stop()
    bearing = o.candidates.bearing
    likely = [d for d in o.extras.detections if d.score >= LIKELY and d.distance > REACH]
    if likely and visits.min() < 2:
        off = np.abs(wrap(bearing - likely[0].bearing)) + 2.0 * visits
        return Move(int(np.argmin(off)))
    return Move(int(rng.choice(np.flatnonzero(visits == visits.min()))))


def never(o: Observation, thing: Detection | None, trail: EpisodeMemory) -> Action | None:
    """Stops at the first thing that looks like it."""
    return Stop() if thing and thing.score >= LIKELY else None


def between(low: float, high: float) -> PricedAskRule:
    """Stops at a thing whose score is at least `high`, passes by below `low`, and asks between."""

    def rule(o: Observation, thing: Detection | None, trail: EpisodeMemory) -> Action | None:
        if thing is None:
            return None
        if trail.asked_at.get(Intention.CONFIRM) == trail.moment:  # asked at this very place: a no lowered the score
            return Stop() if thing.score >= trail.before else None
        if thing.score >= high:
            return Stop()
        if thing.score >= low and Intention.CONFIRM in o.can_ask:
            return Ask(Intention.CONFIRM)
        return None

    return rule


def first(question: Intention, rule: PricedAskRule) -> PricedAskRule:
    """Asks one question at the beginning, then follows another rule."""

    def both(o: Observation, thing: Detection | None, trail: EpisodeMemory) -> Action | None:
        return Ask(question) if question in o.can_ask and not trail.asked.get(question) else rule(o, thing, trail)

    return both


confirm_on_sight = between(LIKELY - 0.1, 2.0)
"""Asks at everything that looks like it whether this is it."""
ASKER_RULES: Mapping[str, PricedAskRule] = {
    "never ask": never,
    "confirm on sight": confirm_on_sight,
    "threshold 0.45-0.85": between(0.45, 0.85),
    "threshold 0.55-0.75": between(0.55, 0.75),
    "appearance first": first(Intention.APPEARANCE, never),
    "region first": first(Intention.REGION, never),
    "appearance, then confirm": first(Intention.APPEARANCE, between(0.5, 0.95)),
    "always route": lambda o, thing, trail: None if o.extras.advised else Ask(Intention.ROUTE),
}


COLLECT = 0.4
"""Share of the steps in which it collects."""


@dataclass
class PoolMemory(EpisodeMemory):
    """Memory of one episode, with what was found on the way."""

    ways: dict[int, tuple[int, ...]] = field(default_factory=dict)
    """Neighbours of the places where it has been."""
    pool: dict[int, str] = field(default_factory=dict)
    """Kind of the room of each place where it reached what may be the thing."""


class CollectThenSplit(Asker):
    """Collects what may be it, then asks what splits the pool, and goes back to what is left.

    The rule of ProCompNav (Kwon et al. 2026, arXiv 2605.06223) with Ask-v0's questions. Theirs finds attributes that
    split the pool and asks yes or no; here it asks for the region where rooms differ, else for the appearance, and at
    a thing whether this is it, unless it is the last.
    """

    def __init__(self) -> None:
        super().__init__(confirm_on_sight)

    def new_memory(self) -> Any:
        return PoolMemory()

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        here, thing, pool = s.pose.node, reached(o), memory.pool
        memory.ways[here] = s.candidate_nodes
        likely = thing is not None and thing.score >= LIKELY
        if o.time < COLLECT * s.task.horizon:
            if likely and not pool.keys() & {here, *s.candidate_nodes}:
                pool[here] = next((f.name for f in o.extras.state_description if f.kind == "room"), "")
            return onward(o, s, memory, rng)
        question = Intention.REGION if len({*pool.values()}) > 1 else Intention.APPEARANCE
        if len(pool) > 1 and question in o.can_ask and not memory.asked:
            return memory.ask(question, thing)
        if Intention.REGION in memory.asked:
            heard_room = o.instruction.split(" . ")[1].replace(" ", "_")
            memory.pool = pool = {v: room for v, room in pool.items() if room in heard_room}
        if thing is not None and here in pool:
            confirmed = memory.asked_at.get(Intention.CONFIRM) == memory.moment
            if likely and (len(pool) == 1 or (confirmed and thing.score >= memory.before)):
                return Stop()
            if likely and not confirmed and Intention.CONFIRM in o.can_ask:
                return memory.ask(Intention.CONFIRM, thing)
            del pool[here]
        place = step_on_known_way(memory.ways, here, pool)
        return super().act_one(o, s, memory, rng) if place is None else Move(s.candidate_nodes.index(place))

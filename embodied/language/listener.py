"""A scripted listener: carries out what it reads, seeing only what anybody would see.

It reads the text with the grammar, then searches, cheapest first, for a walk that fits the
clauses. A walk is only extended from nodes it has looked around at, so all it knows of the house
comes through `Lookout`; it may turn back and try another way, as people do.
"""

from __future__ import annotations

import dataclasses
import heapq
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from embodied.geometry import wrap
from embodied.interface import SeenPlace
from embodied.language import clauses as meaning
from embodied.language.grammar import parse
from embodied.language.lexicon import lexicon_of
from embodied.language.surroundings import Lookout, Surroundings, Way, doorway

STEPS_PER_CLAUSE = 4
"""Most steps that one clause may stand for."""
MOST_WALKS = 2500
"""Most partial walks it thinks through before it settles for the best it has."""
ARRIVAL_DISTANCE, PASSING_DISTANCE = 1.6, 2.6
"""Metres within which one is at a thing, or passes it."""
UNASKED = 1.0
"""Cost of opening a door, or of a step on stairs, that nobody spoke of."""
MISSING = 4.0
"""Cost of a thing or room that is not there."""


@dataclass(frozen=True)
class Execution:
    """The walk of a listener."""

    path: tuple[int, ...]
    cost: float
    """How badly the walk fits the words; 0 is perfect."""


def follow(world: SeenPlace, text: str, start: int, yaw: float) -> Execution:
    """Walk as `text` says, from `start`, looking along `yaw` (radians).

    Raises:
      ValueError: the text holds no instruction.
    """
    return carry_out(Lookout(world), parse(text, lexicon_of(world.catalogue)), start, yaw)


def carry_out(eyes: Lookout, instruction: meaning.RouteInstruction, start: int, yaw: float) -> Execution:
    """The cheapest walk that fits the clauses, found by uniform-cost search."""
    clauses = runnable(instruction.clauses)
    tie = itertools.count()
    queue = [(0.0, next(tie), _Walk((start,), yaw))]
    seen_states: set[tuple] = set()
    fallback: tuple[int, ...] = (start,)
    farthest = -1
    for _ in range(MOST_WALKS):
        if not queue:
            break
        cost, _, walk = heapq.heappop(queue)
        if walk.clause == len(clauses):
            return Execution(walk.path, cost)
        if walk.state in seen_states:
            continue
        seen_states.add(walk.state)
        if walk.clause > farthest:
            fallback, farthest = walk.path, walk.clause
        for added, further in _onward(eyes, clauses[walk.clause], walk):
            heapq.heappush(queue, (cost + added, next(tie), further))
    return Execution(fallback, math.inf)


@dataclass(frozen=True, slots=True)
class _Walk:
    """A partial walk, and how far in the instruction it is."""

    path: tuple[int, ...]
    facing: float
    """Radians."""
    clause: int = 0
    """Index of the clause that is being carried out."""
    begun: int = 0
    """Index in `path` where it began."""
    pending: float = 0.0
    """Turn that was asked for and not made yet, radians."""

    @property
    def steps(self) -> int:
        """Of this clause, so far."""
        return len(self.path) - 1 - self.begun

    @property
    def state(self) -> tuple:
        """Walks that agree in it go on alike."""
        return self.path[-1], self.path[-2:-1], self.clause, self.steps, self.pending

    def next_clause(self, pending: float) -> _Walk:
        return dataclasses.replace(self, clause=self.clause + 1, begun=len(self.path) - 1, pending=pending)


def runnable(clauses: Sequence[meaning.Clause]) -> tuple[meaning.Clause, ...]:
    """Without remarks, and without turns at the end that nothing follows."""
    kept = [c for c in clauses if not isinstance(c, meaning.REMARKS)]
    while len(kept) > 1 and isinstance(kept[-1], meaning.Turn):
        kept.pop()
    return tuple(kept)


def _onward(eyes: Lookout, clause: meaning.Clause, walk: _Walk) -> Iterator[tuple[float, _Walk]]:
    """All ways to go on, with what they cost: finish this clause, or take a step within it."""
    path, steps, pending = walk.path, walk.steps, walk.pending
    if isinstance(clause, meaning.Turn):
        turned = math.radians(clause.angle) * (1 if clause.side == meaning.LEFT else -1)
        yield 0.0, walk.next_clause(pending + turned)
        return
    if isinstance(clause, meaning.STOPS):
        yield stop_cost(clause, eyes.at(path[-1])), walk.next_clause(pending)
        return
    if steps:
        yield walk_cost(clause, eyes, path[walk.begun :]) + count_cost(clause, eyes, path), walk.next_clause(0.0)
    elif isinstance(clause, meaning.To | meaning.Past):
        yield 0.8 + walk_cost(clause, eyes, path[walk.begun :]), walk.next_clause(pending)
    if steps < STEPS_PER_CLAUSE:
        for way in eyes.at(path[-1]).ways:
            added = _step_cost(clause, way, walk) + 1.5 * (way.node in path)
            if isinstance(clause, meaning.Climb):
                added = 0.12 + (0.0 if steps else added) + MISSING * (way.climb not in (None, clause.way))
            elif way.climb is not None:
                added += UNASKED
            if way.leaves and not isinstance(clause, meaning.Exit | meaning.Enter | meaning.OpenDoor | meaning.Climb):
                added += 0.4 * (not isinstance(clause, meaning.Cross))
            if way.closed and not isinstance(clause, meaning.OpenDoor):
                added += UNASKED
            left = 0.0 if steps else pending
            yield added, dataclasses.replace(walk, path=(*path, way.node), facing=way.yaw, pending=left)


def _step_cost(clause: meaning.Clause, way: Way, walk: _Walk) -> float:
    """Of one step in itself: turns that were not asked for, but for the one into a counted door."""
    turned = float(wrap(way.yaw - walk.facing))
    if isinstance(clause, meaning.Enter | meaning.OpenDoor):
        through = way.leaves and clause.nth if isinstance(clause, meaning.Enter) else way.closed and clause.side
        if through and (turned > 0) == (clause.side == meaning.LEFT):
            return 0.12
    wanted = walk.pending if walk.steps == 0 else 0.0
    return 0.12 + turn_cost(turned, wanted, asked=walk.steps == 0 and walk.pending != 0.0)


def turn_cost(turned: float, wanted: float, *, asked: bool) -> float:
    """How badly a turn (radians, left positive) fits the one that was asked for; straight on needs no asking."""
    off = abs(float(wrap(turned - wanted)))
    free, scale = (math.radians(30), math.radians(24)) if asked else (math.radians(35), math.radians(28))
    return min(max(off - free, 0.0) / scale, 2.5) ** 2


def walk_cost(clause: meaning.Clause, eyes: Lookout, path: Sequence[int]) -> float:
    """How badly a stretch of walk (its start included) fits one clause."""
    first, last = eyes.at(path[0]), eyes.at(path[-1])
    ways = [_way(eyes.at(a), b) for a, b in itertools.pairwise(path)]
    crossings = [w.leaves for w in ways]
    if isinstance(clause, meaning.Exit):
        return MISSING * (first.kind != clause.kind) + MISSING * (not any(crossings)) + 1.0 * (sum(crossings) > 1)
    if isinstance(clause, meaning.Enter | meaning.OpenDoor):
        through = any(w.leaves if isinstance(clause, meaning.Enter) else w.closed for w in ways[-1:])
        return MISSING * (last.kind != clause.kind) + MISSING * (not through) + 0.8 * (sum(crossings) > 1)
    if isinstance(clause, meaning.Climb):
        climbed = any(w.climb == clause.way for w in ways)
        return MISSING * (not climbed) + MISSING * (last.on_stairs != clause.half)
    if isinstance(clause, meaning.Cross):
        kinds = [eyes.at(n).kind for n in path]
        return 1.5 * (clause.kind not in kinds) + 0.7 * sum(k != clause.kind for k in kinds[1:])
    if isinstance(clause, meaning.Metres):
        return 0.9 * max(abs(sum(w.length for w in ways) - clause.count) - 0.5, 0.0)
    if isinstance(clause, meaning.To):
        return near_cost(last, clause.thing)
    if isinstance(clause, meaning.Past):
        return past_cost(clause, eyes, path)
    return 0.0


def count_cost(clause: meaning.Clause, eyes: Lookout, path: Sequence[int]) -> float:
    """How badly the doorway of the last step fits 'the second door on your left'; `path` begins before the clause."""
    if not isinstance(clause, meaning.Enter) or not clause.nth:
        return 0.0
    door = doorway(eyes, path)
    return 2.0 if door is None or door[0] != clause.side else min(1.2 * abs(door[1] - clause.nth), 2.0)


def near_cost(seen: Surroundings, thing: meaning.Referent) -> float:
    """How far one is from being at a thing."""
    nearest = seen.nearest(thing)
    if nearest is None:
        return MISSING
    return min(1.3 * max(nearest.distance - ARRIVAL_DISTANCE, 0.0) + 0.15 * nearest.distance, MISSING)


def past_cost(clause: meaning.Past, eyes: Lookout, path: Sequence[int]) -> float:
    """How badly a stretch passes a thing: it should come near, on the right side."""
    best = MISSING
    for a, b in itertools.pairwise(path):
        ahead = _way(eyes.at(a), b).yaw
        for node in (a, b):
            nearest = eyes.at(node).nearest(clause.thing)
            if nearest is None:
                continue
            bearing = float(wrap(nearest.yaw - ahead))
            wrong = (
                clause.side is not None and (bearing > 0) != (clause.side == meaning.LEFT) and 0.2 < abs(bearing) < 2.9
            )
            best = min(best, max(nearest.distance - PASSING_DISTANCE, 0.0) + 2.0 * wrong)
    return best


def stop_cost(clause: meaning.Clause, seen: Surroundings) -> float:
    """How badly a node fits where one is told to stop."""
    if isinstance(clause, meaning.StopBy):
        return near_cost(seen, clause.thing)
    if isinstance(clause, meaning.StopIn):
        return MISSING * (seen.kind != clause.kind)
    return 0.0


def _way(seen: Surroundings, node: int) -> Way:
    return next(w for w in seen.ways if w.node == node)

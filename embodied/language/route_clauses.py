"""From a path to clauses: what a person who knows the way would mention."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from embodied.geometry import wrap
from embodied.interface import SeenPlace
from embodied.language import clauses as meaning
from embodied.language.grammar import Phrase
from embodied.language.lexicon import PASSAGES, Lexicon, Word, lexicon_of, says
from embodied.language.listener import ARRIVAL_DISTANCE, PASSING_DISTANCE
from embodied.language.surroundings import Lookout, Surroundings, VisibleThing, doorway, is_on_stairs
from embodied.language.templates import SPOKEN, Speaker

SLIGHT, SHARP, BACK = math.radians(38), math.radians(66), math.radians(140)
"""Smallest angles called 'slightly', a turn, and turning around."""


@dataclass(frozen=True)
class Leg:
    """A stretch walked in about one direction that ends where a room ends or a turn begins."""

    nodes: tuple[int, ...]
    turn: float
    """Radians turned before it, left positive."""
    crosses: bool
    """Its last step leads into another room."""
    climb: str | None = None
    """UP or DOWN along stairs."""


def legs_of(world: SeenPlace, path: Sequence[int], yaw: float) -> list[Leg]:
    """The path cut at turns, at doorways, and where it comes to stairs and leaves them."""
    rooms, positions = world.graph.room_of_node, np.asarray(world.graph.positions)
    legs: list[Leg] = []
    nodes: list[int] = []
    facing, turned, stairs = yaw, 0.0, 0.0
    for a, b in itertools.pairwise(path):
        step = positions[b] - positions[a]
        direction = math.atan2(step[1], step[0])
        if is_on_stairs(world, a) or is_on_stairs(world, b):
            if not stairs and nodes:
                legs.append(Leg(tuple(nodes), turned, False))
            if not stairs:
                nodes, turned = [a], float(wrap(direction - facing))
            nodes.append(b)
            stairs, facing = stairs + float(step[2]), direction
            if not is_on_stairs(world, b) or b == path[-1]:
                legs.append(Leg(tuple(nodes), turned, False, meaning.UP if stairs > 0 else meaning.DOWN))
                nodes, stairs = [], 0.0
            continue
        turn = float(wrap(direction - facing))
        if nodes and abs(turn) >= SLIGHT:
            legs.append(Leg(tuple(nodes), turned, False))
            nodes = []
        if not nodes:
            nodes, turned = [a], turn
        nodes.append(b)
        facing = direction
        if rooms[a] != rooms[b]:
            legs.append(Leg(tuple(nodes), turned, True))
            nodes = []
    if nodes:
        legs.append(Leg(tuple(nodes), turned, False))
    return legs


@dataclass(frozen=True)
class _Telling:
    """A speaker who is finding words for a route."""

    world: SeenPlace
    eyes: Lookout
    lexicon: Lexicon
    speaker: Speaker
    rng: np.random.Generator
    used: set[str] = field(default_factory=set)
    """Placements that were mentioned; a speaker names each once."""

    def chance(self, probability: float) -> bool:
        return bool(self.rng.random() < probability)

    def kind(self, node: int) -> str:
        """Of the room that a node is in."""
        return self.world.house.room_by_id[self.world.graph.room_of_node[node]].kind


def plan(
    world: SeenPlace, path: Sequence[int], yaw: float, speaker: Speaker, *, rng: np.random.Generator
) -> list[Phrase]:
    """Clauses for `path`, with the nouns that the speaker chooses."""
    telling = _Telling(world=world, eyes=Lookout(world), lexicon=lexicon_of(world.catalogue), speaker=speaker, rng=rng)
    phrases: list[Phrase] = []
    legs = legs_of(world, path, yaw)
    for n, leg in enumerate(legs):
        phrases += _turn(leg.turn)
        if leg.crosses and world.graph.barred(leg.nodes[-2], leg.nodes[-1], world.graph.closed):
            beside = len(leg.nodes) == 2 and SLIGHT <= abs(leg.turn) < BACK
            if beside:
                phrases.pop()
            side = (meaning.LEFT if leg.turn > 0 else meaning.RIGHT) if beside else None
            phrases.append(Phrase(meaning.OpenDoor(telling.kind(leg.nodes[-1]), side)))
        elif leg.crosses:
            crossing = _crossing(telling, leg, first=n == 0)
            walked = [*itertools.chain.from_iterable(earlier.nodes[:-1] for earlier in legs[:n]), *leg.nodes]
            if telling.chance(speaker.counts) and (counted := _counted(telling.eyes, walked, crossing)):
                while phrases and isinstance(phrases[-1].clause, meaning.Turn) and phrases[-1].clause.angle != 180:
                    phrases.pop()
                crossing = counted
            phrases += crossing
        elif leg.climb is not None:
            phrases.append(Phrase(meaning.Climb(leg.climb, is_on_stairs(world, leg.nodes[-1]))))
        else:
            phrases.append(_within_a_room(telling, leg, last=n + 1 == len(legs)))
    if telling.chance(speaker.remarks) and (remark := _remark(telling, path)) is not None:
        phrases.append(remark)
    if telling.chance(speaker.avoids) and (wrong := _wrong_room(telling, path)):
        phrases.append(Phrase(meaning.Avoid(wrong)))
    phrases.append(_stop(telling, path, legs[-1].crosses if legs else False, phrases))
    return phrases


def _within_a_room(telling: _Telling, leg: Leg, *, last: bool) -> Phrase:
    """A leg that leaves no room: to or past something, so many metres, through a passage, or straight on."""
    mark = _mark(telling, leg, needed=last)
    if mark is not None:
        return mark
    if telling.chance(telling.speaker.metres) or last:
        graph = telling.world.graph
        length = float(sum(graph.distance[a, b] for a, b in itertools.pairwise(leg.nodes)))
        return Phrase(meaning.Metres(max(round(length), 1)))
    here = telling.kind(leg.nodes[0])
    return Phrase(meaning.Cross(here)) if here in PASSAGES and telling.chance(0.5) else Phrase(meaning.Forward())


def shortened(phrases: Sequence[Phrase], clauses: int) -> list[Phrase]:
    """At most `clauses` clauses where that is possible: what can best be guessed is left out first.

    Left out, in this order: slight turns, straight stretches, rooms walked through, turns before a
    doorway or a thing, things passed, passages entered. What remains keeps its order.
    """
    kept = list(phrases)
    for rank in range(len(_DROPPABLE)):
        for i in range(len(kept) - 2, 0, -1):
            if len(kept) <= clauses:
                return kept
            between_turns = all(isinstance(kept[k].clause, meaning.Turn) for k in (i - 1, i + 1))
            if not between_turns and _DROPPABLE[rank](kept[i].clause, kept[i + 1].clause):
                del kept[i]
    return kept


_DROPPABLE = (
    lambda c, after: isinstance(c, meaning.Turn) and c.angle == 45,
    lambda c, after: isinstance(c, meaning.Forward | meaning.Metres),
    lambda c, after: isinstance(c, meaning.Cross),
    lambda c, after: (
        isinstance(c, meaning.Turn)
        and c.angle == 90
        and isinstance(after, meaning.Enter | meaning.To)
        and not getattr(after, "nth", 0)
    ),
    lambda c, after: isinstance(c, meaning.Past),
    lambda c, after: (
        isinstance(c, meaning.Enter) and c.kind in PASSAGES and not c.nth and not isinstance(after, meaning.STOPS)
    ),
    lambda c, after: isinstance(c, meaning.To) and not isinstance(after, meaning.STOPS),
)
"""Clauses that may be left out before what follows it, the most dispensable first."""


def _turn(angle: float) -> list[Phrase]:
    side = meaning.LEFT if angle > 0 else meaning.RIGHT
    if abs(angle) >= BACK:
        return [Phrase(meaning.Turn(meaning.LEFT, 180))]
    if abs(angle) >= SHARP:
        return [Phrase(meaning.Turn(side))]
    return [Phrase(meaning.Turn(side, 45))] if abs(angle) >= SLIGHT else []


def _crossing(telling: _Telling, leg: Leg, *, first: bool) -> list[Phrase]:
    """Out of one room into another, perhaps past something on the way to the door."""
    here, there = telling.kind(leg.nodes[0]), telling.kind(leg.nodes[-1])
    phrases = []
    if len(leg.nodes) > 2 and telling.chance(0.6 * telling.speaker.landmarks):
        phrases = _passing(telling, leg.nodes[:-1])
    if first and here not in PASSAGES and there in PASSAGES and telling.chance(0.7):
        return [*phrases, Phrase(meaning.Exit(here))]
    return [*phrases, Phrase(meaning.Enter(there))]


def _counted(eyes: Lookout, walked: Sequence[int], crossing: list[Phrase]) -> list[Phrase]:
    """The crossing by 'the second door on the left', where there is more than one to choose from; else nothing."""
    door, last = doorway(eyes, walked), crossing[-1].clause
    if door is None or not isinstance(last, meaning.Enter):
        return []
    side, nth, doors = door
    return [Phrase(meaning.Enter(last.kind, side, nth))] if doors > 1 and nth < len(SPOKEN.ordinals) else []


def _mark(telling: _Telling, leg: Leg, *, needed: bool) -> Phrase | None:
    """Something to walk to, or past, on a leg within one room."""
    if not needed and not telling.chance(telling.speaker.landmarks):
        return None
    eyes, used = telling.eyes, telling.used
    start, end = eyes.at(leg.nodes[0]), eyes.at(leg.nodes[-1])
    at_start = {t.placement: t for t in start.things}
    heading = next(w.yaw for w in start.ways if w.node == leg.nodes[1])
    good = [
        t
        for t in end.things
        if t.distance <= ARRIVAL_DISTANCE
        and t.placement in at_start
        and t.placement not in used
        and abs(float(wrap(at_start[t.placement].yaw - heading))) < math.radians(50)
        and at_start[t.placement].distance > t.distance + 0.4
    ]
    for thing in _ranked(good, telling.rng):
        if (word := _name(telling, thing, start)) is not None:
            used.add(thing.placement)
            return Phrase(meaning.To(telling.lexicon.thing(word)), word)
    passing = _passing(telling, leg.nodes)
    return passing[0] if passing else None


def _passing(telling: _Telling, nodes: Sequence[int]) -> list[Phrase]:
    """Something beside the way, with its side where that is clear."""
    eyes, used = telling.eyes, telling.used
    beside: dict[str, tuple[VisibleThing, str, Surroundings]] = {}
    for a, b in itertools.pairwise(nodes):
        seen = eyes.at(b)
        ahead = next(w.yaw for w in eyes.at(a).ways if w.node == b)
        for t in seen.things:
            bearing = float(wrap(t.yaw - ahead))
            aside = math.radians(40) < abs(bearing) < math.radians(150)
            if aside and t.distance <= PASSING_DISTANCE - 0.4 and t.placement not in used:
                beside.setdefault(t.placement, (t, meaning.LEFT if bearing > 0 else meaning.RIGHT, eyes.at(a)))
    for thing in _ranked([t for t, _, _ in beside.values()], telling.rng):
        _, side, before = beside[thing.placement]
        if before.nearest(meaning.Referent((thing.asset.object_class,))) is None:
            continue
        if (word := _name(telling, thing, before)) is not None:
            used.add(thing.placement)
            return [Phrase(meaning.Past(telling.lexicon.thing(word), side if telling.chance(0.6) else None), word)]
    return []


def _stop(telling: _Telling, path: Sequence[int], crossed: bool, phrases: Sequence[Phrase]) -> Phrase:
    """The end: by something near the end that can be seen before, else in the room, else here."""
    last = phrases[-1].clause if phrases else None
    if isinstance(last, meaning.To) and telling.chance(0.7):
        return Phrase(meaning.StopHere())
    end = telling.eyes.at(path[-1])
    before = {t.placement for n in path[-3:-1] for t in telling.eyes.at(n).things}
    near = [t for t in end.things if t.distance <= ARRIVAL_DISTANCE]
    for pool in ([t for t in near if t.placement in before and t.placement not in telling.used], near):
        for thing in _ranked(pool, telling.rng):
            if (word := _name(telling, thing, end)) is not None:
                telling.used.add(thing.placement)
                return Phrase(meaning.StopBy(telling.lexicon.thing(word)), word)
    # nobody says 'enter the hall and stop in the hall'
    return Phrase(meaning.StopIn(end.kind) if crossed and not isinstance(last, meaning.Enter) else meaning.StopHere())


def _name(telling: _Telling, thing: VisibleThing, view: Surroundings) -> Word | None:
    """A word for a thing that means it and nothing nearer in `view`; None if there is none.

    Colours and materials are added where they tell two things apart, or because the speaker likes to.
    """
    lexicon, speaker = telling.lexicon, telling.speaker
    for adjectives in range(int(telling.chance(speaker.colours)), 3):
        word = lexicon.words_for(
            thing.asset, telling.rng, adjectives=adjectives, ornament=speaker.ornament, novelty=speaker.novelty
        )
        if not says(thing.asset, meant := lexicon.thing(word)):
            continue
        if all(t.asset.key == thing.asset.key for t in view.things if says(t.asset, meant)):
            return word
    return None


def _ranked(things: Sequence[VisibleThing], rng: np.random.Generator) -> list[VisibleThing]:
    """Things in the order somebody would think of them: large ones mostly first."""
    weights = {
        t.placement: math.log(t.pixels + 1) * (1 + 1.2 * float(rng.random()))
        for t in sorted(things, key=lambda t: t.placement)
    }
    return sorted(things, key=lambda t: (-weights[t.placement], t.placement))


def _remark(telling: _Telling, path: Sequence[int]) -> Phrase | None:
    """Any thing in view near the end, large or small."""
    rng = telling.rng
    things = [t for t in telling.eyes.at(path[-1 - int(rng.integers(2))]).things if t.placement not in telling.used]
    if not things:
        return None
    asset = things[int(rng.integers(len(things)))].asset
    speaker, few = telling.speaker, int(rng.integers(2))
    word = telling.lexicon.words_for(asset, rng, adjectives=few, ornament=speaker.ornament, novelty=speaker.novelty)
    return Phrase(meaning.Notice(telling.lexicon.thing(word)), word)


def _wrong_room(telling: _Telling, path: Sequence[int]) -> str | None:
    """A room that one could walk into by mistake near the end."""
    right = {telling.kind(n) for n in path}
    wrong = sorted({w.kind for n in path[-3:] for w in telling.eyes.at(n).ways if w.leaves} - right)
    return wrong[0] if wrong else None

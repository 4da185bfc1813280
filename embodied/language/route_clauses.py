"""From a path to clauses: what a person who knows the way would mention."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from embodied.geometry import wrap
from embodied.interface import SeenPlace
from embodied.language.clauses import (
    LEFT,
    RIGHT,
    STOPS,
    Avoid,
    Cross,
    Enter,
    Exit,
    Forward,
    Metres,
    Notice,
    Past,
    StopBy,
    StopHere,
    StopIn,
    Thing,
    To,
    Turn,
)
from embodied.language.grammar import Phrase
from embodied.language.lexicon import PASSAGES, Lexicon, Word, lexicon_of, says
from embodied.language.listener import BESIDE, NEAR
from embodied.language.seen import Eyes, Seen, SeenThing, doorway
from embodied.language.speakers import Speaker
from embodied.language.templates import ORDINALS

SLIGHT, SHARP, BACK = math.radians(38), math.radians(66), math.radians(140)
"""Smallest angles called 'slightly', a turn, and turning around."""
PRIVATE = frozenset(
    {
        "bedroom",
        "main_bedroom",
        "kids_room",
        "guest_room",
        "bathroom",
        "toilet",
        "closet",
        "study",
        "laundry_room",
        "pantry",
        "garage",
        "gym",
        "library",
        "playroom",
        "workshop",
        "kitchen",
        "dining_room",
        "sun_room",
        "living_room",
        "family_room",
    }
)


@dataclass(frozen=True)
class Leg:
    """A stretch walked in about one direction that ends where a room ends or a turn begins."""

    nodes: tuple[int, ...]
    turn: float
    """Radians turned before it, left positive."""
    crosses: bool
    """Whether its last step leads into another room."""


def legs_of(world: SeenPlace, path: Sequence[int], yaw: float) -> list[Leg]:
    """The path cut at turns and at doorways."""
    rooms, positions = world.graph.room_of_node, np.asarray(world.graph.positions)
    legs: list[Leg] = []
    nodes: list[int] = []
    facing, turned = yaw, 0.0
    for a, b in itertools.pairwise(path):
        step = positions[b] - positions[a]
        direction = math.atan2(step[1], step[0])
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


def plan(
    world: SeenPlace, path: Sequence[int], yaw: float, speaker: Speaker, *, rng: np.random.Generator
) -> list[Phrase]:
    """Clauses for `path`, with the nouns that the speaker chooses."""
    eyes, lexicon, house = Eyes(world), lexicon_of(world.catalogue), world.house
    kind = lambda node: house.room_by_id[world.graph.room_of_node[node]].kind
    phrases: list[Phrase] = []
    used: set[str] = set()
    legs = legs_of(world, path, yaw)
    for n, leg in enumerate(legs):
        phrases += _turn(leg.turn)
        start, end, last = leg.nodes[0], leg.nodes[-1], n + 1 == len(legs)
        if leg.crosses:
            crossing = _crossing(eyes, lexicon, leg, kind(start), kind(end), n == 0, speaker, used, rng)
            walked = [*itertools.chain.from_iterable(earlier.nodes[:-1] for earlier in legs[:n]), *leg.nodes]
            if rng.random() < speaker.counts and (counted := _counted(eyes, walked, crossing)):
                while phrases and isinstance(phrases[-1].clause, Turn) and phrases[-1].clause.angle != 180:
                    phrases.pop()
                crossing = counted
            phrases += crossing
        elif (mark := _mark(eyes, lexicon, leg, speaker, used, rng, needed=last)) is not None:
            phrases.append(mark)
        elif rng.random() < speaker.metres or last:
            phrases.append(Phrase(Metres(max(round(_length(world, leg.nodes)), 1))))
        elif kind(start) in PASSAGES and rng.random() < 0.5:
            phrases.append(Phrase(Cross(kind(start))))
        else:
            phrases.append(Phrase(Forward()))
    if rng.random() < speaker.remarks and (remark := _remark(eyes, lexicon, path, speaker, used, rng)) is not None:
        phrases.append(remark)
    if rng.random() < speaker.avoids and (wrong := _wrong_room(eyes, path, kind)):
        phrases.append(Phrase(Avoid(wrong)))
    phrases.append(
        _stop(eyes, lexicon, path, kind(path[-1]), legs[-1].crosses if legs else False, phrases, speaker, used, rng)
    )
    return phrases


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
            between_turns = isinstance(kept[i - 1].clause, Turn) and isinstance(kept[i + 1].clause, Turn)
            if not between_turns and _DROPPABLE[rank](kept[i].clause, kept[i + 1].clause):
                del kept[i]
    return kept


_DROPPABLE = (
    lambda c, after: isinstance(c, Turn) and c.angle == 45,
    lambda c, after: isinstance(c, Forward | Metres),
    lambda c, after: isinstance(c, Cross),
    lambda c, after: (
        isinstance(c, Turn) and c.angle == 90 and isinstance(after, Enter | To) and not getattr(after, "nth", 0)
    ),
    lambda c, after: isinstance(c, Past),
    lambda c, after: isinstance(c, Enter) and c.kind in PASSAGES and not c.nth and not isinstance(after, STOPS),
    lambda c, after: isinstance(c, To) and not isinstance(after, STOPS),
)
"""What may be left out before what follows it, the most dispensable first."""


def _turn(angle: float) -> list[Phrase]:
    side = LEFT if angle > 0 else RIGHT
    if abs(angle) >= BACK:
        return [Phrase(Turn(LEFT, 180))]
    if abs(angle) >= SHARP:
        return [Phrase(Turn(side))]
    return [Phrase(Turn(side, 45))] if abs(angle) >= SLIGHT else []


def _crossing(
    eyes: Eyes,
    lexicon: Lexicon,
    leg: Leg,
    here: str,
    there: str,
    first: bool,
    speaker: Speaker,
    used: set[str],
    rng: np.random.Generator,
) -> list[Phrase]:
    """Out of one room into another, perhaps past something on the way to the door."""
    phrases = []
    if len(leg.nodes) > 2 and rng.random() < 0.6 * speaker.landmarks:
        phrases = _passing(eyes, lexicon, leg.nodes[:-1], speaker, used, rng)
    if first and here in PRIVATE and there in PASSAGES and rng.random() < 0.7:
        return [*phrases, Phrase(Exit(here))]
    return [*phrases, Phrase(Enter(there))]


def _counted(eyes: Eyes, walked: Sequence[int], crossing: list[Phrase]) -> list[Phrase]:
    """The crossing by 'the second door on the left', where there is more than one to choose from; else nothing."""
    found = doorway(eyes, walked)
    if found is None or found[2] < 2 or found[1] >= len(ORDINALS) or not isinstance(crossing[-1].clause, Enter):
        return []
    side, nth, _ = found
    return [Phrase(Enter(crossing[-1].clause.kind, side, nth))]


def _mark(
    eyes: Eyes, lexicon: Lexicon, leg: Leg, speaker: Speaker, used: set[str], rng: np.random.Generator, *, needed: bool
) -> Phrase | None:
    """Something to walk to, or past, on a leg within one room."""
    if not needed and rng.random() >= speaker.landmarks:
        return None
    start, end = eyes.at(leg.nodes[0]), eyes.at(leg.nodes[-1])
    at_start = {t.placement: t for t in start.things}
    heading = next(w.yaw for w in start.ways if w.node == leg.nodes[1])
    good = [
        t
        for t in end.things
        if t.distance <= NEAR
        and t.placement in at_start
        and t.placement not in used
        and abs(float(wrap(at_start[t.placement].yaw - heading))) < math.radians(50)
        and at_start[t.placement].distance > t.distance + 0.4
    ]
    for thing in _ranked(good, rng):
        if (word := _name(thing, start, lexicon, speaker, rng)) is not None:
            used.add(thing.placement)
            return Phrase(To(lexicon.thing(word)), word)
    passing = _passing(eyes, lexicon, leg.nodes, speaker, used, rng)
    return passing[0] if passing else None


def _passing(
    eyes: Eyes, lexicon: Lexicon, nodes: Sequence[int], speaker: Speaker, used: set[str], rng: np.random.Generator
) -> list[Phrase]:
    """Something beside the way, with its side where that is clear."""
    found: dict[str, tuple[SeenThing, str, Seen]] = {}
    for a, b in itertools.pairwise(nodes):
        seen = eyes.at(b)
        ahead = next(w.yaw for w in eyes.at(a).ways if w.node == b)
        for t in seen.things:
            bearing = float(wrap(t.yaw - ahead))
            if (
                t.distance <= BESIDE - 0.4
                and math.radians(40) < abs(bearing) < math.radians(150)
                and t.placement not in used
            ):
                found.setdefault(t.placement, (t, LEFT if bearing > 0 else RIGHT, eyes.at(a)))
    for thing in _ranked([t for t, _, _ in found.values()], rng):
        _, side, before = found[thing.placement]
        if before.nearest(Thing((thing.asset.object_class,))) is None:
            continue
        if (word := _name(thing, before, lexicon, speaker, rng)) is not None:
            used.add(thing.placement)
            return [Phrase(Past(lexicon.thing(word), side if rng.random() < 0.6 else None), word)]
    return []


def _stop(
    eyes: Eyes,
    lexicon: Lexicon,
    path: Sequence[int],
    room: str,
    crossed: bool,
    phrases: Sequence[Phrase],
    speaker: Speaker,
    used: set[str],
    rng: np.random.Generator,
) -> Phrase:
    """Where to stop: by something near the end that can be seen before, else in the room, else here."""
    if phrases and isinstance(phrases[-1].clause, To) and rng.random() < 0.7:
        return Phrase(StopHere())
    crossed = crossed and not (
        phrases and isinstance(phrases[-1].clause, Enter)
    )  # 'enter the hall and stop in the hall'
    end = eyes.at(path[-1])
    before = {t.placement for n in path[-3:-1] for t in eyes.at(n).things}
    near = [t for t in end.things if t.distance <= NEAR]
    for pool in ([t for t in near if t.placement in before and t.placement not in used], near):
        for thing in _ranked(pool, rng):
            if (word := _name(thing, end, lexicon, speaker, rng)) is not None:
                used.add(thing.placement)
                return Phrase(StopBy(lexicon.thing(word)), word)
    return Phrase(StopIn(room)) if crossed else Phrase(StopHere())


def _name(thing: SeenThing, view: Seen, lexicon: Lexicon, speaker: Speaker, rng: np.random.Generator) -> Word | None:
    """A word for a thing that means it and nothing nearer in `view`; None if there is none.

    Colours and materials are added where they tell two things apart, or because the speaker likes to.
    """
    wanted = int(rng.random() < speaker.colours)
    for adjectives in range(wanted, 3):
        word = lexicon.words_for(thing.asset, rng, adjectives=adjectives, ornament=speaker.ornament)
        if not says(thing.asset, meant := lexicon.thing(word)):
            continue
        others = [
            t
            for t in view.things
            if t.placement != thing.placement and says(t.asset, meant) and t.asset.key != thing.asset.key
        ]
        if not others:
            return word
    return None


def _ranked(things: Sequence[SeenThing], rng: np.random.Generator) -> list[SeenThing]:
    """Things in the order somebody would think of them: large ones mostly first."""
    weights = {
        t.placement: math.log(t.pixels + 1) * (1 + 1.2 * float(rng.random()))
        for t in sorted(things, key=lambda t: t.placement)
    }
    return sorted(things, key=lambda t: (-weights[t.placement], t.placement))


def _remark(
    eyes: Eyes, lexicon: Lexicon, path: Sequence[int], speaker: Speaker, used: set[str], rng: np.random.Generator
) -> Phrase | None:
    """Any thing in view near the end, large or small."""
    things = [t for t in eyes.at(path[-1 - int(rng.integers(2))]).things if t.placement not in used]
    if not things:
        return None
    word = lexicon.words_for(
        things[int(rng.integers(len(things)))].asset, rng, adjectives=int(rng.integers(2)), ornament=speaker.ornament
    )
    return Phrase(Notice(lexicon.thing(word)), word)


def _wrong_room(eyes: Eyes, path: Sequence[int], kind) -> str | None:
    """A room that one could walk into by mistake near the end."""
    right = {kind(n) for n in path}
    wrong = sorted({w.kind for n in path[-3:] for w in eyes.at(n).ways if w.leaves} - right)
    return wrong[0] if wrong else None


def _length(world: SeenPlace, nodes: Sequence[int]) -> float:
    return float(sum(world.graph.distance[a, b] for a, b in itertools.pairwise(nodes)))

"""The types of questions: one table, a function each, which yields questions about a walk and leaves out what is
ambiguous, by the margins below. Words are in embodied/language/vqa.toml. Ten are VSI-Bench's, in its units
(Yang et al. 2025, "Thinking in Space", sec. 3.2).
"""

import dataclasses
import functools
import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator

import numpy as np
import shapely
from shapely.ops import nearest_points, substring

from embodied.assets.moving_parts import openness_of
from embodied.datasets.vqa.scene import ALIKE, ASKING, WalkScene, bearing, direction, gap, middle
from embodied.datasets.vqa.scoring import OPTIONS, VqaQuestion
from embodied.datasets.vqa.walks import AJAR, CLEAR_SHARE, outline
from embodied.geometry import facing_of, wrap
from embodied.house.house import HINGED, House, Placement
from embodied.house.shapes import footprint, inward
from embodied.language.lexicon import UNFIT
from embodied.language.plain_language import plural
from embodied.light.tracing.sky import sun_direction
from embodied.navigation.floor_ways import FloorWays
from embodied.navigation.free_space import sight_floor
from embodied.people.day import lived_in

SIDE, FIRST_SIDE = 15.0, 10.0
"""Degrees from the border between two sides within which nothing is asked; from that of the first steps of a way."""
LEAST_METRES, MOST_METRES, NEARER, NEARER_METRES = 0.5, 8.0, 1.25, 0.3
"""Between things whose distance is asked for; how much farther the second nearest thing is than the nearest."""
AHEAD, BEHIND, NEXT_TO, HALVED, TRIES = 60.0, 95.0, 0.5, "curtain", 6
"""Degrees off their way up to which people see things, and from which they do not; metres within which what is not on
something might be taken to be; a class whose halves people count; times that a thing is asked about with others."""
SUNNY, LIGHT, SHADY = (math.cos(math.radians(degrees)) for degrees in (50, 70, 115))
HIGH, LATER = 0.15, (7.0, 8.0, 9.0, 10.0, 14.0, 15.0, 16.0, 17.0, 18.0, 19.0)
COMPASS = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")
"""Cosines between where a window looks and the sun, at least of a sunny room, of one whose light may reach through a
passage, and at most of others; the least height of the sun, the sine; hours that are asked about."""
STANDS, FROM_WALL, CORNER, STRAIGHT, ROUTES, BOXED = 1.2, 0.4, 60.0, 25.0, 400, 0.5
"""Metres within which one is at a thing, and from the middle of what stands or hangs at a wall to before it; degrees
from which a bend of a way is a turn, and below which it is none; ways of a walk that are looked at; height up to which
things with a tap or a headboard are as deep as their box, metres."""
IN_FRAME, UNCUT = 0.4, 0.95
"""Shares of the outline of a thing whose size is asked for that a frame shows, and does not cut off."""
FACED, TRIPLES, OFFERED, WIDE_OPEN, NOOK = 1.0, 200, 24, 2.0, 2.5
"""Least metres to what is faced; sets of three things that are looked at; most wrong options to choose from; metres
from which a passage leaves no border between two rooms, and square metres below which frames show too little."""
SETS_OFF, ON_RING, LEAST_WAY, AS_SHORT = 1.5, 0.1, 2.0, (1.15, 0.7)
ANOTHER, NOTHING, RIDGE = 45.0, 30.0, 0.1
"""Metres along a way to where one sets off to, give or take; of the least way; how much longer another way may be, as a
share and in metres, and be as short. Degrees to a side from which it is another, if ways between are so many metres
longer, or there are none for so many degrees."""
UNDERFOOT, WORKTOPS, BASIN, UNIT = {*ASKING["underfoot"]}, {*ASKING["worktops"]}, "kitchen sink", "sink unit"
Sides = dict[str, tuple[float, float]]
"""Degrees to the left, from and to."""
TWO_SIDES: Sides = {"left": (0, 180), "right": (-180, 0)}
BESIDE: Sides = {"left": (5, 165), "right": (-165, -5)}
LEFT_RIGHT_BACK: Sides = {"left": (0, 135), "right": (-135, 0), "back": (135, 225)}
SET_OFF_SIDES: Sides = {"straight on": (-35, 35), "left": (30, 135), "back": (135, 225), "right": (-135, -30)}
QUARTERS: Sides = {"front-left": (0, 90), "back-left": (90, 180), "back-right": (-180, -90), "front-right": (-90, 0)}
Asked = Iterator[VqaQuestion]
QuestionType = Callable[[WalkScene], Asked]


def groups(s: WalkScene, most: int, least: int = 2) -> Iterator[list[tuple[Placement, str]]]:
    """Things of one room with names, in groups; without those whose doors stand out of their boxes, and curtains."""
    out = lambda p: p.object_class == HALVED or max(openness_of(p.params).values(), default=0.0) > AJAR
    for room in s.shuffled(s.looked_at):
        things = s.named([p for p in s.in_room(room) if not out(p)])
        for k in range(len(things) if len(things) >= least else 0):
            yield [*things[k:], *things[:k]][:most]


def side_of(angle: float, sides: Sides, margin: float = SIDE) -> str | None:
    """The side that an angle, degrees to the left, is well inside of."""
    inside = (name for name, (low, high) in sides.items() if margin <= (angle - low) % 360 <= high - low - margin)
    return next(inside, None)


def corners(p: Placement) -> np.ndarray:
    """(4, 2) of the outline from above, metres."""
    return np.array(footprint(p).exterior.coords)[:4]


def before(s: WalkScene, p: Placement) -> np.ndarray:
    """(2,) where one stands before a thing, or before what it is on, metres."""
    p = s.house.placement_by_id[p.parent] if p.parent else p
    front = facing_of(p.yaw)
    return middle(p) + (p.size[1] / 2 + FROM_WALL) * np.array([math.cos(front), math.sin(front)])


def is_above(a: Placement, b: Placement) -> bool:
    """Tells whether one of two things is higher than most of the other, whose box goes up to a tap or a headboard."""
    low, high = sorted((a, b), key=lambda p: p.position[2])
    return low.object_class in ASKING["upright"] and high.position[2] > low.position[2] + BOXED


def sided(
    s: WalkScene, angle: float, sides: Sides, about: Iterable[str], also: Iterable[float] = (), **slots: str
) -> Asked:
    """A question for the side on which something lies; none near the border between two, or where not all of `also`,
    the angles of its parts, are on that side."""
    side = side_of(angle, sides)
    if side and all(side_of(x, sides, 0.0) == side for x in also):
        fact = f"{abs(angle):.0f} degrees to the {'left' if angle > 0 else 'right'}"
        yield s.ask(side, about, [x for x in sides if x != side], fact, **slots)


def counting(s: WalkScene) -> Asked:
    """In a room, or in the whole video."""
    parts, rooms = s.parts(), [(p.room, p.object_class) for p in s.things if p.room in s.looked_at]
    for room, name in s.shuffled([*rooms, *(("", p.object_class) for p in s.things)]):
        noun, together = s.noun(name), {w: {*kinds} for w, kinds in ASKING["together"].items() if name in kinds}
        there = {p.id: p.object_class for p in s.called(noun) if (p.room == room if room else p.id in s.glimpsed)}
        for words, kinds in {plural(noun): {name}, **together}.items() if plural(noun) != noun else ():
            alone = {*there.values()} <= kinds and there.keys() <= {p.id for p in s.things}
            if 2 <= len(there) <= 12 and alone and not kinds & {HALVED, *parts, *WORKTOPS, *ASKING["joined"]}:
                where = s.room_name(room) if room else "video"
                yield s.ask(str(len(there)), (room, *there), things=words, room=where)


def distance(s: WalkScene) -> Asked:
    for (a, first), (b, second) in groups(s, 2):
        if not is_above(a, b) and LEAST_METRES <= (metres := gap(a, b)) <= MOST_METRES:
            yield s.ask(f"{metres:.1f}", (a.id, b.id), a=first, b=second)


def nearest(s: WalkScene) -> Asked:
    for (a, first), *others in groups(s, 2 + OFFERED, least=1 + OPTIONS):
        by_gap = sorted((gap(a, p), p.id, name) for p, name in others if not is_above(a, p))
        metres, ids, names = zip(*by_gap) if by_gap else ((), (), ())
        for k in s.shuffled(range(len(ids) - OPTIONS + 1))[:2]:
            if metres[k + 1] > max(NEARER * metres[k], metres[k] + NEARER_METRES):
                fact = f"{metres[k]:.1f} m, others at least {metres[k + 1]:.1f} m"
                yield s.ask(names[k], (a.id, *ids[k:]), names[k + 1 :], fact, a=first)


def size(s: WalkScene) -> Asked:
    """Of things that a frame shows from end to end."""
    area = lambda p, f, edge: outline(p, f.position, f.yaw, edge)
    whole = lambda p, f: f.shares[p.id] > IN_FRAME * area(p, f, 1.0) > IN_FRAME * UNCUT * area(p, f, 9.0)
    things = [p for p in s.things if p.object_class not in {*ASKING["oversized"], *WORKTOPS}]
    things = [p for p in things if any(whole(p, f) for f in s.walk.frames if p.id in f.clear)]
    yield from (s.ask(f"{100 * max(p.size):.0f}", (p.id,), a=name) for p, name in s.named(things))


def room_size(s: WalkScene) -> Asked:
    areas = {r: s.house.floor(s.house.room_by_id[r]).area for r in s.looked_at}
    passages = [(o.rooms, math.dist(o.a, o.b)) for o in s.house.openings if o.leaf_finish is None]
    open_by = {r: max((width for rooms, width in passages if r in rooms), default=0.0) for r in areas}
    closed = [r for r in s.looked_at if open_by[r] < WIDE_OPEN and areas[r] > NOOK]
    yield from (s.ask(f"{areas[r]:.1f}", (r,), room=s.room_name(r)) for r in s.shuffled(closed))


def turned(sides: Sides) -> QuestionType:
    """The type that asks where a thing is for who stands by one and faces another, and for the mirror image."""

    def asked(s: WalkScene) -> Asked:
        things = [s.named(s.in_room(room)) for room in s.looked_at]
        for three in s.shuffled([x for of_room in things for x in itertools.combinations(of_room, 3)])[:TRIPLES]:
            questions = dict[str, VqaQuestion]()
            for (a, first), (b, second), (c, third) in s.shuffled([*itertools.permutations(three)]):
                edge = np.array(nearest_points(footprint(a), footprint(b))[0].coords[0])
                apart = not footprint(b).intersects(footprint(c)) and not {a.object_class, s.carrier_of(a)} & UNDERFOOT
                if apart and min(math.dist(middle(a), middle(t)) for t in (b, c)) > FACED:
                    angle, *also = (
                        bearing(eye, direction(eye, middle(b)), at)
                        for eye in (middle(a), edge, before(s, a))
                        for at in (middle(c), *(corners(c) + middle(c)) / 2)
                    )
                    faced = (direction(middle(a), at) for at in (corners(b) + middle(b)) / 2)
                    also += [bearing(middle(a), ahead, middle(c)) for ahead in faced]
                    asked = sided(s, angle, sides, (a.id, b.id, c.id), also, a=first, b=second, c=third)
                    questions |= {q.answer: q for q in asked}
            mirror = lambda side: "right".join(x.replace("right", "left") for x in side.split("left"))
            yield from (q for side, q in questions.items() if mirror(side) in questions)

    return asked


def order(s: WalkScene) -> Asked:
    spans: dict[str, tuple[int, int, str]] = {}
    """Noun to the first frame that shows any such thing, the first that does clearly, and which thing."""
    for name in s.shuffled(sorted({p.object_class for p in s.things})):
        noun = s.noun(name)
        seen = {p.id: p.object_class for p in s.called(noun) if p.id in s.glimpsed}
        first = min(s.clear.keys() & seen.keys(), key=lambda i: (s.clear[i], i))
        if {*seen.values()} == {name}:
            spans[noun] = min(s.glimpsed[i] for i in seen), s.clear[first], first
    for _ in range(len(spans) if len(spans) > 3 else 0):
        four = sorted(s.shuffled(sorted(spans))[:4], key=lambda n: spans[n])
        if all(spans[a][1] + 1 < spans[b][0] for a, b in itertools.pairwise(four)):
            wrong = s.shuffled([", ".join(p) for p in itertools.permutations(four) if list(p) != four])[:3]
            fact, listed = ", ".join(f"{n} in frame {spans[n][1]}" for n in four), ", ".join(s.shuffled(four))
            yield s.ask(", ".join(four), (spans[n][2] for n in four), wrong, fact, list=listed)


def visibility(s: WalkScene) -> Asked:
    shown = {i for f in s.walk.frames for i in f.shares} | {*s.glimpsed}
    away = {n: s.noun(n) for n in sorted({*s.elsewhere} - UNFIT)}
    known = {*away} - s.parts()
    unseen = [n for n in s.elsewhere if n in known and not shown & {p.id for p in s.called(away[n])}]
    often = Counter(s.elsewhere)
    for name in s.shuffled(sorted({p.object_class for p in s.things})):
        seen = [p.id for p in s.things if p.object_class == name]
        others = sorted(dict.fromkeys(s.shuffled(unseen)), key=lambda n: abs(often[n] - often[name]))[:OFFERED]
        fact = f"first in frame {min(s.clear[i] for i in seen)}"
        yield from [s.ask(s.noun(name), seen[:1], [away[n] for n in others], fact)] * (len(others) > 2)


def carried(shelf: bool) -> QuestionType:
    """The type that asks what rests on something, or on its shelves."""

    def asked(s: WalkScene) -> Asked:
        small = [p for p in s.things if p.parent is not None]
        of_room = {r.id: [p for p in s.house.placements if p.room == r.id] for r in s.house.rooms}
        for carrier, name in s.named(s.things):
            classes = {p.object_class for p in s.house.placements if p.parent == carrier.id}
            there = [p for p in small if p.parent == carrier.id and s.carrier_of(p).endswith(" shelf") == shelf]
            there = [p for p in there if any({p.id, carrier.id} <= {*f.clear} for f in s.walk.frames)]
            beside = {p.object_class for p in of_room[carrier.room] if gap(carrier, p) < NEXT_TO}
            if carrier.object_class in WORKTOPS:
                beside |= {p.object_class for p in small if p.room == carrier.room and s.carrier_of(p) in WORKTOPS}
            alike = {*beside, *classes, *(c for name in beside | classes for c in ALIKE.get(name, ()))}
            away = {p.object_class for p in small} - alike - {*ASKING["parts"].get(carrier.object_class, ())}
            for p in s.shuffled(there) if len(away) > 2 else ():
                wrong = s.shuffled(sorted(away))[:OFFERED]
                fact = f"{'in' if shelf else 'on'} it: {', '.join(sorted(classes))}"
                what = name.replace(BASIN, UNIT) if shelf else name
                yield s.ask(s.noun(p.object_class), (carrier.id, p.id), map(s.noun, wrong), fact, a=what)

    return asked


def openness(s: WalkScene) -> Asked:
    """Which of several things is open where the others are shut, and which is shut where they are open. What has no
    name of its own is open as one of its kind, and shut if all of them are."""
    often = Counter(i for f in s.walk.frames for i in f.ajar)
    ajar, shut = {i for i in often if often[i] > 1}, {i for f in s.walk.frames for i in f.shut} - {*often}

    def named(p: Placement, an: str) -> str | None:
        alike = s.meant(p.object_class)
        several = sum(q.object_class == p.object_class for q in alike) > 1
        tells = an == "an" and (p.id in ajar or {q.id for q in alike} <= shut)
        name = s.name(p) or (f"one of the {plural(p.object_class)}" if several and tells else None)
        return name.replace(BASIN, UNIT) if name else None

    for an, right, others in [("an", ajar, shut), ("no", shut, ajar)] * TRIES:
        for p in s.shuffled([p for p in s.things if p.id in right]):
            of_name = {name: q.id for q in s.shuffled(s.things) if q.id in others and (name := named(q, an))}
            wrong = [*of_name][: s.rng.integers(1, OPTIONS)]
            if wrong and (name := named(p, an)):
                about = (p.id, *sorted(of_name[n] for n in wrong))
                yield s.ask(name, about, wrong, "open" if right is ajar else "shut", an=an)


def change(s: WalkScene) -> Asked:
    half = len(s.walk.frames) // 2
    twice = {i for f in s.walk.frames[:half] for i in f.clear} & {i for f in s.walk.frames[half:] for i in f.clear}
    moved = {s.house.placement_by_id[i].object_class for i in s.walk.moved}
    alike = {*moved, *(c for name in moved for c in ALIKE.get(name, ()))}
    others = [p for p in s.things if p.id in twice & s.movable and not {p.id, p.parent} & {*s.walk.moved}]
    others = [p for p in others if p.object_class not in alike]
    for p, name in s.named(TRIES * [p for p in s.things if p.id in s.walk.moved]):
        wrong = s.named([q for q in others if q.room == p.room])[:3]
        if len(wrong) > 1:
            yield s.ask(name, (p.id, *sorted(q.id for q, _ in wrong)), [n for _, n in wrong])


def whereabouts(s: WalkScene) -> Asked:
    for p, name in s.people(anywhere=True):
        wrong = [s.room_name(r) for r in s.shuffled(s.looked_at) if r != p.room][:3]
        if p.room in s.looked_at and len(wrong) > 1:
            yield s.ask(s.room_name(p.room), (p.id,), wrong, a=name)


def seen_by(s: WalkScene) -> Asked:
    for p, name in s.people():
        here, seen = s.in_room(p.room), s.walk.views.get(p.id, {})
        off = lambda t: min(abs(bearing(middle(p), facing_of(p.yaw), at)) for at in corners(t))  # noqa: B023
        wrong = s.named([t for t in here if t.id not in seen and off(t) > BEHIND])[:OFFERED]
        ahead = [t for t in here if seen.get(t.id, 0.0) > CLEAR_SHARE and gap(p, t) > FROM_WALL]
        ahead = [t for t in ahead if abs(bearing(middle(p), facing_of(p.yaw), middle(t))) < AHEAD]
        wrong = [(q, n) for q, n in wrong if q.parent not in {t.id for t in ahead}]
        mirrored = any(s.house.placement_by_id[i].object_class == "mirror" for i in seen)
        for t, right in s.named(ahead)[: 2 * (len(wrong) > 1 and not mirrored)]:
            yield s.ask(right, (p.id, t.id, *(q.id for q, _ in wrong)), [n for _, n in wrong], a=name)


def side_of_person(s: WalkScene) -> Asked:
    for p, name in s.people():
        for t, thing in s.named(s.in_room(p.room)):
            angle, *also = (bearing(middle(p), facing_of(p.yaw), at) for at in (middle(t), *corners(t)))
            if math.dist(middle(p), middle(t)) > LEAST_METRES and gap(p, t) > FROM_WALL:
                yield from sided(s, angle, BESIDE, (p.id, t.id), also, a=name, b=thing)


def sun(s: WalkScene) -> Asked:
    """A room into which the sun shines at an hour; into the others it cannot. Words say which way the video begins."""
    openings = [o for o in s.house.openings if o.rooms[1] is None]
    looks = COMPASS[round(math.degrees(s.house.sky.north - s.walk.frames[0].yaw) / 45) % 8]
    for hour in s.shuffled(LATER):
        towards = sun_direction(dataclasses.replace(s.house.sky, hour=hour))
        lit = [(o, float(-inward(s.house, o) @ towards[:2] / math.hypot(*towards[:2]))) for o in openings]
        windows = [(o.rooms[0], cosine) for o, cosine in lit if o.kind not in HINGED]  # doors may have panes
        sunny = [r for r in s.looked_at if any(room == r and cosine > SUNNY for room, cosine in windows)]
        shady = [r for r in s.looked_at if any(room == r for room, _ in windows)]
        shady = [r for r in shady if all(cosine < SHADY for o, cosine in lit if o.rooms[0] == r)]
        bright = {o.rooms[0] for o, cosine in lit if cosine > LIGHT}
        passages = (o.rooms for o in s.house.openings if o.leaf_finish is None)
        lit_through = {r for rooms in passages for r in rooms if bright & {*rooms}}
        shady = [r for r in shady if r not in lit_through]
        for room in sunny if shady and towards[2] > HIGH else ():
            about = (room, *shady[:3])
            names = [s.room_name(r) for r in about]
            yield s.ask(names[0], about, names[1:], f"at {hour:.0f}:00", looks=looks, hour=f"{hour:.0f}")


def next_step(s: WalkScene) -> Asked:
    """Which way somebody sets off who stands where the video ends, and looks as its last frame does."""
    last, ground = s.walk.frames[-1], _ground(s.house)
    room = s.graph.room_of_node[int(np.argmin(np.linalg.norm(s.graph.positions - last.position, axis=1)))]
    feet = np.array([*last.position[:2], s.house.storey_of(s.house.room_by_id[room]).elevation])
    walked = ground.ways(np.array([ground.cell_at(feet)])).metres
    for t, name in s.named([t for t in s.things if t.room != room]):
        there = np.flatnonzero(ground.room_of_cell == t.room)
        if len(there):
            goal = there[np.linalg.norm(ground.xyz[there, :2] - middle(t), axis=1).argmin()]
            way = ground.xyz[ground.wide_ways(np.array([goal])).cells(ground.cell_at(feet))]
            line = shapely.LineString(np.concatenate([[feet], way])[:, :2])
            first, angle = (
                bearing(feet[:2], last.yaw, np.array(line.interpolate(x).coords[0])) for x in (SETS_OFF / 2, SETS_OFF)
            )
            shortest, *others = (math.degrees(wrap(x - last.yaw)) for x in set_offs(ground, feet, walked, int(goal)))
            ways = {side_of(shortest, SET_OFF_SIDES), side_of(angle, SET_OFF_SIDES)}
            if line.length > LEAST_WAY and ways == {side_of(first, SET_OFF_SIDES, FIRST_SIDE)}:
                yield from sided(s, angle, SET_OFF_SIDES, (t.id,), others, a=name)


def set_offs(ground: FloorWays, feet: np.ndarray, walked: np.ndarray, goal: int) -> list[float]:
    """Radians in which the shortest way to a cell sets off, and then another to another side that is as short, if there
    is one: by the lengths of the ways over all places that are SETS_OFF away, which have more than one valley.

    Args:
      feet: (2,) or (3,) metres, world.
      walked: (n,) metres from there to every cell.
    """
    ring = np.flatnonzero(np.abs(walked - SETS_OFF) < ON_RING)
    if not len(ring):
        return [direction(feet[:2], ground.xyz[goal, :2])]
    metres = walked[ring] + ground.ways(np.array([goal])).metres[ring]
    away, first = np.array([direction(feet[:2], at) for at in ground.xyz[ring, :2]]), int(metres.argmin())
    signed, ridge, widest = np.degrees(wrap(away - away[first])), metres.copy(), np.zeros(len(ring))
    for side in (signed >= 0, signed <= 0):
        outwards = np.flatnonzero(side)[np.argsort(np.abs(signed[side]))]
        ridge[outwards] = np.maximum.accumulate(metres[outwards])
        widest[outwards] = np.maximum.accumulate(np.diff(np.abs(signed[outwards]), prepend=0.0))
    far = (np.abs(signed) > ANOTHER) & ((metres < ridge - RIDGE) | (widest > NOTHING))
    short = far & (metres < max(AS_SHORT[0] * metres[first], metres[first] + AS_SHORT[1]))
    return away[[first, *([int(np.where(short, metres, np.inf).argmin())] if short.any() else [])]].tolist()


@functools.lru_cache(4)
def _ground(house: House) -> FloorWays:
    house = lived_in(house)
    firm = tuple(p for p in house.placements if p.object_class != HALVED)
    return FloorWays(dataclasses.replace(house, placements=firm))


def is_leg(s: WalkScene, floor: shapely.Geometry, a: Placement, b: Placement) -> bool:
    """Tells whether somebody goes straight from one thing to another: not near, no wall between, and both show their
    fronts, or what they are on does."""
    line = shapely.LineString([middle(a), middle(b)])
    if line.length < FACED or gap(a, b) < LEAST_METRES:
        return False
    ends = [FROM_WALL * (p.parent is None) for p in (a, b)]  # what stands or hangs at a wall may reach into it
    below = [s.house.placement_by_id[p.parent] if p.parent else p for p in (a, b)]
    seen = zip(below, (b, a))
    fronts = all(abs(bearing(middle(p), facing_of(p.yaw), middle(q))) < 90 for p, q in seen)
    return fronts and floor.covers(substring(line, ends[0], max(line.length - ends[1], ends[0])))


def route(s: WalkScene) -> Asked:
    """Turns on a way of two or three straight legs, with things to stop at."""
    spots = s.graph.positions[:, :2]
    room_of, near = s.graph.room_of_node, lambda t, n: footprint(t).distance(shapely.Point(spots[n])) < STANDS
    at = {n: [t for t in s.things if t.room == room and near(t, n)] for n, room in enumerate(room_of)}
    floors = [sight_floor(s.house, k) for k in range(len(s.house.storeys))]
    ends = [n for n, room in enumerate(room_of) if at[n] and room in s.walk.rooms]
    for way in (s.graph.path(*pair) for pair in s.shuffled([*itertools.permutations(ends, 2)])[:ROUTES]):
        bends = [
            (b, bearing(spots[b], direction(spots[a], spots[b]), spots[c])) for a, b, c in zip(way, way[1:], way[2:])
        ]
        turns = [(n, angle) for n, angle in bends if abs(angle) >= STRAIGHT]
        stops = [thing for n in (way[0], *(n for n, _ in turns), way[-1]) for thing in s.named(at[n])[:1]]
        if np.ptp(s.graph.positions[way, 2]) or not 1 <= len(turns) <= 2 or min(abs(a) for _, a in turns) < CORNER:
            continue
        floor = floors[s.house.room_by_id[room_of[way[0]]].storey]
        if not all(is_leg(s, floor, a, b) for (a, _), (b, _) in itertools.pairwise(stops)):
            continue
        at_things = [middle(t) for t, _ in stops]
        seen = [bearing(b, direction(a, b), c) for a, b, c in zip(at_things, at_things[1:], at_things[2:])]
        agree = (angle * true > 0 and 3 * SIDE < abs(angle) < 180 - 2 * SIDE for angle, (_, true) in zip(seen, turns))
        if len({t.id for t, _ in stops}) < len(turns) + 2 or not all(agree):
            continue
        names = [name for _, name in stops]
        steps = "; [fill in]; ".join(f"go forward until you reach {name}" for name in names[1:])
        right = ", ".join("turn left" if angle > 0 else "turn right" for _, angle in turns)
        every = (", ".join(x) for x in itertools.product(("turn left", "turn right"), repeat=len(turns)))
        slots = {"a": names[0], "b": names[1], "c": names[-1], "steps": f"{steps}."}
        yield s.ask(right, [t.id for t, _ in stops], [x for x in every if x != right], **slots)


CHANGE = "change"
"""The type that is asked about two visits."""
TYPES: dict[str, QuestionType] = {
    "object_counting": counting,
    "object_abs_distance": distance,
    "object_rel_distance": nearest,
    "object_size_estimation": size,
    "room_size_estimation": room_size,
    "obj_appearance_order": order,
    "object_rel_direction_easy": turned(TWO_SIDES),
    "object_rel_direction_medium": turned(LEFT_RIGHT_BACK),
    "object_rel_direction_hard": turned(QUARTERS),
    "visibility": visibility,
    "support": carried(shelf=False),
    "containment": carried(shelf=True),
    "route_planning": route,
    "next_step": next_step,
    "openness": openness,
    CHANGE: change,
    "person_room": whereabouts,
    "person_view": seen_by,
    "person_side": side_of_person,
    "sun": sun,
}

"""The types of questions: one table, a function each, which yields questions about a walk and leaves out what is
ambiguous, by the margins below. Words are in embodied/language/vqa.toml. Nine are VSI-Bench's, in its units
(Yang et al. 2025, "Thinking in Space", sec. 3.2).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator

from embodied.datasets.vqa.scene import ALIKE, WalkScene, apart, bearing, direction, middle
from embodied.datasets.vqa.scoring import VqaQuestion
from embodied.house.house import Placement
from embodied.language.lexicon import UNFIT
from embodied.language.plain_language import plural

SIDE = 15.0
"""Degrees from the border between two sides within which nothing is asked."""
LEAST_METRES, MOST_METRES, NEARER, NEARER_METRES = 0.5, 8.0, 1.25, 0.3
"""Between things whose distance is asked for; how much farther the second nearest thing is than the nearest."""
Sides = dict[str, tuple[float, float]]
"""Degrees to the left, from and to."""
TWO_SIDES: Sides = {"left": (0, 180), "right": (-180, 0)}
LEFT_RIGHT_BACK: Sides = {"left": (0, 135), "right": (-135, 0), "back": (135, 225)}
QUARTERS: Sides = {"front-left": (0, 90), "back-left": (90, 180), "back-right": (-180, -90), "front-right": (-90, 0)}
Asked = Iterator[VqaQuestion]
QuestionType = Callable[[WalkScene], Asked]


def groups(s: WalkScene, n: int, far: float = 0.0) -> Iterator[list[tuple[Placement, str]]]:
    """Things of one room with names, in groups of n, each at least `far` metres from the first."""
    for room in s.shuffled(s.looked_at):
        things = s.named(s.in_room(room))
        for k, first in enumerate(things):
            rest = [t for t in (*things[k + 1 :], *things[:k]) if math.dist(middle(first[0]), middle(t[0])) >= far]
            yield from [[first, *rest[: n - 1]]] * (len(rest) >= n - 1)


def side_of(angle: float, sides: Sides) -> str | None:
    """The side that an angle, degrees to the left, is well inside of."""
    inside = (name for name, (low, high) in sides.items() if SIDE <= (angle - low) % 360 <= high - low - SIDE)
    return next(inside, None)


def sided(s: WalkScene, angle: float, sides: Sides, about: Iterable[str], **slots: str) -> Asked:
    """A question for the side on which something lies; none near the border between two."""
    if side := side_of(angle, sides):
        yield s.ask(side, about, [x for x in sides if x != side], f"{angle:.0f} degrees to the left", **slots)


def counting(s: WalkScene) -> Asked:
    for room, name in s.shuffled([(p.room, p.object_class) for p in s.things if p.room in s.looked_at]):
        noun = s.noun(name)
        there = {p.id: p.object_class for p in s.called(noun) if p.room == room}
        alone = {*there.values()} == {name} and there.keys() <= s.clear.keys()
        if 2 <= len(there) <= 12 and plural(noun) != noun and alone:
            yield s.ask(str(len(there)), (room, *there), things=plural(noun), room=s.room_name(room))


def distance(s: WalkScene) -> Asked:
    for (a, first), (b, second) in groups(s, 2):
        if LEAST_METRES <= (metres := apart(a, b)) <= MOST_METRES:
            yield s.ask(f"{metres:.1f}", (a.id, b.id), a=first, b=second)


def nearest(s: WalkScene) -> Asked:
    for (a, first), *others in groups(s, 5):
        metres, ids, names = zip(*sorted((apart(a, p), p.id, name) for p, name in others))
        if metres[1] > max(NEARER * metres[0], metres[0] + NEARER_METRES):
            yield s.ask(names[0], (a.id, *ids), names[1:], ", ".join(f"{d:.1f} m" for d in metres), a=first)


def size(s: WalkScene) -> Asked:
    yield from (s.ask(f"{100 * max(p.size):.0f}", (p.id,), a=name) for p, name in s.named(s.things))


def room_size(s: WalkScene) -> Asked:
    areas = {r: s.house.floor(s.house.room_by_id[r]).area for r in s.looked_at}
    yield from (s.ask(f"{areas[r]:.1f}", (r,), room=s.room_name(r)) for r in s.shuffled(s.looked_at))


def turned(sides: Sides) -> QuestionType:
    """The type that asks on which side something lies for who stands by a thing and faces another."""

    def asked(s: WalkScene) -> Asked:
        for (a, first), (b, second), (c, third) in groups(s, 3, far=1.0):
            angle = bearing(middle(a), direction(middle(a), middle(b)), middle(c))
            yield from sided(s, angle, sides, (a.id, b.id, c.id), a=first, b=second, c=third)

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
    shown = {i for f in s.walk.frames for i in f.shares}
    away = {n: s.noun(n) for n in sorted({*s.elsewhere} - UNFIT)}
    unseen = [n for n in s.elsewhere if n in away and not shown & {p.id for p in s.called(away[n])}]
    for name in s.shuffled(sorted({p.object_class for p in s.things})):
        seen = [p.id for p in s.things if p.object_class == name]
        wrong = [away[n] for n in dict.fromkeys(s.shuffled(unseen))][:3]
        if len(wrong) == 3:
            yield s.ask(s.noun(name), seen, wrong, f"first in frame {min(s.clear[i] for i in seen)}")


def carried(shelf: bool) -> QuestionType:
    """The type that asks what rests on something, or on its shelves."""

    def asked(s: WalkScene) -> Asked:
        small = [p for p in s.things if p.parent is not None]
        for carrier, name in s.named(s.things):
            classes = {p.object_class for p in s.house.placements if p.parent == carrier.id}
            there = [p for p in small if p.parent == carrier.id and (p.surface or "").startswith("shelf") == shelf]
            alike = {*classes, *(c for name in classes for c in ALIKE.get(name, ()))}
            away = [*dict.fromkeys(s.shuffled([p.object_class for p in small if p.object_class not in alike]))]
            for p in s.shuffled(there)[: len(away) > 2]:
                fact = f"on it: {', '.join(sorted(classes))}"
                yield s.ask(s.noun(p.object_class), (carrier.id, p.id), map(s.noun, away[:3]), fact, a=name)

    return asked


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
}

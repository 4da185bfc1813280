"""Who lives in a house: how many, how old, and what they like doing; what lies about follows from it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from embodied.assets.people import Person, people
from embodied.house.house import House
from embodied.seeds import stream

HABITS = {"cooks": 0.5, "reads": 0.5, "plays": 0.4, "does sports": 0.35, "works at home": 0.4, "makes things": 0.2}
"""Habits that a household may have, and the share of households that do."""
ROOM_FOR = {"study": "works at home", "library": "reads", "gym": "does sports", "workshop": "makes things"}
"""Room kind to the habit that whoever has such a room certainly has."""
PRIVATE = ("main_bedroom", "bedroom", "kids_room")
"""Room kinds that belong to some of the household."""
GROWN_UP = 18
"""Age from which somebody of the pack is one of a household's adults, years."""


@dataclass(frozen=True)
class Household:
    """The people of one house."""

    adults: int
    children: tuple[int, ...]
    """Ages in years, the eldest first."""
    habits: frozenset[str]
    """Out of HABITS."""

    @property
    def people(self) -> int:
        return self.adults + len(self.children)

    def residents(self, kind: str, rooms: int = 1) -> float:
        """How many use a room of this kind, where the house has so many of them: the mean where they share."""
        if kind == "main_bedroom":
            return float(self.adults)
        if kind == "kids_room":
            return max(1.0, len(self.children) / rooms)
        if kind == "guest_room":
            return 0.0
        return 1.0 if kind in PRIVATE else float(self.people)

    def __str__(self) -> str:
        """As one says it: '2 adults, children of 4 and 7; cooks, reads'."""
        who = f"{self.adults} adult{'s' if self.adults > 1 else ''}"
        if self.children:
            ages = [str(a) for a in self.children]
            listed = ages[0] if len(ages) == 1 else f"{', '.join(ages[:-1])} and {ages[-1]}"
            who += f", {'children' if len(ages) > 1 else 'a child'} of {listed}"
        return f"{who}; {', '.join(sorted(self.habits)) or 'no habits'}"


def household_of(house: House) -> Household:
    """Who lives in a house: it follows from its seed and its rooms."""
    return draw_household([r.kind for r in house.rooms], rng=stream(house.seed, "house", "household"))


def draw_household(kinds: Sequence[str], *, rng: np.random.Generator) -> Household:
    """Who might live in a house of rooms of these kinds (one entry per room).

    Couples mostly, where there is a main bedroom; one or two children for each children's room, and a half-grown one
    in every third other bedroom.
    """
    adults = 1 + int(rng.random() < (0.75 if "main_bedroom" in kinds else 0.4))
    children: list[int] = []
    for kind in kinds:
        if kind == "kids_room":
            children += [int(rng.integers(2, 12)) for _ in range(1 + int(rng.random() < 0.3))]
        elif kind == "bedroom" and rng.random() < 0.35:
            children.append(int(rng.integers(11, 18)))
    drawn = {name for name, share in HABITS.items() if rng.random() < share}
    certain = {habit for kind, habit in ROOM_FOR.items() if kind in kinds}
    return Household(adults, tuple(sorted(children, reverse=True)), frozenset(drawn | certain))


def residents(house: House) -> tuple[Person, ...]:
    """Those of the pack who live in a house: of one family, grown-ups and children as its household has them."""
    rng, household = stream(house.seed, "house", "family"), household_of(house)
    families = sorted({p.family for p in people().values()})
    family = families[int(rng.integers(len(families)))]
    own = sorted((p for p in people().values() if p.family == family), key=lambda p: p.age)
    adults = [p for p in own if p.age >= GROWN_UP]
    if not household.children:
        adults = [adults[i] for i in rng.permutation(len(adults))]
    apart = lambda p: min((abs(p.age - age) for age in household.children), default=0)
    children = sorted((p for p in own if p.age < GROWN_UP), key=apart)
    return (*adults[: household.adults], *children[: len(household.children)])

"""What a finished house lacks: nobody lives where the kitchen has no sink or the bedroom no bed."""

from __future__ import annotations

from embodied.generate.furnish.rooms import PROGRAMMES
from embodied.house.house import House


def lacking(house: House) -> tuple[str, ...]:
    """'kitchen_1: fridge' for everything that a room of `house` lacks.

    Counted are the needs of the table of rooms that name object classes. The furnisher tries for
    more; and it is asked of the finished house, because clearing the ways may take a bed out again.
    """
    there: dict[str, set[str]] = {}
    for p in house.placements:
        there.setdefault(p.room, set()).add(p.object_class)
    return tuple(
        f"{r.id}: {need.classes[0]}"
        for r in house.rooms
        for need in PROGRAMMES[r.kind].needs
        if need.classes and there.get(r.id, set()).isdisjoint(need.classes)
    )

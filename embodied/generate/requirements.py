"""Things that a finished house lacks: nobody lives where the kitchen has no sink or the bedroom no bed."""

from __future__ import annotations

from embodied.assets.catalogue import Catalogue
from embodied.generate.access import MOVING
from embodied.generate.furnish.tables import tables, tables_of
from embodied.generate.kinds import BEDROOMS
from embodied.house.house import DOORS, House

FLAT = 75.0
"""Up to here bedrooms may open off the living room, square metres."""


def missing_requirements(house: House, catalogue: Catalogue | None = None) -> tuple[str, ...]:
    """'kitchen_1: fridge' for everything that a room of `house` lacks, 'bedroom_1: way from a hall or corridor'.

    Counted are the needs of the table of rooms that name object classes. The furnisher tries for
    more; and it is asked of the finished house, because clearing the ways may take a bed out again.

    Args:
      catalogue: one whose own groups have needs, too.
    """
    there: dict[str, set[str]] = {}
    for p in house.placements:
        there.setdefault(p.room, set()).add(p.object_class)
    known = tables_of(catalogue) if catalogue is not None else tables()
    short = [
        f"{r.id}: {need.roles[0]}"
        for r in house.rooms
        for need in (known.rooms[r.kind].needs if r.kind in known.rooms else ())
        if need.classes and not any({*known.classes(c)} & there.get(r.id, set()) for c in need.classes)
    ]
    return (*short, *_through_rooms(house))


def _through_rooms(house: House) -> list[str]:
    """The bedrooms of a house that one enters through another room only."""
    if house.area <= FLAT:
        return []
    moving = {r.id for r in house.rooms if r.kind in MOVING}
    entered = {name for o in house.openings if o.kind in DOORS and moving & {*o.rooms} for name in o.rooms}
    return [f"{r.id}: way from a hall or corridor" for r in house.rooms if r.kind in BEDROOMS and r.id not in entered]

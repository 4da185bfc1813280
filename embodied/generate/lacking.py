"""What a room must not lack: nobody lives in a house whose kitchen has no sink or whose bedroom has no bed."""

from __future__ import annotations

from collections.abc import Mapping

from embodied.house.house import House

BEDS = ("bed", "child bed", "bunk bed", "loft bed", "day bed", "sofa bed", "crib", "cradle")
NEEDS: Mapping[str, tuple[tuple[str, ...], ...]] = {
    "kitchen": (("kitchen sink",), ("cooker", "cooktop"), ("fridge",)),
    "bathroom": (
        ("toilet",),
        ("washbasin", "wall washbasin", "basin", "bathroom vanity", "double vanity"),
        ("bathtub", "corner bathtub", "shower"),
    ),
    "toilet": (("toilet",),),
    "main_bedroom": (BEDS,),
    "bedroom": (BEDS,),
    "guest_room": (BEDS,),
    "kids_room": (BEDS,),
    "living_room": (("sofa", "sofa bed", "corner sofa", "armchair", "lounge chair"),),
}
"""Room kind to groups of object classes; a room should have one of every group.

Fewer than the furnisher tries for (furnish/rooms.py), and asked of the finished house: clearing the ways may take a bed out again.
"""


def lacking(house: House) -> tuple[str, ...]:
    """'kitchen_1: fridge' for everything that a room of `house` lacks."""
    there: dict[str, set[str]] = {}
    for p in house.placements:
        there.setdefault(p.room, set()).add(p.object_class)
    return tuple(
        f"{r.id}: {group[0]}"
        for r in house.rooms
        for group in NEEDS.get(r.kind, ())
        if there.get(r.id, set()).isdisjoint(group)
    )

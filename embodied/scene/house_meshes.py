"""The one translation from a House to triangles: everything visible as a tuple of Parts."""

import dataclasses
import typing
from collections.abc import Sequence

from embodied.assets.people.figures import FIGURES
from embodied.assets.records import Finish, MeshPart
from embodied.house.house import House, Placement
from embodied.scene.part import Part
from embodied.scene.shell import shell_owners, shell_parts

__all__ = ["Meshes", "Part", "house_parts", "instance_classes", "owners"]


class Meshes(typing.Protocol):
    """The part of a catalogue that this module needs."""

    def mesh(
        self, key: str, size: tuple[float, float, float], params: tuple[tuple[str, str | float], ...] = ()
    ) -> tuple[MeshPart, ...]: ...

    def finish(self, material_key: str) -> Finish: ...


def house_parts(house: House, catalogue: Meshes, apart: bool = False) -> tuple[Part, ...]:
    """Everything visible in and around the house: shell first, then placements, in the house's order; `apart`: as of
    joinery.opening_parts."""
    return shell_parts(house, catalogue.finish, apart) + object_parts(house, catalogue)


def object_parts(house: House, catalogue: Meshes) -> tuple[Part, ...]:
    """The placements alone."""
    return _parts_of(house.placements, catalogue)


def coarser_people(house: House, catalogue: Meshes) -> tuple[Part, ...]:
    """The figures of the pack among the placements in details 1 and 2."""
    some, more = [p for p in house.placements if p.asset in FIGURES], list[Part]()
    for detail in (1, 2):
        less = [dataclasses.replace(p, params=(*p.params, ("detail", detail))) for p in some]
        more += (dataclasses.replace(x, detail=detail) for x in _parts_of(less, catalogue))
    return tuple(more)


def _parts_of(placements: Sequence[Placement], catalogue: Meshes) -> tuple[Part, ...]:
    parts = []
    for p in placements:
        stem = "/".join([p.asset, *(f"{s:.4f}" for s in p.size), *(f"{k}={v}" for k, v in p.params)])
        for i, mesh in enumerate(catalogue.mesh(p.asset, p.size, p.params)):
            parts.append(Part(p.id, "object", p.room, mesh, f"{stem}#{i}", p.position, p.yaw))
    return tuple(parts)


def owners(house: House) -> tuple[str, ...]:
    """Who may own pixels: instance id i + 1 belongs to owners(house)[i]; 0 is nothing (the sky).

    Placements come first, in the house's order, then the shell.
    """
    return tuple(p.id for p in house.placements) + shell_owners(house)


def instance_classes(house: House) -> tuple[str, ...]:
    """The class of each instance id: 'nothing' (0), the furniture's classes, then 'floor', 'wall', 'door', ..."""
    kinds = {o.id: "window" if o.kind == "roof_window" else o.kind for o in house.openings}

    def of_shell(owner: str) -> str:
        whole, _, piece = owner.rpartition("/")
        if whole == "outdoor":
            return "outdoors"
        return kinds.get(whole) or piece.partition("_")[0]

    return ("nothing", *(p.object_class for p in house.placements), *map(of_shell, shell_owners(house)))

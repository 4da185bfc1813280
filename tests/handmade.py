"""A catalogue made by hand: boxes of a few colours, so that tests of pictures and physics need no pack."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from embodied.assets.built.primitives import box, part
from embodied.assets.records import Asset, Finish, MeshPart, SupportSurface
from embodied.geometry import rotation
from embodied.house.house import House, Placement
from embodied.scene.house_meshes import house_parts
from embodied.scene.lit_pages import LitMesh, LitPages

RED, GREEN, BLUE, WOOD = (0.9, 0.05, 0.05, 1.0), (0.05, 0.8, 0.1, 1.0), (0.1, 0.15, 0.9, 1.0), (0.6, 0.4, 0.25, 1.0)


def box_mesh(low, high, color) -> MeshPart:
    """An axis-aligned box with its corners at `low` and `high`."""
    return part(Finish(color), box(low, high))


def _asset(key: str, object_class: str, size, support: str = "floor", surfaces=()) -> Asset:
    return Asset(key, object_class, object_class, size, support, surfaces=surfaces, materials=("wood",))


HAND_ASSETS = (
    _asset("hand/red_box", "red box", (0.5, 0.5, 0.8)),
    _asset("hand/flag", "flag", (0.6, 0.1, 1.0)),
    _asset("hand/table", "table", (1.2, 0.8, 0.75), surfaces=(SupportSurface("top", 0.75, -0.6, -0.4, 0.6, 0.4, 9.0),)),
    _asset("hand/mug", "mug", (0.08, 0.08, 0.1), "surface"),
    _asset("built/rug", "rug", (2.0, 1.4, 0.012)),
)


@dataclass(frozen=True, eq=False)
class HandCatalogue:
    """Quacks like embodied.assets.catalogue.Catalogue as far as a scene needs it."""

    assets: Mapping[str, Asset] = field(default_factory=lambda: {a.key: a for a in HAND_ASSETS})

    def mesh(self, key: str, size, params=()) -> tuple[MeshPart, ...]:
        w, d, h = size
        if key == "hand/flag":
            half = box_mesh((-w / 2, -d / 2, 0), (0, d / 2, h), GREEN)
            return half, box_mesh((0, -d / 2, 0), (w / 2, d / 2, h), BLUE)
        if key == "hand/table":
            legs = [
                box_mesh((x - 0.03, y - 0.03, 0), (x + 0.03, y + 0.03, h - 0.04), WOOD)
                for x in (-w / 2 + 0.05, w / 2 - 0.05)
                for y in (-d / 2 + 0.05, d / 2 - 0.05)
            ]
            return (box_mesh((-w / 2, -d / 2, h - 0.04), (w / 2, d / 2, h), WOOD), *legs)
        color = {"hand/red_box": RED, "hand/mug": BLUE}.get(key, WOOD)
        return (box_mesh((-w / 2, -d / 2, 0), (w / 2, d / 2, h), color),)

    def parameters(self, key: str) -> dict[str, float | str]:
        return {}

    def own_digests(self, keys) -> dict[str, str]:
        return {}

    def finish(self, key: str) -> Finish:
        return Finish({"oak_planks/0": (0.72, 0.55, 0.38, 1.0)}.get(key, (0.93, 0.92, 0.9, 1.0)))


def furnished(house: House) -> House:
    """The two-room house with a table that carries a mug, a red box to the east and a two-coloured flag."""
    things = (
        Placement("red_box_1", "hand/red_box", "red box", "living_room_1", (4.4, 2.6, 0.0), 0.0, (0.5, 0.5, 0.8)),
        Placement("flag_1", "hand/flag", "flag", "living_room_1", (2.0, 3.8, 0.0), 0.0, (0.6, 0.1, 1.0)),
        Placement("table_1", "hand/table", "table", "living_room_1", (1.2, 0.9, 0.0), 0.3, (1.2, 0.8, 0.75)),
        Placement(
            "mug_1", "hand/mug", "mug", "living_room_1", (1.3, 1.0, 0.75), 1.0, (0.08, 0.08, 0.1), "table_1", "top"
        ),
        Placement("red_box_2", "hand/red_box", "red box", "bedroom_1", (8.5, 3.4, 0.0), 0.0, (0.5, 0.5, 0.8)),
    )
    return dataclasses.replace(house, placements=(*house.placements, *things))


def painted(house: House, catalogue) -> LitPages:
    """Lit pages without a bake: every part evenly in its own colour, one texel block each."""
    parts = [p for p in house_parts(house, catalogue) if len(p.mesh.faces)]
    page, meshes = np.zeros((8, 8 * len(parts), 3), np.uint8), []
    for i, piece in enumerate(parts):
        page[:, 8 * i : 8 * i + 8] = np.rint(255 * np.array(piece.mesh.finish.color[:3]))
        turned = piece.mesh.vertices.copy()
        turned[:, :2] = turned[:, :2] @ rotation(piece.yaw).T
        uv = np.full((len(turned), 2), [(i + 0.5) / len(parts), 0.5], np.float32)
        vertices, alpha = (turned + piece.position).astype(np.float32), float(piece.mesh.finish.color[3])
        meshes.append(LitMesh(piece.owner, piece.kind, piece.room, 0, vertices, piece.mesh.faces, uv, alpha))
    return LitPages(tuple(meshes), (page,), "painted")


def smooth_pages(house: House, catalogue) -> LitPages:
    """`painted` in colours that change smoothly and differently along u and v, so that a turned texture is seen."""
    u, v = np.meshgrid(np.linspace(0, 1, 128), np.linspace(0, 1, 64))
    page = np.stack([60 + 180 * u, 220 - 160 * v, 90 + 60 * u + 60 * v], -1).astype(np.uint8)
    along = lambda m: np.clip(m.vertices[:, [0, 2]] / (10, 3) + m.vertices[:, [1, 1]] / (50, 20), 0, 1)
    uv = lambda m: m.uv if m.kind == "outdoor" else along(m).astype(np.float32)
    pages = painted(house, catalogue)
    meshes = tuple(dataclasses.replace(m, uv=uv(m)) for m in pages.meshes)
    return dataclasses.replace(pages, pages=(page,), meshes=meshes)


def of_panes(pages: LitPages, **changes) -> LitPages:
    """The same with other panes of glass."""
    glass = lambda m: dataclasses.replace(m, **changes) if m.owner.endswith("/glass") else m
    return dataclasses.replace(pages, meshes=tuple(map(glass, pages.meshes)))


def decibels(a: np.ndarray, b: np.ndarray) -> float:
    """Peak signal-to-noise ratio of two uint8 pictures."""
    return float(10 * np.log10(255**2 / max(np.mean((a.astype(float) - b) ** 2), 1e-9)))

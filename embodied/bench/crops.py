"""Crops of the objects of a house: each seen from the viewpoint that shows most of it from before, and all of it."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from assets.cache import atomic_path, digest
from assets.closure import code_digest
from embodied.geometry import facing_of, rectangle

if TYPE_CHECKING:
    from embodied.house.house import House, Placement
    from embodied.world import World

LEAST, SIDE = 96, 224
"""Pixels of the longer side of an object before it is shown, and of what is shown."""
DRAWN = 448
"""Pixels of the views that crops are cut from."""
NARROWEST, WIDEST = math.radians(8), math.radians(80)
"""Fields of view of such a view."""
NEARER = 8
"""A view that cannot hold the whole object is taken if it has this many times the pixels of those that can."""
ROOM = 2.2
"""Field of view over the widest angle between the middle of an object and a corner of its box."""
MARGIN = 1.25
"""Side of a crop over the longer side of its object."""


@dataclass(frozen=True, eq=False)
class Crop:
    """One object as it is shown to the judge."""

    house: str
    owner: str
    object_class: str
    rgb: np.ndarray
    """(SIDE, SIDE, 3) uint8."""


def kept_crops(world: World, classes: Collection[str], folder: Path) -> list[Crop]:
    """The crops of a house, from `folder` if the same code has put them there, else drawn and put there."""
    made = digest(world.fingerprint, code_digest("embodied.bench.crops"), sorted(classes))
    path = folder / f"{world.house.name}_{made[:16]}.npz"
    if not path.exists():
        crops = crops_of(world, classes)
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            rgb = np.stack([c.rgb for c in crops]) if crops else np.zeros((0, SIDE, SIDE, 3), np.uint8)
            owners, names = [c.owner for c in crops], [c.object_class for c in crops]
            np.savez_compressed(file, rgb=rgb, owners=np.array(owners, str), classes=np.array(names, str))
    with np.load(path, allow_pickle=False) as held:
        rows = zip(held["owners"].tolist(), held["classes"].tolist(), held["rgb"], strict=True)
        return [Crop(world.name, owner, name, rgb) for owner, name, rgb in rows]


def crops_of(world: World, classes: Collection[str]) -> list[Crop]:
    """Every object of these classes of a house that is LEAST pixels large in the best view of it.

    The best view has the most pixels of it, weighted by how far it is from before, among those that can hold all of it:
    a fridge at arm's length is a wall, and a bookcase from its side a board, to whoever looks.
    """
    number = {owner: i + 1 for i, owner in enumerate(world.owners)}
    nodes = [np.bincount(world.renderer.seen(at)[1].ravel(), minlength=len(number) + 1) for at in world.graph.positions]
    crops = []
    for thing in world.house.placements:
        if thing.object_class not in classes:
            continue
        mine = number[thing.id]
        base = thing.position[2] + _elevation(world.house, thing)
        before = [_fronting(thing, base, at) for at in world.graph.positions]
        pixels = np.array([counts[mine] for counts in nodes]) * before
        wide = np.array([_vfov(*_towards(world, thing, at)) for at in world.graph.positions])
        whole = pixels * (wide <= WIDEST)
        best = int(np.argmax(whole if whole.max() * NEARER > pixels.max() else pixels))
        if pixels[best] and (rgb := _crop(world, thing, mine, world.graph.positions[best])) is not None:
            crops.append(Crop(world.name, thing.id, thing.object_class, rgb))
    return crops


def _crop(world: World, thing: Placement, mine: int, eye: np.ndarray) -> np.ndarray | None:
    """What stands in a square around an object, seen from `eye`; None if it is too small or hidden there."""
    middle, corners = _towards(world, thing, eye)
    yaw, pitch = math.atan2(middle[1], middle[0]), math.asin(middle[2] / max(float(np.linalg.norm(middle)), 1e-6))
    vfov = float(np.clip(_vfov(middle, corners), NARROWEST, WIDEST))
    view = world.renderer.view(eye, yaw, pitch, vfov, (DRAWN, DRAWN))
    rows, columns = np.nonzero(view.ids == mine)
    if len(rows) < LEAST * LEAST / 8 or max(np.ptp(rows), np.ptp(columns)) < LEAST:
        return None
    side = int(min(max(np.ptp(rows), np.ptp(columns)) * MARGIN, DRAWN))
    top, left = (int(np.clip((a.min() + a.max() - side) / 2, 0, DRAWN - side)) for a in (rows, columns))
    return cv2.resize(view.rgb[top : top + side, left : left + side], (SIDE, SIDE), interpolation=cv2.INTER_AREA)


def _fronting(thing: Placement, base: float, eye: np.ndarray) -> float:
    """1 before an object, 1/4 beside it, 0 behind it: it is photographed from where it can be known.

    What hangs above the eye has no side that is its front.
    """
    if base > eye[2]:
        return 1.0
    x, y = eye[:2] - thing.position[:2]
    return ((1 + math.cos(math.atan2(y, x) - facing_of(thing.yaw))) / 2) ** 2


def _towards(world: World, thing: Placement, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From `eye` to the middle of an object's box, (3,), and to its corners, (8, 3), metres."""
    low = thing.position[2] + _elevation(world.house, thing) - eye[2]
    (x, y, _), (width, depth, _) = thing.position, thing.size
    ground = np.array(rectangle(x, y, width, depth, thing.yaw)) - eye[:2]
    corners = np.array([(*xy, z) for z in (low, low + thing.size[2]) for xy in ground])
    return corners.mean(0), corners


def _vfov(middle: np.ndarray, corners: np.ndarray) -> float:
    """Field of view that holds a box with some room around it, radians."""
    away = np.linalg.norm(corners, axis=1) * max(float(np.linalg.norm(middle)), 1e-6)
    return ROOM * float(np.arccos(np.clip(corners @ middle / np.maximum(away, 1e-9), -1, 1)).max())


def _elevation(house: House, thing: Placement) -> float:
    return house.storey_of(house.room_by_id[thing.room]).elevation

"""Contents of a strip as labels for training: objects, rooms and distances per cell of the feature map."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from embodied.agents.vision.encoder import CELL, HEIGHT, STRIP_COLUMNS, STRIP_ROWS, WIDTH, windows
from embodied.agents.vision.features import EQUIRECT, margin, strip_of
from embodied.assets.cache import DAMAGED, atomic_path
from embodied.assets.decoding import open_arrays
from embodied.assets.records import ROOM_KINDS
from embodied.house.house import OPENING_KINDS, House
from embodied.scene.house_meshes import owners

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.world import World

VISIBLE = 0.003
"""An object class counts as visible in a view if it covers this share of the picture."""
NEAREST, FARTHEST = 0.1, 50.0
"""Metres; distances are clipped to this range before their logarithm is taken."""
SHELL = ("floor", "ceiling", "skirting", "wall", "stairs", "outdoor")
"""Parts of a house that are no objects; doors and windows go by the kind of their opening."""
MOST = 2**30
"""Most bytes of one house, unpacked; those of 200 m² are a tenth."""


@dataclass(frozen=True, eq=False)
class HouseStrips:
    """Nodes of one house: pictures and labels; n is their number."""

    name: str
    classes: tuple[str, ...]
    """Object classes and parts of the shell ('wall', 'door', 'outdoor'), sorted."""
    rgb: np.ndarray
    """(n, 192, 576, 3) uint8."""
    share: np.ndarray
    """(n, 12, 36, C) uint8, share of each cell that each class covers, times 255, rounded up."""
    rooms: np.ndarray
    """(n, 12, 36) int8, kind (index into ROOM_KINDS) of the room most of a cell shows; -1 for none."""
    log_depth: np.ndarray
    """(n, 12, 36) float16, mean natural logarithm of the distance along the ray, metres."""
    room: np.ndarray
    """(n,) int8, kind of the room the node is in."""

    def save(self, path: Path) -> None:
        with atomic_path(Path(path)) as temporary, open(temporary, "wb") as f:
            np.savez_compressed(f, **{name: value for name, value in vars(self).items() if name != "name"})

    @staticmethod
    def load(path: Path) -> HouseStrips:
        """Read what `save` wrote; the house's name is the file's stem.

        Raises:
          FileNotFoundError, OSError.
          ValueError: damaged.
        """
        try:
            with open_arrays(path, MOST) as f:
                classes = tuple(str(c) for c in f["classes"])
                arrays = {name: f[name] for name in ("rgb", "share", "rooms", "log_depth", "room")}
        except DAMAGED as e:
            raise ValueError(f"{path}: not a file of strips, or damaged ({e}); delete it and render again") from e
        return HouseStrips(Path(path).stem, classes, **arrays)


def shell_class(owner: str) -> str:
    """'wall' of 'kitchen_1/wall_3', 'door' of 'door_2/leaf', 'stairs', 'outdoor'."""
    place, piece = owner.split("/")
    if piece.split("_")[0] in SHELL:
        return piece.split("_")[0]
    return place.rstrip("0123456789").rstrip("_")


def all_classes(catalogue: Catalogue) -> tuple[str, ...]:
    """Every class that any house may show, sorted: the catalogue's objects and the parts of the shell."""
    return tuple(sorted({*catalogue.classes, *OPENING_KINDS, *SHELL}))


def look(world: World, classes: Sequence[str]) -> HouseStrips:
    """Draw the nodes of a world, and label what is seen."""
    object_class, room_of_id = ids_to_labels(world.house, classes)
    rgb, share, rooms, depths, room = [], [], [], [], []
    rows = margin()
    for node in range(len(world.graph.positions)):
        panorama = world.panorama(node)
        ids, depth = panorama.equirect_ids(EQUIRECT)[rows], panorama.equirect_depth(EQUIRECT)[rows]
        labels = cell_labels(ids, np.minimum(depth, FARTHEST), object_class, room_of_id, len(classes))
        rgb.append(strip_of(panorama))
        share.append(labels[0])
        rooms.append(labels[1])
        depths.append(labels[2])
        room.append(ROOM_KINDS.index(world.house.room_by_id[str(world.graph.room_of_node[node])].kind))
    return HouseStrips(
        world.house.name,
        tuple(classes),
        np.stack(rgb),
        np.stack(share),
        np.stack(rooms),
        np.stack(depths),
        np.array(room, dtype=np.int8),
    )


def ids_to_labels(house: House, classes: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """(m + 1,) class and (m + 1,) room kind of each instance id, -1 where there is none; id 0 is nothing."""
    number = {c: i for i, c in enumerate(classes)}
    kind = {r.id: ROOM_KINDS.index(r.kind) for r in house.rooms}
    object_class, room = [-1], [-1]
    for owner in owners(house):
        placed = house.placement_by_id.get(owner)
        object_class.append(number.get(placed.object_class if placed else shell_class(owner), -1))
        room.append(kind.get(placed.room if placed else owner.split("/")[0], -1))
    return np.array(object_class), np.array(room)


@functools.cache
def _cells() -> np.ndarray:
    """(192, 576) index of the cell each pixel is in."""
    rows, columns = np.indices((HEIGHT, WIDTH)) // CELL
    return rows * STRIP_COLUMNS + columns


def cell_labels(
    ids: np.ndarray, depth: np.ndarray, object_class: np.ndarray, room: np.ndarray, classes: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Labels of one strip.

    Args:
      ids: (192, 576) int instance ids.
      depth: (192, 576) metres along the ray.
      object_class, room: of each id, as `ids_to_labels` gives them.
      classes: C.

    Returns:
      share (12, 36, C) uint8, rooms (12, 36) int8, log_depth (12, 36) float16; see HouseStrips.
    """
    cells, n = _cells(), STRIP_ROWS * STRIP_COLUMNS
    seen = object_class[ids]
    share = _count(cells, seen, n, classes) / CELL**2  # (432, C)
    kinds = _count(cells, room[ids], n, len(ROOM_KINDS))  # (432, kinds)
    most = np.where(kinds.max(1) > 0, kinds.argmax(1), -1)
    logs = np.log(np.maximum(depth, NEAREST)).reshape(STRIP_ROWS, CELL, STRIP_COLUMNS, CELL).mean((1, 3))
    return (
        np.ceil(share * 255).astype(np.uint8).reshape(STRIP_ROWS, STRIP_COLUMNS, classes),
        most.astype(np.int8).reshape(STRIP_ROWS, STRIP_COLUMNS),
        logs.astype(np.float16),
    )


def _count(cells: np.ndarray, values: np.ndarray, n: int, size: int) -> np.ndarray:
    """(n, size) how many pixels of each cell have each value; negative values are not counted."""
    known = values >= 0
    return np.bincount(cells[known] * size + values[known], minlength=n * size).reshape(n, size)


def visible_in_views(share: np.ndarray) -> np.ndarray:
    """(n, 12, 36, C) uint8 shares of cells -> (n, 36, C) bool, classes that cover VISIBLE of a view."""
    n, classes = len(share), share.shape[-1]
    flat = share.reshape(n, STRIP_ROWS * STRIP_COLUMNS, classes).astype(np.float32) / 255
    return np.einsum("vc,nck->nvk", windows().reshape(36, -1), flat, optimize=True) >= VISIBLE

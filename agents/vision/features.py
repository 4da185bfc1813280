"""From panoramas to the 36 x D features per node of appendix D.1, and their files; FeatureBank: features of many worlds
in one tensor, by Sight, and of pictures that were taken at another time; and the contents of a strip as labels for
training: objects, rooms and distances per cell of the feature map.

A feature file belongs to one house, one encoder and one way of drawing, and says so: `<folder>/<encoder digest, 16
letters>/<drawing>/<house>.safetensors`. Row k of a node is view k of embodied.interface: turn
k % 12 (counter-clockwise from +x), tilt k // 12 - 1.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch

from embodied.agents.common.weights import load_tensors, save_tensors
from embodied.agents.vision.config import PLAIN, drawing
from embodied.agents.vision.encoder import CELL, HEIGHT, STRIP_COLUMNS, STRIP_ROWS, WIDTH, Encoder, windows
from embodied.assets.cache import DAMAGED, atomic_path
from embodied.assets.decoding import open_arrays
from embodied.assets.records import ROOM_KINDS
from embodied.house.house import OPENING_KINDS, House
from embodied.interface import VIEWS, Sight, Viewpoint, is_picture, viewpoint
from embodied.render.panorama import Panorama
from embodied.render.pictures import PictureSettings
from embodied.scene.house_meshes import owners

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.world import World

FEATURES_FORMAT = "embodied-features-2"
EQUIRECT = 288
"""Height of the equirect that the strip is cut from: 1.6 pixels per degree."""


def strip_of(panorama: Panorama) -> np.ndarray:
    """(192, 576, 3) uint8: what the 36 views see, in one picture (see vision.strip)."""
    return panorama.equirect(EQUIRECT)[margin()]


def margin() -> slice:
    """Rows of the equirect that belong to the strip."""
    above = (EQUIRECT - HEIGHT) // 2
    return slice(above, above + HEIGHT)


def encode_panoramas(encoder: Encoder, panoramas: Iterable[Panorama]) -> np.ndarray:
    """(n, 36, D) float16 features of panoramas, in order."""
    return encode_strips(encoder, map(strip_of, panoramas))


def encode_strips(encoder: Encoder, strips: Iterable[np.ndarray]) -> np.ndarray:
    """(n, 36, D) float16 features of strips, in order."""
    out, left = list[np.ndarray](), iter(strips)
    while group := list(itertools.islice(left, 8)):
        out.append(encoder.encode_strips(np.stack(group)))
    return np.concatenate(out).astype(np.float16)


def feature_path(folder: Path, digest: str, world: str, pictures: PictureSettings = PLAIN) -> Path:
    """The file in which the features of a world by an encoder, from pictures drawn so, are kept."""
    return Path(folder) / digest[:16] / drawing(pictures) / f"{world}.safetensors"


def save_features(
    path: Path, features: np.ndarray, encoder: Encoder, source: str, pictures: PictureSettings = PLAIN
) -> None:
    """Write (n, 36, D) features; `source` is the digest of what they were computed from (the house)."""
    about = {"format": FEATURES_FORMAT, "encoder": encoder.digest, "source": source, "drawing": drawing(pictures)}
    tensor = torch.from_numpy(np.ascontiguousarray(features, dtype=np.float16))
    save_tensors(Path(path), {"features": tensor}, about)


def load_features(path: Path, *, encoder: str, source: str, pictures: PictureSettings) -> np.ndarray:
    """(n, 36, D) float16 features by the encoder of a digest, of the house of a digest, from pictures drawn so.

    Raises:
      FileNotFoundError: there is no such file.
      ValueError: truncated, changed, of another format, encoder, house or way of drawing.
    """
    picture_kind = "" if pictures.word == PLAIN.word else f" --pictures {pictures.word}"
    remedy = f"make it with `embodied features{picture_kind}`"
    tensors, about = load_tensors(Path(path), FEATURES_FORMAT, remedy)
    for name, expected in {"encoder": encoder, "source": source, "drawing": drawing(pictures)}.items():
        if about[name] != expected:
            raise ValueError(f"{path}: made from {name} {about[name][:12]}, expected {expected[:12]}; {remedy}")
    return tensors["features"].numpy()


def has_features(path: Path, encoder: Encoder, source: str, pictures: PictureSettings) -> bool:
    """True if a file holds the features of the house with the digest `source`; False: missing or damaged."""
    try:
        load_features(path, encoder=encoder.digest, source=source, pictures=pictures)
        return True
    except (FileNotFoundError, ValueError):
        return False


class FeatureBank:
    """A FeatureSource over (36, D) feature sets that are already computed, as one tensor on a device."""

    def __init__(
        self, worlds: Mapping[str, np.ndarray], digest: str, live: Callable[[Sight], np.ndarray] | None = None
    ) -> None:
        """Args:
          worlds: world name -> (nodes, 36, D) features, float16 or float32.
          digest: of the encoder that agents must have learned from to be shown them.
          live: makes those (36, D) of a house with other doors closed, when they are first asked for.

        Raises:
          ValueError: another shape, or no world.
        """
        self._spans, self._table = stacked(worlds)
        self._shown: int | None = None
        self._first = len(self._table)
        self._live, self._other_doors = live, dict[Viewpoint, int]()
        self.size, self.digest = self._table.shape[2], digest

    def to(self, device: torch.device | str) -> FeatureBank:
        """The bank on another device; this one stays."""
        return self._with(_table=self._table.to(device))

    def with_goal_images(self, pictures: Mapping[str, np.ndarray]) -> FeatureBank:
        """The bank with other features for pictures (embodied.interface.is_picture): of the same worlds, taken at
        another time."""
        spans, table = stacked(pictures)
        if spans != self._spans or table.shape[2] != self.size:
            raise ValueError("pictures must be of the same worlds, with as many nodes and features")
        both = torch.cat([self._table, table.to(self._table.device)])
        return self._with(_table=both, _shown=len(self._table), _first=len(both))

    def blind(self) -> FeatureBank:
        """The bank in which everything is black: all features are zero."""
        nothing = np.zeros((VIEWS, self.size), np.float32)
        return self._with(_table=torch.zeros_like(self._table), _live=lambda sight: nothing, _other_doors={})

    def features(self, sight: Sight) -> np.ndarray:
        """(36, D) float32, in absolute order."""
        return self._table[self._row(sight)].cpu().numpy()

    def gather(self, sights: Sequence[Sight | None]) -> torch.Tensor:
        """(n, 36, D) features of several sights, zeros for None."""
        rows = torch.tensor([0 if s is None else self._row(s) for s in sights], device=self._table.device)
        known = torch.tensor([s is not None for s in sights], device=self._table.device)
        return self._table[rows] * known[:, None, None]

    def _with(self, **changed: object) -> FeatureBank:
        other = object.__new__(FeatureBank)
        other.__dict__.update(self.__dict__, **changed)
        return other

    def _row(self, sight: Sight) -> int:
        at = viewpoint(sight)
        first, end = self._spans.get(at.world, (0, 0))
        if at.world not in self._spans and self._live is not None:
            if at not in self._other_doors:
                row = self._other_doors[at] = self._first + len(self._other_doors)
                if row >= len(self._table):  # twice as many: copied seldom
                    self._table = torch.cat([self._table, torch.zeros_like(self._table)])
                self._table[row] = torch.from_numpy(self._live(sight)).to(self._table)
            return self._other_doors[at]
        if not 0 <= at.node < end - first:
            raise KeyError(f"no features of node {at.node} of world {at.world!r}; make them with `embodied features`")
        return first + at.node + (self._shown if self._shown is not None and is_picture(sight) else 0)


def stacked(worlds: Mapping[str, np.ndarray]) -> tuple[dict[str, tuple[int, int]], torch.Tensor]:
    """Features (nodes, 36, D) of worlds below each other: world to its first row and the one after its last, and
    (rows, 36, D) float32.

    Raises:
      ValueError: another shape, or no world.
    """
    shapes, spans, count = {name: worlds[name].shape for name in sorted(worlds)}, dict[str, tuple[int, int]](), 0
    sizes = {s[1:] for s in shapes.values()}
    if len(sizes) != 1 or any(len(s) != 3 or s[1] != VIEWS for s in shapes.values()):
        raise ValueError(f"features must all be (nodes, {VIEWS}, D) with one D, got {shapes}")
    for name, shape in shapes.items():
        spans[name] = count, count + shape[0]
        count += shape[0]
    table = np.zeros((count, *sizes.pop()), np.float32)
    for name, (first, end) in spans.items():
        table[first:end] = worlds[name]
    return spans, torch.from_numpy(table)


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
    looks, rows = [], margin()
    for node in range(len(world.graph.positions)):
        panorama = world.panorama(node)
        ids, depth = panorama.equirect_ids(EQUIRECT)[rows], panorama.equirect_depth(EQUIRECT)[rows]
        labels = cell_labels(ids, np.minimum(depth, FARTHEST), object_class, room_of_id, len(classes))
        room = ROOM_KINDS.index(world.house.room_by_id[str(world.graph.room_of_node[node])].kind)
        looks.append((strip_of(panorama), *labels, np.int8(room)))
    return HouseStrips(world.house.name, tuple(classes), *map(np.stack, zip(*looks, strict=True)))


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

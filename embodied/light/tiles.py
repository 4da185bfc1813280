"""Pages of a house as what takes light: places and normals under their luxels, in tiles that change one by one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np

from embodied.light.pages.cover import sources
from embodied.light.pages.files import Bake, Ingredients
from embodied.light.tracing.rays import rays_among
from embodied.scene.lit_pages import LitMesh

TILE = 16
"""Luxels along the sides of the tiles in which pages change."""
HALF_TILE = TILE // 2
SAMPLES = HALF_TILE * HALF_TILE
METALLIC = 77
"""Metallic share, times 255, from which on a page wears what the face mirrors, which does not change."""

Tile: TypeAlias = tuple[int, int, int]
"""Page, row and column of a tile."""


@dataclass(frozen=True, eq=False)
class Receiver:
    """A page of the house as something that things hide light from; in luxels."""

    position: np.ndarray
    """(h, w, 3) float32, of the nearest covered luxel where none is."""
    normal: np.ndarray
    takes: np.ndarray
    """(h, w) bool: its light may change."""
    mesh: np.ndarray
    """(h, w) int32: which of `meshes` a luxel is of; -1 where it is of none."""
    meshes: tuple[LitMesh, ...]
    """Of the page."""
    low: np.ndarray
    high: np.ndarray
    """(rows, columns, 3) boxes of its tiles; empty ones are far away."""
    samples: np.ndarray
    sample_normals: np.ndarray
    """(rows, columns, SAMPLES, 3) float32 of every second luxel of its tiles, row by row."""
    gain: np.ndarray
    """(h, w, 3)."""
    held: Ingredients
    fineness: int

    def near(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """(k, 2) row and column of the tiles that meet a box."""
        return np.argwhere(((self.low <= high) & (self.high >= low)).all(-1))

    def texels(self, tile: Sequence[int]) -> tuple[np.ndarray, np.ndarray, tuple[slice, slice]]:
        """(n, 3) positions and normals of the texels of a tile, and where on the page they are."""
        at = luxels_in(tile)
        position = self.position[at]
        h, w = position.shape[:2]
        size = (w * self.fineness, h * self.fineness)
        fine = cv2.resize(position, size, interpolation=cv2.INTER_LINEAR)
        normal = cv2.resize(self.normal[at], size, interpolation=cv2.INTER_NEAREST)
        rows, columns = (slice(s.start * self.fineness, s.start * self.fineness + n) for s, n in zip(at, size[::-1]))
        return fine.reshape(-1, 3), normal.reshape(-1, 3), (rows, columns)


def read_receiver(bake: Bake, page: int) -> Receiver:
    """Page `page` of a bake."""
    held = bake.ingredients(page)
    h, w = held.soft.shape[:2]
    whole = [(m, g) for m, g in zip(bake.lit.meshes, bake.gloss) if m.page == page and len(m.faces)]
    corners = np.concatenate([m.vertices[m.faces] for m, _ in whole])
    flat = np.concatenate([m.uv[m.faces] for m, _ in whole]) * np.array([w, h], np.float32)
    dull = np.concatenate([g[:, 2] < METALLIC if g is not None else np.zeros(len(m.faces), bool) for m, g in whole])
    layout = np.concatenate([flat, np.zeros((*flat.shape[:2], 1), np.float32)], axis=-1)
    row, column = np.divmod(np.arange(h * w), w)
    above = np.stack([column + 0.5, row + 0.5, np.ones(h * w)], axis=1).astype(np.float32)
    face, _, u, v = rays_among(layout)(above, np.tile(np.array([0, 0, -1], np.float32), (h * w, 1)))
    index = np.flatnonzero(face >= 0)
    face, weights = face[index], np.stack([1 - u - v, u, v], axis=1)[index]
    position = np.einsum("nk,nkc->nc", weights, corners[face])
    sides = corners[:, 1:] - corners[:, :1]
    normal = np.cross(sides[:, 0], sides[:, 1])
    normal = (normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12))[face]
    shown_by = sources(index, (h, w))
    takes = np.zeros(h * w, bool)
    takes[index] = dull[face]
    if held.glow.size:
        takes &= held.glow.reshape(-1, 3).max(1) == 0
    mesh = np.full(h * w, -1, np.int32)
    mesh[index] = np.repeat(np.arange(len(whole)), [len(m.faces) for m, _ in whole])[face]
    where, gain = position[shown_by], bake.exposure.near(position)[shown_by]
    low, high = _tiles_of(where.reshape(h, w, 3), takes.reshape(h, w))
    shape = lambda a: a.reshape(h, w, 3).astype(np.float32)
    fineness = held.albedo.shape[0] // h
    return Receiver(
        shape(where),
        shape(normal[shown_by]),
        takes.reshape(h, w),
        mesh.reshape(h, w),
        tuple(m for m, _ in whole),
        low,
        high,
        sampled(shape(where)),
        sampled(shape(normal[shown_by])),
        shape(gain),
        held,
        fineness,
    )


def blocks_of(tiles: np.ndarray) -> list[np.ndarray]:
    """Tiles (k, 2) in sets whose rectangles they fill at least by half."""
    low, high = tiles.min(0), tiles.max(0) + 1
    if 2 * len(tiles) >= (high - low).prod():
        return [tiles]
    axis = int(np.argmax(high - low))
    order = tiles[np.argsort(tiles[:, axis], kind="stable")]
    gaps = np.diff(order[:, axis])
    cut = int(np.argmax(gaps)) + 1 if gaps.max() > 1 else int(np.searchsorted(order[:, axis], (low + high)[axis] / 2))
    return [*blocks_of(order[:cut]), *blocks_of(order[cut:])]


def luxels_in(tile: Sequence[int]) -> tuple[slice, slice]:
    return slice(tile[0] * TILE, (tile[0] + 1) * TILE), slice(tile[1] * TILE, (tile[1] + 1) * TILE)


def sampled(a: np.ndarray) -> np.ndarray:
    """(rows, columns, SAMPLES, 3) means of two by two luxels of a page (h, w, 3), tile by tile."""
    h, w = a.shape[:2]
    rows, columns = -(-h // TILE), -(-w // TILE)
    whole = cv2.copyMakeBorder(a, 0, rows * TILE - h, 0, columns * TILE - w, cv2.BORDER_REPLICATE)
    small = cv2.resize(whole, (columns * HALF_TILE, rows * HALF_TILE), interpolation=cv2.INTER_AREA)
    return small.reshape(rows, HALF_TILE, columns, HALF_TILE, 3).swapaxes(1, 2).reshape(rows, columns, SAMPLES, 3)


def _tiles_of(position: np.ndarray, takes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes of the tiles of a page (h, w, 3)."""
    h, w = takes.shape
    rows, columns = -(-h // TILE), -(-w // TILE)
    low, high = np.full((rows * TILE, columns * TILE, 3), 1e9), np.full((rows * TILE, columns * TILE, 3), -1e9)
    low[:h, :w][takes], high[:h, :w][takes] = position[takes], position[takes]
    cut = lambda a: a.reshape(rows, TILE, columns, TILE, 3)
    return cut(low).min((1, 3)).astype(np.float32), cut(high).max((1, 3)).astype(np.float32)

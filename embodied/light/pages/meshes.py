"""Meshes that renderers draw of an atlas: one mesh per owner and page."""

from __future__ import annotations

import numpy as np

from embodied.assets.records import DETAILS, Finish
from embodied.light.pages.atlas import Atlas, Page
from embodied.light.pages.unwrap import areas_of, told_apart
from embodied.scene.lit_pages import LitMesh


def meshes_of(atlas: Atlas, first: int) -> tuple[list[LitMesh], list[np.ndarray]]:
    """One mesh per owner and page, corners welded, thin faces listed twice, and the gloss of its faces.

    Args:
      first: number of the atlas's first page.

    Returns:
      Meshes, and for each (m, 4) uint8: roughness, specular and metallic times 255, and detail (see gloss_of and
      detail_of).
    """
    out, shine = [], []
    for number, page in enumerate(atlas.pages, first):
        uv = page.luxels / np.array([page.width, page.height], np.float32)
        gloss = np.array([gloss_of(f) for f in page.finishes], np.uint8).reshape(-1, 3)
        kinds, areas = np.column_stack([gloss[page.finish], detail_of(page)]), areas_of(page.corners)
        for o in np.unique(page.owner):
            owned = np.nonzero(page.owner == o)[0]
            both = np.concatenate([page.corners[owned], uv[owned]], axis=-1).reshape(-1, 5)
            corner, index = welded(np.round(both, 5))
            faces = index.reshape(-1, 3).astype(np.int32)
            thin = page.thin[owned]
            faces = np.concatenate([faces, faces[thin][:, ::-1]])
            real = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
            alpha = (
                min(f.color[3] for f in (page.finishes[k] for k in np.unique(page.finish[owned])))
                if page.glass
                else 1.0
            )
            kind, area = kinds[owned], areas[owned]
            mean = tuple(((kind[:, :2] * area[:, None]).sum(0) / max(area.sum(), 1e-12) / 255).round(3).tolist())
            whose = atlas.owners[o], atlas.kinds[o], atlas.rooms[o]
            xyz, at = both[corner, :3].astype(np.float32), both[corner, 3:].astype(np.float32)
            out.append(LitMesh(*whose, number, xyz, faces[real], at, float(alpha), mean))
            shine.append(np.concatenate([kind, kind[thin]])[real])
    return out, shine


def welded(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(k,) first occurrence of each different row of (n, c) numbers, in no order, and (n,) which of these each row is.

    Rows are sorted by a hash (odd multiplier and shifts, as in SplitMix64): one sort in place of one for each column.
    Should two different rows have one hash, some row may occur twice among the k.
    """
    mixed = np.zeros(len(rows), np.uint64)
    for column in (rows.astype(np.float64) + 0.0).view(np.uint64).T:  # + 0.0: -0 is 0
        mixed = (mixed ^ column) * np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(29)
    return told_apart(rows, np.argsort(mixed, kind="stable"))


def gloss_of(finish: Finish) -> tuple[int, int, int]:
    """Roughness, specular and metallic times 255; a mirror is smooth metal."""
    if finish.mirror:
        return 4, 255, 255
    rough, specular, metal = (min(max(x, 0.0), 1.0) for x in (finish.roughness, finish.specular, finish.metallic))
    return round(255 * rough), round(255 * specular), round(255 * metal)


def detail_of(page: Page) -> np.ndarray:
    """(m,) uint8 of the faces: number of what they show from nearby, from 1 on, and 16 times that of the axis along
    which their texture's u runs, 3 for none; 0 for smooth ones."""
    number = np.array([1 + DETAILS.index(f.detail) if f.detail else 0 for f in page.finishes], np.uint8)
    corners, uv = page.corners, page.uv.astype(np.float64)
    sides, turns = corners[:, 1:] - corners[:, :1], uv[:, 1:] - uv[:, :1]
    area = turns[:, 0, 0] * turns[:, 1, 1] - turns[:, 0, 1] * turns[:, 1, 0]
    along = sides[:, 0] * turns[:, 1, 1, None] - sides[:, 1] * turns[:, 0, 1, None]
    axis = np.where(np.abs(area) > 1e-12, np.abs(along).argmax(1), 3)
    detail = number[page.finish]
    return np.where(detail > 0, detail + 16 * axis, 0).astype(np.uint8)

"""Whole views before a judge that has seen photographs: how far are its features of ours from those of traced ones?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from assets.cache import digest, write_bytes
from assets.closure import code_digest
from embodied.bench.light import VFOV, viewpoints
from embodied.light.baking import bake
from embodied.light.reference import Tracer
from embodied.render.camera import camera_at

if TYPE_CHECKING:
    from embodied.world import World

SIZE = (224, 336)
"""Height and width of a view."""
RAYS = 32
"""Per pixel of the traced ones."""
PITCH = -0.1
"""Radians by which views look up."""


@dataclass(frozen=True, eq=False)
class ViewPair:
    """One view twice."""

    house: str
    drawn: np.ndarray
    """(h, w, 3) uint8, as the world draws it."""
    traced: np.ndarray
    """The same size, by the path tracer alone."""


def kept_pair(world: World, folder: Path) -> ViewPair:
    """The longest view of the largest room of a house; each half from `folder` if the same code has put it there."""
    _, eye, yaw = viewpoints(world.house, world.catalogue, 1)[0]
    light = bake(world.house, world.catalogue, world.cache, world.pictures.lit_by or "fast")

    def drawn() -> np.ndarray:
        return world.renderer.view(eye, yaw, PITCH, VFOV, SIZE).rgb

    def traced() -> np.ndarray:
        camera = camera_at(eye, yaw, PITCH, VFOV)
        tracer = Tracer(light, world.house, quality="reference", rays=RAYS)
        return tracer.picture(eye, camera.forward, camera.up, VFOV, SIZE)[0]

    stem, code = folder / world.house.name, code_digest(__name__)
    return ViewPair(
        world.name,
        _kept(Path(f"{stem}_drawn_{digest(world.fingerprint, code)[:16]}.png"), drawn),
        _kept(Path(f"{stem}_traced_{digest(light.manifest['key'], code)[:16]}.png"), traced),
    )


def _kept(path: Path, draw: Callable[[], np.ndarray]) -> np.ndarray:
    if not path.exists():
        write_bytes(path, cv2.imencode(".png", draw()[..., ::-1])[1].tobytes())
    return cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB)


def likeness(pairs: Sequence[ViewPair], features: Callable[[np.ndarray], np.ndarray]) -> dict[str, float | int | None]:
    """Cosine distances (0: the same, 1: nothing in common) of a judge's features, means over `pairs`.

    Args:
      features: from (n, h, w, 3) uint8 to (n, k).

    Returns:
      'views'; 'own', from each view to the path tracer's picture of it; 'others', from each traced picture to those of
      the other houses, which says how much an 'own' is; 'nearest', the share of views that are nearer to their own
      traced picture than to all others; None where there are too few.
    """
    if not pairs:
        return {"views": 0, "own": None, "others": None, "nearest": None}
    drawn, traced = (_unit(features(np.stack([getattr(p, way) for p in pairs]))) for way in ("drawn", "traced"))
    away, among = 1 - drawn @ traced.T, 1 - traced @ traced.T
    many = len(pairs) > 1
    return {
        "views": len(pairs),
        "own": float(np.diag(away).mean()),
        "others": float(among[~np.eye(len(pairs), dtype=bool)].mean()) if many else None,
        "nearest": float((away.argmin(1) == np.arange(len(pairs))).mean()) if many else None,
    }


def write_pairs(pairs: Sequence[ViewPair], path: Path) -> None:
    """One sheet (JPEG): every view as drawn, and right of it as traced; two of them in a row."""
    cells = [np.concatenate([p.drawn, p.traced], axis=1) for p in pairs]
    cells += [np.full_like(cells[0], 255)] * (-len(cells) % 2)
    picture = np.concatenate([np.concatenate(cells[k : k + 2], axis=1) for k in range(0, len(cells), 2)])
    write_bytes(path, cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes())


def _unit(x: np.ndarray) -> np.ndarray:
    return x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-9)

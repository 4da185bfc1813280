"""Pictures of the skyboxes that `embodied export matterport` writes, drawn as the Matterport3D simulator draws them.

A viewpoint's skybox is one picture of six square tiles beside each other. `TILES` says which of our cube faces each
tile is and how often it is turned; nothing is resampled, so that a face survives the way out and back.
"""

from __future__ import annotations

import functools
from pathlib import Path

import cv2
import numpy as np

from embodied.geometry import yaw_of_heading
from embodied.render.panorama import Panorama, ray_stretch

TILES = ((3, 0), (5, 1), (2, 3), (4, 1), (0, 1), (1, 2))
"""Face and quarter turns (counter-clockwise) of each tile."""
DEPTH_UNITS = 4000.0
"""Depth is kept in quarters of a millimetre; 0 where nothing is."""
RGB, DEPTH = "{}_skybox_small.jpg", "{}_skybox_depth_small.png"
FACES = "{}_skybox{}_sami.jpg"
"""The first release reads its tiles from six files."""


def skybox_folder(dataset: str, scan: str) -> Path:
    return Path(dataset) / scan / "matterport_skybox_images"


def tiles_of(faces: np.ndarray) -> np.ndarray:
    """(6, s, s, ...) tiles of a skybox from our faces."""
    return np.stack([np.rot90(faces[face], turns) for face, turns in TILES])


def faces_of(tiles: np.ndarray) -> np.ndarray:
    """(6, s, s, ...) faces in our order from the tiles of a skybox."""
    faces = [tiles[0]] * 6
    for tile, (face, turns) in zip(tiles, TILES, strict=True):
        faces[face] = np.rot90(tile, -turns)
    return np.stack(faces)


class Skyboxes:
    """The skyboxes of a folder, the last used of them in memory."""

    def __init__(self, dataset: str, kept: int, *, depth: bool, apart: bool = False) -> None:
        """Args:
        dataset: folder of `<scan>/matterport_skybox_images`.
        kept: how many to keep in memory.
        depth: whether depth is wanted.
        apart: read the six files of the first release.
        """
        self.dataset, self.depth, self.apart = dataset, depth, apart
        self.panorama = functools.lru_cache(maxsize=max(1, kept))(self._load)

    def _load(self, scan: str, viewpoint: str) -> Panorama:
        """A skybox as a Panorama whose colours are blue, green, red.

        Raises:
          ValueError: a picture is missing, as there.
        """
        folder = skybox_folder(self.dataset, scan)
        if self.apart:
            tiles = np.stack([_read(folder / FACES.format(viewpoint, k), cv2.IMREAD_COLOR) for k in range(6)])
        else:
            tiles = _apart(_read(folder / RGB.format(viewpoint), cv2.IMREAD_COLOR))
        rgb = faces_of(tiles)
        size = rgb.shape[1]
        units = np.zeros((6, size, size))
        if self.depth:
            units = faces_of(_apart(_read(folder / DEPTH.format(viewpoint), cv2.IMREAD_ANYDEPTH))).astype(float)
        metres = units / DEPTH_UNITS
        along = np.where(metres > 0, metres / ray_stretch(size), np.inf).astype(np.float32)
        return Panorama(rgb, along, np.zeros((6, size, size), np.int32))

    def rgb(
        self, scan: str, viewpoint: str, heading: float, elevation: float, vfov: float, size: tuple[int, int]
    ) -> np.ndarray:
        """(h, w, 3) uint8, blue, green, red: the picture of a pose; size is (height, width)."""
        return self.panorama(scan, viewpoint).view_rgb(float(yaw_of_heading(heading)), elevation, vfov, size)

    def metres(
        self, scan: str, viewpoint: str, heading: float, elevation: float, vfov: float, size: tuple[int, int]
    ) -> np.ndarray:
        """(h, w, 1) uint16, quarters of a millimetre along the optical axis; 0 where nothing is."""
        depth = self.panorama(scan, viewpoint).view(float(yaw_of_heading(heading)), elevation, vfov, size)[1]
        units = np.where(np.isfinite(depth), np.minimum(np.rint(depth * DEPTH_UNITS), 65535), 0)
        return units.astype(np.uint16)[..., None]


def _apart(strip: np.ndarray) -> np.ndarray:
    """(6, s, s, ...) tiles of a strip."""
    return np.stack(np.split(strip, 6, axis=1))


def _read(path: Path, mode: int) -> np.ndarray:
    picture = cv2.imread(str(path), mode)
    if picture is None:
        raise ValueError(
            f"MatterSim: Could not open skybox files at: {path}; write them with `embodied export matterport`, "
            "or call setRenderingEnabled(False)"
        )
    return picture

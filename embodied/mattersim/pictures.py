"""Pictures of the skyboxes that `embodied export matterport` writes, drawn as the Matterport3D simulator draws them.

A viewpoint's skybox is one picture of six square tiles beside each other. `TILES` says which of our cube faces each
tile is and how often it is turned; nothing is resampled, so that a face survives the way out and back.
"""

from __future__ import annotations

import functools
from pathlib import Path

import cv2
import numpy as np

from assets.archives import read_picture
from embodied.geometry import yaw_of_heading
from embodied.render.panorama import (
    PixelGrid,
    checked,
    padded_nearness,
    padded_rgba,
    perspective_grid,
    ray_stretch,
    resampled_depth,
    resampled_rgb,
)

TILES = ((3, 0), (5, 1), (2, 3), (4, 1), (0, 1), (1, 2))
"""Face and quarter turns (counter-clockwise) of each tile."""
WHERE = {face: (tile, turns) for tile, (face, turns) in enumerate(TILES)}
"""Tile and quarter turns of each face."""
TURNED_BACK = {1: cv2.ROTATE_90_CLOCKWISE, 2: cv2.ROTATE_180, 3: cv2.ROTATE_90_COUNTERCLOCKWISE}
"""What undoes so many quarter turns."""
LARGE = 1e30
"""More than any depth or its inverse."""
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


def face_of(strip: np.ndarray, face: int) -> np.ndarray:
    """One of our faces, (s, s, ...), from the six tiles of a skybox beside each other.

    Raises:
      ValueError: the tiles are not square.
    """
    height, width = strip.shape[:2]
    if width != 6 * height:
        raise ValueError(f"MatterSim: a skybox is six squares beside each other, got {width} x {height} pixels")
    tile, turns = WHERE[face]
    picture = strip[:, tile * height : (tile + 1) * height]
    return cv2.rotate(picture, TURNED_BACK[turns]) if turns else picture


class Skyboxes:
    """The skyboxes of a folder, the last used of them in memory."""

    def __init__(self, dataset: str, kept: int, *, apart: bool = False) -> None:
        """Args:
        dataset: folder of `<scan>/matterport_skybox_images`.
        kept: how many to keep in memory.
        apart: read the six files of the first release.
        """
        self.dataset, self.apart = dataset, apart
        self.colours = functools.lru_cache(maxsize=max(1, kept))(self._colours)
        self.nearness = functools.lru_cache(maxsize=max(1, kept))(self._nearness)

    def _colours(self, scan: str, viewpoint: str) -> np.ndarray:
        """`padded_rgba` of a skybox, but blue, green, red.

        Raises:
          ValueError: a picture is missing, as there.
        """
        folder = skybox_folder(self.dataset, scan)
        if self.apart:
            strip = np.concatenate([_read(folder / FACES.format(viewpoint, k), cv2.IMREAD_COLOR) for k in range(6)], 1)
        else:
            strip = _read(folder / RGB.format(viewpoint), cv2.IMREAD_COLOR)
        return padded_rgba(len(strip), lambda k, to: cv2.cvtColor(face_of(strip, k), cv2.COLOR_RGB2RGBA, dst=to))

    def _nearness(self, scan: str, viewpoint: str) -> np.ndarray:
        """`padded_nearness` of a skybox for depth in DEPTH_UNITS.

        Raises:
          ValueError: the picture is missing.
        """
        units = _read(skybox_folder(self.dataset, scan) / DEPTH.format(viewpoint), cv2.IMREAD_ANYDEPTH)
        stretch = ray_stretch(len(units))

        def write(k: int, to: np.ndarray) -> None:
            with np.errstate(divide="ignore"):
                np.divide(stretch, face_of(units, k), out=to, dtype=np.float32)
            cv2.threshold(to, LARGE, 0.0, cv2.THRESH_TOZERO_INV, dst=to)

        return padded_nearness(len(units), write)

    def rgb(
        self, scan: str, viewpoint: str, heading: float, elevation: float, vfov: float, size: tuple[int, int]
    ) -> np.ndarray:
        """(h, w, 3) uint8, blue, green, red: the picture of a pose; size is (height, width)."""
        padded = self.colours(scan, viewpoint)
        return resampled_rgb(padded, _grid(padded, heading, elevation, vfov, size))

    def metres(
        self, scan: str, viewpoint: str, heading: float, elevation: float, vfov: float, size: tuple[int, int]
    ) -> np.ndarray:
        """(h, w, 1) uint16, quarters of a millimetre along the optical axis; 0 where nothing is."""
        padded = self.nearness(scan, viewpoint)
        units = resampled_depth(padded, _grid(padded, heading, elevation, vfov, size))
        cv2.threshold(units, LARGE, 0.0, cv2.THRESH_TOZERO_INV, dst=units)
        return cv2.add(units, 0.0, dtype=cv2.CV_16U)[..., None]


def _grid(padded: np.ndarray, heading: float, elevation: float, vfov: float, size: tuple[int, int]) -> PixelGrid:
    return perspective_grid(padded.shape[1] - 2, float(yaw_of_heading(heading)), elevation, vfov, *checked(vfov, size))


def _read(path: Path, mode: int) -> np.ndarray:
    picture = read_picture(path, mode)
    if picture is None:
        raise ValueError(
            f"MatterSim: Could not open skybox files at: {path}; write them with `embodied export matterport`, "
            "or call setRenderingEnabled(False)"
        )
    return picture

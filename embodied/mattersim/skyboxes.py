"""Panoramas as the skyboxes of Matterport3DSimulator: our six faces, turned where it wants them turned.

Per viewpoint: `<id>_skybox_small.jpg` (six tiles beside each other) and `<id>_skybox_depth_small.png` (16 bits,
quarters of a millimetre along the ray) for the simulator of today, `<id>_skybox{0..5}_sami.jpg` for its first release.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from embodied.assets.cache import write_bytes
from embodied.mattersim.pictures import DEPTH, DEPTH_UNITS, RGB, tiles_of
from embodied.render.panorama import Panorama, ray_stretch
from embodied.render.panorama_file import PanoramaFile

FACES = "{}_skybox{}_sami.jpg"
"""The first release reads its tiles from six files."""
QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 95, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
"""About 47 dB for our pictures."""
PACKING = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP]
"""Depth in differences from row to row is smaller, and read and written in two thirds of the time."""


def drawn(panoramas: Path) -> Path:
    """The panorama file of a house, which has to be there.

    Raises:
      ValueError: there are no panoramas.
    """
    if not Path(panoramas).exists():
        raise ValueError(
            f"{panoramas} does not exist; draw the panoramas first: run the command that built the data set "
            "once more, with --pictures fast"
        )
    return Path(panoramas)


def write_skyboxes(panoramas: Path, ids: Sequence[str], folder: Path) -> list[Path]:
    """Write the skyboxes of a house; returns their files.

    Args:
      panoramas: the house's panorama file, which has to be there (`drawn`).
      ids: viewpoint id of each node.
    """
    with PanoramaFile(panoramas) as file:
        return [path for node, key in enumerate(ids) for path in write_skybox(file.read(node), key, folder)]


def write_skybox(panorama: Panorama, viewpoint: str, folder: Path) -> list[Path]:
    """Write the skybox of one viewpoint; returns its files."""
    colours = tiles_of(panorama.rgb[..., ::-1])
    metres = np.where(np.isfinite(panorama.depth), panorama.depth * ray_stretch(panorama.size), 0)
    units = tiles_of(np.minimum(np.rint(metres * DEPTH_UNITS), 65535).astype(np.uint16))
    pictures = {
        RGB.format(viewpoint): (np.concatenate(list(colours), axis=1), QUALITY),
        DEPTH.format(viewpoint): (np.concatenate(list(units), axis=1), PACKING),
        **{FACES.format(viewpoint, k): (tile, QUALITY) for k, tile in enumerate(colours)},
    }
    files = []
    for name, (picture, options) in pictures.items():
        files.append(Path(folder) / name)
        write_bytes(files[-1], cv2.imencode(files[-1].suffix, np.ascontiguousarray(picture), options)[1].tobytes())
    return files

"""Archives of arrays, and pictures, opened without unpacking more than such files hold."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import cv2
import numpy as np
from numpy.lib.npyio import NpzFile
from PIL import Image

MOST_UNPACKED = 4 * 2**30
"""Most bytes that the arrays of one file unpack to; those of a large house's light are a third of it."""
MOST_PIXELS = 2**27
"""Of a picture; the largest here has an eighth of them."""


@contextlib.contextmanager
def open_arrays(file: Path | BinaryIO, most: int = MOST_UNPACKED) -> Iterator[NpzFile]:
    """An open .npz archive; its arrays are unpacked when they are asked for.

    Raises:
      ValueError: its directory says that it unpacks to over `most` bytes, or it is no such archive.
      OSError, or another of embodied.assets.cache.DAMAGED: it cannot be read.
    """
    archive = np.load(file, allow_pickle=False)
    if not isinstance(archive, NpzFile):
        raise ValueError(f"{file} is no .npz archive")
    with archive:
        directory = archive.zip.infolist() if archive.zip else []
        whole = sum(int(entry.file_size) for entry in directory)  # zipfile unpacks no more than that
        if whole > most:
            raise ValueError(f"{file} unpacks to {whole} bytes, such a file should hold at most {most}")
        yield archive


def read_picture(path: Path | str, mode: int = cv2.IMREAD_COLOR) -> np.ndarray | None:
    """The picture of a file as OpenCV's `imread` gives it; None where it is missing, damaged or declares too much."""
    try:
        with Image.open(path) as declared:
            if declared.width * declared.height > MOST_PIXELS:
                return None
        return cv2.imread(str(path), mode)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError, cv2.error):
        return None

"""Archives of arrays, opened without unpacking more than such files hold."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.lib.npyio import NpzFile

MOST = 4 * 2**30
"""Most bytes that the arrays of one file unpack to; those of a large house's light are a third of it."""


@contextlib.contextmanager
def open_arrays(file: Path | BinaryIO, most: int = MOST) -> Iterator[NpzFile]:
    """An open .npz archive; its arrays are unpacked when they are asked for.

    Raises:
      ValueError: its directory says that it unpacks to over `most` bytes, or it is no such archive.
      OSError, or another of assets.cache.DAMAGED: it cannot be read.
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

"""Archives of arrays and picture files, read without unpacking more than such files hold.

16-bit PNG files are read by a decoder that is quicker than OpenCV's, and gives the same. What it does not read, OpenCV
reads: rows filtered otherwise. It checks the sum of the pixels, not those of chunks.
"""

import contextlib
import io
import struct
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import cv2
import deflate
import numpy as np
from numpy.lib.npyio import NpzFile
from PIL import Image

from embodied.assets.cache import DAMAGED, write_bytes

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


PNG = b"\x89PNG\r\n\x1a\n"
HEADER = b"IHDR"
GREY_16 = struct.pack(">5B", 16, 0, 0, 0, 0)
"""Of a PNG's header: 16 bits, grey, packed and filtered in the usual way, rows in order."""
UP = 2
"""The filter of rows that hold the difference to the row above."""
CHUNK = struct.Struct(">I4s")


def size_of(data: bytes) -> tuple[int, int] | None:
    """Width and height that a JPEG or PNG says to have, without decoding it; None where it is neither."""
    try:
        with Image.open(io.BytesIO(data), formats=("JPEG", "PNG")) as opened:
            return opened.size
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        return None


def colours(data: bytes, order: str = "RGB") -> np.ndarray | None:
    """(h, w, 3 or 4) uint8 pixels of a file; None where it cannot be read.

    Args:
      order: of the channels, 'RGB', 'BGR' or 'BGRA'.
    """
    pixels = _by_opencv(data, cv2.IMREAD_COLOR_RGB if order == "RGB" else cv2.IMREAD_COLOR)
    return cv2.cvtColor(pixels, cv2.COLOR_BGR2BGRA) if order == "BGRA" and pixels is not None else pixels


def numbers(data: bytes) -> np.ndarray | None:
    """(h, w) pixels of one channel of a file, uint16 where it has 16 bits; None where it cannot be read."""
    try:
        pixels = _filtered_up(data)
    except (struct.error, deflate.DeflateError, ValueError):
        pixels = None
    return _by_opencv(data, cv2.IMREAD_ANYDEPTH) if pixels is None else pixels


def _by_opencv(data: bytes, mode: int) -> np.ndarray | None:
    try:
        return cv2.imdecode(np.frombuffer(data, np.uint8), mode) if data else None
    except cv2.error:
        return None


def _filtered_up(data: bytes) -> np.ndarray | None:
    """The pixels of a PNG of 16-bit numbers, all rows of which are filtered UP; None where it is another."""
    width, height = struct.unpack_from(">II", data, 16)
    if not data.startswith(PNG) or data[12:16] != HEADER or data[24:29] != GREY_16 or not height:
        return None
    packed, at = [], len(PNG)
    while at < len(data):
        length, kind = CHUNK.unpack_from(data, at)
        at += CHUNK.size
        if kind == b"IDAT":
            packed.append(data[at : at + length])
        at += length + 4
    unpacked = deflate.zlib_decompress(b"".join(packed), height * (2 * width + 1))
    rows = np.frombuffer(unpacked, np.uint8).reshape(height, 2 * width + 1)
    if not (rows[:, 0] == UP).all():
        return None
    pixels = np.empty((height, 2 * width), np.uint8)
    pixels[0] = rows[0, 1:]
    for k in range(1, height):
        np.add(pixels[k - 1], rows[k, 1:], out=pixels[k])
    return pixels.view(np.uint16).byteswap(inplace=True)


def jpeg(rgb: np.ndarray, quality: int, *options: int) -> bytes:
    """(h, w, 3) uint8 sRGB as a JPEG of `quality`, 1 to 100; `options` as cv2.imencode takes them."""
    bgr = cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality, *options])[1].tobytes()


T = TypeVar("T")
LEVEL = 1
"""Of zlib: the default takes five times as long for files that are a tenth smaller."""


def packed(arrays: Mapping[str, np.ndarray]) -> bytes:
    """Bytes as np.savez_compressed writes them, at `LEVEL`."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=LEVEL) as archive:
        for name, a in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as f:
                np.lib.format.write_array(f, np.asanyarray(a), allow_pickle=False)
    return out.getvalue()


def save_record(record: Any, path: Path) -> None:
    """Write a dataclass of arrays."""
    write_bytes(path, packed({x.name: getattr(record, x.name) for x in fields(record)}))


def load_record(kind: type[T], path: Path) -> T | None:
    """Read what `save_record` wrote; None when absent, cut short or of another shape."""
    try:
        with open_arrays(path) as z:
            return kind(**{x.name: z[x.name] for x in fields(kind)})  # type: ignore[arg-type]  # a dataclass
    except (OSError, *DAMAGED):
        return None

"""PanoramaFile: all panoramas of a house in one file, each readable alone.

Layout: 8 bytes magic; the encoded pictures of every node one after another; the index (JSON); its
length, its SHA-256 and the magic again. Per node three pictures with the six faces side by side:

  rgb    JPEG, quality 90 without chroma subsampling (44 dB on lit flats, ten above the light's own error)
  depth  16-bit PNG of whole millimetres (error at most 0.5 mm up to 65.5 m, 0 where nothing is)
  ids    16-bit PNG, exact

Every picture carries a CRC-32 that is checked when it is read.
"""

import functools
import hashlib
import json
import os
import struct
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Self

import cv2
import numpy as np

from embodied.assets.cache import atomic_path
from embodied.assets.decoding import colours, numbers, size_of
from embodied.assets.json_file import RecordError, from_plain, parse
from embodied.render.panorama import Panorama

MAGIC = b"EMBPANO1"
TAIL = struct.Struct("<Q32s8s")
"""Length of the index, its SHA-256, the magic."""
JPEG_OPTIONS = (
    *(cv2.IMWRITE_JPEG_QUALITY, 90, cv2.IMWRITE_JPEG_OPTIMIZE, 1),
    *(cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444),
)
SMOOTH = (cv2.IMWRITE_PNG_COMPRESSION, 6, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP)
"""For planes and areas: a fifth smaller, and read sooner, than with OpenCV's own choice."""
FARTHEST_STORED = 65.535
"""Metres beyond which depths are stored as this."""
CHANNELS = ("rgb", "depth", "ids")


class PanoramaFileError(ValueError):
    """A panorama file that is damaged, cut short or of another kind."""


@dataclass(frozen=True)
class PanoramaIndex:
    """The index at the end of a file."""

    meta: dict[str, object]
    size: int
    """Side of a face, pixels."""
    lossless: bool
    """False in all files that are written."""
    nodes: tuple[dict[str, tuple[int, int, int]], ...]
    """By channel: where its picture begins, its length and its CRC-32."""

    def __post_init__(self) -> None:
        if not 1 <= self.size <= 16384 or any(set(node) != set(CHANNELS) for node in self.nodes):
            raise ValueError(f"it should hold {CHANNELS} of every node, of 1 to 16384 pixels")


class PanoramaFile:
    """An open panorama file. Reads only what is asked for; safe to share between threads and forked processes."""

    def __init__(self, path: Path) -> None:
        """Open `path` and read its index.

        Raises:
          PanoramaFileError: not a panorama file, truncated, or its index is damaged.
        """
        self.path = Path(path)
        self._file = self.path.open("rb")
        try:
            self.index = _read_index(self._file, self.path)
        except PanoramaFileError:
            self._file.close()
            raise

    @property
    def meta(self) -> Mapping[str, object]:
        """Facts about what the file was made from and with."""
        return self.index.meta

    @property
    def size(self) -> int:
        """Side of a face, pixels."""
        return self.index.size

    def __len__(self) -> int:
        return len(self.index.nodes)

    def read(self, node: int) -> Panorama:
        """The panorama of one node; each channel is decoded when it is first asked for.

        Raises:
          PanoramaFileError: a picture is damaged.
        """
        return _Stored(self, {channel: self._checked(node, channel) for channel in CHANNELS}, node)

    def damaged(self) -> tuple[tuple[int, str], ...]:
        """(node, channel) of every picture that does not match its checksum; reads the whole file."""
        return tuple((node, c) for node in range(len(self)) for c in CHANNELS if self._data(node, c) is None)

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _checked(self, node: int, channel: str) -> bytes:
        """The picture as a file, which is whole."""
        if not 0 <= node < len(self):
            raise IndexError(f"{self.path} holds the nodes 0 to {len(self) - 1}, not {node}")
        data = self._data(node, channel)
        if data is None:
            raise PanoramaFileError(
                f"{self.path}: the {channel} of node {node} is damaged; delete the file, it is made again"
            )
        return data

    def decoded(self, data: bytes, node: int, channel: str) -> np.ndarray:
        """The faces of a picture: (6, s, s, 3) uint8 'rgb', (6, s, s) float32 'depth', metres along each face's axis to
        0.5 mm, inf where nothing is, or (6, s, s) int32 'ids'.

        Raises:
          PanoramaFileError: it is none of this file's size.
        """
        picture = None
        if size_of(data) == (6 * self.size, self.size):
            picture = colours(data) if channel == "rgb" else numbers(data)
        if picture is None:
            raise PanoramaFileError(
                f"{self.path}: the {channel} of node {node} is no picture of its size; "
                "delete the file, it is made again"
            )
        faces = np.stack(np.split(picture, 6, axis=1))
        if channel == "rgb":
            return faces
        if channel == "ids":
            return faces.astype(np.int32)
        return np.where(faces > 0, faces / np.float32(1000), np.float32(np.inf))

    def _data(self, node: int, channel: str) -> bytes | None:
        """The picture as a file, or None where it is damaged."""
        offset, length, crc = self.index.nodes[node][channel]
        data = os.pread(self._file.fileno(), length, offset)  # whoever shares the file shares its position
        return data if len(data) == length and zlib.crc32(data) == crc else None


class _Stored(Panorama):
    """A panorama of a file, whose channels are decoded when they are first asked for."""

    _file: PanoramaFile
    _data: dict[str, bytes]
    _node: int

    def __init__(self, file: PanoramaFile, data: dict[str, bytes], node: int) -> None:
        self.__dict__.update(_file=file, _data=data, _node=node)

    @property
    def size(self) -> int:
        return self._file.size

    @functools.cached_property
    def rgb(self) -> np.ndarray:
        return self._file.decoded(self._data["rgb"], self._node, "rgb")

    @functools.cached_property
    def depth(self) -> np.ndarray:
        return self._file.decoded(self._data["depth"], self._node, "depth")

    @functools.cached_property
    def ids(self) -> np.ndarray:
        return self._file.decoded(self._data["ids"], self._node, "ids")


def write_panoramas(path: Path, panoramas: Iterable[Panorama], meta: Mapping[str, object]) -> None:
    """Write `panoramas` (node 0, 1, ...) to `path` atomically.

    Args:
      meta: JSON-able facts about what they were made from and with.
    """
    with atomic_path(Path(path)) as temporary, open(temporary, "wb") as f:
        f.write(MAGIC)
        nodes, size = [], 0
        for panorama in panoramas:
            size, entry = panorama.size, {}
            for channel, data in zip(CHANNELS, encode(panorama), strict=True):
                entry[channel] = [f.tell(), len(data), zlib.crc32(data)]
                f.write(data)
            nodes.append(entry)
        index = json.dumps({"meta": dict(meta), "size": size, "lossless": False, "nodes": nodes}).encode()
        f.write(index)
        f.write(TAIL.pack(len(index), hashlib.sha256(index).digest(), MAGIC))


def encode(panorama: Panorama) -> tuple[bytes, bytes, bytes]:
    """The three pictures of a node as files: rgb, depth, ids."""
    rgb = _encoded(".jpg", cv2.cvtColor(beside(panorama.rgb), cv2.COLOR_RGB2BGR), *JPEG_OPTIONS)
    metres = np.where(np.isfinite(panorama.depth), np.minimum(panorama.depth, FARTHEST_STORED), 0)
    depth = _encoded(".png", beside(np.rint(metres * 1000).astype(np.uint16)), *SMOOTH)
    if panorama.ids.max() > 65535:
        raise ValueError(f"instance id {panorama.ids.max()} does not fit into 16 bits; a house may have 65535 owners")
    return rgb, depth, _encoded(".png", beside(panorama.ids.astype(np.uint16)), *SMOOTH)


def _encoded(kind: str, image: np.ndarray, *options: int) -> bytes:
    return cv2.imencode(kind, image, options)[1].tobytes()


def beside(faces: np.ndarray) -> np.ndarray:
    """(6, s, s, ...) faces next to each other: (s, 6 s, ...)."""
    return np.ascontiguousarray(np.concatenate(list(faces), axis=1))


def _read_index(f: BinaryIO, path: Path) -> PanoramaIndex:
    end = f.seek(0, 2)
    f.seek(0)
    broken = f"{path} is no complete panorama file ({end} bytes); delete it, it is made again"
    if end < len(MAGIC) + TAIL.size or f.read(len(MAGIC)) != MAGIC:
        raise PanoramaFileError(broken)
    f.seek(end - TAIL.size)
    length, checksum, magic = TAIL.unpack(f.read(TAIL.size))
    if magic != MAGIC or length > end - TAIL.size - len(MAGIC):
        raise PanoramaFileError(broken)
    f.seek(end - TAIL.size - length)
    index = f.read(length)
    if hashlib.sha256(index).digest() != checksum:
        raise PanoramaFileError(f"{path}: the index is damaged; delete the file, it is made again")
    try:
        decoded = from_plain(PanoramaIndex, parse(index, "an index"), "the index")
        if not all(0 <= at <= at + n <= end for node in decoded.nodes for at, n, _ in node.values()):
            raise RecordError("pictures outside the file")
        return decoded
    except RecordError as e:
        raise PanoramaFileError(f"{path}: {e}; delete the file, it is made again") from e

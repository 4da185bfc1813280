"""JPEGs of tiles beside each other, of which each can be decoded alone: after each row of blocks of a tile comes a
restart marker, as `embodied export matterport` writes them (ITU T.81, B.2)."""

from __future__ import annotations

import re
import struct

from embodied.assets.decoding import EXIF

START_OF_FRAME, RESTART_INTERVAL, START_OF_SCAN = 0xC0, 0xDD, 0xDA
WHOLE = bytes([3, 1, 0x11, 0, 2, 0x11, 1, 3, 0x11, 1])
"""Of a frame: three components, none of them subsampled. Numbers of quantization tables are those of OpenCV."""
BLOCK = 8
"""Side of a block of pixels."""
RESTART = [bytes([0xFF, 0xD0 + k]) for k in range(8)]
RESTARTS, END_OF_IMAGE = re.compile(rb"\xff[\xd0-\xd7]"), b"\xff\xd9"


def tiles_in(data: bytes, count: int) -> list[bytes] | None:
    """A JPEG for each of `count` square tiles that lie beside each other in a JPEG; None without such markers."""
    segments, at = {}, 2
    while START_OF_SCAN not in segments:
        if data[at : at + 1] != b"\xff" or len(data) < at + 4:
            return None
        length = struct.unpack_from(">H", data, at + 2)[0]
        segments[data[at + 1]] = slice(at + 4, at + 2 + length)
        at += 2 + length
    frame, interval = segments.get(START_OF_FRAME), segments.get(RESTART_INTERVAL)
    if frame is None or interval is None:
        return None
    if data[frame][5:] != WHOLE or EXIF in data[:at]:
        return None
    _, side, width = struct.unpack_from(">BHH", data, frame.start)
    blocks, rest = divmod(side, BLOCK)
    if rest or width != count * side or data[interval] != struct.pack(">H", blocks):
        return None
    parts = RESTARTS.split(data[at:].removesuffix(END_OF_IMAGE))
    if not data.endswith(END_OF_IMAGE) or len(parts) != count * blocks:
        return None
    head = data[: frame.start + 3] + struct.pack(">H", side) + data[frame.start + 5 : at]
    marks = [RESTART[k % 8] for k in range(blocks - 1)] + [END_OF_IMAGE]
    return [head + b"".join(p + m for p, m in zip(parts[t::count], marks, strict=True)) for t in range(count)]

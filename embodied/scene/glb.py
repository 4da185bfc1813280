"""Writing binary glTF 2.0 (Khronos, https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html), all in one file."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Hashable
from typing import Any

import numpy as np

UPRIGHT = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""z up to y up, as the format asks."""
VERTICES, INDICES = 34962, 34963
"""What a buffer view holds, in OpenGL's numbers."""
FLOAT, UINT = 5126, 5125
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942


class GlbWriter:
    """Collects what a file holds. Meshes, materials and pictures are kept by key: what has one is not added again."""

    def __init__(self) -> None:
        self.tree: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "embodied"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            **{name: [] for name in ("nodes", "meshes", "materials", "textures", "images", "accessors", "bufferViews")},
        }
        self._body = bytearray()
        self._numbers: dict[tuple[str, Hashable], int] = {}

    def number(self, kind: str, key: Hashable) -> int | None:
        """Where in tree[kind] the one of this key is; None if it was not added."""
        return self._numbers.get((kind, key))

    def add(self, kind: str, key: Hashable, content: dict[str, Any]) -> int:
        """Append to tree[kind]; returns where it is."""
        self.tree[kind].append(content)
        self._numbers[kind, key] = len(self.tree[kind]) - 1
        return self._numbers[kind, key]

    def texture(self, key: Hashable, picture: bytes) -> int:
        """A texture that repeats, from a PNG or JPEG file."""
        kind = "image/png" if picture.startswith(b"\x89PNG") else "image/jpeg"
        image = self.add("images", key, {"bufferView": self._view(picture), "mimeType": kind})
        return self.add("textures", key, {"source": image})

    def mesh(self, key: Hashable, material: int, vertices: np.ndarray, faces: np.ndarray, **more: np.ndarray) -> int:
        """A mesh of one material.

        Args:
          vertices: (n, 3) metres.
          faces: (m, 3) indices of vertices.
          more: further attributes by glTF's names: NORMAL (n, 3), TEXCOORD_0 (n, 2) with v down.
        """
        attributes = {"POSITION": self._accessor(vertices, VERTICES, bounded=True)}
        attributes |= {name: self._accessor(a, VERTICES) for name, a in more.items()}
        indices = self._accessor(faces.reshape(-1), INDICES)
        primitive = {"attributes": attributes, "indices": indices, "material": material}
        return self.add("meshes", key, {"primitives": [primitive]})

    def node(self, name: str, mesh: int, pose: np.ndarray, extras: dict[str, str] | None = None) -> None:
        """A mesh placed by `pose`, (4, 4), world with z up."""
        matrix = (UPRIGHT @ pose).T.reshape(-1).tolist()
        node = {"name": name, "mesh": mesh, "matrix": matrix} | ({"extras": extras} if extras else {})
        self.tree["scenes"][0]["nodes"].append(self.add("nodes", name, node))

    def data(self) -> bytes:
        """The file."""
        body = bytes(self._body) + bytes(-len(self._body) % 4)
        tree = {name: content for name, content in self.tree.items() if content != []}
        text = json.dumps(tree | {"buffers": [{"byteLength": len(body)}]}, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), JSON_CHUNK) + text + struct.pack("<II", len(body), BINARY_CHUNK) + body
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def _view(self, data: bytes, **target: int) -> int:
        self._body += bytes(-len(self._body) % 4)
        view = {"buffer": 0, "byteOffset": len(self._body), "byteLength": len(data), **target}
        self._body += data
        self.tree["bufferViews"].append(view)
        return len(self.tree["bufferViews"]) - 1

    def _accessor(self, array: np.ndarray, target: int, bounded: bool = False) -> int:
        held = np.ascontiguousarray(array, "<u4" if target == INDICES else "<f4")
        accessor = {
            "bufferView": self._view(held.tobytes(), target=target),
            "componentType": UINT if target == INDICES else FLOAT,
            "count": len(held),
            "type": "SCALAR" if held.ndim == 1 else f"VEC{held.shape[1]}",
        }
        if bounded:
            accessor |= {"min": held.min(0).tolist(), "max": held.max(0).tolist()}
        self.tree["accessors"].append(accessor)
        return len(self.tree["accessors"]) - 1


def turned(position: tuple[float, float, float], yaw: float) -> np.ndarray:
    """(4, 4) the pose of what stands at `position`, turned by `yaw` about z."""
    c, s = math.cos(yaw), math.sin(yaw)
    x, y, z = position
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]])

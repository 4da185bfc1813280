"""Panoramas for browsers: six faces side by side as a JPEG, in two sizes, under names that say nothing."""

from __future__ import annotations

import functools
import hashlib
import hmac
from collections.abc import Mapping

import cv2
import numpy as np

from embodied.render.jpeg import jpeg
from embodied.render.panorama_file import PanoramaFile, beside

FACE_SIZES = {"small": 128, "large": 768}
"""Name to the largest side of a face, pixels."""
QUALITY = {"small": 60, "large": 82}
ENCODED_KEPT = 600
"""Encoded panoramas held in memory: some 100 MB."""


class EncodedPanoramas:
    """The panoramas of the study's houses; nothing else can be asked for."""

    def __init__(self, files: Mapping[str, PanoramaFile], secret: str) -> None:
        """
        Args:
          files: by house.
          secret: makes the names; only who was shown a viewpoint knows that of its panorama.
        """
        self._files, self._secret = files, secret.encode()
        self._place = {self.name(w, n): (w, n) for w, file in files.items() for n in range(len(file))}
        self.encoded = functools.lru_cache(maxsize=ENCODED_KEPT)(self._encode)

    def name(self, world: str, node: int) -> str:
        """Of the panorama of a viewpoint, in addresses."""
        return hmac.new(self._secret, f"{world}/{node}".encode(), hashlib.sha256).hexdigest()[:24]

    def has(self, name: str, size: str) -> bool:
        return name in self._place and size in FACE_SIZES

    def _encode(self, name: str, size: str) -> bytes:
        """A JPEG of the faces in the order of embodied.render.panorama.FACES."""
        world, node = self._place[name]
        faces = self._files[world].rgb(node)
        side = min(FACE_SIZES[size], faces.shape[1])
        if side != faces.shape[1]:
            faces = np.stack([cv2.resize(f, (side, side), interpolation=cv2.INTER_AREA) for f in faces])
        return jpeg(beside(faces), QUALITY[size], cv2.IMWRITE_JPEG_OPTIMIZE, 1)

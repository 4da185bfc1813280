"""Pictures as JPEG files, for pages, browsers and recordings."""

from __future__ import annotations

import cv2
import numpy as np


def jpeg(rgb: np.ndarray, quality: int, *options: int) -> bytes:
    """(h, w, 3) uint8 sRGB as a JPEG of `quality`, 1 to 100; `options` as cv2.imencode takes them."""
    bgr = cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality, *options])[1].tobytes()

"""How alike two pictures are."""

from __future__ import annotations

import math

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

VIEW_ANGLE = math.radians(65.0)


def psnr(a: np.ndarray, b: np.ndarray, where: np.ndarray | None = None) -> float:
    """Peak signal to noise ratio in dB of uint8 pictures, both blurred by one pixel against path-tracing noise.

    Args:
      where: (h, w) bool, pixels that count; all if None.
    """
    a, b = (gaussian_filter(x.astype(float), (1, 1, 0)) for x in (a, b))
    off = np.mean((a - b) ** 2, axis=-1)
    return float(10 * np.log10(255**2 / max(float(np.mean(off if where is None else off[where])), 1e-9)))


def ssim(a: np.ndarray, b: np.ndarray, where: np.ndarray | None = None) -> float:
    """Mean structural similarity of the luma (Wang et al. 2004, eq. 13, Gaussian window of 1.5 pixels)."""
    a, b = (cv2.cvtColor(x, cv2.COLOR_RGB2GRAY).astype(float) for x in (a, b))
    mean = lambda x: gaussian_filter(x, 1.5)
    ma, mb = mean(a), mean(b)
    va, vb, cov = mean(a * a) - ma**2, mean(b * b) - mb**2, mean(a * b) - ma * mb
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    alike = (2 * ma * mb + c1) * (2 * cov + c2) / ((ma**2 + mb**2 + c1) * (va + vb + c2))
    return float(np.mean(alike if where is None else alike[where]))

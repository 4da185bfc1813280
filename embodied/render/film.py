"""Between light and what a picture shows of it: the film curve of a bake for greys, and back."""

import functools

import numpy as np

CODES = 16384
"""Steps of the table from light to values."""


def light_of(rgb: np.ndarray) -> np.ndarray:
    """Exposed light of shown values from 0 to 255, float32, between whole values too: the bake's film curve undone,
    channel by channel, which is exact for greys and near enough for colours."""
    if rgb.dtype == np.uint8:
        return _light_of_values()[rgb]
    return np.interp(rgb, np.arange(256), _light_of_values()).astype(np.float32)


def shown_of(light: np.ndarray) -> np.ndarray:
    """Exposed light as uint8: the inverse of `light_of`."""
    codes = (light / (1 + light) * (CODES - 1) + 0.5).astype(np.int32)
    return _values_of_light()[codes]


@functools.cache
def _values_of_light() -> np.ndarray:
    """(CODES,) uint8 of light x at x / (1 + x), evenly."""
    t = np.arange(CODES) / CODES
    return (np.clip(film(t / (1 - t)), 0, 1) * 255 + 0.5).astype(np.uint8)


@functools.cache
def _light_of_values() -> np.ndarray:
    """(256,) float32."""
    t = np.arange(CODES) / CODES
    x = t / (1 - t)
    return np.interp(np.arange(256) / 255, film(x)[x <= 5], x[x <= 5]).astype(np.float32)


def film(x: np.ndarray) -> np.ndarray:
    """Exposed light of a grey as sRGB in [0, 1]: the curve of embodied.light.pages.tone, which drawing may not import;
    a test compares them."""
    y = np.minimum(x * (1 + x / 25.0) / (1 + x), 1.0)
    lifted = np.where(y <= 0.0031308, 12.92 * y, 1.055 * y ** (1 / 2.4) - 0.055) * 1.12
    return lifted - np.square(np.maximum(lifted - 0.78, 0)) * (0.12 / 0.34**2)

"""Geometry: the points that spread evenly over a square."""

from __future__ import annotations

import numpy as np
import pytest

from embodied.geometry import r2


def test_the_r2_sequence_steps_by_powers_of_the_plastic_number():
    """Its steps are 1/g and 1/g^2 with g^3 = g + 1."""
    g = next(x.real for x in np.roots([1, 0, -1, -1]) if abs(x.imag) < 1e-12)
    assert r2(1) == pytest.approx((1 / g, 1 / g**2), abs=1e-15) and r2(0) == (0.0, 0.0)
    k = np.arange(1000)
    each = np.array([r2(int(i)) for i in k])
    assert np.array_equal(np.stack(r2(k), axis=1), each), "a number at a time or all at once, to the bit"


def test_the_r2_sequence_fills_the_square_more_evenly_than_chance():
    """Of 8 x 8 cells each should hold 8 of 512 points: R2's are within 3 of that, random ones are not."""

    def farthest(points):
        counts = np.histogram2d(*points.T, bins=8, range=((0, 1), (0, 1)))[0]
        return np.abs(counts - 8).max()

    assert farthest(np.stack(r2(np.arange(512)), axis=1) % 1) <= 3
    assert farthest(np.random.default_rng(0).random((512, 2))) > 5

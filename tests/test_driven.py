"""The body on wheels stands where it is put."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import two_rooms

from embodied.assets.catalogue import load_catalogue
from embodied.envs.driven import Driver, is_overhead


@pytest.mark.slow
def test_the_body_stands_still_when_nothing_is_asked(shared_cache):
    driver, start = Driver(two_rooms(), load_catalogue(shared_cache)), np.array([2.5, 2.6, 1.5])
    driver.place(start, 0.5)
    assert np.linalg.norm(driver.position - start[:2]) < 1e-3 and abs(driver.yaw - 0.5) < 1e-2


def test_only_what_hangs_over_the_body_is_left_out():
    floors = [0.0, 2.9]
    assert is_overhead(1.6, 2.2, floors) and is_overhead(4.6, 5.3, floors)  # wall cabinets
    assert not is_overhead(0.0, 2.6, floors) and not is_overhead(2.6, 2.9, floors)  # a wall; the upper floor
    assert not is_overhead(1.4, 2.0, floors) and not is_overhead(2.9, 3.6, floors)

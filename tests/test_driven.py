"""The body on wheels stands where it is put."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import two_rooms

from embodied.assets.catalogue import load_catalogue
from embodied.envs.driven import Driver


@pytest.mark.slow
def test_the_body_stands_still_when_nothing_is_asked(shared_cache):
    driver, start = Driver(two_rooms(), load_catalogue(shared_cache)), np.array([2.5, 2.6, 1.5])
    driver.place(start, 0.5)
    assert np.linalg.norm(driver.position - start[:2]) < 1e-3 and abs(driver.yaw - 0.5) < 1e-2

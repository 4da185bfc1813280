"""Small worlds made by hand, before generated ones."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from embodied.assets.cache import default_cache
from embodied.house.house import House, Opening, Placement, Room, Storey

WHITE = "paint_white/0"
FINISHES = {"floor_finish": "oak_planks/0", "wall_finish": WHITE, "ceiling_finish": WHITE, "skirting_finish": WHITE}


def two_rooms() -> House:
    """A 5 x 4 m living room and a 4 x 4 m bedroom to its east, joined by one door."""
    living = Room("living_room_1", "living_room", ((0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)), **FINISHES)
    bedroom = Room("bedroom_1", "bedroom", ((5.0, 0.0), (9.0, 0.0), (9.0, 4.0), (5.0, 4.0)), **FINISHES)
    inside, outside = ("bedroom_1", "living_room_1"), ("living_room_1", None)
    openings = (
        Opening("door_1", "door", inside, (5.0, 0.6), (5.0, 1.5), 0.0, 2.05, WHITE, "a", 1.4),
        Opening("front_door_1", "front_door", outside, (0.0, 2.0), (0.0, 1.0), 0.0, 2.1, WHITE),
        Opening("window_1", "window", outside, (1.5, 0.0), (3.5, 0.0), 0.9, 2.1, WHITE),
        Opening("window_2", "window", ("bedroom_1", None), (7.5, 4.0), (6.0, 4.0), 0.9, 2.1, WHITE),
    )
    rug = Placement("rug_1", "built/rug", "rug", "living_room_1", (2.5, 2.0, 0.0), 0.0, (2.0, 1.4, 0.012))
    return House(0, "two rooms", (Storey(0.0, 2.6),), (living, bedroom), openings, (rug,), ())


@pytest.fixture(scope="session", autouse=True)
def shared_folder(tmp_path_factory) -> None:
    """A folder that all workers of a test run may use, as `hand_data.built` does; named in the environment."""
    own = tmp_path_factory.getbasetemp()
    os.environ["EMBODIED_TESTS_SHARED"] = str(own.parent if "PYTEST_XDIST_WORKER" in os.environ else own)
    os.environ.setdefault("SB3_LOGDIR", str(own / "stable_baselines3"))  # whose logs lie in the temporary folder else


@pytest.fixture(scope="session")
def shared_cache() -> Path:
    """The user's cache, for all tests and workers, kept between runs; its files are atomic and checked."""
    return default_cache()


@pytest.fixture
def two_room_house() -> House:
    return two_rooms()

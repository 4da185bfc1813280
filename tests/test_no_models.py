"""Without furniture models houses are furnished all the same, with what code builds, and that is told once."""

from __future__ import annotations

import warnings

import embodied.assets.importing.sh3f as sh3f
from embodied.assets.built import BASICS
from embodied.assets.catalogue import _tell_once, load_catalogue
from embodied.generate import HouseConfig, generate_house
from embodied.generate.stages import missing_requirements


def test_a_house_without_models_lacks_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(sh3f, "SYSTEM_FOLDER", tmp_path / "none")
    monkeypatch.setattr(sh3f, "OWN_FOLDER", tmp_path / "none")
    monkeypatch.setattr(sh3f, "WHEEL", "no_such_package")
    _tell_once.cache_clear()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        house, again = generate_house(3, HouseConfig(area=(32, 40)), load_catalogue(tmp_path)), load_catalogue(tmp_path)
    assert not missing_requirements(house)
    assert sum("no furniture models" in str(w.message) for w in told) == 1
    assert {"sofa", "bed", "toilet"} <= {p.object_class for p in house.placements}
    assert any(p.asset in BASICS for p in house.placements)
    assert all(p.asset in again.assets for p in house.placements)


def test_with_models_no_house_holds_simple_furniture(two_room_house):
    assert not BASICS & load_catalogue().furnishing.assets.keys()

"""All materials by key."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from assets.materials.list_art import art_materials
from assets.materials.list_cloth import cloth_materials
from assets.materials.list_floors import floor_materials
from assets.materials.list_outdoor import outdoor_materials
from assets.materials.list_rugs import rug_materials
from assets.materials.list_walls import wall_materials
from assets.materials.material import ROLES, Material


def _build() -> Mapping[str, Material]:
    made = [
        *wall_materials(),
        *floor_materials(),
        *cloth_materials(),
        *art_materials(),
        *rug_materials(),
        *outdoor_materials(),
    ]
    keys = [m.key for m in made]
    assert len(set(keys)) == len(keys), sorted(k for k in keys if keys.count(k) > 1)
    assert all(r in ROLES for m in made for r in m.roles)
    return MappingProxyType({m.key: m for m in sorted(made, key=lambda m: m.key)})


MATERIALS: Mapping[str, Material] = _build()
"""Every material by key, keys sorted."""

"""Things built in code: furniture and small objects that the asset packs lack.

MAKERS holds them by key, 'built/<name>'; `MAKERS[key].make(size, params, finish)` gives the meshes.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from assets.built.bath import bath_makers
from assets.built.decor import decor_makers
from assets.built.entry import entry_makers
from assets.built.fittings import fittings_makers
from assets.built.kitchen import kitchen_makers
from assets.built.lamps import lamps_makers
from assets.built.maker import Maker
from assets.built.papers import papers_makers
from assets.built.plants import plants_makers
from assets.built.soft import soft_makers
from assets.built.storage import storage_makers
from assets.built.tableware import tableware_makers

__all__ = ["MAKERS", "Maker"]


def _all() -> Mapping[str, Maker]:
    made = [
        *kitchen_makers(),
        *decor_makers(),
        *soft_makers(),
        *lamps_makers(),
        *bath_makers(),
        *papers_makers(),
        *tableware_makers(),
        *plants_makers(),
        *storage_makers(),
        *entry_makers(),
        *fittings_makers(),
    ]
    keys = [m.asset.key for m in made]
    assert len(set(keys)) == len(keys), sorted(k for k in keys if keys.count(k) > 1)
    return MappingProxyType({m.asset.key: m for m in sorted(made, key=lambda m: m.asset.key)})


MAKERS: Mapping[str, Maker] = _all()
"""Every maker by key, keys sorted."""

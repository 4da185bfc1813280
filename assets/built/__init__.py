"""Things built in code: furniture and small objects that the asset packs lack.

What is built, in which sizes and looks, is a table: assets/data/built.json. How it is built is the code of this folder.
MAKERS holds them by key, 'built/<name>', and what stands for a pack's poor model under that model's key;
`MAKERS[key].make(size, params, finish)` gives the meshes.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from assets.built.maker import Maker
from assets.built.table import read_makers, remade
from assets.rows import DATA, check_classes, read_json, read_models

__all__ = ["BASICS", "MAKERS", "Maker"]


def _remade() -> Mapping[str, Maker]:
    rows, classes = read_json(DATA / "catalogue.json"), check_classes("classes.json", read_json(DATA / "classes.json"))
    return remade("catalogue.json", rows, read_models("catalogue.json", rows, classes, {})[0])


def _basic() -> Mapping[str, Maker]:
    table, classes = read_json(DATA / "basics.json"), check_classes("classes.json", read_json(DATA / "classes.json"))
    return read_makers("basics.json", table | {"groups": [classes[g["class"]] | g for g in table["groups"]]})


_BASIC = _basic()
BASICS = frozenset(_BASIC)
"""Keys of the simple furniture that houses get only where no furniture models are installed."""
_ALL = {**read_makers("built.json", read_json(DATA / "built.json")), **_BASIC, **_remade()}
MAKERS: Mapping[str, Maker] = MappingProxyType(dict(sorted(_ALL.items())))
"""Every maker by key, keys sorted."""

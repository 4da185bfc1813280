"""Things built in code: furniture and small objects that the asset packs lack.

What is built, in which sizes and looks, is a table: assets/data/built.json. How it is built is the code of this folder.
MAKERS holds them by key, 'built/<name>'; `MAKERS[key].make(size, params, finish)` gives the meshes.
"""

from __future__ import annotations

from collections.abc import Mapping

from assets.built.maker import Maker
from assets.built.table import read_makers
from assets.rows import DATA, read_json

__all__ = ["MAKERS", "Maker"]

MAKERS: Mapping[str, Maker] = read_makers("built.json", read_json(DATA / "built.json"))
"""Every maker by key, keys sorted."""

"""Whose packages Python imports: four of our names are short enough to be somebody else's, too.

Imports nothing but the standard library and our name, so that it answers where the other packages cannot be imported.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path

from embodied.distribution import DISTRIBUTION

PACKAGES = ("embodied", "agents", "assets", "viz")
ROOT = Path(__file__).resolve().parents[2]
"""The folder that holds our four packages: a clone, or site-packages."""
REMEDY = (
    "install embodied in a virtual environment of its own (README, Installing), or take the other folder out of "
    "PYTHONPATH"
)


def strangers(path: Sequence[str] | None = None) -> list[str]:
    """One sentence per package of another project that Python imports, or elsewhere would import, in place of ours.

    Args:
      path: the folders that Python searches; sys.path if None.
    """
    path = sys.path if path is None else list(path)
    found = []
    for name in PACKAGES:
        here = _folder(importlib.util.find_spec(name) if path is sys.path else PathFinder.find_spec(name, path))
        elsewhere = _folder(PathFinder.find_spec(name, [p for p in path if Path(p).resolve() != ROOT]))
        if here is not None and here != ROOT / name:
            found.append(f"`{name}` is imported from {here}, which is not ours ({ROOT / name})")
        elif here is None:
            found.append(f"`{name}` is not there ({ROOT / name} is expected)")
        elif elsewhere is not None and elsewhere != ROOT / name:
            found.append(f"`{name}` would be imported from {elsewhere} when Python is started outside {ROOT}")
    return found + _sharing()


def _folder(spec: ModuleSpec | None) -> Path | None:
    """The folder of a package, or the file of a module."""
    if spec is None:
        return None
    if spec.submodule_search_locations:
        return Path(next(iter(spec.submodule_search_locations))).resolve()
    return Path(spec.origin).resolve() if spec.origin else None


def _sharing() -> list[str]:
    """Distributions beside us whose files go into folders of our names: one of the two has overwritten the other."""
    found = []
    for other in importlib.metadata.distributions():
        top = (other.read_text("top_level.txt") or "").split()
        if other.name.lower().replace("_", "-") == DISTRIBUTION or (top and not set(top) & set(PACKAGES)):
            continue
        names = sorted({f.parts[0] for f in other.files or () if len(f.parts) > 1} & set(PACKAGES))
        if names:
            found.append(f"the distribution {other.name} {other.version} installs {', '.join(names)}, too")
    return found

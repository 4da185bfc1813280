"""Folders of furniture libraries, and the library that holds a model."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from embodied.assets.cache import write_bytes
from embodied.assets.importing.sh3f import Pack, PackError, open_pack

SYSTEM_FOLDER = Path("/usr/share/sweethome3d/furniture")
"""Folder of the five libraries of Debian's and Ubuntu's package sweethome3d-furniture."""
OWN_FOLDER = Path(sys.prefix, "share", "sweethome3d", "furniture")
"""Folder into which `embodied doctor --fix` puts those of that package, and libraries that --pack names."""
WHEEL = "embodied_furniture"
"""The package of `pip install embodied-houses[furniture]`: the models of those libraries that the catalogue uses."""


def find_packs(packs: Sequence[Path] = ()) -> tuple[Path, ...]:
    """The .sh3f files of `packs` (files or folders), or, if none are given, those of this environment, of the system
    and of the wheel, in this order.

    Raises:
      PackError: a path in `packs` does not exist.
    """
    libraries: list[Path] = []
    for path in packs or _installed():
        path = Path(path)
        if path.is_dir():
            libraries.extend(sorted(path.glob("*.sh3f")))
        elif path.is_file():
            libraries.append(path)
        elif packs:
            raise PackError(f"furniture library {path} does not exist; name a .sh3f file or a folder of them")
    return tuple(libraries)


def _installed() -> tuple[Path, ...]:
    spec = importlib.util.find_spec(WHEEL)
    return OWN_FOLDER, SYSTEM_FOLDER, *map(Path, (spec and spec.submodule_search_locations) or ())


def install_packs(packs: Sequence[Path]) -> Iterator[Path]:
    """Copy .sh3f files to where every command finds them; yields the copies.

    Raises:
      PackError: no such file, or no furniture library.
    """
    for path in find_packs(packs) if packs else ():
        open_pack(path)
        write_bytes(OWN_FOLDER / path.name, path.read_bytes())
        yield OWN_FOLDER / path.name


def pack_of(key: str) -> Pack:
    """The library that holds the model `key`.

    Raises:
      PackError: no library is installed, or none of them holds it.
    """
    libraries = find_packs()
    for path in libraries:
        pack = open_pack(path)
        if key in pack.entries:
            return pack
    if not libraries:
        raise PackError(
            f"no furniture models are installed, so {key!r} cannot be imported; embodied doctor --fix, "
            "or apt-get install sweethome3d-furniture, or embodied doctor --fix --pack FILE.sh3f"
        )
    raise PackError(
        f"no furniture library holds {key!r}, looked in {[p.name for p in libraries]}; "
        "apt-get install sweethome3d-furniture (version 1.8 or later), or embodied doctor --fix --pack FILE.sh3f"
    )

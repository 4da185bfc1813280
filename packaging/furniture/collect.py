"""Collect the furniture models that the catalogue uses into this folder, so that `pip wheel` makes a package of them.

Reads the libraries of Debian's package sweethome3d-furniture (or those named) and writes one .sh3f of each with the
OBJ, MTL and picture files that are needed, byte for byte as they are, beside their licences and ATTRIBUTION.md.
"""

from __future__ import annotations

import shutil
import sys
import zipfile
from pathlib import Path

from embodied.assets.catalogue import load_catalogue, write_attribution
from embodied.assets.importing.importer import obj_files
from embodied.assets.importing.sh3f import CATALOGUE, SYSTEM_FOLDER, Pack, find_packs, open_pack

HERE = Path(__file__).resolve().parent
STAMP = (2020, 12, 22, 0, 0, 0)
"""The time of every entry, so that the same libraries give the same bytes."""


def needed(pack: Pack, models: frozenset[str]) -> list[str]:
    """Names of the entries of `pack` that its models in `models` consist of, and of its licences, sorted."""
    with zipfile.ZipFile(pack.path) as z:
        names = set(z.namelist())
    kept = {CATALOGUE, *(n for n in names if n.lower().endswith(".txt"))}
    for key in models & pack.entries.keys():
        obj = pack.entries[key].model
        kept |= {obj, *obj_files(pack.read, obj)}
    return sorted(kept & names)


def collect(source: Path, models: frozenset[str], out: Path) -> int:
    """Write the part of the library `source` that `models` need to `out`; returns how many of them it has."""
    pack = open_pack(source)
    with zipfile.ZipFile(out, "w") as z:
        for name in needed(pack, models):
            z.writestr(zipfile.ZipInfo(name, STAMP), pack.read(name), zipfile.ZIP_DEFLATED, 9)
    return len(models & pack.entries.keys())


def main() -> None:
    libraries = find_packs([Path(p) for p in sys.argv[1:]] or [SYSTEM_FOLDER])
    catalogue = load_catalogue()
    models = catalogue.models
    package, licences = HERE / "embodied_furniture", HERE / "licences"
    for old in package.glob("*.sh3f"):
        old.unlink()
    shutil.rmtree(licences, ignore_errors=True)
    licences.mkdir()
    found = 0
    for path in libraries:
        found += collect(path, models, package / path.name)
        with zipfile.ZipFile(path) as z:
            for name in z.namelist():
                if name.lower().endswith(".txt"):
                    (licences / f"{path.stem}-{name.replace('/', '-')}").write_bytes(z.read(name))
    if found < len(models):
        raise SystemExit(f"{found} of {len(models)} models are in {[p.name for p in libraries]}; name all libraries")
    write_attribution(catalogue, HERE / "ATTRIBUTION.md")
    print(f"{found} models in {sum(p.stat().st_size for p in package.glob('*.sh3f')) / 1e6:.1f} MB")


if __name__ == "__main__":
    main()

"""ATTRIBUTION.md: who made every model the catalogue uses, and under which licence."""

from __future__ import annotations

from pathlib import Path

from embodied.assets.cache import write_bytes
from embodied.assets.catalogue import Catalogue
from embodied.assets.records import Asset
from embodied.assets.rows import DATA, read_json

LICENCES = {
    "CC0-1.0": "https://creativecommons.org/publicdomain/zero/1.0/",
    "CC-BY-3.0": "https://creativecommons.org/licenses/by/3.0/",
    "CC-BY-3.0-US": "https://creativecommons.org/licenses/by/3.0/us/",
}


def attribution(catalogue: Catalogue) -> str:
    """The text of ATTRIBUTION.md for the models of `catalogue`; things built in code need none."""
    packs = read_json(DATA / "packs.json")
    lines = [
        "# Attribution",
        "",
        "The furniture models are not part of this repository. They come from Debian's package",
        "`sweethome3d-furniture`, collected by Emmanuel Puybaret / eTeks for Sweet Home 3D",
        "(http://www.sweethome3d.com), and are converted, resized and decimated on import.",
        "This file is written by `embodied assets attribution`.",
    ]
    by_pack: dict[str, list[Asset]] = {}
    for asset in catalogue.assets.values():
        if not catalogue.parameters(asset.key) and "+" not in asset.key:
            by_pack.setdefault(asset.pack, []).append(asset)
    for name in sorted(by_pack):
        pack, assets = packs.get(name, {}), by_pack[name]
        licence = pack.get("licence") or assets[0].licence or "licence not stated"
        link = LICENCES.get(licence)
        lines += ["", f"## {pack.get('title', name)} ({len(assets)} models)", ""]
        lines += [f"{pack.get('holder', assets[0].creator)}. {f'[{licence}]({link})' if link else licence}.", ""]
        makers: dict[str, list[str]] = {}
        for asset in assets:
            makers.setdefault(asset.creator or pack.get("holder", "unknown"), []).append(asset.key.split("/", 1)[1])
        lines += [f"- {maker}: {', '.join(makers[maker])}" for maker in sorted(makers, key=str.lower)]
    return "\n".join(lines) + "\n"


def write_attribution(catalogue: Catalogue, path: Path) -> None:
    """Write the attribution to `path`."""
    write_bytes(Path(path), attribution(catalogue).encode())

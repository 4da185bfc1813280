"""Build, list or show the catalogue of furniture.

build imports every model of the furniture packs into the cache (otherwise each is imported when
first needed), list prints the catalogue, sheet draws contact sheets of all models.
"""

from __future__ import annotations

import argparse
import collections
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from embodied.cli.common import add_cache, add_json, add_packs, catalogue_of, show
from embodied.cli.options import any_path

if TYPE_CHECKING:
    from assets.catalogue import Catalogue
    from assets.records import Asset


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "action",
        choices=("build", "list", "sheet", "attribution"),
        help="attribution writes who made which model, under which licence",
    )
    parser.add_argument("--class", dest="object_class", metavar="NAME", help="only this object class")
    parser.add_argument("--out", type=any_path, metavar="PATH", help="folder for sheets, file for the attribution")
    add_cache(parser)
    add_packs(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    catalogue = catalogue_of(args)
    chosen = [a for a in catalogue.assets.values() if args.object_class in (None, a.object_class)]
    if not chosen:
        raise ValueError(
            f"no object class {args.object_class!r}; `embodied assets list` names all {len(catalogue.classes)}"
        )
    return {"build": build, "list": list_assets, "sheet": sheet, "attribution": attribution}[args.action](
        args, catalogue, chosen
    )


def build(args: argparse.Namespace, catalogue: Catalogue, chosen: Sequence[Asset]) -> int:
    """Import the meshes into the cache."""
    catalogue.build([a.key for a in chosen])
    show(args, {"models": len(chosen), "cache": str(args.cache)}, f"{len(chosen)} models are ready in {args.cache}")
    return 0


def list_assets(args: argparse.Namespace, catalogue: Catalogue, chosen: Sequence[Asset]) -> int:
    """Print the catalogue by class."""
    by_class = collections.defaultdict(list)
    for a in chosen:
        by_class[a.object_class].append(a)
    lines = [f"{name:<24} {', '.join(a.key for a in by_class[name])}" for name in sorted(by_class)]
    lines.append(f"{len(chosen)} models in {len(by_class)} classes")
    show(args, {name: [a.key for a in by_class[name]] for name in sorted(by_class)}, "\n".join(lines))
    return 0


def sheet(args: argparse.Namespace, catalogue: Catalogue, chosen: Sequence[Asset]) -> int:
    """Draw the contact sheets."""
    from embodied.render.contact_sheet import draw_sheets

    out = args.out or Path("out/sheets")
    paths = draw_sheets(catalogue, [a.key for a in chosen], out)
    show(args, {"sheets": [str(p) for p in paths]}, f"{len(paths)} sheets in {out}")
    return 0


def attribution(args: argparse.Namespace, catalogue: Catalogue, chosen: Sequence[Asset]) -> int:
    """Write who made which model, under which licence."""
    from assets.attribution import write_attribution

    out = args.out or Path("ATTRIBUTION.md")
    write_attribution(catalogue, out)
    show(args, {"out": str(out)}, f"wrote {out}")
    return 0

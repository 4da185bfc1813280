"""Build or list the catalogue of furniture, or write who made which model.

`build` imports every model of the furniture packs into the cache (otherwise each is imported when first needed), `list`
prints the catalogue, `attribution` writes who made which model, under which licence.
"""

from __future__ import annotations

import collections
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from embodied.cli.common import Furnished, Printed, catalogue_of, show
from embodied.options import Option, any_path

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.assets.records import Asset


@dataclass(frozen=True, kw_only=True)
class AssetsOptions(Furnished, Printed):
    action: Annotated[str, Option(words=("build", "list", "attribution"), name="action")]
    """Action."""
    object_class: Annotated[str | None, Option(metavar="NAME", name="--class")] = None
    """Only this object class."""
    out: Annotated[Path, Option(any_path, "FILE")] = Path("ATTRIBUTION.md")
    """File for the attribution."""


def run(args: AssetsOptions) -> None:
    catalogue = catalogue_of(args)
    chosen = [a for a in catalogue.assets.values() if args.object_class in (None, a.object_class)]
    if not chosen:
        raise ValueError(
            f"no object class {args.object_class!r}; `embodied assets list` names all {len(catalogue.classes)}"
        )
    actions = {"build": build, "list": list_assets, "attribution": attribution}
    actions[args.action](args, catalogue, chosen)


def build(args: AssetsOptions, catalogue: Catalogue, chosen: Sequence[Asset]) -> None:
    """Import the meshes into the cache."""
    catalogue.build([a.key for a in chosen])
    show(args, {"models": len(chosen), "cache": str(args.cache)}, f"{len(chosen)} models are ready in {args.cache}")


def list_assets(args: AssetsOptions, catalogue: Catalogue, chosen: Sequence[Asset]) -> None:
    """Print the catalogue by class."""
    by_class = collections.defaultdict(list)
    for a in chosen:
        by_class[a.object_class].append(a)
    lines = [f"{name:<24} {', '.join(a.key for a in by_class[name])}" for name in sorted(by_class)]
    lines.append(f"{len(chosen)} models in {len(by_class)} classes")
    show(args, {name: [a.key for a in by_class[name]] for name in sorted(by_class)}, "\n".join(lines))


def attribution(args: AssetsOptions, catalogue: Catalogue, chosen: Sequence[Asset]) -> None:
    """Write who made which model, under which licence."""
    from embodied.assets.catalogue import write_attribution

    write_attribution(catalogue, args.out)
    show(args, {"out": str(args.out)}, f"wrote {args.out}")

"""Arguments of things built in code: a few seeds, so that no two cushions are crumpled alike."""

from __future__ import annotations

from assets.records import Asset
from embodied.generate.furnish.arrange import Params
from embodied.generate.furnish.context import Context

VARIED = ("cushion", "blanket", "curtain", "vase", "books", "towel")
"""Object classes whose makers look different from seed to seed."""
SEEDS = 3
"""Few, because equal arguments share one mesh."""


def looks(ctx: Context, asset: Asset) -> Params:
    """Parameters for the maker of `asset`; empty for models of the packs."""
    if not asset.key.startswith("built/") or asset.object_class not in VARIED:
        return ()
    return (("seed", float(ctx.rng.integers(SEEDS))),)

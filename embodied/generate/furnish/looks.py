"""Arguments of things built in code: which finish, pattern and seed they are made with."""

from __future__ import annotations

from assets.records import Asset
from embodied.generate.furnish.context import Context


def looks(ctx: Context, asset: Asset) -> tuple[tuple[str, str | float], ...]:
    """Parameters for the maker of `asset`; empty for models of the packs."""
    return ()

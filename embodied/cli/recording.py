"""Options that say where a recording goes."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from viz.sinks import Sinks


def add_sinks(parser: argparse.ArgumentParser) -> None:
    """--rrd, --spawn, --connect, --serve."""
    group = parser.add_argument_group("recording")
    group.add_argument("--rrd", type=Path, metavar="FILE", help="write the Rerun recording here")
    group.add_argument("--spawn", action="store_true", help="open the Rerun viewer and watch live")
    group.add_argument("--connect", metavar="URL", help="send to a running viewer, e.g. rerun+http://127.0.0.1:9876/proxy")
    group.add_argument("--serve", action="store_true", help="serve the web viewer and watch in the browser")


def sinks_of(args: argparse.Namespace, rrd: Path | None = None) -> Sinks:
    """The sinks that the options ask for; `rrd` is written when no --rrd is given."""
    from viz.sinks import Sinks

    return Sinks(args.rrd or rrd, args.spawn, args.connect, args.serve)

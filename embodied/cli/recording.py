"""Options that say where a recording goes."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator

from embodied.cli.common import note
from embodied.cli.options import file_ending_in


def add_sinks(parser: argparse.ArgumentParser, default: str | None = None) -> None:
    """--rrd, --spawn, --connect, --serve.

    Args:
      default: what --rrd is when it is not given, for the help text.
    """
    group = parser.add_argument_group("recording")
    group.add_argument(
        "--rrd",
        type=file_ending_in(".rrd"),
        metavar="FILE",
        help="write the Rerun recording here" + (f" (default: {default})" if default else ""),
    )
    add_viewers(group)


def add_viewers(group: argparse._ActionsContainer) -> None:
    """--spawn, --connect, --serve."""
    group.add_argument(
        "--spawn", action="store_true", help="open the Rerun viewer, which needs a screen, and watch live"
    )
    group.add_argument(
        "--connect", metavar="URL", help="send to a running viewer, e.g. rerun+http://127.0.0.1:9876/proxy"
    )
    group.add_argument(
        "--serve", action="store_true", help="serve the web viewer, watch in the browser, end with Ctrl-C"
    )
    group.add_argument(
        "--bind",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="where --serve listens (default: %(default)s, this machine only; 0.0.0.0 lets everybody look and write)",
    )


@contextlib.contextmanager
def viewers_of(args: argparse.Namespace) -> Iterator[tuple[str, ...]]:
    """The viewers that the options ask for; open them before the work begins. --serve goes on until Ctrl-C."""
    if not (args.spawn or args.connect is not None or args.serve):
        yield ()
        return
    from embodied import gl
    from viz.sinks import open_viewers

    with open_viewers(spawn=args.spawn, connect=args.connect, serve=args.serve, bind=args.bind) as viewers:
        if args.spawn and gl.info().software:
            note(
                "this machine draws by software: the native viewer is slow, and fills memory with some drivers; "
                "better --serve"
            )
        yield viewers

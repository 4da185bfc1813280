"""The console command `embodied`: one module per subcommand, composed here.

This is the one place of the package where everything meets: subcommands may import `viz` and
`agents`, late and inside `run`, so that `embodied --help` answers at once.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

COMMANDS = ("demo", "doctor", "assets", "house", "light", "render", "rollout", "view", "dataset", "features",
            "train", "eval", "judge", "bench")
"""Subcommands in the order `--help` lists them; each is a module with `add` and `run`."""


class UserError(Exception):
    """A mistake of the caller; the message is all that is shown."""


def parser() -> argparse.ArgumentParser:
    """The whole argument parser."""
    top = argparse.ArgumentParser(
        prog="embodied",
        description="Generated houses in MuJoCo, panoramas, and agents that ask people for help.",
        epilog="Start with `embodied doctor`, then `embodied demo`. `embodied COMMAND --help` explains each.",
    )
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        module = importlib.import_module(f"embodied.cli.{name}")
        summary = module.__doc__.splitlines()[0].rstrip(".")
        sub = commands.add_parser(
            name,
            help=summary[0].lower() + summary[1:],
            description=module.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add(sub)
        sub.set_defaults(run=module.run)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one subcommand; returns the exit status (2: wrong input, 130: Ctrl-C)."""
    args = parser().parse_args(argv)
    try:
        return args.run(args) or 0
    except KeyboardInterrupt:
        print("\nstopped; finished parts are kept and the same command goes on from there", file=sys.stderr)
        return 130
    except (UserError, ValueError, OSError) as e:
        if getattr(args, "traceback", False):
            raise
        print(f"error: {e}", file=sys.stderr)
        return 2

"""Writes the page of the command line: what every command says with --help."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from pathlib import Path

os.environ["COLUMNS"] = "100"

from embodied.cli import COMMANDS, parser

PAGE = Path(__file__).parent / "reference" / "command_line.md"


def commands(one: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """The parser and those of its subcommands, in their order."""
    yield one
    for action in one._actions:
        if isinstance(action, argparse._SubParsersAction):
            for sub in action.choices.values():
                yield from commands(sub)


def named(top: argparse.ArgumentParser, name: str) -> argparse.ArgumentParser:
    """The parser of one command, which alone has its options in `top`."""
    return next(a.choices[name] for a in top._actions if isinstance(a, argparse._SubParsersAction))


def main() -> None:
    home = str(Path.home())
    parts = ["# Command line\n\n`embodied COMMAND --help` says the same.\n"]
    for one in (c for name in COMMANDS for c in commands(named(parser(name), name))):
        parts.append(f"## {one.prog}\n\n```text\n{one.format_help().rstrip()}\n```\n".replace(home, "~"))
    PAGE.write_text("\n".join(parts), encoding="utf-8")


if __name__ == "__main__":
    main()

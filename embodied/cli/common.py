"""Options and helpers that several subcommands share."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from assets.cache import default_cache


def add_cache(parser: argparse.ArgumentParser) -> None:
    """--cache: where meshes, textures, baked light and panoramas are kept."""
    parser.add_argument(
        "--cache", type=Path, default=default_cache(), metavar="DIR",
        help="where expensive products are kept; safe to delete (default: %(default)s)",
    )


def add_packs(parser: argparse.ArgumentParser) -> None:
    """--pack, --own: which furniture to use."""
    parser.add_argument(
        "--pack", type=Path, action="append", default=[], metavar="FILE",
        help=".sh3f furniture library, may be repeated (default: those of the system package)",
    )
    parser.add_argument(
        "--own", type=Path, action="append", default=[], metavar="DIR",
        help="folder with your own .sh3f, .glb or .obj files and a catalogue.json (docs/assets.md)",
    )


def add_json(parser: argparse.ArgumentParser) -> None:
    """--json: machine-readable output."""
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def catalogue_of(args: argparse.Namespace):
    """The catalogue that --cache, --pack and --own describe."""
    from assets.catalogue import load_catalogue

    return load_catalogue(args.cache, tuple(args.pack), tuple(args.own))


def show(args: argparse.Namespace, result: dict, text: str) -> None:
    """Print `result` as JSON where --json was given, else `text`."""
    print(json.dumps(result, indent=1, default=str) if args.json else text)


def note(text: str) -> None:
    """A line for the person who watches; goes to stderr so that --json output stays clean."""
    print(text, file=sys.stderr, flush=True)

"""Options and helpers that several subcommands share."""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING, Self, TypeVar

from tqdm import tqdm

from assets.cache import default_cache
from embodied.cli.options import any_folder, any_path

if TYPE_CHECKING:
    from assets.catalogue import Catalogue
    from embodied.house.house import House, Opening, Room

T = TypeVar("T")
PATIENCE = 2.0
"""Seconds after which a bar appears."""
SELDOM = 30.0
"""Seconds between two states of a bar that no terminal shows, where each is a line."""


def add_cache(parser: argparse.ArgumentParser) -> None:
    """--cache: where meshes, textures, baked light and panoramas are kept."""
    parser.add_argument(
        "--cache",
        type=any_folder,
        default=str(default_cache()),
        metavar="DIR",
        help="where expensive products are kept; safe to delete (default: %(default)s)",
    )


def add_packs(parser: argparse.ArgumentParser) -> None:
    """--pack, --own: which furniture to use."""
    parser.add_argument(
        "--pack",
        type=any_path,
        action="append",
        default=[],
        metavar="FILE",
        help=".sh3f furniture library, may be repeated (default: those of the system package)",
    )
    parser.add_argument(
        "--own",
        type=any_path,
        action="append",
        default=[],
        metavar="DIR",
        help="folder with your own .sh3f, .glb or .obj files and a catalogue.json (docs/assets.md)",
    )


def add_json(parser: argparse._ActionsContainer) -> None:
    """--json: machine-readable output."""
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def catalogue_of(args: argparse.Namespace) -> Catalogue:
    """The catalogue that --cache, --pack and --own describe."""
    from assets.catalogue import load_catalogue

    return load_catalogue(args.cache, tuple(args.pack), tuple(args.own))


def pause() -> float:
    """Seconds between two states of a progress bar."""
    return 0.1 if sys.stderr.isatty() else SELDOM


class Stages:
    """A bar over the named stages of a command; it appears when they take longer than two seconds."""

    def __init__(self, *names: str) -> None:
        self._names, self._bar = (
            iter(names),
            tqdm(total=len(names), delay=PATIENCE, leave=False, unit="stage", mininterval=pause()),
        )
        self._bar.set_description_str(next(self._names), refresh=False)

    def next(self) -> None:
        """The present stage is done."""
        self._bar.update()
        self._bar.set_description_str(next(self._names, "done"), refresh=False)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()


def bar(items: Iterable[T], name: str, unit: str, total: int | None = None) -> Iterable[T]:
    """`items`, with a progress bar that appears when they take longer than two seconds."""
    return tqdm(items, name, total=total, unit=unit, delay=PATIENCE, leave=False, mininterval=pause())


def fetch(catalogue: Catalogue, house: House) -> None:
    """Import all models and materials that `house` needs into the cache, with a bar if that takes a while."""
    surfaces: list[Room | Opening] = [*house.rooms, *house.openings]
    finishes = {getattr(s, f.name) for s in surfaces for f in dataclasses.fields(s) if f.name.endswith("finish")} - {
        None
    }
    models = dict.fromkeys((p.asset, p.size, p.params) for p in house.placements)
    jobs = [(catalogue.finish, (key,)) for key in sorted(finishes)] + [(catalogue.mesh, m) for m in models]
    for job, arguments in bar(jobs, "furniture and materials", "model"):
        job(*arguments)


def show(args: argparse.Namespace, result: dict, text: str) -> None:
    """Print `result` as JSON where --json was given, else `text`."""
    print(json.dumps(result, indent=1, default=str) if args.json else text)


def note(text: str) -> None:
    """A line for the person who watches; goes to stderr so that --json output stays clean."""
    print(text, file=sys.stderr, flush=True)

"""Options and helpers that several subcommands share."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

from tqdm import tqdm

from embodied.options import Cached, Option, any_path

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.house.house import House, Opening, Room

T = TypeVar("T")
BAR_DELAY = 2.0
"""Seconds after which a bar appears."""
SELDOM = 30.0
"""Seconds between two states of a bar that no terminal shows, where each is a line."""


@dataclass(frozen=True, kw_only=True)
class Furnished(Cached):
    own: Annotated[tuple[Path, ...], Option(any_path, "DIR", repeated=True)] = ()
    """Folder with your own models and a catalogue.json, or your groups.toml (docs/assets.md); may be repeated."""


@dataclass(frozen=True, kw_only=True)
class Printed:
    json: bool = False
    """Print the result as JSON."""


def catalogue_of(args: Furnished) -> Catalogue:
    """The catalogue that --cache and --own describe."""
    from embodied.assets.catalogue import load_catalogue

    return load_catalogue(args.cache, own=args.own)


def check_machine(pictures: str) -> None:
    """See that this machine can light and draw such pictures, before work that would be lost.

    Raises:
      GLError: no off-screen renderer works.
      LightError: the pictures are lit, and light cannot be computed.
    """
    from embodied import gl
    from embodied.light.backend import device
    from embodied.render.pictures import parse_pictures

    if pictures == "none":
        return
    gl.info()
    if parse_pictures(pictures).quality is not None:
        device()


def pause() -> float:
    """Seconds between two states of a progress bar."""
    return 0.1 if sys.stderr.isatty() else SELDOM


def bar(items: Iterable[T], name: str, unit: str, total: int | None = None) -> Iterable[T]:
    """`items`, with a progress bar that appears when they take longer than two seconds."""
    return tqdm(items, name, total=total, unit=unit, delay=BAR_DELAY, leave=False, mininterval=pause())


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


def show(args: Printed, result: dict, text: str) -> None:
    """Print `result` as JSON where --json was given, else `text`."""
    print(json.dumps(result, indent=1, default=str) if args.json else text)


def note(text: str) -> None:
    """A line for the person who watches; goes to stderr so that --json output stays clean."""
    print(text, file=sys.stderr, flush=True)

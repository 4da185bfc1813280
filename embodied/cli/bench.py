"""Measure speed and memory here, as medians, and compare with what the project promises.

houses, pictures, steps and memory make the table of the main line; plays counts environment steps with help,
seen with pixels, drive a body on wheels with live pictures; bakes lights a flat again and again; light
compares the ways of drawing with a path tracer, growth lights houses of 40 to 400 m² and fits how the cost
grows (fast, or --quality normal), codecs compares ways of storing what was drawn (choose --quality fast),
look asks a network that has seen photographs only what the objects of --houses flats are, and how far a whole
view of each is, to it, from the path tracer's (--quality, --look, --no-traced; optional packages; it goes on
where it was stopped). Close other programs first: the numbers are only as good
as the quiet. freeze measures nothing: it makes houses, a lit flat, data sets, episodes, tables and features
in OUT/freeze and writes their digests; with --against it says of every part whether it is the same as in a
file of them (docs/freeze.json), or differs and why that is meant. serve lets --people take part in a study at
once for --seconds, in pairs, and prints how long a step takes from the browser to the disk and back.
"""

from __future__ import annotations

import argparse
import itertools
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from embodied.cli.common import add_cache, add_json, add_packs, catalogue_of, note, show
from embodied.cli.options import any_path, folder_to_write, whole
from embodied.render.pictures import DRAWN, LOOKS, PictureSettings

if TYPE_CHECKING:
    from assets.catalogue import Catalogue

PARTS = (
    "houses",
    "pictures",
    "steps",
    "plays",
    "seen",
    "drive",
    "memory",
    "bakes",
    "light",
    "growth",
    "codecs",
    "look",
    "freeze",
    "serve",
)


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "part", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)} (default: houses, pictures, steps)"
    )
    parser.add_argument("--seed", type=int, default=7, help="which houses (default: %(default)s)")
    parser.add_argument("--quality", choices=DRAWN, default="unlit", help="how pictures are drawn (default: unlit)")
    parser.add_argument(
        "--look", choices=LOOKS, default="matte", help="with what pictures, drive and look draw (default: matte)"
    )
    parser.add_argument(
        "--houses", type=whole(), help="that memory loads and drops (default: 1000), or whose things look shows (3)"
    )
    parser.add_argument(
        "--no-traced", action="store_true", help="look: leave out the comparison with path-traced views"
    )
    parser.add_argument(
        "--out",
        type=folder_to_write,
        default=Path("out/bench"),
        metavar="DIR",
        help="where light, growth, look and freeze write",
    )
    parser.add_argument(
        "--against", type=any_path, metavar="FILE", help="digests that freeze compares with (its digests.json)"
    )
    parser.add_argument("--people", type=whole(2), default=50, help="who take part at once, for serve (default: 50)")
    parser.add_argument("--seconds", type=whole(), default=60, help="how long, for serve (default: 60)")
    add_cache(parser)
    add_packs(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    from embodied import gl
    from embodied.bench import bakes, drive, episodes, seen, timing, world

    parts = args.part or ["houses", "pictures", "steps"]
    if unknown := sorted(set(parts) - set(PARTS)):
        raise ValueError(f"unknown benchmark {unknown}; choose from {PARTS}")
    alone = {"light": light, "codecs": codecs, "growth": growth, "look": look, "freeze": freeze, "serve": serve}
    if len(parts) > 1 and (reports := sorted(set(parts) & set(alone))):
        raise ValueError(f"{reports[0]} makes a report of its own; run it without {sorted(set(parts) - {reports[0]})}")
    catalogue = catalogue_of(args)
    if parts[0] in alone:
        return alone[parts[0]](args, catalogue)
    lines = {
        "houses": lambda: world.houses(catalogue, args.seed),
        "pictures": lambda: world.pictures(catalogue, args.cache, args.seed, args.quality, args.look),
        "steps": lambda: world.steps(catalogue, args.cache, args.seed),
        "plays": lambda: episodes.plays(catalogue, args.seed),
        "seen": lambda: seen.seen(catalogue, args.cache, args.seed, args.quality),
        "drive": lambda: drive.drive(catalogue, args.cache, args.seed, args.quality, args.look),
        "bakes": lambda: bakes.bakes(catalogue, args.cache, args.seed),
        "memory": lambda: world.memory(catalogue, args.cache, args.seed, args.houses or 1000),
    }
    measures = []
    for m in itertools.chain.from_iterable(lines[p]() for p in parts):
        note(timing.table([m]).splitlines()[-1])
        measures.append(m)
    facts = {"renderer": str(gl.info()), **timing.machine(), "seed": args.seed}
    head = f"{facts['renderer']}; {facts['cores']} cores, {facts['system']}, seed {args.seed}\n\n"
    show(args, {**facts, "measures": [asdict(m) for m in measures]}, head + timing.table(measures))
    return 0


def light(args: argparse.Namespace, catalogue: Catalogue) -> int:
    """The comparison of all ways of drawing."""
    from embodied.bench.light import compare

    report = compare(catalogue, args.cache, args.out, seed=args.seed, progress=note)
    show(args, report.facts, report.text)
    return 0


def look(args: argparse.Namespace, catalogue: Catalogue) -> int:
    """How much of what is drawn a network knows that has seen photographs only."""
    from agents.vision.stranger import Stranger
    from embodied.bench.look import HOUSES, recognised

    report = recognised(
        catalogue,
        args.cache,
        args.out,
        Stranger(),
        seed=args.seed,
        pictures=PictureSettings(256, args.quality, look=args.look),
        houses=args.houses or HOUSES,
        traced=not args.no_traced,
        progress=note,
    )
    show(args, report.facts, report.text)
    return 0


def codecs(args: argparse.Namespace, catalogue: Catalogue) -> int:
    """Bytes against decibels of ways to store panoramas."""
    from embodied.bench.codecs import compare

    report = compare(catalogue, args.cache, args.seed, args.quality)
    show(args, report.facts, report.text)
    return 0


def growth(args: argparse.Namespace, catalogue: Catalogue) -> int:
    """The cost of light against area."""
    from embodied.bench.growth import growth as measured
    from embodied.bench.growth import table
    from embodied.light.settings import QUALITIES

    quality = args.quality if args.quality in QUALITIES else "fast"
    facts = measured(catalogue, args.cache, args.out, seed=args.seed, quality=quality, progress=note)
    show(args, facts, table(facts))
    return 0


def serve(args: argparse.Namespace, catalogue: Catalogue) -> int:
    """People at once on a server."""
    from embodied.bench.serve import measure

    report = measure(args.out, args.cache, people=args.people, seconds=args.seconds, seed=args.seed, progress=note)
    show(args, report.facts, report.text)
    return 0


def freeze(args: argparse.Namespace, catalogue: Catalogue) -> int:
    """Digests of what must not change by accident; 1 where they differ from those of --against without a reason."""
    from assets.cache import write_json
    from embodied.bench.freeze import compare, load_frozen, make_products, summary

    before = load_frozen(args.against) if args.against else None  # refused before the work, if it is none
    found = make_products(args.out / "freeze", catalogue, args.cache, progress=note)
    write_json(args.out / "digests.json", {"digests": found}, indent=1)
    if before is None:
        show(args, {"digests": found}, f"{len(found)} digests in {args.out}/digests.json")
        return 0
    verdicts = compare(before, found)
    facts = {"digests": found, "verdicts": [asdict(v) | {"wrong": v.wrong} for v in verdicts]}
    wrong = sum(v.wrong for v in verdicts)
    end = f"{wrong} parts differ without a reason" if wrong else "nothing differs without a reason"
    show(args, facts, f"{summary(verdicts)}\n{end}")
    return int(wrong > 0)

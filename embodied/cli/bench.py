"""Measure speed and memory on this machine, as medians.

  houses, pictures, plays   generation, rendering, environment steps with help
  views, seen               views of a panorama, steps with pixels
  drive, robots             live pictures, and the steps of a body on wheels, and of a robot, that see them
  bakes                     light a flat repeatedly
  light                     compare the ways of rendering with a path tracer
  moving                    compare what moves with a path tracer, and what a frame costs then; takes an hour, in pieces
  people                    draw everybody whom one meets in six lit houses; takes half an hour

Close other programs first.
"""

from __future__ import annotations

import itertools
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

from embodied.cli.common import Furnished, Printed, catalogue_of, note, show
from embodied.options import Option, OutputFolder, drawn_as
from embodied.render.pictures import DRAWN

PARTS = ("houses", "pictures", "views", "plays", "seen", "drive", "robots", "bakes", "light", "moving", "people")


@dataclass(frozen=True, kw_only=True)
class BenchOptions(Furnished, Printed):
    part: Annotated[tuple[str, ...], Option(metavar="PART", name="part")] = ()
    """Benchmarks to run (default: houses, pictures, plays)."""
    seed: int = 7
    """Seed of the houses."""
    pictures: Annotated[str, drawn_as(DRAWN)] = "unlit"
    """How pictures, seen, drive and robots draw the house."""
    out: OutputFolder = Path("out/bench")
    """Folder for the files of light, moving and people."""


def run(args: BenchOptions) -> None:
    from embodied import gl
    from embodied.bench import light, timing, world

    parts = args.part or ["houses", "pictures", "plays"]
    if unknown := sorted(set(parts) - set(PARTS)):
        raise ValueError(f"unknown benchmark {unknown}; choose from {PARTS}")
    catalogue = catalogue_of(args)
    lines = {
        "houses": lambda: world.houses(catalogue, args.seed),
        "pictures": lambda: world.pictures(catalogue, args.cache, args.seed, args.pictures),
        "views": lambda: world.views(catalogue, args.cache, args.seed),
        "plays": lambda: world.plays(catalogue, args.seed),
        "seen": lambda: world.seen(catalogue, args.cache, args.seed, args.pictures),
        "drive": lambda: world.drive(catalogue, args.cache, args.seed, args.pictures),
        "robots": lambda: world.robots(catalogue, args.cache, args.seed, args.pictures),
        "bakes": lambda: world.bakes(catalogue, args.cache, args.seed),
    }
    measures = []
    for m in itertools.chain.from_iterable(lines[p]() for p in parts if p in lines):
        note(timing.table([m]).splitlines()[-1])
        measures.append(m)
    renderer = str(gl.info()) if gl.available() else "no OpenGL"
    facts: dict[str, Any] = {"renderer": renderer, **timing.machine(), "seed": args.seed}
    texts = [f"{facts['renderer']}; {facts['cores']} cores, {facts['system']}, seed {args.seed}"]
    facts["measures"] = [asdict(m) for m in measures]
    if measures:
        texts.append(timing.table(measures))
    if "light" in parts:
        facts["light"] = light.compare(catalogue, args.cache, args.out, seed=args.seed, progress=note)
        texts.append(light.table(facts["light"]))
    if "moving" in parts:
        from embodied.bench import moving  # late: loads the path tracer and MuJoCo

        facts["moving"] = moving.compare(catalogue, args.cache, args.out, seed=args.seed, progress=note)
        texts.append(moving.table(facts["moving"]))
    if "people" in parts:
        from embodied.bench.moments import people_pictures  # late: loads the generator and MuJoCo

        facts["people"] = people_pictures(catalogue, args.cache, args.out, seed=args.seed, progress=note)
        texts.append(f"{facts['people']['people']} people: {facts['people']['sheet']}")
    show(args, facts, "\n\n".join(texts))

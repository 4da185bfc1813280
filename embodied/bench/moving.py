"""Things that move in lit houses, against the path tracer of the same moment, and what a frame with them costs."""

import dataclasses
import functools
import itertools
import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import numpy as np

from embodied.assets.cache import write_json
from embodied.assets.catalogue import Catalogue
from embodied.assets.json_file import parse_file
from embodied.bench.light import VIEW_ANGLE, psnr
from embodied.bench.moments import BENCH_ROBOT, LOOKED_FROM, MOVING_HOURS, Staged, WithRobot, staged, truth, with_robot
from embodied.bench.timing import one_core
from embodied.house.moment import Moment
from embodied.light.moving import MovingHouse
from embodied.light.pages.tone import displayed
from embodied.render.camera import View
from embodied.world import SLACK, World, gloss_of, open_world

FLAT_LIGHT = 0.5
"""Exposed light of a thing without any light of its own."""
TIMED_FRAMES = 24
"""Of each timed way."""
FEWEST_PIXELS = 60
"""Pixels of a part of a picture that is judged."""
WAYS_MOVED = ("moving", "static", "flat")
Seen: TypeAlias = tuple[View, tuple[str, ...]]
"""A view, and the owners that its ids number."""


def drawn(s: Staged, catalogue: WithRobot, cache: Path, known: Mapping[str, np.ndarray]) -> dict[str, dict[str, Seen]]:
    """Views of every mover from its eye, with the light of what moves and with flat light and no shadows."""
    views: dict[str, dict[str, Seen]] = {"moving": {}, "flat": {}}
    for moment, movers in zip(s.moments, s.movers, strict=True):
        with open_world(s.house, catalogue.catalogue, cache, "fast", graph=s.graph) as world:
            for name, parts in catalogue.bodies.items():
                world.add(name, parts)
            world.show(moment)
            owners, first = world.renderer.owners, len(world.baked().lit.pages)

            def look(way: str) -> None:
                for name in movers:  # noqa: B023
                    (*eye, yaw, pitch), size = known[f"{name}/eye"], known[f"{name}/reference"].shape[:2]
                    views[way][name] = world.camera(eye, yaw, pitch, VIEW_ANGLE, size), owners  # noqa: B023

            look("moving")
            bare = MovingHouse(world.baked(), s.house, catalogue.catalogue, cache)
            for name, parts in catalogue.bodies.items():
                bare.add(name, parts)
            shown = bare.show(moment)
            painted = [page for surface in bare.surfaces for page in surface.pages]
            flat = [(first + k, 0, 0, displayed(page.albedo * FLAT_LIGHT)) for k, page in enumerate(painted)]
            world.renderer.replace(bare.lit, bare.moving, owners, gloss_of(world.baked(), moving=bare))
            world.renderer.change(shown.corners, flat)
            look("flat")
    return views


def judged(s: Staged, catalogue: WithRobot, cache: Path, known: Mapping[str, np.ndarray], out: Path) -> list[dict]:
    """A row of every mover: decibels of each way on the mover and on the floor; and a picture with all ways."""
    views, rows = drawn(s, catalogue, cache, known), []
    for name, kind in {**s.movers[0], **s.movers[1]}.items():
        fact = {key: known[f"{name}/{key}"] for key in ("reference", "static", "mover", "floor")}
        ways = {"static": fact["static"], **{way: seen[name][0].rgb for way, seen in views.items()}}
        own = s.carried(name) | (set(catalogue.bodies) if kind == BENCH_ROBOT else set())
        view, owners = views["moving"][name]
        numbers = [i + 1 for i, o in enumerate(owners) if o.partition("/")[0] in own]
        floors = [i + 1 for i, o in enumerate(owners) if o.endswith("/floor")]
        masks = {key: fact[key] & np.isin(view.ids, own) for key, own in (("mover", numbers), ("floor", floors))}
        masks = {key: cv2.erode(m.astype(np.uint8), np.ones((3, 3))) > 0 for key, m in masks.items()}
        row: dict = {"house": s.house.seed, "hour": s.house.sky.hour, "name": name, "kind": kind}
        for key, mask in masks.items():
            row |= {
                f"{way} {key}": psnr(p, fact["reference"], mask) if mask.sum() >= FEWEST_PIXELS else None
                for way, p in ways.items()
            }
        rows.append(row)
        strip = np.concatenate([ways["flat"], ways["moving"], ways["static"], fact["reference"]], axis=1)
        cv2.imwrite(str(out / f"{s.house.seed}_{name}.png"), strip[..., ::-1])
    return rows


def compare(
    catalogue: Catalogue, cache: Path, out: Path, *, seed: int, progress: Callable[[str], None] = lambda text: None
) -> dict:
    """Five movers in each of eight houses, then the prices; what is finished lies in `out`/moving and is kept."""
    folder = Path(out) / "moving"
    folder.mkdir(parents=True, exist_ok=True)
    known = with_robot(catalogue, cache)
    rows: list = []
    for k in range(len(MOVING_HOURS)):
        s, path = staged(known, seed, k), folder / f"{seed + k}.json"
        if not path.exists():
            facts = truth(s, known, cache, folder / f"{seed + k}.npz")
            write_json(path, judged(s, known, cache, facts, folder), indent=1)
        judged_house: Any = parse_file(path)
        rows += judged_house
        progress(f"house {seed + k}: {path}")
    path = folder / "prices.json"
    if not path.exists():
        write_json(path, prices(staged(known, seed, 0), known, cache), indent=1)
    return {"rows": rows, "prices": parse_file(path)}


def prices(s: Staged, catalogue: WithRobot, cache: Path) -> list[dict]:
    """Milliseconds of a frame, processor time, in the ways in which things move, and as shares of one at rest."""
    rows = []
    moved = {name: pose for name, pose in s.moments[0].moved.items() if s.movers[0][name] == "furniture"}
    name, pose = next(iter(moved.items()))
    x, y, z = pose.position
    drive = lambda i: {
        n: dataclasses.replace(p, position=tuple(np.add(p.position, (0.02 * i, 0, 0))))
        for n, p in s.moments[0].bodies.items()
    }
    ways = {
        "at rest": lambda i: Moment(),
        "moved, at rest": lambda i: Moment({name: pose}),
        "2 cm a frame": lambda i: Moment({name: dataclasses.replace(pose, position=(x + 0.02 * i, y, z))}),
        "robot of 15 links, 2 cm a frame": lambda i: Moment(bodies=drive(i)),
    }
    for pictures in ("fast-matte", "fast"):
        with one_core(), open_world(s.house, catalogue.catalogue, cache, pictures, graph=s.graph) as world:
            for body, parts in catalogue.bodies.items():
                world.add(body, parts)
            away = lambda e: abs(math.dist(e, (x, y, 1.5)) - LOOKED_FROM)
            eye = min(world.graph.positions, key=away)
            yaw = math.atan2(y - eye[1], x - eye[0])
            for size in ((128, 128), (480, 640)):
                draw = functools.partial(world.camera, eye, yaw, -0.5, VIEW_ANGLE, size)
                took = {way: _milliseconds(world, at, draw) for way, at in ways.items()}
                about = {"pictures": pictures, "size": size[1]}
                rows += [{**about, "way": w, "ms": ms, "share": ms / took["at rest"]} for w, ms in took.items()]
    return rows


def _milliseconds(world: World, at: Callable[[int], Moment], draw: Callable[[], object]) -> float:
    """Mean over frames, after some that are not counted."""
    start = 0.0
    for i in range(TIMED_FRAMES + 6):
        start = time.process_time() if i == 6 else start
        if i == 0 or at(i) != at(i - 1):
            world.show(at(i), slack=SLACK)
        draw()
    return 1e3 * (time.process_time() - start) / TIMED_FRAMES


def table(facts: dict) -> str:
    """Quartiles of decibels by kind and part of the picture, and prices, as Markdown."""
    lines = ["| movers | n | what | moving | static bake of the moment | flat light |", "|---|---|---|---|---|---|"]
    kinds = sorted({r["kind"] for r in facts["rows"]})
    for kind, part in itertools.product(["all", *kinds], ("mover", "floor")):
        rows = [r for r in facts["rows"] if kind in ("all", r["kind"]) and r[f"moving {part}"] is not None]
        cells = [
            "{1:.1f} ({0:.1f} to {2:.1f})".format(*np.quantile([r[f"{way} {part}"] for r in rows], (0.25, 0.5, 0.75)))
            for way in WAYS_MOVED
            if rows
        ]
        lines.append(f"| {kind} | {len(rows)} | {part} | {' | '.join(cells)} |")
    lines += ["\n| pictures | width | way | ms a frame | of one at rest |", "|---|---|---|---|---|"]
    lines += [
        f"| {r['pictures']} | {r['size']} | {r['way']} | {r['ms']:.3g} | {r['share']:.2f} |" for r in facts["prices"]
    ]
    return "\n".join(lines)

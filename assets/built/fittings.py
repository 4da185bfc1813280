"""Switches, sockets and radiators."""

from __future__ import annotations

import numpy as np

from assets.built.maker import BLACK, WHITE, FinishOf, Look, Size, material, parts_of, plain
from assets.built.primitives import box, cylinder, lathe, moved, tube, turned
from assets.records import MeshPart


def switch(size: Size, look: Look, finish: FinishOf, *, rng: np.random.Generator) -> list[MeshPart]:
    w, d, h = size
    plate = box([-w / 2, -d * 0.1, 0], [w / 2, d / 2, h], 0.002)
    rocker = turned(box([-w * 0.33, -d * 0.35, -h * 0.33], [w * 0.33, d * 0.2, h * 0.33], 0.0015), 0.05, "x")
    return parts_of((WHITE, [plate, moved(rocker, 0, -d * 0.1, h / 2)]))


def socket(size: Size, look: Look, finish: FinishOf, *, rng: np.random.Generator) -> list[MeshPart]:
    w, d, h = size
    plate = box([-w / 2, -d / 2, 0], [w / 2, d / 2, h], 0.002)
    ring = moved(
        turned(lathe([(0.0195, 0), (0.021, 0.0), (0.021, 0.0012), (0.0195, 0.0012), (0.0195, 0)], 24), np.pi / 2, "x"),
        0,
        -d / 2,
        h / 2,
    )
    well = moved(
        turned(lathe([(0, 0), (0.0195, 0), (0.0195, 0.0006), (0, 0.0006)], 24), np.pi / 2, "x"), 0, -d / 2, h / 2
    )
    holes = [
        moved(turned(cylinder(0.0025, 0, 0.001, 0, 10), np.pi / 2, "x"), x, -d / 2 - 0.0003, h / 2)
        for x in (-0.0095, 0.0095)
    ]
    return parts_of((WHITE, [plate, ring]), (plain((0.78, 0.77, 0.75), 0.5), well), (BLACK, holes))


def radiator(size: Size, look: Look, finish: FinishOf, *, rng: np.random.Generator) -> list[MeshPart]:
    """Panel radiator with ribs, grille and valve; or columns where look['kind'] is 'columns'."""
    w, d, h = size
    made = []
    if look.get("kind") == "columns":
        count = max(4, round(w / 0.055))
        for x in np.linspace(-w / 2 + 0.022, w / 2 - 0.022, count):
            for y in (-d * 0.28, d * 0.28):
                made.append(tube([(x, y, 0.03), (x, y, h - 0.03)], 0.0125, 8, caps=False))
            for z in (0.03, h - 0.03):
                made.append(box([x - 0.02, -d / 2, z - 0.03], [x + 0.02, d / 2, z + 0.03], 0.010))
    else:
        made.append(box([-w / 2, -d / 2 + 0.012, 0], [w / 2, d / 2 - 0.02, h], 0.006))
        ribs = max(6, round(w / 0.05))
        for x in np.linspace(-w / 2 + 0.03, w / 2 - 0.03, ribs):
            made.append(box([x - 0.014, -d / 2, 0.03], [x + 0.014, -d / 2 + 0.015, h - 0.03], 0.005))
        made += [box([-w / 2 + 0.1, d / 2 - 0.02, z], [-w / 2 + 0.13, d / 2, z + 0.05]) for z in (0.1, h - 0.15)]
        made += [box([w / 2 - 0.13, d / 2 - 0.02, z], [w / 2 - 0.1, d / 2, z + 0.05]) for z in (0.1, h - 0.15)]
    grille = (
        []
        if look.get("kind") == "columns"
        else [
            box([x - 0.004, -d / 2 + 0.02, h - 0.001], [x + 0.004, d / 2 - 0.028, h + 0.0015])
            for x in np.linspace(-w / 2 + 0.02, w / 2 - 0.02, max(8, round(w / 0.022)))
        ]
    )
    knob = moved(turned(cylinder(0.018, 0, 0.06, 0.004, 14), np.pi / 2, "y"), w / 2 - 0.05, -d / 2 + 0.03, 0.05)
    return parts_of(
        (
            finish("lacquer_white/0")
            if look.get("skin") is None
            else material(look, "skin", finish, "lacquer_white/0"),
            made,
        ),
        (plain((0.35, 0.35, 0.35), 0.6), grille),
        (WHITE, knob),
    )

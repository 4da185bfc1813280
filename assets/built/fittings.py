"""Switches, sockets, radiators and washing machines."""

from __future__ import annotations

import numpy as np

from embodied.assets.built.parametric import BuildRequest, parts_of, plain
from embodied.assets.built.primitives import Shape, box, cylinder, lathe, quads, tube
from embodied.assets.records import MeshPart


def switch(spec: BuildRequest) -> list[MeshPart]:
    w, d, h = spec.size
    plate = box([-w / 2, -d * 0.1, 0], [w / 2, d / 2, h], 0.002)
    rocker = box([-w * 0.33, -d * 0.35, -h * 0.33], [w * 0.33, d * 0.2, h * 0.33], 0.0015).turned(0.05, "x")
    return parts_of(("white", [plate, rocker.moved(0, -d * 0.1, h / 2)]))


def socket(spec: BuildRequest) -> list[MeshPart]:
    w, d, h = spec.size
    plate = box([-w / 2, -d / 2, 0], [w / 2, d / 2, h], 0.002)
    around = [(0.0195, 0), (0.021, 0.0), (0.021, 0.0012), (0.0195, 0.0012), (0.0195, 0)]
    ring = lathe(around, 24).hung(0, -d / 2, h / 2)
    well = lathe([(0, 0), (0.0195, 0), (0.0195, 0.0006), (0, 0.0006)], 24).hung(0, -d / 2, h / 2)
    holes = [cylinder(0.0025, 0, 0.001, 0, 10).hung(x, -d / 2 - 0.0003, h / 2) for x in (-0.0095, 0.0095)]
    return parts_of(("white", [plate, ring]), (plain((0.78, 0.77, 0.75), 0.5), well), ("black", holes))


def radiator(spec: BuildRequest) -> list[MeshPart]:
    """Panel radiator with ribs, grille and valve; or columns where params['kind'] is 'columns'."""
    w, d, h = spec.size
    made: list[Shape] = []
    grille: list[Shape] = []
    pipe: list[Shape] = []
    if spec.params.get("kind") == "columns":
        count = max(4, round(w / 0.055))
        for x in np.linspace(-w / 2 + 0.022, w / 2 - 0.022, count):
            for y in (-d * 0.28, d * 0.28):
                made.append(tube([(x, y, 0.03), (x, y, h - 0.03)], 0.0125, 8, caps=False))
            for z in (0.03, h - 0.03):
                made.append(box([x - 0.02, -d / 2, z - 0.03], [x + 0.02, d / 2, z + 0.03], 0.010))
        knob = [cylinder(0.018, 0, 0.06, 0.004, 14).turned(np.pi / 2, "y").moved(w / 2 - 0.05, -d / 2 + 0.03, 0.05)]
    else:
        right = w / 2 - 0.07  # the valve stands beside the panel
        made.append(box([-w / 2, -d / 2 + 0.016, 0], [right, d / 2 - 0.02, h], 0.006))
        for x in np.linspace(-w / 2 + 0.03, right - 0.03, max(6, round(w / 0.055))):
            made.append(_rib(x, -d / 2, 0.035, h - 0.035))
        made += [
            box([x - 0.015, d / 2 - 0.02, z], [x + 0.015, d / 2, z + 0.05])
            for x in (-w / 2 + 0.115, right - 0.115)
            for z in (0.1, h - 0.15)
        ]
        grille = [
            box([x - 0.004, -d / 2 + 0.02, h - 0.001], [x + 0.004, d / 2 - 0.028, h + 0.0015])
            for x in np.linspace(-w / 2 + 0.02, w / 2 - 0.09, max(8, round(w / 0.022)))
        ]
        knob, pipe = _valve(w / 2 - 0.03, right, d, h)
    return parts_of(
        (spec.material("skin", "lacquer_white/0"), made),
        ("chrome", pipe),
        (plain((0.35, 0.35, 0.35), 0.6), grille),
        ("white", knob),
    )


def _rib(x: float, y: float, z0: float, z1: float) -> Shape:
    """A pressed rib of a panel radiator, its face at y and its sides sloping back 16 mm, so that light models it."""
    a, b, deep = 0.010, 0.022, 0.0165
    front, back = [(x - a, y), (x + a, y)], [(x - b, y + deep), (x + b, y + deep)]
    (p, q), (r, s) = front, back
    lift = 0.02
    return quads(
        [
            [(*p, z0 + lift), (*q, z0 + lift), (*q, z1 - lift), (*p, z1 - lift)],
            [(*r, z0), (*p, z0 + lift), (*p, z1 - lift), (*r, z1)],
            [(*q, z0 + lift), (*s, z0), (*s, z1), (*q, z1 - lift)],
            [(*p, z1 - lift), (*q, z1 - lift), (*s, z1), (*r, z1)],
            [(*r, z0), (*s, z0), (*q, z0 + lift), (*p, z0 + lift)],
        ]
    )


def _valve(x: float, panel: float, d: float, h: float) -> tuple[list[Shape], list[Shape]]:
    """A thermostat's head above the valve at x beside the panel's edge, and the pipes to panel, wall and vent."""
    y = -d / 2 + 0.035
    head = lathe([(0, 0.075), (0.017, 0.075), (0.021, 0.082), (0.022, 0.135), (0.018, 0.142), (0, 0.142)], 18, 0.9)
    around = ((x + 0.0215 * np.cos(t), y + 0.0215 * np.sin(t)) for t in np.linspace(0, 2 * np.pi, 9)[:-1])
    ribs = [box([u - 0.002, v - 0.002, 0.088], [u + 0.002, v + 0.002, 0.13]) for u, v in around]
    pipes = [
        cylinder(0.012, 0.02, 0.078, 0.002, 14).moved(x, y, 0),
        tube([(x, y, 0.045), (panel - 0.01, y, 0.045)], 0.009, 10),
        tube([(x, y, 0.03), (x, d / 2, 0.03)], 0.008, 10),
        cylinder(0.008, 0, 0.014, 0.002, 10).turned(np.pi / 2, "y").moved(panel - 0.002, y, h - 0.06),
    ]
    return [head.moved(x, y, 0), *ribs], pipes


def washer(spec: BuildRequest) -> list[MeshPart]:
    """A washing machine that is filled from before; dial, keys and display on a panel that rises behind its top."""
    w, d, h = spec.size
    top, panel_y = 0.84 * h, 0.25 * d
    y = -d / 2 + 0.03
    body = [
        box([-w / 2, y, 0.02], [w / 2, d / 2, top - 0.026], 0.008),
        box([-w / 2, y - 0.006, top - 0.024], [w / 2, d / 2, top], 0.006),
        box([-w / 2 + 0.01, panel_y, top - 0.01], [w / 2 - 0.01, d / 2, h], 0.012),
    ]
    foot = cylinder(0.02, 0, 0.022, 0.002, 12)
    feet = [foot.moved(a * (w / 2 - 0.05), b * (d / 2 - 0.06)) for a in (-1, 1) for b in (-1, 1)]
    middle, r = 0.46 * top, 0.34 * w
    rim = [(0.74, 0.0), (1.0, 0.0), (1.0, 0.012), (0.93, 0.026), (0.80, 0.030), (0.74, 0.022)]
    ring = lathe([(r * a, z) for a, z in rim], 40, 0.6).hung(0, y, middle)
    dark = lathe([(0, 0.002), (r * 0.75, 0.002)], 32).hung(0, y, middle)
    drum = [lathe([(r * a, 0.003), (r * (a + 0.05), 0.004)], 32).hung(0, y, middle) for a in (0.62, 0.40)]
    bowl = np.linspace(0, np.pi / 2, 6)
    glass = lathe(np.stack([r * 0.75 * np.cos(bowl), 0.008 + 0.016 * np.sin(bowl)], 1), 32, 0.9).hung(0, y, middle)
    grip = box([r * 0.84, y - 0.034, middle - 0.055], [r * 0.95, y - 0.02, middle + 0.055], 0.005)
    flap = box([w * 0.26, y - 0.003, 0.045], [w * 0.42, y + 0.002, 0.115], 0.001)
    seam = [box([-w / 2 + 0.004, y - 0.0012, z], [w / 2 - 0.004, y + 0.01, z + 0.004]) for z in (0.145, top - 0.030)]
    seam.append(box([w * 0.258, y - 0.001, 0.043], [w * 0.422, y + 0.002, 0.117]))
    z = (top + h) / 2 + 0.002
    dial = [
        lathe([(0, 0), (0.034, 0), (0.032, 0.016), (0.028, 0.02), (0, 0.02)], 24).hung(0.06, panel_y, z),
        lathe([(0.038, 0), (0.040, 0.001), (0.038, 0.002)], 28).hung(0.06, panel_y, z),
    ]
    around = ((0.06 + 0.045 * np.cos(t), z + 0.045 * np.sin(t)) for t in np.linspace(0, 2 * np.pi, 13)[:-1])
    ticks = [box([x - 0.002, panel_y - 0.0012, up - 0.002], [x + 0.002, panel_y, up + 0.002]) for x, up in around]
    mark = box([0.058, panel_y - 0.0215, z + 0.008], [0.062, panel_y - 0.018, z + 0.026])
    keys = [cylinder(0.009, 0, 0.006, 0.002, 12).hung(x, panel_y, z) for x in np.linspace(0.15, 0.25, 4)]
    display = box([-0.08, panel_y - 0.002, z - 0.018], [-0.005, panel_y + 0.001, z + 0.018], 0.001)
    drawer = box([-0.27, panel_y - 0.004, z - 0.026], [-0.11, panel_y + 0.001, z + 0.026], 0.003)
    pull = box([-0.225, panel_y - 0.0045, z - 0.016], [-0.155, panel_y, z - 0.004], 0.001)
    return parts_of(
        ("enamel", [*body, flap, drawer]),
        (plain((0.5, 0.51, 0.52), 0.3), ring),
        ("chrome", [grip, *dial]),
        (plain((0.035, 0.04, 0.045), 0.15), dark),
        ("steel", drum),
        ("dark glass", glass),
        ("gap", seam),
        (plain((0.35, 0.36, 0.37), 0.4), [*ticks, *keys, pull]),
        ("black", [*feet, mark]),
        (plain((0.03, 0.05, 0.06), 0.1), display),
    )

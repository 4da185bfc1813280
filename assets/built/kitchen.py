"""Kitchen units that belong together: base, drawers, sink, cooker, wall and tall cabinets, island, hood."""

import itertools
from collections.abc import Sequence

import numpy as np

from embodied.assets.built.parametric import (
    BuildRequest,
    FinishedShapes,
    carcass,
    front,
    handle,
    joints,
    parts_of,
    plain,
)
from embodied.assets.built.primitives import Shape, between, box, cylinder, joined, lathe, quads, tube, upright
from embodied.assets.records import MeshPart

TOP = 0.038
"""Thickness of the worktop, metres."""
PLINTH = (0.10, 0.06)
"""Height of the plinth and how far it stands back, metres."""


def _base(
    spec: BuildRequest,
    h: float,
    doors: list[Shape],
    grips: list[Shape],
    top: list[Shape] | None = None,
    extra: Sequence[FinishedShapes] = (),
) -> list[MeshPart]:
    w, d, _ = spec.size
    body = carcass((-w / 2, -d / 2 + 0.022, PLINTH[0]), (w / 2, d / 2, h - TOP), top=top is None)
    plinth = box([-w / 2, -d / 2 + 0.022 + PLINTH[1], 0], [w / 2, -d / 2 + 0.04 + PLINTH[1], PLINTH[0]])
    worktop = [box([-w / 2, -d / 2, h - TOP], [w / 2, d / 2, h], 0.003)] if top is None else top
    return parts_of(
        ("white", body),
        ("black", plinth),
        joints(doors),
        (spec.material("front", "lacquer_white/0"), doors),
        (spec.metal(), grips),
        (spec.material("worktop", "oak_worktop/0"), worktop),
        *extra,
    )


def base(spec: BuildRequest) -> list[MeshPart]:
    """Doors, or drawers where params['drawers'] > 0, under a worktop."""
    w, d, h = spec.size
    y, z0, z1 = -d / 2 + 0.002, PLINTH[0], h - TOP - 0.003
    drawers, style, grip = (int(spec.params.get("drawers", 0)), spec.word("style", "flat"), spec.word("handle", "bar"))
    columns = max(1, round(w / 0.6))
    edges = np.linspace(-w / 2, w / 2, columns + 1)
    doors, grips = [], []
    for a, b in itertools.pairwise(edges):
        if drawers:
            rows = np.cumsum([0.0, *([0.24] if drawers == 3 else []), *([0.38] * 2)])
            rows = rows / rows[-1]
            for r0, r1 in itertools.pairwise(rows):
                zt, zb = z1 - r0 * (z1 - z0), z1 - r1 * (z1 - z0)
                doors.append(front(a, b, zb, zt, y, style))
                grips.append(handle((a + b) / 2, zt - 0.05, y, grip, False, min(0.2, (b - a) * 0.4)))
        else:
            doors.append(front(a, b, z0, z1, y, style))
            left = (b + a) / 2 > 0 or columns == 1
            grips.append(handle(a + 0.04 if left else b - 0.04, z1 - 0.12, y, grip, True))
    return _base(spec, h, doors, grips)


def corner(spec: BuildRequest) -> list[MeshPart]:
    """A blind corner unit: one door, one fixed filler."""
    w, d, h = spec.size
    y, z0, z1 = -d / 2 + 0.002, PLINTH[0], h - TOP - 0.003
    style = spec.word("style", "flat")
    doors = [front(-w / 2, 0, z0, z1, y, style), box([0.0, y, z0], [w / 2, y + 0.02, z1], 0.001)]
    grips = [handle(-0.05, z1 - 0.12, y, spec.word("handle", "bar"), True)]
    return _base(spec, h, doors, grips)


def sink(spec: BuildRequest) -> list[MeshPart]:
    """A base unit with a steel basin let into the worktop, and a mixer tap behind it."""
    w, d, h = spec.size
    tap_rise = 0.30
    h = h - tap_rise
    y, z0, z1 = -d / 2 + 0.002, PLINTH[0], h - TOP - 0.003
    bw, bd, deep = min(0.50, w - 0.12), 0.38, 0.17
    by = -0.03
    lo, hi = np.array([-bw / 2, by - bd / 2]), np.array([bw / 2, by + bd / 2])
    worktop = [
        box([-w / 2, -d / 2, h - TOP], [lo[0], d / 2, h], 0.0),
        box([hi[0], -d / 2, h - TOP], [w / 2, d / 2, h], 0.0),
        box([lo[0], -d / 2, h - TOP], [hi[0], lo[1], h], 0.0),
        box([lo[0], hi[1], h - TOP], [hi[0], d / 2, h], 0.0),
    ]
    rim = [
        box([lo[0] - 0.012, lo[1] - 0.012, h], [lo[0] + 0.006, hi[1] + 0.012, h + 0.004], 0.0015),
        box([hi[0] - 0.006, lo[1] - 0.012, h], [hi[0] + 0.012, hi[1] + 0.012, h + 0.004], 0.0015),
        box([lo[0], lo[1] - 0.012, h], [hi[0], lo[1] + 0.006, h + 0.004], 0.0015),
        box([lo[0], hi[1] - 0.006, h], [hi[0], hi[1] + 0.012, h + 0.004], 0.0015),
    ]
    (x0, y0), (x1, y1), rim_width = lo, hi, 0.03
    f0, f1 = np.array([x0, y0]) + rim_width, np.array([x1, y1]) - rim_width
    top = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    low = [(f0[0], f0[1]), (f1[0], f0[1]), (f1[0], f1[1]), (f0[0], f1[1])]
    zb = h - deep
    ground = [(*p, zb) for p in low]
    basin = joined(between([(*p, h) for p in top], ground), quads([ground]))
    drain = cylinder(0.035, 0, 0.003, 0.001, 14).moved(0, by, zb)
    ty = hi[1] + 0.045
    t = np.linspace(0, np.pi, 10)
    bow = np.stack([0 * t, ty - 0.085 + 0.085 * np.cos(t), h + 0.20 + 0.085 * np.sin(t)], 1)
    neck = np.concatenate([[(0, ty, h), (0, ty, h + 0.17)], bow, [(0, ty - 0.17, h + 0.15)]])
    tap = [
        tube(neck, 0.012, 10),
        cylinder(0.025, 0, 0.02, 0.004, 14).moved(0, ty, h),
        tube([(0.012, ty, h + 0.06), (0.05, ty, h + 0.075), (0.085, ty - 0.01, h + 0.10)], 0.007, 8),
    ]
    style, grip = spec.word("style", "flat"), spec.word("handle", "bar")
    pair = w > 0.7
    edges = [-w / 2, 0, w / 2] if pair else [-w / 2, w / 2]
    doors = [front(a, b, z0, z1, y, style) for a, b in itertools.pairwise(edges)]
    grips = [handle(x, z1 - 0.12, y, grip, True) for x in ((-0.05, 0.05) if pair else (w / 2 - 0.045,))]
    return _base(spec, h, doors, grips, worktop, (("steel", [*rim, basin, drain]), ("chrome", tap)))


def cooker(spec: BuildRequest) -> list[MeshPart]:
    """Built-in oven with a glass door under a ceramic hob in the worktop."""
    w, d, h = spec.size
    y, z0, z1 = -d / 2 + 0.002, PLINTH[0], h - TOP - 0.003
    panel, drawer = 0.11, 0.12
    ow = min(w, 0.6)
    edges = ((-w / 2, -ow / 2), (ow / 2, w / 2)) if w - ow >= 0.01 else ()
    sides = [box([a, y, z0], [b, y + 0.02, z1], 0.001) for a, b in edges]
    kick = front(-ow / 2, ow / 2, z0, z0 + drawer, y, "flat")
    steel = [box([-ow / 2 + 0.002, y, z1 - panel], [ow / 2 - 0.002, y + 0.02, z1], 0.002)]
    glass = [box([-ow / 2 + 0.002, y, z0 + drawer + 0.003], [ow / 2 - 0.002, y + 0.02, z1 - panel - 0.003], 0.003)]
    hob = [box([-ow / 2 + 0.01, -0.26, h], [ow / 2 - 0.01, 0.25, h + 0.006], 0.002)]
    rings = [
        lathe([(r - 0.0025, 0), (r, 0), (r, 0.0006), (r - 0.0025, 0.0006)], 28).moved(x, yy, h + 0.0058)
        for x, yy, big in ((-0.14, -0.11, 0.09), (0.14, -0.11, 0.07), (-0.14, 0.12, 0.07), (0.14, 0.12, 0.105))
        for r in (big, big * 0.62)
    ]
    touch = [box([x - 0.006, -0.243, h + 0.0055], [x + 0.006, -0.231, h + 0.0064]) for x in np.linspace(-0.1, 0.1, 6)]
    knobs = [_knob().moved(x, y, z1 - panel / 2) for x in (-0.22, -0.13, 0.13, 0.22)]
    marks = [
        box([x - 0.0012, y - 0.0275, z1 - panel / 2], [x + 0.0012, y - 0.024, z1 - panel / 2 + 0.014])
        for x in (-0.22, -0.13, 0.13, 0.22)
    ]
    low, high = z0 + drawer + 0.06, z1 - panel - 0.11
    pane = box([-ow / 2 + 0.07, y - 0.001, low], [ow / 2 - 0.07, y + 0.002, high], 0.0008)
    racks = [
        box([-ow / 2 + 0.075, y - 0.0014, z - 0.0015], [ow / 2 - 0.075, y, z + 0.0015])
        for z in low + (high - low) * np.array([0.25, 0.28, 0.6, 0.63])
    ]
    display = [box([-0.06, y - 0.0015, z1 - 0.075], [0.06, y + 0.002, z1 - 0.035])]
    grip = _level_grip(0, z1 - panel - 0.05, y - 0.002, ow * 0.78)
    extra = (
        ("steel", [*steel, grip, *knobs, *racks]),
        (plain((0.10, 0.095, 0.09), 0.06), pane),
        ("white", [*marks, *touch]),
        (plain((0.03, 0.03, 0.035), 0.08), [*glass, *hob, *display]),
        (plain((0.55, 0.55, 0.56), 0.3), rings),
    )
    worktop = [box([-w / 2, -d / 2, h - TOP], [w / 2, d / 2, h], 0.003)]
    return _base(spec, h, [*sides, kick], [], worktop, extra)


def _level_grip(x: float, z: float, y: float, length: float) -> Shape:
    """The round bar of an oven's door on two feet."""
    bar = tube([(x - length / 2, y - 0.026, z), (x + length / 2, y - 0.026, z)], 0.0075, 10)
    ends = (x + s * (length / 2 - 0.03) for s in (-1, 1))
    return joined(bar, *[tube([(at, y, z), (at, y - 0.026, z)], 0.006, 8) for at in ends])


def _knob() -> Shape:
    t = lathe([(0, 0), (0.021, 0), (0.021, 0.004), (0.017, 0.006), (0.0155, 0.024), (0.012, 0.026), (0, 0.026)], 16)
    m = t.vertices[:, [0, 2, 1]] * [1, -1, 1]
    n = t.normals[:, [0, 2, 1]] * [1, -1, 1]
    return Shape(m, t.faces, n, t.uv)


def wall_cabinet(spec: BuildRequest) -> list[MeshPart]:
    """Doors on a box; where params['glazed'] is 1 two of glass with bars, crockery on the boards behind them."""
    w, d, h = spec.size
    y = -d / 2 + 0.002
    style, grip = spec.word("style", "flat"), spec.word("handle", "bar")
    columns = max(2, round(w / 0.4)) if spec.params.get("glazed") and w > 0.45 else max(1, round(w / 0.5))
    edges = np.linspace(-w / 2, w / 2, columns + 1)
    doors, grips, panes, inside = [], [], [], []
    crockery: list[FinishedShapes] = []
    for k, (a, b) in enumerate(itertools.pairwise(edges)):
        if spec.params.get("glazed"):
            r = 0.05
            doors += [
                box([a + 0.0015, y, 0.0015], [a + r, y + 0.02, h - 0.0015], 0.0015),
                box([b - r, y, 0.0015], [b - 0.0015, y + 0.02, h - 0.0015], 0.0015),
                box([a + r, y, h - r], [b - r, y + 0.02, h - 0.0015], 0.0015),
                box([a + r, y, 0.0015], [b - r, y + 0.02, r], 0.0015),
                *(box([a + r, y + 0.004, z - 0.007], [b - r, y + 0.016, z + 0.007], 0.002) for z in (h / 3, 2 * h / 3)),
            ]
            panes.append(upright(a + r, b - r, r, h - r, y + 0.01))
        else:
            doors.append(front(a, b, 0, h, y, style))
        left = columns > 1 and k % 2 == 1
        grips.append(handle(a + 0.035 if left else b - 0.035, 0.12, y, grip, True))
    if spec.params.get("glazed"):
        heights = np.linspace(0, h, 4)[1:-1]
        inside = [box([-w / 2 + 0.018, y + 0.05, z], [w / 2 - 0.018, d / 2 - 0.01, z + 0.018]) for z in heights]
        crockery = _crockery(w - 0.06, y + 0.06, d / 2 - 0.03, (0.018, h / 3 + 0.018, 2 * h / 3 + 0.018), rng=spec.rng)
    return parts_of(
        ("white", [carcass((-w / 2, y + 0.02, 0), (w / 2, d / 2, h)), *inside]),
        joints([] if spec.params.get("glazed") else doors),
        (spec.material("front", "lacquer_white/0"), doors),
        (spec.metal(), grips),
        *crockery,
        ("glass", panes),
    )


def _crockery(
    width: float, y0: float, y1: float, boards: Sequence[float], *, rng: np.random.Generator
) -> list[FinishedShapes]:
    """Plates below, bowls and cups above them, glasses on top, standing on boards between y0 and y1."""
    y, r = (y0 + y1) / 2, min(0.10, (y1 - y0) / 2)
    plate = [(0, 0), (r * 0.6, 0), (r, 0.02), (r * 0.99, 0.022), (r * 0.6, 0.006), (0, 0.005)]
    dish = [(0, 0), (r * 0.35, 0), (r * 0.62, 0.04), (r * 0.7, 0.06), (r * 0.66, 0.06), (r * 0.3, 0.01), (0, 0.01)]
    cup = [(0, 0), (0.026, 0), (0.038, 0.075), (0.035, 0.075), (0.024, 0.008), (0, 0.008)]
    glass = [(0, 0), (0.026, 0), (0.032, 0.11), (0.030, 0.11), (0.024, 0.006), (0, 0.006)]
    white = plain((0.91, 0.90, 0.88), 0.15)
    colour = plain(((0.33, 0.45, 0.53), (0.72, 0.62, 0.48))[int(rng.integers(2))], 0.2)
    light: list[Shape] = []
    tinted: list[Shape] = []
    clear: list[Shape] = []
    for x, pile, count in ((-width / 4, light, 6), (width / 4, tinted, 5)):
        pile += [lathe(plate, 18, 0.6).moved(x, y, boards[0] + 0.009 * k) for k in range(count)]
    pile = light if rng.random() < 0.5 else tinted
    pile += [lathe(dish, 16, 0.6).moved(-width / 4, y, boards[1] + 0.018 * k) for k in range(3)]
    ear = tube([(0.032, 0, 0.062), (0.055, 0, 0.052), (0.052, 0, 0.028), (0.03, 0, 0.02)], 0.004, 5)
    for x in (width * 0.14, width * 0.34):
        light.append(joined(lathe(cup, 14, 0.6), ear).turned(float(rng.uniform(-2.6, -0.5))).moved(x, y, boards[1]))
    clear += [lathe(glass, 12, 0.6).moved(x * width, y, boards[2]) for x in (-0.38, -0.22, -0.06, 0.14, 0.3)]
    return [(white, light), (colour, tinted), ("glass", clear)]


def tall_cabinet(spec: BuildRequest) -> list[MeshPart]:
    """Larder unit: a tall door over a short one."""
    w, d, h = spec.size
    y = -d / 2 + 0.002
    style, grip = spec.word("style", "flat"), spec.word("handle", "bar")
    cut = PLINTH[0] + 0.72
    edges = np.linspace(-w / 2, w / 2, max(1, round(w / 0.6)) + 1)
    rows = ((PLINTH[0], cut), (cut, h))
    doors = [front(a, b, z0, z1, y, style) for a, b in itertools.pairwise(edges) for z0, z1 in rows]
    grips = [handle(b - 0.04, z, y, grip, True) for b in edges[1:] for z in (cut - 0.12, cut + 0.2)]
    side = box([-w / 2, y + 0.022, 0], [w / 2, d / 2, h], 0.002)
    return parts_of((spec.material("front", "lacquer_white/0"), [*doors, side]), joints(doors), (spec.metal(), grips))


def fridge(spec: BuildRequest) -> list[MeshPart]:
    """Two doors over one another, a dark seal between them, upright grips that meet there.

    On the upper door params['notes'] papers hang under magnets; where params['water'] is 1 it gives water and ice.
    """
    w, d, h = spec.size
    front_y, thick, split, foot = -d / 2 + 0.052, 0.062, h * 0.36, 0.07
    back_of_doors = front_y + thick
    body = box([-w / 2 + 0.003, back_of_doors + 0.012, foot - 0.02], [w / 2 - 0.003, d / 2, h], 0.004)
    seal = [
        box([-w / 2 + 0.012, back_of_doors - 0.004, foot], [w / 2 - 0.012, back_of_doors + 0.014, h - 0.012]),
        box([-w / 2 + 0.006, front_y + 0.012, split - 0.012], [w / 2 - 0.006, back_of_doors, split + 0.012]),
    ]
    base = box([-w / 2 + 0.02, back_of_doors - 0.01, 0], [w / 2 - 0.02, d / 2 - 0.03, foot - 0.02])
    slats = [
        box([-w / 2 + 0.05, back_of_doors - 0.014, z], [w / 2 - 0.05, back_of_doors - 0.008, z + 0.006])
        for z in (0.012, 0.024, 0.036)
    ]
    rows = ((foot - 0.012, split - 0.008), (split + 0.008, h - 0.004))
    doors = [box([-w / 2, front_y, z0], [w / 2, back_of_doors, z1], 0.016) for z0, z1 in rows]
    hinges = [box([w / 2 - 0.09, back_of_doors - 0.03, h - 0.006], [w / 2 - 0.01, back_of_doors + 0.05, h], 0.002)]
    x = -w / 2 + 0.055
    grips = [_long_grip(x, front_y, z0, z1) for z0, z1 in ((split - 0.46, split - 0.04), (split + 0.04, split + 0.70))]
    badge = box([-0.045, front_y - 0.0015, h - 0.085], [0.045, front_y + 0.001, h - 0.066], 0.0005)
    papers, magnets = _notes(int(spec.params.get("notes", 0)), w, h, front_y, rng=spec.rng)
    skin = spec.material("front", "lacquer_white/0")
    sides = plain((0.42, 0.42, 0.43), 0.5) if skin.metallic else skin
    return parts_of(
        (skin, doors),
        (sides, body),
        ("black", [base]),
        (plain((0.09, 0.09, 0.095), 0.7), seal),
        (plain((0.3, 0.3, 0.31), 0.5), [*slats, *hinges]),
        (spec.metal("steel"), [*grips, badge]),
        *(_water(front_y, split + 0.30) if spec.params.get("water") else _display(front_y, split + 0.56 * (h - split))),
        *papers,
        (plain((0.62, 0.16, 0.14), 0.4), magnets),
    )


def _display(y: float, z: float) -> list[FinishedShapes]:
    """The temperature on a fridge's door at y."""
    panel = box([-0.055, y - 0.0012, z], [0.055, y + 0.001, z + 0.034], 0.0005)
    digits = [box([x, y - 0.0018, z + 0.012], [x + 0.007, y, z + 0.022]) for x in (-0.035, -0.024, 0.016, 0.027)]
    return [(plain((0.02, 0.02, 0.025), 0.08), panel), (plain((0.55, 0.8, 0.9), 0.3), digits)]


def _water(y: float, z: float) -> list[FinishedShapes]:
    """Water and ice from a fridge's door at y: a steel frame, a dark niche, keys over it, a spout, a tray."""
    wide, high, rim, x = 0.20, 0.36, 0.012, 0.04
    x0, x1, sill = x - wide / 2, x + wide / 2, z + 0.26
    frame = [
        box([x0, y - 0.006, z], [x0 + rim, y + 0.002, z + high], 0.002),
        box([x1 - rim, y - 0.006, z], [x1, y + 0.002, z + high], 0.002),
        *(
            box([x0 + rim, y - 0.006, a], [x1 - rim, y + 0.002, a + rim], 0.002)
            for a in (z, sill - rim, z + high - rim)
        ),
    ]
    niche = box([x0 + rim, y - 0.0012, z + rim], [x1 - rim, y + 0.001, sill - rim])
    keys = box([x0 + rim, y - 0.003, sill], [x1 - rim, y + 0.001, z + high - rim], 0.001)
    lit = [
        box([x + k * 0.05 - 0.012, y - 0.0036, sill + 0.04], [x + k * 0.05 + 0.012, y, sill + 0.052])
        for k in (-1, 0, 1)
    ]
    spout = cylinder(0.016, 0, 0.03, 0.003, 14).moved(x, y - 0.014, sill - rim - 0.03)
    lever = box([x - 0.02, y - 0.008, z + 0.07], [x + 0.02, y, sill - 0.06], 0.003)
    tray = box([x0 + rim, y - 0.022, z + rim], [x1 - rim, y, z + rim + 0.008], 0.002)
    return [
        ("steel", [*frame, tray]),
        (plain((0.035, 0.035, 0.04), 0.25), [niche, keys]),
        (plain((0.2, 0.2, 0.21), 0.3), [spout, lever]),
        (plain((0.55, 0.8, 0.9), 0.3), lit),
    ]


def _notes(
    count: int, w: float, h: float, y: float, *, rng: np.random.Generator
) -> tuple[list[FinishedShapes], list[Shape]]:
    """Papers on a fridge's door at y, and the magnets that hold them."""
    papers: list[FinishedShapes] = []
    magnets: list[Shape] = []
    for k in range(count):
        x = (k % 3 - 1) * w * 0.24 + rng.normal(0, 0.015) + 0.03
        z = h - 0.16 - 0.21 * (k // 3) - rng.uniform(0, 0.05)
        pw, ph = rng.uniform(0.07, 0.12), rng.uniform(0.08, 0.16)
        leaf = box([-pw / 2, -0.0008, -ph], [pw / 2, 0, 0]).turned(rng.normal(0, 0.05), "y")
        tint = ((0.9, 0.885, 0.84), (0.9, 0.8, 0.4), (0.9, 0.885, 0.84), (0.75, 0.83, 0.88), (0.88, 0.62, 0.66))
        papers.append((plain(tint[int(rng.integers(5))], 0.9), leaf.moved(x, y - 0.0004, z)))
        magnets.append(cylinder(0.012, 0, 0.006, 0.002, 12).hung(x, y, z - 0.015))
    return papers, magnets


def _long_grip(x: float, y: float, z0: float, z1: float) -> Shape:
    """An upright bar on two feet before a front at y."""
    bar = box([x - 0.011, y - 0.052, z0], [x + 0.011, y - 0.034, z1], 0.006)
    feet = [
        box([x - 0.008, y - 0.04, z - 0.014], [x + 0.008, y + 0.002, z + 0.014], 0.003) for z in (z0 + 0.04, z1 - 0.04)
    ]
    return joined(bar, *feet)


def island(spec: BuildRequest) -> list[MeshPart]:
    """Cabinets on one side, a panelled back, a thick overhanging top for stools."""
    w, d, h = spec.size
    bw, back = w - 0.06, d / 2 - min(0.28, d * 0.3)
    y, z0, z1 = -d / 2 + 0.03, PLINTH[0], h - 0.045
    style, grip = spec.word("style", "flat"), spec.word("handle", "bar")
    edges = np.linspace(-bw / 2, bw / 2, max(2, round(bw / 0.55)) + 1)
    doors, grips = [], []
    for k, (a, b) in enumerate(itertools.pairwise(edges)):
        if k % 2:
            doors.append(front(a, b, z0, z1, y, style))
            grips.append(handle(a + 0.04, z1 - 0.12, y, grip, True))
        else:
            for q0, q1 in ((0, 0.4), (0.4, 0.75), (0.75, 1)):
                doors.append(front(a, b, z0 + q0 * (z1 - z0), z0 + q1 * (z1 - z0), y, style))
                grips.append(handle((a + b) / 2, z0 + q1 * (z1 - z0) - 0.04, y, grip, False))
    body = box([-bw / 2, y + 0.02, z0], [bw / 2, back, z1], 0.002)
    plinth = box([-bw / 2 + 0.03, y + 0.07, 0], [bw / 2 - 0.03, back - 0.03, z0])
    top = box([-w / 2, -d / 2, z1], [w / 2, d / 2, h], 0.004)
    return parts_of(
        (spec.material("front", "lacquer_white/0"), [*doors, body]),
        ("black", plinth),
        joints(doors),
        (spec.metal(), grips),
        (spec.material("worktop", "oak_worktop/0"), top),
    )


def hood(spec: BuildRequest) -> list[MeshPart]:
    """Chimney hood: a flat canopy, a slope, a shaft up the wall."""
    w, d, h = spec.size
    rim, slope = 0.05, min(0.16, h * 0.3)
    sw, sd = min(0.30, w * 0.5), min(0.26, d * 0.55)
    low = [(-w / 2, -d / 2, rim), (w / 2, -d / 2, rim), (w / 2, d / 2, rim), (-w / 2, d / 2, rim)]
    y, z = d / 2 - sd, rim + slope
    high = [(-sw / 2, y, z), (sw / 2, y, z), (sw / 2, d / 2, z), (-sw / 2, d / 2, z)]
    shaft = box([-sw / 2, d / 2 - sd, rim + slope], [sw / 2, d / 2, h], 0.002)
    filters = [
        box([-w / 2 + 0.05, -d / 2 + 0.06, -0.001], [-0.01, d / 2 - 0.06, 0.004]),
        box([0.01, -d / 2 + 0.06, -0.001], [w / 2 - 0.05, d / 2 - 0.06, 0.004]),
    ]
    lamps = [cylinder(0.025, -0.002, 0.003, 0.0, 12).moved(x, -d / 2 + 0.035, 0) for x in (-w * 0.25, w * 0.25)]
    return parts_of(
        (spec.metal(), [box([-w / 2, -d / 2, 0], [w / 2, d / 2, rim], 0.002), between(low, high), shaft]),
        (plain((0.45, 0.45, 0.45), 0.4, 1.0), filters),
        (plain((0.95, 0.93, 0.88), 0.3), lamps),
    )

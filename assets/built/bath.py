"""Bathroom: vanity, shower, towels, mats and what stands around the basin."""

import numpy as np
import shapely

from embodied.assets.built.parametric import BuildRequest, FinishedShapes, carcass, front, handle, parts_of, plain
from embodied.assets.built.primitives import (
    Shape,
    ball,
    between,
    box,
    cylinder,
    extruded,
    facets,
    joined,
    lathe,
    quads,
    sheet,
    tube,
    unrolled_uv,
)
from embodied.assets.built.soft import layers
from embodied.assets.records import Finish, MeshPart


def vanity(spec: BuildRequest) -> list[MeshPart]:
    """A drawer cabinet hung off the floor, a ceramic top with an oval basin, a mixer tap."""
    w, d, h = spec.size
    tap = 0.14
    top = h - tap
    z0, z1, y = 0.28, top - 0.05, -d / 2 + 0.01
    body = carcass((-w / 2 + 0.01, y + 0.02, z0), (w / 2 - 0.01, d / 2, z1), top=False)
    mid = (z0 + z1) / 2
    style, x = spec.word("style", "flat"), w / 2 - 0.01
    doors = [front(-x, x, a, b, y, style) for a, b in ((z0, mid), (mid, z1))]
    grips = [handle(0, b - 0.05, y, "bar", False, w * 0.3) for b in (mid, z1)]
    t = np.linspace(0, 2 * np.pi, 41)[:-1]
    rx, ry, deep, cy = min(0.24, w * 0.38), d * 0.30, 0.10, -0.03
    hole = np.stack([rx * np.cos(t), cy + ry * np.sin(t)], 1)
    plate = shapely.box(-w / 2, -d / 2, w / 2, d / 2).difference(shapely.Polygon(hole))
    slab = extruded(plate, top - 0.05, top)
    profile = [(0.08, -deep), (0.55, -deep * 0.93), (0.85, -deep * 0.6), (0.97, -0.015), (1.0, 0.0)]
    bowl = lathe([(0.0, -deep), *profile], 40, 0.9)
    bowl = bowl.reversed().scaled(rx, ry, 1).moved(0, cy, top)
    drain = cylinder(0.022, 0, 0.003, 0.001, 14).moved(0, cy, top - deep)
    ty = cy + ry + 0.035
    neck = [(0, ty, top), (0, ty, top + 0.09), (0, ty - 0.03, top + 0.115), (0, ty - 0.11, top + 0.10)]
    spout = tube(neck, 0.011, 10)
    lever = tube([(0, ty, top + 0.09), (0, ty + 0.005, top + 0.13), (0, ty - 0.05, top + tap)], 0.006, 8)
    base = cylinder(0.022, 0, 0.012, 0.003, 14).moved(0, ty, top)
    wood = spec.material("front", "oak/0")
    return parts_of(
        (wood, [body, *doors]),
        (spec.metal("black"), grips),
        ("porcelain", [slab, bowl]),
        ("chrome", [drain, spout, lever, base]),
    )


def shower(spec: BuildRequest) -> list[MeshPart]:
    """A corner shower: tray, two glass screens (one with a way in), mixer, rail and head on the back wall."""
    w, d, h = spec.size
    rim, t = 0.045, 0.05
    tray = [
        box([-w / 2, -d / 2, 0], [w / 2, d / 2, 0.02]),
        box([-w / 2, -d / 2, 0], [w / 2, -d / 2 + t, rim], 0.01),
        box([-w / 2, d / 2 - t, 0], [w / 2, d / 2, rim], 0.01),
        box([-w / 2, -d / 2 + t, 0], [-w / 2 + t, d / 2 - t, rim], 0.01),
        box([w / 2 - t, -d / 2 + t, 0], [w / 2, d / 2 - t, rim], 0.01),
    ]
    x, y, g = w / 2 - 0.025, -d / 2 + 0.025, 0.004
    door = min(0.6, w * 0.55)
    glass = [box([x - g, y, rim], [x + g, d / 2, h]), box([-x + door, y - g, rim], [x, y + g, h])]
    posts = [
        box([x - 0.012, y - 0.012, rim], [x + 0.012, y + 0.012, h], 0.003),
        box([x - 0.012, d / 2 - 0.02, rim], [x + 0.012, d / 2, h], 0.003),
        box([-x + door - 0.01, y - 0.01, rim], [-x + door + 0.01, y + 0.01, h], 0.003),
        box([-w / 2, y - 0.012, h - 0.03], [x, y + 0.012, h], 0.003),
    ]
    by = d / 2 - 0.05
    rail = tube([(0, by, 1.05), (0, by, h - 0.02)], 0.010, 10)
    neck = tube([(0, by, h - 0.03), (0, by - 0.05, h - 0.012), (0, by - 0.28, h - 0.012)], 0.010, 10)
    head = lathe([(0, -0.02), (0.11, -0.02), (0.11, -0.010), (0.02, 0.0), (0, 0.0)], 28).moved(0, by - 0.28, h - 0.02)
    mixer = [cylinder(0.022, -0.13, 0.13, 0.004, 14).turned(np.pi / 2, "y").moved(0, by, 1.08)]
    s = np.linspace(0, 1, 14)
    sag = np.sin(np.pi * s)
    hose = tube(np.stack([0.10 + 0.05 * sag, by - 0.02 - 0.05 * sag, 1.06 - 0.55 * sag + 0.45 * s], 1), 0.006, 7)
    stays = [box([-0.012, by, z], [0.012, d / 2, z + 0.02]) for z in (1.07, h - 0.12)]
    drain = cylinder(0.045, 0, 0.004, 0.001, 18).moved(-w * 0.1, d * 0.25, 0.02)
    return parts_of(
        ("porcelain", tray), ("glass", glass), ("chrome", [*posts, rail, neck, head, *mixer, hose, *stays, drain])
    )


def _draped(w: float, h: float, d: float, *, rng: np.random.Generator) -> Shape:
    """A towel over a rail: a long front, a shorter back, soft folds."""
    rows, cols = 26, 18
    r = d * 0.22
    long, short = h - r, (h - r) * 0.72
    s = np.linspace(0, 1, rows + 1)
    total = long + np.pi * r + short
    y, z = np.empty(rows + 1), np.empty(rows + 1)
    for i, q in enumerate(s * total):
        if q < long:
            y[i], z[i] = -r, q
        elif q < long + np.pi * r:
            a = (q - long) / r
            y[i], z[i] = -r * np.cos(a), long + r * np.sin(a)
        else:
            y[i], z[i] = r, long - (q - long - np.pi * r)
    x = np.linspace(-w / 2, w / 2, cols + 1)
    phase = rng.uniform(0, 6.28)
    sway = np.sin(np.linspace(0, 2 * np.pi * rng.uniform(1.2, 2.0), cols + 1) + phase)
    hang = np.clip(1 - z / long, 0, 1)
    yy = y[:, None] * (1 + 0.0 * sway) + np.sign(y)[:, None] * d * 0.16 * hang[:, None] * (0.8 + sway[None])
    xx = x[None] * (1 - 0.03 * hang[:, None] * np.abs(sway[None]))
    return sheet(np.stack([xx, yy, z[:, None] + 0 * xx], -1), 0.006)


def towel_rail(spec: BuildRequest) -> list[MeshPart]:
    """A rail on two posts with a towel over it."""
    (w, d, h), rng = spec.size, spec.rng
    y, z = -d * 0.1, h - 0.035
    rail = tube([(-w / 2, y, z), (w / 2, y, z)], 0.008, 10)
    posts = [
        joined(tube([(x, y, z), (x, d / 2, z)], 0.007, 8), cylinder(0.022, 0, 0.006, 0.002, 14).hung(x, d / 2, z))
        for x in (-w / 2 + 0.02, w / 2 - 0.02)
    ]
    tw = w * float(spec.params.get("share", 0.72))
    towel = _draped(tw, h - 0.012, min(d * 0.7, 0.06), rng=rng).shifted_uv(*rng.random(2))
    towel = towel.moved(rng.uniform(-0.05, 0.05) * w, y, 0)
    return parts_of((spec.metal("chrome"), [rail, *posts]), (spec.material("cloth", "terry/0"), towel))


def hanging_towel(spec: BuildRequest) -> list[MeshPart]:
    """A towel on a hook by the loop in the middle of its edge: the corners fall, folds run down from the hook."""
    (w, d, h), rng = spec.size, spec.rng
    rows, cols = 22, 34
    half, long = 0.42 * h, 0.94 * h
    u, t = np.linspace(-1, 1, cols + 1)[None], np.linspace(1, 0, rows + 1)[:, None]
    reach = np.hypot(u * half, t * long)
    gather = np.clip(reach / long, 0, 1) ** 0.62
    phase = 2.6 * np.pi * u + 0.5 * np.sin(3 * u + rng.uniform(0, 6)) + 0.5 * t
    swing = np.sin(phase) + 0.35 * np.sin(2.1 * phase + rng.uniform(0, 6))
    x = w / 2 * gather * (u + 0.05 * np.cos(phase) * t)
    y = d * 0.05 - 0.20 * d * swing * gather - 0.10 * d * gather * (1 - u**2)
    z = h - 0.04 - reach
    cloth = np.stack(np.broadcast_arrays(x, y, z), -1)
    hook = joined(
        tube([(0, d / 2, h - 0.03), (0, -d * 0.1, h - 0.035), (0, -d * 0.25, h - 0.005)], 0.006, 8),
        cylinder(0.02, 0, 0.006, 0.002, 14).hung(0, d / 2, h - 0.03),
    )
    terry, low, high = spec.material("cloth", "terry/0"), 2, 4  # rows of the woven border
    pile = [sheet(cloth[: low + 1], 0.006), sheet(cloth[high:], 0.006)]
    red, green, blue = (0.45 + 0.5 * c for c in terry.color[:3])
    border = plain((red, green, blue), 0.85, specular=0.1)
    return parts_of(("chrome", hook), (terry, pile), (border, sheet(cloth[low : high + 1], 0.004)))


def towels(spec: BuildRequest) -> list[MeshPart]:
    """Folded towels on one another."""
    return parts_of(
        (spec.material("cloth", "terry/0"), layers(spec.size, int(spec.params.get("layers", 3)), rng=spec.rng))
    )


def bath_mat(spec: BuildRequest) -> list[MeshPart]:
    """A thick terry mat with a flat hem."""
    w, d, h = spec.size
    hem = [box([-w / 2, -d / 2, 0], [w / 2, d / 2, h * 0.55], 0.003)]
    pile = box([-w / 2 + 0.03, -d / 2 + 0.03, 0], [w / 2 - 0.03, d / 2 - 0.03, h], 0.006)
    return parts_of((spec.material("cloth", "terry/0"), [*hem, pile]))


def toilet_brush(spec: BuildRequest) -> list[MeshPart]:
    w, _, h = spec.size
    r = w / 2
    cup = lathe([(0, 0), (r, 0), (r, h * 0.42), (r * 0.86, h * 0.42), (r * 0.84, h * 0.1), (0, h * 0.1)], 24)
    grip = [(0.007, h * 0.8), (0.011, h * 0.84), (0.011, h * 0.98), (0.006, h), (0, h)]
    stick = lathe([(0, h * 0.2), (0.007, h * 0.2), *grip], 12, 0.9)
    lid = lathe([(0, h * 0.42), (r * 0.8, h * 0.42), (r * 0.5, h * 0.46), (0, h * 0.47)], 24, 0.9)
    return parts_of((spec.metal("white"), cup), ("chrome", [stick, lid]))


def soap_dispenser(spec: BuildRequest) -> list[MeshPart]:
    w, d, h = spec.size
    r = min(w, d) * 0.5
    shoulder = [(r, h * 0.62), (r * 0.85, h * 0.70), (r * 0.35, h * 0.72), (0, h * 0.72)]
    body = lathe([(0, 0), (r * 0.94, 0), (r, 0.006), *shoulder], 24, 0.6)
    collar = [(0, h * 0.7), (r * 0.38, h * 0.7), (r * 0.38, h * 0.78)]
    pump = [
        lathe([*collar, (r * 0.14, h * 0.79), (r * 0.14, h * 0.93), (0, h * 0.93)], 14),
        tube([(0, 0, h * 0.955), (0, -r * 0.98, h * 0.935)], h * 0.03, 7),
        lathe([(0, h * 0.92), (r * 0.3, h * 0.93), (r * 0.3, h), (0, h)], 14),
    ]
    colour = spec.word("colour", "white")
    bright = plain((0.1, 0.1, 0.1), 0.4) if colour == "black" else "chrome"
    return parts_of((f"soap/{colour}", body), (bright, pump))


def toothbrush_cup(spec: BuildRequest) -> list[MeshPart]:
    (w, _, h), rng = spec.size, spec.rng
    r, cup = w / 2, h * 0.5
    body = lathe([(0, 0), (r * 0.9, 0), (r * 0.97, cup), (r * 0.87, cup), (r * 0.8, 0.008), (0, 0.008)], 22)
    brushes = []
    for k, c in enumerate(((0.20, 0.45, 0.70), (0.85, 0.40, 0.42), (0.92, 0.92, 0.90))[: 2 + int(rng.integers(2))]):
        a = 2.2 * k + rng.uniform(0, 1)
        foot = np.array([-0.4 * r * np.cos(a), -0.4 * r * np.sin(a), 0.012])
        top = np.array([0.75 * r * np.cos(a), 0.75 * r * np.sin(a), h * rng.uniform(0.9, 0.99)])
        stick = tube([foot, (foot + top) / 2, top], [0.004, 0.005, 0.0035], 6)
        head = box([-0.005, -0.006, -0.014], [0.005, 0.006, 0.010], 0.001).moved(*(top + [0.004, 0, 0]))
        brushes += [(plain(c, 0.35), stick), (plain((0.93, 0.95, 0.96), 0.8), head)]
    return parts_of(("porcelain", body), *brushes)


def paper_roll(spec: BuildRequest) -> list[MeshPart]:
    """A toilet roll on a wall bracket, its end hanging."""
    w, d, h = spec.size
    r = min(h * 0.42, d * 0.42)
    x, y, z = w / 2 - 0.008, -d / 2 + r, h - r - 0.012
    roll = lathe([(0.02, -0.05), (r, -0.05), (r, 0.05), (0.02, 0.05), (0.02, -0.05)], 28)
    roll = roll.turned(np.pi / 2, "y").moved(0, y, z)
    loose = box([-0.05, -d / 2, 0], [0.05, -d / 2 + 0.0015, z])
    arm = tube([(x, d / 2, z), (x, y, z), (-w / 2, y, z)], 0.006, 8)
    plate = box([w / 2 - 0.03, d / 2 - 0.006, h - r - 0.035], [w / 2, d / 2, h], 0.002)
    return parts_of((plain((0.94, 0.94, 0.93), 0.95, specular=0.05), [roll, loose]), ("chrome", [arm, plate]))


def bin_(spec: BuildRequest) -> list[MeshPart]:
    """A round bin: waste basket with crumpled paper in it, or pedal bin where params['lid'] is 1."""
    (w, d, h), rng = spec.size, spec.rng
    r = w / 2
    main = spec.material("skin", "brushed_steel/0") if "skin" in spec.params else spec.metal("white")
    if spec.params.get("lid"):
        return parts_of(*_pedal_bin(w, d, h, main))
    wall, low = 0.004, 0.82
    sheet_steel = [(0, 0), (r * low, 0), (r, h - 0.004), (r - wall, h - 0.004), (r * low - wall, 0.006), (0, 0.006)]
    t = np.linspace(0, 2 * np.pi, 33)[:-1]
    around = np.stack([(r - 0.004) * np.cos(t), (r - 0.004) * np.sin(t), 0 * t + h - 0.004], 1)
    shell, edge = lathe(sheet_steel, 32), tube(around, 0.004, 7, closed=True)
    paper = []
    for k in range(5):
        a, q = 2.4 * k + rng.uniform(0, 1), r * low * (0.45 if k else 0.0)
        lump = ball(0.04, 10, 7)
        lump = _faceted(lump.vertices * rng.normal(1.0, 0.13, (len(lump.vertices), 1)), lump.faces)
        paper.append(lump.moved(q * np.cos(a), q * np.sin(a), 0.04 + 0.03 * (k % 3)))
    return parts_of((main, [s.scaled(1, d / w, 1) for s in (shell, edge)]), ("paper", paper))


def _faceted(vertices: np.ndarray, faces: np.ndarray) -> Shape:
    """Triangles with a normal each, as paper has that was crumpled; corners that lie together stay together."""
    ways = np.round(vertices / np.linalg.norm(vertices, axis=1, keepdims=True), 4)
    _, first, weld = np.unique(ways, axis=0, return_index=True, return_inverse=True)
    flat = facets(vertices[first][weld.reshape(-1)][faces])
    return Shape(flat.vertices, flat.faces, flat.normals, flat.vertices[:, :2])


def _pedal_bin(w: float, d: float, h: float, main: Finish) -> list[FinishedShapes]:
    """Base ring, body, a dark gap, a lid with a rim that is hinged behind, a pedal before it."""
    r, top = w / 2, h * 0.86
    base = lathe([(0, 0), (r * 0.97, 0), (r * 0.985, 0.004), (r * 0.985, h * 0.045), (0, h * 0.045)], 32)
    body = lathe([(0, h * 0.04), (r * 0.965, h * 0.04), (r * 0.965, top), (0, top)], 32)
    gap = lathe([(0, top - 0.002), (r * 0.93, top - 0.002), (r * 0.93, top + 0.01), (0, top + 0.01)], 32)
    t = np.linspace(0, np.pi / 2, 8)[1:]
    edge = top + 0.008
    dome = np.stack([r * 0.97 * np.cos(t), edge + 0.024 + (h - edge - 0.024) * np.sin(t)], 1)
    band = lathe([(0, edge), (r, edge), (r, edge + 0.02), (r * 0.97, edge + 0.024), (0, edge + 0.024)], 32)
    lid = lathe([(r * 0.97, edge + 0.022), (r * 0.97, edge + 0.024), *dome], 32, 0.9)
    hinge = box([-w * 0.16, d / 2 - 0.012, top - 0.03], [w * 0.16, d / 2 + 0.004, top + 0.03], 0.005)
    arm = box([-0.012, -d / 2 - 0.008, 0.012], [0.012, -d / 2 + 0.03, 0.02], 0.003)
    pedal = box([-w * 0.17, -d / 2 - 0.016, 0.010], [w * 0.17, -d / 2 + 0.006, 0.024], 0.006)
    dark = plain((0.05, 0.05, 0.055), 0.45)
    rounds = [s.scaled(1, d / w, 1) for s in (body, lid)]
    return [
        (main, rounds),
        (dark, [base.scaled(1, d / w, 1), gap.scaled(1, d / w, 1), hinge]),
        ("chrome", [band.scaled(1, d / w, 1), arm, pedal]),
    ]


def laundry_basket(spec: BuildRequest) -> list[MeshPart]:
    """Wickerwork with a rolled rim and clothes looking out."""
    (w, d, h), rng = spec.size, spec.rng
    body = shapely.box(-w / 2, -d / 2, w / 2, d / 2).buffer(-0.06).buffer(0.06, quad_segs=4)
    ring = np.asarray(shapely.geometry.polygon.orient(body).exterior.coords)[:-1]
    top = h * 0.93
    at = lambda scale, z: np.column_stack([ring * scale, np.full(len(ring), z)])
    uv = unrolled_uv(ring, 0.0, h)
    lay = [between(at(0.84, 0.0), at(0.985, top), uv), between(at(0.945, top), at(0.80, 0.01), uv[:, ::-1])]
    bottom = quads([[(-w * 0.4, -d * 0.4, 0), (-w * 0.4, d * 0.4, 0), (w * 0.4, d * 0.4, 0), (w * 0.4, -d * 0.4, 0)]])
    edge = tube(at(0.965, top), min(0.014, h * 0.03), 8, closed=True)
    x, y = np.meshgrid(np.linspace(-1, 1, 13), np.linspace(-1, 1, 13))
    bump = sum(
        rng.normal(0, 0.5) * np.sin(rng.uniform(1.5, 4) * (x * np.cos(a) + y * np.sin(a)) + a)
        for a in rng.uniform(0, 6, 6)
    )
    z = top * 0.9 + (h - top * 0.9) * np.clip(0.55 + 0.25 * bump, 0, 1) * (1 - np.maximum(np.abs(x), np.abs(y)) ** 4)
    heap = sheet(np.stack([x * w * 0.43, y * d * 0.43, z], -1))
    return parts_of(
        (spec.material("skin", "wicker/0"), [*lay, bottom, edge]), (spec.material("cloth", "cotton/3"), heap)
    )

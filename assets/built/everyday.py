"""Things left about: post, notes, cables, clothes thrown down, unmade bedding, tins, jars, toys, folders."""

import numpy as np

from embodied.assets.built.parametric import TINTS, BuildRequest, FinishedShapes, parts_of, plain
from embodied.assets.built.primitives import Shape, ball, box, cylinder, frame, joined, lathe, quads, sheet, skirt, tube
from embodied.assets.records import Finish, MeshPart, Size


def _tint(spec: BuildRequest, name: str = "colour", default: str = "white") -> tuple[float, float, float]:
    return TINTS[spec.word(name, default)]


def _leaf(x: float, y: float, z: float, w: float, d: float, turn: float, thick: float) -> Shape:
    """A sheet of paper lying at (x, y, z)."""
    return box([-w / 2, -d / 2, 0], [w / 2, d / 2, thick]).turned(turn).moved(x, y, z)


def post(spec: BuildRequest) -> list[MeshPart]:
    """Letters in a loose heap, some with a window, one brown."""
    (w, d, h), rng = spec.size, spec.rng
    count = 4
    letters: list[Shape] = []
    windows: list[Shape] = []
    brown: list[Shape] = []
    stamps: list[Shape] = []
    for k in range(count):
        z, turn = h * k / count, rng.normal(0, 0.16)
        lw, ld = w * 0.82, d * 0.72
        x, y = rng.normal(0, 0.006, 2)
        (brown if k == 1 else letters).append(_leaf(x, y, z, lw, ld, turn, h / count * 0.95))
        if k == count - 1:
            top = h * 0.99
            c, s = np.cos(turn), np.sin(turn)
            windows.append(_leaf(x - 0.14 * lw * c, y - 0.14 * lw * s, top - 0.0004, lw * 0.42, ld * 0.3, turn, 0.0006))
            u, v = 0.38 * lw, 0.3 * ld
            stamps.append(_leaf(x + u * c - v * s, y + u * s + v * c, top - 0.0004, lw * 0.1, ld * 0.22, turn, 0.0006))
    return parts_of(
        ("paper", letters),
        (plain((0.62, 0.48, 0.33), 0.9), brown),
        (plain((0.70, 0.76, 0.80), 0.3), windows),
        (plain((0.55, 0.16, 0.16), 0.8), stamps),
    )


def note(spec: BuildRequest) -> list[MeshPart]:
    """A sheet on a wall under a pin, its foot coming forward; a child's drawing (params['drawing']) or writing."""
    (w, d, h), rng = spec.size, spec.rng

    def curl(share: float) -> float:
        """How far the sheet comes forward at a share of its height."""
        return d / 2 - 0.0008 - (d - 0.004) * (1 - share) ** 3

    rows = np.linspace(0, 1, 6)
    edges = np.array([(-w / 2, curl(t), h * t, w / 2) for t in rows])
    leaf = sheet(np.stack([edges[:, :3], edges[:, [3, 1, 2]]], 1)).two_sided()

    def patch(x0: float, x1: float, z0: float, z1: float) -> Shape:
        """A flat mark on the sheet, in shares of it."""
        a, b, low, high = (x0 - 0.5) * w, (x1 - 0.5) * w, (curl(z0) - 4e-4, z0 * h), (curl(z1) - 4e-4, z1 * h)
        return quads([[(a, *low), (b, *low), (b, *high), (a, *high)]])

    marks: list[tuple[Finish, list[Shape]]]
    if spec.params.get("drawing"):
        crayons = [(0.35, 0.6, 0.85), (0.7, 0.2, 0.18), (0.85, 0.6, 0.3), (0.6, 0.35, 0.65), (0.2, 0.45, 0.7)]
        wall, roof, sky = (crayons[k] for k in rng.permutation(5)[:3])
        grass, sun = (0.3, 0.6, 0.25), (0.95, 0.8, 0.2)
        left = float(rng.uniform(0.15, 0.4))
        steps = ((0.05 * k, 0.04 * k) for k in range(4))
        tiles = [patch(left - 0.04 + into, left + 0.38 - into, 0.5 + up, 0.55 + up) for into, up in steps]
        marks = [
            (plain(grass, 0.9), [patch(0.06, 0.94, 0.16, 0.24)]),
            (plain(wall, 0.9), [patch(left, left + 0.34, 0.24, 0.5)]),
            (plain(roof, 0.9), tiles),
            (plain(sun, 0.9), [patch(0.74, 0.88, 0.76, 0.88)]),
            (plain(sky, 0.9), [patch(0.06, 0.66, 0.9, 0.94), patch(left + 0.06, left + 0.14, 0.34, 0.44)]),
        ]
    else:
        ink = [patch(0.12, 0.12 + float(rng.uniform(0.35, 0.75)), 0.82 - 0.11 * k, 0.84 - 0.11 * k) for k in range(6)]
        marks = [(plain((0.2, 0.2, 0.28), 0.9), ink)]
    pin = ball(0.006, 8, 5).scaled(1, 0.6, 1).moved(0, d / 2 - 0.004, h * 0.965)
    head = plain(TINTS[("red", "blue", "green", "yellow")[int(rng.integers(4))]], 0.35)
    return parts_of((plain(_tint(spec, "paper"), 0.9, specular=0.2), leaf), (head, pin), *marks)


def notice_board(spec: BuildRequest) -> list[MeshPart]:
    """A framed cork board with notes and cards pinned to it."""
    (w, d, h), rng = spec.size, spec.rng
    f, y = 0.022, d / 2
    left, right, top, bottom = frame(-w / 2, w / 2, 0, h, (y - 0.02, y), f, 0.002)
    cork = box([-w / 2 + f, y - 0.01, f], [w / 2 - f, y, h - f])
    leaves: dict[str, list[Shape]] = {}
    pins: list[Shape] = []
    names = ("white", "yellow", "white", "pink", "beige", "blue")
    columns, rows = max(2, round(w / 0.16)), max(2, round(h / 0.17))
    for k in range(columns * rows):
        if rng.random() < 0.3:
            continue
        cx = (k % columns + 0.5 + rng.uniform(-0.15, 0.15)) * (w - 2 * f) / columns - w / 2 + f
        cz = (k // columns + 0.5 + rng.uniform(-0.1, 0.1)) * (h - 2 * f) / rows + f
        pw, ph = rng.uniform(0.4, 0.75) * w / columns, rng.uniform(0.45, 0.75) * h / rows
        lean = rng.normal(0, 0.06)
        leaf = box([-pw / 2, -0.0012, -ph / 2], [pw / 2, 0, ph / 2]).turned(lean, "y")
        leaves.setdefault(names[int(rng.integers(len(names)))], []).append(leaf.moved(cx, y - 0.0105, cz))
        pins.append(ball(0.005, 8, 5).moved(cx, y - 0.014, cz + ph * 0.42))
    return parts_of(
        (spec.material("wood", "oak/0"), [left, right, bottom, top]),
        (plain((0.62, 0.45, 0.28), 0.95, specular=0.1), cork),
        *((plain(TINTS[n], 0.9), s) for n, s in sorted(leaves.items())),
        (plain((0.66, 0.16, 0.13), 0.35), pins),
    )


def wall_calendar(spec: BuildRequest) -> list[MeshPart]:
    """A picture above, the days of a month below, on a nail."""
    w, d, h = spec.size
    y = d / 2
    leaf = box([-w / 2, y - 0.004, 0], [w / 2, y, h * 0.97])
    art = spec.material("art", "art_sea/0")
    a, b, c, e = -w / 2 + 0.01, w / 2 - 0.01, h * 0.52, h * 0.94
    picture = quads(
        [[(a, y - 0.0045, c), (b, y - 0.0045, c), (b, y - 0.0045, e), (a, y - 0.0045, e)]],
        np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]]) * (art.tile or 1.0),
    )
    days = [
        box([x - 0.006, y - 0.0047, z - 0.004], [x + 0.006, y - 0.004, z + 0.004])
        for x in np.linspace(a + 0.015, b - 0.015, 7)
        for z in np.linspace(h * 0.06, h * 0.42, 5)
    ]
    nail = cylinder(0.004, 0, 0.012).hung(0, y, h * 0.99)
    return parts_of(("paper", leaf), (art, picture), (plain((0.3, 0.3, 0.33), 0.8), days), ("steel", nail))


def folders(spec: BuildRequest) -> list[MeshPart]:
    """Ring binders side by side, each with a label on its spine."""
    (w, d, h), rng = spec.size, spec.rng
    count = max(2, round(w / 0.07))
    t = w / count
    names = ("grey", "black", "blue", "red", "green", "grey")
    bodies: dict[str, list[Shape]] = {}
    labels: list[Shape] = []
    for k in range(count):
        x = -w / 2 + (k + 0.5) * t
        y = rng.uniform(0, 0.01)
        bodies.setdefault(names[int(rng.integers(len(names)))], []).append(
            box([x - t / 2 + 0.001, -d / 2 + y, 0], [x + t / 2 - 0.001, d / 2, h], 0.002)
        )
        labels.append(box([x - t * 0.3, -d / 2 + y - 0.0006, h * 0.45], [x + t * 0.3, -d / 2 + y + 0.001, h * 0.85]))
    return parts_of(*((plain(TINTS[n], 0.55), s) for n, s in sorted(bodies.items())), ("paper", labels))


def cable(spec: BuildRequest) -> list[MeshPart]:
    """A charger with its cable in loops."""
    (w, d, h), rng = spec.size, spec.rng
    t = np.linspace(0, 1, 40)
    turns = 2 * np.pi * (1.6 + rng.uniform(0, 0.6))
    r = 0.5 - 0.33 * t + 0.04 * np.sin(9 * t + rng.uniform(0, 6))
    x, y = w * 0.9 * r * np.cos(turns * t), d * 0.9 * r * np.sin(turns * t)
    path = np.stack([x, y, 0.0022 + 0.002 * np.sin(12 * t)], 1)
    end = path[-1]
    plug = box([-0.014, -0.02, 0], [0.014, 0.02, h], 0.004).moved(end[0], end[1])
    tip = box([-0.004, -0.012, 0], [0.004, 0.012, 0.006], 0.001).moved(*path[0, :2])
    return parts_of((plain(_tint(spec), 0.45), [tube(path, 0.0022, 6), plug]), ("steel", tip))


def _crumpled(size: Size, cells: int, roundness: float, *, rng: np.random.Generator) -> Shape:
    """Cloth thrown down: a closed heap of soft ridges, thin at a ragged rim; `roundness` 0 is a sheet, 1 a heap."""
    width, depth, height = size
    x, y = np.meshgrid(np.linspace(-1, 1, cells + 1), np.linspace(-1, 1, cells + 1))
    a = np.arctan2(y, x)
    reach = 0.82 + 0.10 * np.sin(2 * a + rng.uniform(0, 6)) + 0.08 * np.sin(3 * a + rng.uniform(0, 6))
    square = np.maximum(np.abs(x), np.abs(y))
    ridges = np.zeros_like(x)
    for k in range(7):
        turn, rate = rng.uniform(0, np.pi), rng.uniform(3.0, 8.0)
        wave = np.sin(rate * (x * np.cos(turn) + y * np.sin(turn)) + 0.9 * np.sin(2.5 * y + k) + rng.uniform(0, 6))
        ridges = np.maximum(ridges, rng.uniform(0.5, 1.0) * (1 - np.abs(wave)) ** 1.3)
    rise = height * (0.22 + 0.78 * ridges / ridges.max()) * np.clip(1 - square**6, 0, 1) ** 0.5 + 0.004
    axes = ((width / 2, x, np.cos(a)), (depth / 2, y, np.sin(a)))
    px, py = (half * reach * ((1 - roundness) * u + roundness * square * v) for half, u, v in axes)
    grid = np.stack([px, py, rise], -1)
    low = sheet(np.stack([px, py, 0 * rise], -1))
    return joined(sheet(grid), low.reversed(), skirt(grid)).shifted_uv(*rng.random(2))


def thrown_clothes(spec: BuildRequest) -> list[MeshPart]:
    """Clothes as they were taken off: two pieces, one over the other."""
    (w, d, h), rng = spec.size, spec.rng
    under = _crumpled((w, d, h * 0.7), 14, 0.8, rng=rng)
    over = _crumpled((w * 0.6, d * 0.6, h * 0.55), 12, 0.6, rng=rng).turned(rng.uniform(0, 3))
    over = over.moved(0.06 * w, -0.05 * d, h * 0.45)
    cloth, other = spec.material("cloth", "denim/0"), spec.material("other", "linen/4")
    return parts_of((cloth, under), (other, over))


def duvet(spec: BuildRequest) -> list[MeshPart]:
    """A duvet pushed back in the morning: feathers in cotton, in a few long, round folds across the bed."""
    (w, d, h), rng = spec.size, spec.rng
    cells = 34
    t = np.linspace(-1, 1, cells + 1)
    t = np.sign(t) * (1 - (1 - np.abs(t)) ** 1.5)  # close together at the rim, which is round
    x, y = np.meshgrid(t, t)
    lie = np.zeros_like(x)  # what lies higher: folds as they follow one another from the foot to the head
    for at in np.linspace(-0.75, 0.8, 5) + rng.uniform(-0.1, 0.1, 5):
        line = at + rng.uniform(-0.3, 0.3) * x + rng.uniform(-0.16, 0.16) * np.sin(2.3 * x + rng.uniform(0, 6))
        ends = rng.uniform(0.55, 1.0) * (0.75 + 0.25 * np.cos(1.8 * (x - rng.uniform(-0.8, 0.8))))
        lie = np.maximum(lie, ends * np.exp(-(((y - line) / rng.uniform(0.11, 0.17)) ** 2)))
    for _ in range(6):  # and short dents, where the cotton is pulled
        turn, (cx, cy) = rng.uniform(0, np.pi), rng.uniform(-0.8, 0.8, 2)
        along = (x - cx) * np.cos(turn) + (y - cy) * np.sin(turn)
        across = (y - cy) * np.cos(turn) - (x - cx) * np.sin(turn)
        lie = lie - 0.16 * np.exp(-((along / 0.4) ** 2) - (across / 0.07) ** 2)
    wander = 1 - 0.05 * (1 + np.sin(3.1 * np.roll(np.stack([x, y]), 1, 0) + rng.uniform(0, 6, (2, 1, 1))))
    px, py = x * wander[0] * w / 2, y * wander[1] * d / 2
    puff = ((1 - x**4) * (1 - y**4)) ** 0.45
    rise = puff * h * (0.36 + 0.64 * lie.clip(-0.2, 1.0)) + 0.004
    top, low = sheet(np.stack([px, py, rise], -1)), sheet(np.stack([px, py, 0 * rise], -1))
    cloth = joined(top, low.reversed()).shifted_uv(*rng.random(2))
    return parts_of((spec.material("cloth", "cotton/0"), cloth))


def dish_rack(spec: BuildRequest) -> list[MeshPart]:
    """A wire rack with plates on edge and two cups upside down."""
    w, d, h = spec.size
    wire = 0.003
    a, b, rim = w / 2 - wire, d / 2 - wire, h * 0.4
    wires = [tube([(-a, s * b, z), (a, s * b, z)], wire, 6) for s in (-1, 1) for z in (0.02, rim)]
    wires += [tube([(x, -b, rim), (x, -b, 0.02), (x, b, 0.02), (x, b, rim)], wire, 6) for x in np.linspace(-a, a, 7)]
    foot = cylinder(0.006, 0, 0.02, segments=8)
    feet = [foot.moved(x * (w / 2 - 0.02), y * (d / 2 - 0.02)) for x in (-1, 1) for y in (-1, 1)]
    r = min(0.12, d / 2, (h - 0.03) / 2)
    flat = lathe([(0, 0), (r * 0.62, 0.003), (r, 0.016), (r * 0.99, 0.018), (r * 0.6, 0.006), (0, 0.005)], 24, 0.7)
    lean = flat.turned(np.pi / 2, "y").turned(0.16, "y")
    stand = [lean.moved(x, 0, r + 0.022) for x in np.linspace(-0.36, 0.05, 4) * w]
    cup = lathe([(0.0, 0.08), (0.03, 0.08), (0.038, 0.0), (0.034, 0.0), (0.026, 0.076), (0, 0.076)], 18)
    cups = [cup.moved(0.32 * w, y, 0.024) for y in (-0.2 * d, 0.2 * d)]
    return parts_of(
        (spec.metal("chrome"), wires),
        ("black", feet),
        (plain((0.92, 0.91, 0.89), 0.15), stand),
        (plain(_tint(spec, "cup", "blue"), 0.2), cups),
    )


def jar(spec: BuildRequest) -> list[MeshPart]:
    """A storage jar with a lid, full to three quarters."""
    w, _, h = spec.size
    r, body = w / 2, h * 0.86
    outside = [(0, 0), (r * 0.94, 0), (r, 0.006), (r, body * 0.88), (r * 0.86, body)]
    within = [(r * 0.82, body), (r * 0.96, body * 0.86), (r * 0.96, 0.008), (0, 0.006)]
    shell = lathe([*outside, *within], 22, 0.7)
    inside = lathe([(0, 0.009), (r * 0.93, 0.009), (r * 0.93, h * 0.6), (0, h * 0.61)], 20)
    lid = cylinder(r * 0.9, 0, h - body, 0.004, 20).moved(0, 0, body)
    return parts_of(
        ("glass", shell),
        (f"stored/{spec.word('holds', 'pasta')}", inside),
        (spec.metal("steel") if "metal" in spec.params else spec.material("wood", "oak/0"), lid),
    )


def tin(spec: BuildRequest) -> list[MeshPart]:
    """A tin of food with a paper label."""
    w, _, h = spec.size
    r = w / 2
    can = lathe([(0, 0), (r, 0), (r, h), (r * 0.93, h), (r * 0.92, h - 0.004), (0, h - 0.004)], 20, 0.6)
    label = lathe([(r + 0.0005, h * 0.06), (r + 0.0005, h * 0.94)], 20)
    band = lathe([(r + 0.0009, h * 0.3), (r + 0.0009, h * 0.55)], 20)
    return parts_of(("steel", can), (plain(_tint(spec), 0.5), label), ("paper", band))


def packet(spec: BuildRequest) -> list[MeshPart]:
    """A cardboard packet, printed: a field, a stripe and a picture's patch on its front."""
    w, d, h = spec.size
    y = -d / 2 - 0.0004
    stripe = box([-w / 2, y, h * 0.72], [w / 2, y + 0.001, h * 0.88])
    patch = box([-w * 0.34, y, h * 0.14], [w * 0.34, y + 0.001, h * 0.56])
    return parts_of(
        (plain(_tint(spec), 0.55), box([-w / 2, -d / 2, 0], [w / 2, d / 2, h], 0.0015)),
        ("paper", stripe),
        (plain(_tint(spec, "patch", "yellow"), 0.55), patch),
    )


def toilet_roll(spec: BuildRequest) -> list[MeshPart]:
    """A roll of toilet paper standing on end."""
    w, _, h = spec.size
    r = w / 2
    roll = lathe([(r * 0.36, 0), (r, 0), (r, h), (r * 0.36, h), (r * 0.36, 0)], 24, 0.7)
    card = lathe([(r * 0.35, h), (r * 0.35, 0)], 20)
    return parts_of((plain((0.93, 0.93, 0.92), 0.95, specular=0.05), roll), (plain((0.6, 0.5, 0.38), 0.9), card))


def duck(spec: BuildRequest) -> list[MeshPart]:
    """A bath duck."""
    w, d, h = spec.size
    body = ball(0.5, 14, 9).scaled(w, d, h * 0.62).moved(0, 0, h * 0.31)
    head = ball(h * 0.24, 12, 8).moved(0, -d * 0.2, h * 0.74)
    tail = ball(0.5, 8, 6).scaled(w * 0.3, d * 0.24, h * 0.3).moved(0, d * 0.42, h * 0.5)
    beak = ball(0.5, 8, 6).scaled(w * 0.28, d * 0.2, h * 0.1).moved(0, -d * 0.42, h * 0.7)
    eyes = [ball(h * 0.035, 6, 4).moved(s * h * 0.13, -d * 0.36, h * 0.82) for s in (-1, 1)]
    return parts_of(
        (plain(TINTS["yellow"], 0.35), [body, head, tail]), (plain(TINTS["orange"], 0.4), beak), ("black", eyes)
    )


def blocks(spec: BuildRequest) -> list[MeshPart]:
    """Building blocks where a child left them: some on one another, the rest about."""
    (w, d, h), rng = spec.size, spec.rng
    side = min(h / 2.02, 0.045)
    by: dict[str, list[Shape]] = {}
    names = ("red", "blue", "yellow", "green", "beige", "orange")
    taken: list[tuple[float, float]] = []
    for k in range(9):
        for _ in range(12):
            x, y = rng.uniform(-0.5, 0.5, 2) * (np.array([w, d]) - 1.5 * side)
            if all(np.hypot(x - p, y - q) > 1.5 * side for p, q in taken):
                break
        else:
            continue
        taken.append((float(x), float(y)))
        one = box([-side / 2, -side / 2, 0], [side / 2, side / 2, side], 0.002)
        by.setdefault(names[k % 6], []).append(one.turned(rng.uniform(0, 1.57)).moved(x, y))
        if k < 3:
            by.setdefault(names[(k + 2) % 6], []).append(one.turned(rng.uniform(0, 1.57)).moved(x, y, side))
    return parts_of(*((plain(TINTS[n], 0.5), s) for n, s in sorted(by.items())))


def board_game(spec: BuildRequest) -> list[MeshPart]:
    """Flat boxes of games on one another."""
    (w, d, h), rng = spec.size, spec.rng
    count = int(spec.params.get("count", 2))
    made: list[FinishedShapes] = []
    names = ("red", "blue", "green", "orange", "black")
    turns = rng.permutation(len(names))
    for k in range(count):
        shrink = 1.0 - 0.07 * k
        a, b, t = w * shrink * 0.96, d * shrink * 0.96, h / count
        lean = 0.0 if k == 0 else rng.normal(0, 0.06)
        case = box([-a / 2, -b / 2, 0], [a / 2, b / 2, t - 0.0012], 0.002).turned(lean)
        title = box([-a * 0.3, -b * 0.12, t - 0.0014], [a * 0.3, b * 0.12, t]).turned(lean)
        made += [(plain(TINTS[names[turns[k % 5]]], 0.45), case.moved(z=k * t)), ("paper", title.moved(z=k * t))]
    return parts_of(*made)


def crayons(spec: BuildRequest) -> list[MeshPart]:
    """Pencils of many colours on a sheet with a scribble."""
    (w, d, h), rng = spec.size, spec.rng
    leaf = box([-w / 2, -d / 2, 0], [w / 2, d / 2, 0.0012])
    by: dict[str, list[Shape]] = {}
    for k, name in enumerate(("red", "blue", "green", "yellow", "orange", "pink")):
        a = rng.uniform(-1.2, 1.2)
        x, y = rng.uniform(-0.3, 0.3, 2) * [w, d]
        u, v = 0.055 * np.cos(a), 0.055 * np.sin(a)
        r = (h - 0.0012) / 2
        by.setdefault(name, []).append(tube([(x - u, y - v, 0.0012 + r), (x + u, y + v, 0.0012 + r)], r, 6))
        z = 0.0014
        s = 0.16 + 0.04 * k
        line = [(w * (0.3 * np.cos(t) * s * 2), d * (0.3 * np.sin(2 * t) * s * 2), z) for t in np.linspace(0, 6.0, 14)]
        if k < 3:
            by[name].append(tube(line, 0.0012, 4))
    return parts_of(("paper", leaf), *((plain(TINTS[n], 0.6), s) for n, s in sorted(by.items())))

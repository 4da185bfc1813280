"""Things by the door: coats, shoes, umbrellas, mats, bags."""

import numpy as np
import shapely

from embodied.assets.built.parametric import TINTS, BuildRequest, parts_of, plain
from embodied.assets.built.primitives import Shape, bar, box, extruded, flat, joined, lathe, sheet, tube
from embodied.assets.records import MeshPart


def shoes(spec: BuildRequest) -> list[MeshPart]:
    """A pair of low shoes, one a little askew."""
    (w, d, h), rng = spec.size, spec.rng
    colour = TINTS[f"{spec.word('colour', 'brown')} shoe"]
    length, width = d * 0.97, w * 0.44
    uppers: list[Shape] = []
    soles: list[Shape] = []
    laces: list[Shape] = []
    for side in (-1, 1):
        s, t = np.linspace(0, 1, 22), np.linspace(0, np.pi, 13)
        wide = 0.62 + 0.50 * np.sin(np.pi * s**0.75) ** 0.7 - 0.22 * np.exp(-(((s - 0.38) / 0.16) ** 2))
        outline = width / 2 * wide * np.clip(np.sin(np.pi * (s * 0.94 + 0.03)) * 3.2, 0, 1) ** 0.5
        places = [0, 0.08, 0.22, 0.42, 0.60, 0.80, 0.94, 1]
        height = h * np.interp(s, places, [0.55, 0.98, 0.92, 0.86, 0.72, 0.50, 0.36, 0.16])
        y = length * (0.5 - s)
        across = outline[:, None] * np.cos(t)[None]
        up = 0.024 + (height[:, None] - 0.024) * np.sin(t)[None] ** 0.55
        open_ = ((s > 0.08) & (s < 0.40))[:, None] * np.exp(-((np.cos(t)[None] / 0.55) ** 4))
        upper = sheet(np.stack([-across, y[:, None] + 0 * across, up - open_ * h * 0.42], -1)[::-1])
        lay = [(upper, uppers), (_sole(outline, y), soles)]
        for k, q in enumerate((0.46, 0.53, 0.60)):
            i = int(q * 21)
            x, z = outline[i] * 0.45, height[i] * 0.97
            lay.append((bar([-x, y[i], z], [x, y[i] - 0.004 * k, z], 0.007, 0.005), laces))
        turn, at = side * 0.04 + rng.normal(0, 0.05), side * w * 0.25
        for shape, group in lay:
            group.append(shape.scaled(side, 1, 1).turned(turn).moved(at, rng.normal(0, 0.003)))
    pale = (0.88, 0.87, 0.84) if spec.params.get("colour") in ("white", "blue") else (0.09, 0.08, 0.075)
    dark = (0.7 * colour[0], 0.7 * colour[1], 0.7 * colour[2])
    return parts_of((plain(colour, 0.45), uppers), (plain(pale, 0.7), soles), (plain(dark, 0.8), laces))


def _sole(outline: np.ndarray, y: np.ndarray) -> Shape:
    ring = np.concatenate([np.stack([outline * 1.06, y], 1), np.stack([-outline * 1.06, y], 1)[::-1]])
    return extruded(shapely.Polygon(ring).buffer(0), 0, 0.026)


def coat_hooks(spec: BuildRequest) -> list[MeshPart]:
    """A board with hooks, some of them with coats, a bag or a scarf."""
    (w, d, h), rng = spec.size, spec.rng
    top = h - 0.10
    plank = box([-w / 2, d / 2 - 0.02, top], [w / 2, d / 2, h], 0.004)
    count = max(3, round(w / 0.17))
    hooks, clothes = [], []
    cloths = ("tweed/0", "linen/4", "denim/0", "linen/3", "velvet/3", "linen/6", "tweed/1")
    turns = rng.permutation(len(cloths))
    full = {int(k) for k in rng.choice(count, min(int(spec.params.get("coats", 3)), count), replace=False)}
    for k, x in enumerate(np.linspace(-w / 2 + 0.07, w / 2 - 0.07, count)):
        y = d / 2 - 0.02
        hooks.append(tube([(x, y, h - 0.03), (x, y - 0.045, h - 0.035), (x, y - 0.06, h - 0.012)], 0.006, 8))
        hooks.append(tube([(x, y, h - 0.065), (x, y - 0.025, h - 0.075), (x, y - 0.035, h - 0.06)], 0.005, 8))
        if k in full:
            drop = (h - 0.04) * (1.0 if k == min(full) else rng.uniform(0.72, 0.98))
            garment = _coat(min(0.40, w / count * 2.0), d * 0.62, drop, rng=rng)
            garment = garment.moved(x, d / 2 - 0.02 - d * 0.40, h - 0.035 - drop)
            clothes.append((spec.finish(cloths[turns[k % len(cloths)]]), garment))
    return parts_of((spec.material("wood", "oak/0"), plank), (spec.metal("black"), hooks), *clothes)


def _coat(w: float, d: float, h: float, *, rng: np.random.Generator) -> Shape:
    """A coat on a hook: a tube of cloth with sloping shoulders, folded towards the hem, its front lapped over, with
    sleeves, cuffs, flaps of pockets and a turned-down collar."""
    rows, cols = 11, 28
    t = np.linspace(0, 1, rows + 1)[:, None]
    a = np.linspace(0, 2 * np.pi, cols + 1)[None]
    turn = rng.uniform(0, 6)

    def at(t: np.ndarray, a: np.ndarray, out: float = 0.0) -> np.ndarray:
        """Points on the body, `out` metres before it: t from hem to neck, a around it, -pi / 2 in front."""
        half = w / 2 * np.interp(t, [0, 0.45, 0.8, 0.87, 0.94, 1.0], [0.92, 0.78, 0.80, 0.72, 0.36, 0.16]) + out
        deep = d / 2 * np.interp(t, [0, 0.5, 0.85, 0.93, 1.0], [0.85, 0.75, 0.7, 0.45, 0.26]) + out
        fold = 1 + 0.10 * (1 - t) ** 1.3 * np.sin(7 * a + turn + 1.5 * t) + 0.04 * (1 - t) * np.sin(3 * a + 4 * t)
        x, y = half * np.cos(a) * fold, deep * np.sin(a) * fold
        return np.stack(np.broadcast_arrays(x, y, h * t - 0.01 * (1 - t) * np.sin(7 * a + turn)), -1)

    shapes = [sheet(at(t, a))]
    lap = np.linspace(-0.12, 0.16, 4)[None] - np.pi / 2
    shapes.append(sheet(at(np.linspace(0.01, 0.93, 12)[:, None], lap, 0.006), 0.004))
    for s in (-1, 1):
        flap = np.linspace(-0.24, 0.24, 5)[None] + s * 0.62 - np.pi / 2
        shapes.append(sheet(at(np.linspace(0.36, 0.41, 3)[:, None], flap, 0.007), 0.005))
        q = np.linspace(0, 1, 8)
        reach = np.interp(q, [0, 0.12, 0.3, 1], [0.24, 0.36, 0.41, 0.44 + rng.uniform(-0.02, 0.02)])
        bend = rng.uniform(0.02, 0.10) * d * np.sin(np.pi * q) + 0.05 * d * q
        path = np.stack([s * w * reach, -bend, h * np.interp(q, [0, 0.12, 1], [0.88, 0.83, 0.30])], 1)
        wide = w * np.interp(q, [0, 0.15, 0.6, 1], [0.07, 0.125, 0.105, 0.095])
        shapes.append(tube(path, wide * (1 + 0.05 * np.sin(9 * q + turn)), 8))
        shapes.append(tube(path[-2:], 1.08 * wide[-2:], 8))
    around = np.linspace(0, 2 * np.pi, 14, endpoint=False)
    neck = 0.10 * w * np.cos(around), 0.22 * d * np.sin(around) - 0.01, h * (0.955 + 0.02 * np.sin(around))
    shapes.append(tube(np.stack(neck, 1), 0.05 * w, 6, closed=True))
    return joined(*shapes)


def coat(spec: BuildRequest) -> list[MeshPart]:
    """A coat on a hook."""
    w, d, h = spec.size
    hook = tube([(0, d / 2, h - 0.02), (0, d / 2 - 0.04, h - 0.025), (0, d / 2 - 0.05, h)], 0.005, 8)
    body = _coat(w, d * 0.7, h - 0.02, rng=spec.rng).moved(0, d / 2 - 0.01 - d * 0.42, 0)
    return parts_of((spec.metal("black"), hook), (spec.material("cloth", "tweed/0"), body))


def shoe_rack(spec: BuildRequest) -> list[MeshPart]:
    """Two slatted boards between two sides."""
    w, d, h = spec.size
    board = 0.018
    sides = [box([x0, -d / 2, 0], [x0 + board, d / 2, h], 0.002) for x0 in (-w / 2, w / 2 - board)]
    slats = [
        box([-w / 2 + board, y, z], [w / 2 - board, y + 0.05, z + 0.016], 0.002)
        for z in (h * 0.22 - 0.016, h - 0.016)
        for y in np.linspace(-d / 2 + 0.005, d / 2 - 0.055, 4)
    ]
    return parts_of((spec.material("wood", "oak/0"), [*sides, *slats]))


def umbrella_stand(spec: BuildRequest) -> list[MeshPart]:
    """A tall pot with two umbrellas."""
    w, _, h = spec.size
    r, pot = w / 2, h * 0.58
    stand = lathe([(0, 0), (r * 0.92, 0), (r * 0.96, pot), (r * 0.9, pot), (r * 0.86, 0.012), (0, 0.012)], 28)
    shafts, cloths = [], []
    for k, lean in enumerate((0.10, -0.12)):
        t = np.linspace(0, 1, 7)
        foot = np.array([-lean * r * 3, 0.02 * k, 0.02])
        crook = np.array([lean * r * 5, 0.03 * k, h * (0.90 - 0.05 * k)])
        up = 0.032 * np.sin(np.pi * t) + 0.01 * (t < 0.1)
        hook = crook + np.stack([0.032 * (1 - np.cos(np.pi * t)), 0 * t, up], 1)
        shafts += [tube([foot, crook], 0.005, 7), tube(hook, 0.008, 8)]
        along = foot + (crook - foot) * np.array([0.12, 0.3, 0.55, 0.75])[:, None]
        cloths.append(tube(along, [0.008, 0.026, 0.032, 0.012], 10))
    return parts_of(
        (spec.metal("black"), stand),
        (plain((0.30, 0.20, 0.12), 0.4), shafts),
        (plain((0.10, 0.12, 0.18), 0.7), cloths[0]),
        (plain((0.45, 0.12, 0.12), 0.7), cloths[1]),
    )


def doormat(spec: BuildRequest) -> list[MeshPart]:
    w, d, h = spec.size
    edge = box([-w / 2, -d / 2, 0], [w / 2, d / 2, h * 0.6], 0.002)
    mat = box([-w / 2 + 0.02, -d / 2 + 0.02, 0], [w / 2 - 0.02, d / 2 - 0.02, h], 0.004)
    return parts_of((plain((0.06, 0.06, 0.06), 0.8), edge), (spec.material("skin", "sisal/0"), mat))


def rucksack(spec: BuildRequest) -> list[MeshPart]:
    """A rucksack that stands: a stuffed body with a zip over it, a pocket before it, straps behind, a loop on top."""
    w, d, h = spec.size
    y, bw, bd = 0.02 * d, 0.80 * w, 0.60 * d
    body = _stuffed(bw, bd, 0.94 * h, 0.24 * h).moved(0, y)
    front_y = y - bd / 2
    pocket = _stuffed(0.66 * w, 0.26 * d, 0.44 * h, 0.09 * h).moved(0, front_y - 0.045 * d, 0.03 * h)
    bag = _stuffed(0.20 * w, 0.34 * d, 0.36 * h, 0.05 * h)
    sides = [bag.moved(s * (bw / 2 + 0.01 * w), y, 0.02 * h) for s in (-1, 1)]
    foot = _stuffed(bw * 1.02, bd * 1.02, 0.14 * h, 0.01 * h).moved(0, y)
    a = np.linspace(0.04, 0.96, 17) * np.pi
    ridge = np.stack([0.93 * bw / 2 * np.cos(a), np.full(17, y - 0.30 * bd), 0.60 * h + 0.285 * h * np.sin(a)], 1)
    mouth = np.stack([0.30 * w * np.cos(a), np.full(17, front_y - 0.160 * d), 0.355 * h + 0.075 * h * np.sin(a)], 1)
    zips = [tube(ridge, 0.005, 6), tube(mouth, 0.004, 6)]
    pulls = [
        box([p[0] - 0.005, p[1] - 0.010, p[2] - 0.032], [p[0] + 0.005, p[1] - 0.005, p[2]], 0.002)
        for p in (ridge[4], mouth[12])
    ]
    t = np.linspace(0, np.pi, 11)
    arch = np.stack([0.11 * w * np.cos(t), np.full(11, y + 0.12 * d), 0.915 * h + 0.085 * h * np.sin(t)], 1)
    loop = tube(arch, 0.008, 7)
    straps = [_strap(s * 0.19 * w, y + bd / 2, d / 2, h) for s in (-1, 1)]
    label = box([-0.05 * w, front_y - 0.178 * d, 0.17 * h], [0.05 * w, front_y - 0.160 * d, 0.25 * h], 0.003)
    cloth = spec.material("cloth", "denim/0")
    trim = spec.material("trim", "leather/0")
    return parts_of(
        (cloth, [body, pocket.shifted_uv(0.1, 0.3), *sides]),
        (trim, [foot, loop, *straps, label]),
        ("seam", zips),
        ("steel", pulls),
    )


def _stuffed(w: float, d: float, h: float, shoulder: float) -> Shape:
    """A stuffed bag on the floor, round-cornered from above, its top domed from `shoulder` below it."""
    cols, t = 28, np.linspace(0, 1, 6)
    side, dome = np.linspace(0.12, 1, 5), t[1:] * np.pi / 2
    up = np.concatenate([[0.0, 0.02], side * (h - shoulder) / h, 1 - shoulder / h * (1 - np.sin(dome))])
    wide = np.concatenate([[0.86, 0.95], 1 - 0.05 * side, 0.95 * np.cos(dome[:-1]) ** 0.55, [0.0]])
    angle = np.linspace(0, 2 * np.pi, cols + 1)
    c, s = np.cos(angle), np.sin(angle)
    x, y = np.sign(c) * np.abs(c) ** 0.55 * w / 2, np.sign(s) * np.abs(s) ** 0.55 * d / 2
    grid = np.stack([wide[:, None] * x, wide[:, None] * y, np.repeat(up[:, None] * h, cols + 1, 1)], -1)
    rim = shapely.Polygon(np.column_stack([0.86 * x, 0.86 * y])[:-1])
    return joined(sheet(grid), flat(rim, 0.0, up=False))


def _strap(x: float, y: float, back: float, h: float) -> Shape:
    """A padded shoulder strap at x: from the top of the back at y, out to `back`, and in again near the floor."""
    s = np.linspace(0, 1, 12)
    bow = np.sin(np.pi * s) ** 0.6
    path = np.stack([x * (1 + 0.35 * s), y - 0.012 + (back - y - 0.002) * bow, h * (0.86 - 0.80 * s)], 1)
    across = np.array([0.022, 0, 0])
    return sheet(np.stack([path - across, path, path + across], 1)[:, ::-1], 0.012)


def suitcase(spec: BuildRequest) -> list[MeshPart]:
    """A hard suitcase on its long edge: two ribbed shells, a metal seam, corners, two locks and a grip above."""
    w, d, h = spec.size
    low, high = 0.018, h - 0.055
    outline = shapely.box(-w / 2 + 0.004, low, w / 2 - 0.004, high)
    tall, wide = high - low, w - 0.008
    shell = _half_shell(outline, d / 2 - 0.009, 0.05)
    ribs = [
        box([x - 0.011, -d / 2, low + 0.09 * tall], [x + 0.011, -d / 2 + 0.012, high - 0.09 * tall], 0.004)
        for x in np.linspace(-0.38, 0.38, 8) * wide
    ]
    halves = [joined(shell, *ribs), joined(shell, *ribs).turned(np.pi)]
    ring = np.asarray(outline.buffer(-0.05).buffer(0.052, quad_segs=6).exterior.coords)[:-1]
    seam = tube(np.column_stack([ring[:, 0], 0 * ring[:, 0], ring[:, 1]]), 0.0065, 6, closed=True)
    corners = [
        _corner(s * (w / 2 - 0.05), t, s, u, d) for s in (-1, 1) for t, u in ((low + 0.046, -1), (high - 0.046, 1))
    ]
    locks = [
        joined(
            box([x - 0.022, -0.024, high - 0.004], [x + 0.022, 0.024, high + 0.008], 0.002),
            box([x - 0.012, -0.010, high + 0.006], [x + 0.012, 0.010, high + 0.014], 0.002),
        )
        for x in (-0.30 * w, 0.30 * w)
    ]
    t = np.linspace(0, 1, 13)
    lift = np.clip(np.sin(np.pi * t) * 2.2, 0, 1)
    grip = tube(np.stack([(t - 0.5) * 0.17, 0 * t, high + 0.006 + (h - high - 0.014) * lift], 1), 0.0085, 8)
    posts = [box([x - 0.016, -0.016, high - 0.002], [x + 0.016, 0.016, high + 0.014], 0.003) for x in (-0.085, 0.085)]
    feet = [
        box([x - 0.02, y - 0.012, 0], [x + 0.02, y + 0.012, low + 0.008], 0.004)
        for x in (-0.34 * w, 0.34 * w)
        for y in (-0.06, 0.06)
    ]
    return parts_of(
        (spec.material("shell", "leather/0") if "shell" in spec.params else plain((0.15, 0.29, 0.46), 0.35), halves),
        ("chrome", [seam, *locks, *posts]),
        ("black", [grip, *feet]),
        (plain((0.55, 0.55, 0.56), 0.35, 1.0), corners),
    )


def _half_shell(outline: shapely.Polygon, deep: float, r: float) -> Shape:
    """Half a case over an outline in x and z, from y = 0 to -`deep`, its edges rounded by r."""
    t = np.linspace(0, np.pi / 2, 7)
    rows = [(0.0, 0.0), *((deep - r + r * np.sin(a), r * (1 - np.cos(a))) for a in t)]
    grid = []
    for y, inset in rows:
        ring = outline.buffer(-0.07).buffer(0.07 - inset, quad_segs=5)
        p = np.asarray(shapely.geometry.polygon.orient(ring).exterior.coords)
        grid.append(np.column_stack([p[:, 0], np.full(len(p), -y), p[:, 1]]))
    p = grid[-1]
    face = flat(shapely.Polygon(p[:, [0, 2]]), deep)
    return joined(sheet(np.array(grid)[:, ::-1]).reversed(), face.turned(np.pi / 2, "x"))


def _corner(x: float, z: float, side: int, up: int, d: float) -> Shape:
    """A metal cap on an edge's corner, as deep as the case."""
    a = np.linspace(0, np.pi / 2, 7)
    ring = np.stack([x + side * 0.0495 * np.cos(a), z + up * 0.0495 * np.sin(a)], 1)
    grid = np.stack([np.column_stack([ring[:, 0], np.full(7, y), ring[:, 1]]) for y in (-d * 0.26, d * 0.26)])
    return sheet(grid if side * up > 0 else grid[::-1], 0.003)

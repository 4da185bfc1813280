"""Rugs, curtains, blinds, cushions and blankets."""

import numpy as np

from embodied.assets.built import primitives
from embodied.assets.built.parametric import BuildRequest, parts_of, plain, whole_image
from embodied.assets.records import MeshPart, Size

PLEAT = 0.095
"""Width of a fold of a drawn curtain, metres."""


def rug(spec: BuildRequest) -> list[MeshPart]:
    """A rectangular rug with its pattern; fringes at the short ends where params['fringe'] is 1."""
    (w, d, h), rng = spec.size, spec.rng
    name = spec.word("pattern", "rug_bordered/0")
    pattern = spec.finish(name)
    fringe = 0.045 if spec.params.get("fringe") else 0.0
    w0 = w / 2 - fringe
    body = primitives.box([-w0, -d / 2, 0], [w0, d / 2, h], min(0.004, h * 0.4))
    if name.startswith("rug_"):
        body = whole_image(body, pattern, -w0, w0, -d / 2, d / 2, "xy", keep_aspect=False)
    tassels = []
    if fringe:
        y = np.arange(-d / 2 + 0.008, d / 2 - 0.008, 0.014)
        for side in (-1, 1):
            reach = rng.uniform(0.7, 1.0, len(y)) * fringe
            sway = rng.normal(0, 0.003, len(y))
            a, b = side * w0 + 0 * y, side * (w0 + reach)
            corners = (
                (a, y - 0.004, 0.004),
                (b, y - 0.003 + sway, 0.002),
                (b, y + 0.003 + sway, 0.002),
                (a, y + 0.004, 0.004),
            )
            c = np.stack([np.stack([u, v, np.full_like(y, up)], 1) for u, v, up in corners], 1)
            tassels.append(primitives.quads(c if side > 0 else c[:, ::-1]))
        tassels += [
            primitives.box([-w / 2, -0.004, 0], [-w0, 0.004, 0.003]),
            primitives.box([w0, -0.004, 0], [w / 2, 0.004, 0.003]),
        ]
    return parts_of((pattern, body), (plain((0.80, 0.75, 0.64), 0.95, specular=0.05), tassels))


def round_rug(spec: BuildRequest) -> list[MeshPart]:
    """A round (or oval) rug."""
    w, d, h = spec.size
    pattern = spec.material("pattern", "rug_rings/0")
    disc = primitives.lathe([(0, 0), (0.49, 0), (0.5, h * 0.4), (0.495, h * 0.85), (0.485, h), (0, h)], 56, 0.8)
    disc = disc.scaled(w, d, 1.0)
    return parts_of((pattern, whole_image(disc, pattern, -w / 2, w / 2, -d / 2, d / 2, "xy", keep_aspect=False)))


def curtain(spec: BuildRequest) -> list[MeshPart]:
    """A pair of curtains drawn back to the sides of a window, on a rod with rings and finials."""
    (w, d, h), rng = spec.size, spec.rng
    cloth = spec.material("cloth", "linen/0")
    rod_z = h - 0.03
    panel = w * float(spec.params.get("drawn", 0.30)) * 0.5 + 0.10
    parts, hooks = [], []
    around = [(0, 0.019 * np.cos(t), 0.019 * np.sin(t)) for t in np.linspace(0, 2 * np.pi, 12, endpoint=False)]
    ring = primitives.tube(around, 0.0022, 5, closed=True)
    for side in (-1, 1):
        width = panel * rng.uniform(0.94, 1.06)
        count = max(4, round(width / PLEAT))
        grid = primitives.folds(
            width, rod_z - 0.035, count, min(d * 0.36, 0.06), rng=rng, columns=count * 9, rows=7, gather=0.1
        )
        cloth_sheet = primitives.sheet(grid, 0.0025)
        # Cloth is gathered: the pattern runs on over the folds, as measured along the sheet.
        parts.append(cloth_sheet.moved(side * (w / 2 - 0.05 - width / 2), -0.01, 0.0))
        for x in np.linspace(-0.46, 0.46, max(4, count // 2)) * width:
            hooks.append(ring.moved(side * (w / 2 - 0.05 - width / 2) + x, -0.01, rod_z - 0.008))
    rod = primitives.tube([(-w / 2 + 0.03, -0.01, rod_z), (w / 2 - 0.03, -0.01, rod_z)], 0.011, 10)
    ends = [primitives.ball(0.022, 12, 8).scaled(1.4, 1, 1).moved(s * (w / 2 - 0.031), -0.01, rod_z) for s in (-1, 1)]
    brackets = [
        primitives.joined(
            primitives.box([x - 0.008, -0.01, rod_z - 0.008], [x + 0.008, d / 2, rod_z + 0.008], 0.002),
            primitives.box([x - 0.02, d / 2 - 0.006, rod_z - 0.03], [x + 0.02, d / 2, rod_z + 0.03], 0.002),
        )
        for x in (-w / 2 + 0.09, w / 2 - 0.09)
    ]
    return parts_of((cloth, parts), (spec.metal("black"), [rod, *ends, *brackets, *hooks]))


def sheer(spec: BuildRequest) -> list[MeshPart]:
    """One light curtain over the whole window."""
    w, d, h = spec.size
    grid = primitives.folds(w * 0.97, h - 0.03, max(6, round(w / 0.09)), min(d * 0.35, 0.035), rng=spec.rng, rows=5)
    rail = primitives.box([-w / 2, -0.012, h - 0.03], [w / 2, 0.02, h], 0.002)
    return parts_of((plain((0.93, 0.93, 0.92), 0.9, specular=0.05), primitives.sheet(grid, 0.001)), ("white", rail))


def roller_blind(spec: BuildRequest) -> list[MeshPart]:
    """Cloth from a roll, a bar at its foot, a bead chain."""
    w, d, h = spec.size
    r = min(d / 2, 0.028)
    roll = primitives.cylinder(r * 0.85, -w / 2 + 0.02, w / 2 - 0.02, 0, 16).turned(np.pi / 2, "y").moved(0, 0, h - r)
    cloth = primitives.box([-w / 2 + 0.025, -0.001, 0.014], [w / 2 - 0.025, 0.001, h - r])
    foot = primitives.box([-w / 2 + 0.022, -0.006, 0], [w / 2 - 0.022, 0.006, 0.022], 0.003)
    spans = ((-w / 2, -w / 2 + 0.02), (w / 2 - 0.02, w / 2))
    ends = [primitives.box([a, -d / 2, h - 2 * r], [b, d / 2, h], 0.003) for a, b in spans]
    chain = primitives.tube([(w / 2 - 0.01, -d / 2 + 0.006, h - r), (w / 2 - 0.01, -d / 2 + 0.006, h * 0.35)], 0.002, 5)
    return parts_of((spec.material("cloth", "screen/0"), [roll, cloth]), ("white", [foot, *ends, chain]))


def cushion(spec: BuildRequest) -> list[MeshPart]:
    """A cushion lying flat, dented by use."""
    (w, d, h), rng = spec.size, spec.rng
    cells = 14
    waves = np.zeros((cells + 1, cells + 1))
    x, y = np.meshgrid(np.linspace(-1, 1, cells + 1), np.linspace(-1, 1, cells + 1))
    for _ in range(4):
        a, k = rng.uniform(0, np.pi), rng.uniform(1.5, 3.5)
        waves += 0.045 * h * np.sin(k * (x * np.cos(a) + y * np.sin(a)) * 2 + rng.uniform(0, 6))
    waves -= 0.10 * h * np.exp(-((x - rng.normal(0, 0.2)) ** 2 + (y - rng.normal(0, 0.2)) ** 2) * 3)
    cloth = spec.material("cloth", "linen/7")
    return parts_of(
        (cloth, primitives.pillow(w, d, h, cells, 0.36, waves).shifted_uv(*rng.random(2)).moved(0, 0, h / 2))
    )


def throw(spec: BuildRequest) -> list[MeshPart]:
    """A blanket folded to a stack of soft layers, fringe at one side."""
    return parts_of(
        (spec.material("cloth", "tweed/0"), layers(spec.size, int(spec.params.get("layers", 1)), rng=spec.rng))
    )


def layers(size: Size, count: int, *, rng: np.random.Generator) -> list[primitives.Shape]:
    """`count` folded cloths on one another, each of four layers, the fold in front."""
    w, d, h = size
    t = h / count
    made = []
    for k in range(count):
        dx, dy = rng.normal(0, 0.004, 2)
        for outer in (True, False):
            leaf = _folded_leaf(w - 0.012, d - 0.01, t, outer, rng=rng)
            made.append(leaf.moved(dx, dy, k * t).shifted_uv(*rng.random(2)))
    return made


def _folded_leaf(w: float, d: float, t: float, outer: bool, *, rng: np.random.Generator) -> primitives.Shape:
    """Cloth folded once around a bend in front, `t` thick as the outer of two such leaves, or the inner of them."""
    thick = t * 0.235
    bend = t * (0.375 if outer else 0.125)
    front, back = -d / 2 + t / 2, d / 2 - (0.0 if outer else 0.006) - rng.uniform(0, 0.006, 2)
    angle = np.linspace(-np.pi / 2, -3 * np.pi / 2, 9)
    low = np.linspace(back[0], front, 4)[:-1]
    high = np.linspace(front, back[1], 4)[1:]
    arc = np.stack([front + bend * np.cos(angle), bend * np.sin(angle)], 1)
    line = np.concatenate([np.stack([low, 0 * low - bend], 1), arc, np.stack([high, 0 * high + bend], 1)])
    along = np.gradient(line, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    out = np.stack([-along[:, 1], along[:, 0]], 1)  # towards the inside of the bend
    ends = [line[:1] - along[:1] * thick * 0.5, line[-1:] + along[-1:] * thick * 0.5]
    ring = np.concatenate([line - out * thick / 2, ends[1], (line + out * thick / 2)[::-1], ends[0]])
    core = np.concatenate([line, line[-1:], line[::-1], line[:1]])
    ring, core = np.concatenate([ring, ring[:1]]), np.concatenate([core, core[:1]])
    share = np.array([-1, -0.985, -0.95, -0.6, -0.2, 0.2, 0.6, 0.95, 0.985, 1])
    plump = np.array([0.05, 0.6, 1, 1, 1, 1, 1, 1, 0.6, 0.05])[:, None, None]
    section = core + (ring - core) * plump
    along_x, along_y = 2.5 * share[:, None] + rng.uniform(0, 6), 9 * core[None, :, 0] / d + rng.uniform(0, 6)
    sag = 0.05 * t * np.sin(along_x) * np.sin(along_y)
    x = share[:, None] * w / 2 + 0.004 * np.sin(14 * core[None, :, 0] / d + rng.uniform(0, 6)) * np.abs(share[:, None])
    leaf = primitives.sheet(np.stack(np.broadcast_arrays(x, section[..., 0], section[..., 1] + t / 2 + sag), -1))
    a, b, c = (leaf.vertices - np.mean(leaf.vertices, axis=0))[leaf.faces.T]
    volume = np.einsum("ij,ij->", a, np.cross(b, c))
    return leaf if volume > 0 else leaf.reversed()

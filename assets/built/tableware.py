"""Crockery, bottles, candles and kitchen things."""

import numpy as np
import shapely

from embodied.assets.built.parametric import BuildRequest, parts_of, plain
from embodied.assets.built.primitives import Shape, ball, box, cylinder, extruded, lathe, tube
from embodied.assets.records import MeshPart


def cup(r: float, h: float, taper: float = 0.92, wall: float = 0.004) -> Shape:
    outside = [(0, 0), (r * taper * 0.95, 0), (r * taper, 0.004), (r, h - 0.002), (r - wall * 0.5, h)]
    return lathe([*outside, (r - wall, h - 0.002), (r * taper - wall, 0.008), (0, 0.007)], 28, 0.6)


def mug(spec: BuildRequest) -> list[MeshPart]:
    """A mug with a handle, coffee inside where params['coffee'] is 1."""
    w, d, h = spec.size
    r = d / 2
    cx = -(w - d) / 2
    t = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 10)
    bow = np.stack([cx + r * 0.94 + (w / 2 - cx - r - 0.005) * np.cos(t), 0 * t, h * 0.5 + h * 0.30 * np.sin(t)], 1)
    ear = tube(bow, 0.0055, 8)
    drink = [lathe([(r * 0.9, 0), (0, 0.0001)], 24).moved(cx, 0, h * 0.8)] if spec.params.get("coffee") else []
    return parts_of(
        (f"mug/{spec.word('colour', 'white')}", [cup(r, h).moved(cx), ear]), (plain((0.11, 0.06, 0.035), 0.1), drink)
    )


def tumbler(spec: BuildRequest) -> list[MeshPart]:
    """A drinking glass, with water where params['water'] is 1."""
    w, _, h = spec.size
    r = w / 2
    drink = (
        [lathe([(0, 0.01), (r * 0.78, 0.01), (r * 0.88, h * 0.6), (0, h * 0.6)], 24)]
        if spec.params.get("water")
        else []
    )
    return parts_of(("glass", cup(r, h, 0.84, 0.0025)), (plain((0.75, 0.85, 0.88), 0.03), drink))


def plates(spec: BuildRequest) -> list[MeshPart]:
    """Plates piled up (params['count'])."""
    w, _, h = spec.size
    r, count = w / 2, int(spec.params.get("count", 5))
    step = (h - 0.022) / max(count - 1, 1)
    below = [(0, 0), (r * 0.58, 0), (r * 0.62, 0.004), (r * 0.98, 0.018), (r, 0.021)]
    one = lathe([*below, (r * 0.985, 0.022), (r * 0.64, 0.008), (r * 0.56, 0.005), (0, 0.005)], 36, 0.6)
    return parts_of((f"plate/{spec.word('colour', 'white')}", [one.moved(0, 0, k * step) for k in range(count)]))


def bowl(spec: BuildRequest) -> list[MeshPart]:
    """A bowl, with fruit where params['fruit'] is 1."""
    (w, _, h), rng = spec.size, spec.rng
    r = w / 2
    fruit = bool(spec.params.get("fruit"))
    rise = h * 0.72 if fruit else h
    t = np.linspace(0.15, 1, 9)
    outer = np.stack([r * np.sin(t * np.pi / 2) ** 0.9, rise * (1 - np.cos(t * np.pi / 2)) + 0.003], 1)
    inner = outer[::-1] * [0.955, 1.0] + [0, 0.004]
    inner[0] = outer[-1] * [0.965, 1.0]
    shell = lathe([(0, 0), (r * 0.3, 0), *outer, *inner, (0, inner[-1, 1])], 36, 0.8)
    skin = spec.material("skin", "walnut/0") if "skin" in spec.params else plain((0.88, 0.86, 0.82), 0.2)
    heap = []
    if fruit:
        tints = ((0.72, 0.20, 0.12), (0.82, 0.48, 0.12), (0.58, 0.62, 0.18), (0.85, 0.70, 0.22))
        fr = r * 0.34
        for k in range(7):
            a = 2 * np.pi * k / 6
            q = 0.0 if k == 6 else r * 0.50
            z = h - fr if k == 6 else rise * 0.55 + fr * 0.55 + rng.uniform(-0.004, 0.004)
            apple = ball(fr * rng.uniform(0.9, 1.0), 14, 10).scaled(1, 1, 0.93)
            heap.append((plain(tints[int(rng.integers(4))], 0.3), apple.moved(q * np.cos(a), q * np.sin(a), z)))
    return parts_of((skin, shell), *heap)


def bottle(spec: BuildRequest) -> list[MeshPart]:
    """A bottle with a label and a cap."""
    (w, _, h), rng = spec.size, spec.rng
    r = w / 2
    neck = float(spec.params.get("neck", 0.36))
    shoulder = [(r, h * 0.58), (r * 0.86, h * 0.66), (r * neck, h * 0.78), (r * neck, h * 0.95), (0, h * 0.95)]
    body = lathe([(0, 0), (r * 0.94, 0), (r, 0.006), *shoulder], 26, 0.75)
    label = lathe([(r * 1.004, h * 0.2), (r * 1.004, h * 0.48)], 26)
    cap = lathe([(0, h * 0.90), (r * (neck + 0.06), h * 0.90), (r * (neck + 0.06), h), (0, h)], 18)
    tint = ((0.88, 0.84, 0.74), (0.72, 0.22, 0.18), (0.93, 0.92, 0.90), (0.22, 0.30, 0.40))[int(rng.integers(4))]
    return parts_of(
        (f"bottle/{spec.word('colour', 'green')}", body),
        (plain(tint, 0.7), label),
        (plain((0.14, 0.13, 0.13) if rng.random() < 0.5 else (0.60, 0.16, 0.14), 0.4), cap),
    )


def candle(spec: BuildRequest) -> list[MeshPart]:
    """A pillar candle on a saucer, its rim melted."""
    w, _, h = spec.size
    r, top = w / 2, h * 0.93
    melted = [(r * 0.72, top - 0.004), (r * 0.68, top), (r * 0.58, top - 0.005), (0, top - 0.008)]
    wax = lathe([(0, 0.006), (r * 0.72, 0.006), *melted], 24, 0.8)
    dish = lathe([(0, 0), (r * 0.7, 0), (r, 0.008), (r * 0.96, 0.010), (r * 0.7, 0.005), (0, 0.005)], 28, 0.8)
    wick = tube([(0, 0, top - 0.01), (0.001, 0, h)], 0.0012, 5)
    return parts_of(
        (plain((0.91, 0.87, 0.77), 0.55), wax),
        ("black" if spec.params.get("dish") == "black" else "brass", dish),
        ("black", wick),
    )


def paper_towel(spec: BuildRequest) -> list[MeshPart]:
    w, _, h = spec.size
    r = w / 2
    foot = cylinder(r, 0, 0.014, 0.003, 32)
    rod = lathe([(0, 0.01), (0.007, 0.01), (0.007, h - 0.012), (0.012, h - 0.008), (0.010, h), (0, h)], 12, 0.8)
    roll = lathe([(0.02, 0.015), (r * 0.78, 0.015), (r * 0.78, h * 0.84), (0.02, h * 0.84), (0.02, 0.015)], 32)
    return parts_of(
        (spec.finish("oak/0") if spec.params.get("wood") else "steel", [foot, rod]),
        (plain((0.94, 0.94, 0.93), 0.95, specular=0.05), roll),
    )


def board(spec: BuildRequest) -> list[MeshPart]:
    """A chopping board with a grip hole, lying flat."""
    w, d, h = spec.size
    plate = shapely.box(-w / 2, -d / 2, w / 2, d / 2).buffer(-0.02).buffer(0.02, quad_segs=4)
    hole = shapely.Point(w / 2 - 0.035, 0).buffer(0.012, quad_segs=4)
    return parts_of((spec.material("wood", "beech/0"), extruded(plate.difference(hole), 0, h)))


def knife_block(spec: BuildRequest) -> list[MeshPart]:
    """A leaning block of wood with knife handles standing out."""
    w, d, h = spec.size
    lean = 0.32
    body = box([-w / 2, -d * 0.35, 0.0], [w / 2, d * 0.30, h * 0.70], 0.004).turned(-lean, "x")
    handles, bolsters = [], []
    for x in np.linspace(-0.3, 0.3, 3) * w:
        for y, s in ((-0.18 * d, 1.0), (0.1 * d, 0.85)):
            handle = box([x - 0.007, y - 0.011, h * 0.73], [x + 0.007, y + 0.011, h * 0.73 + 0.10 * s], 0.004)
            bolster = box([x - 0.005, y - 0.010, h * 0.69], [x + 0.005, y + 0.010, h * 0.735])
            handles.append(handle.turned(-lean, "x"))
            bolsters.append(bolster.turned(-lean, "x"))
    foot = box([-w / 2, -d * 0.28, 0], [w / 2, d * 0.55, 0.018], 0.003)
    return parts_of((spec.material("wood", "beech/0"), [body, foot]), ("black", handles), ("steel", bolsters))

"""House plants in pots."""

from __future__ import annotations

import numpy as np

from embodied.assets.built.parametric import BuildRequest, parts_of, plain
from embodied.assets.built.primitives import Shape, lathe, sheet, tube
from embodied.assets.records import MeshPart, Size


def plant(spec: BuildRequest) -> list[MeshPart]:
    """A pot with leaves: 'broad', 'grass', 'trailing' or 'rubber'."""
    w, _, h = spec.size
    kind = spec.word("kind", "broad")
    pr, ph = (0.26 * w, 0.30 * h) if kind != "rubber" else (0.24 * w, 0.22 * h)
    pot = lathe([(0, 0), (pr * 0.78, 0), (pr, ph), (pr * 0.92, ph), (pr * 0.9, ph * 0.86), (0, ph * 0.86)], 28, 0.6)
    soil = lathe([(pr * 0.9, ph * 0.87), (0, ph * 0.87)], 20)
    soil = Shape(soil.vertices, soil.faces, np.tile([0.0, 0, 1.0], (len(soil.vertices), 1)), soil.uv)
    leaves, stems = _leaves(kind, spec.size, ph, rng=spec.rng)
    return parts_of(
        (f"pot/{spec.word('pot', 'white')}", pot),
        ("soil", soil),
        (plain((0.28, 0.30, 0.16), 0.8), stems),
        (f"dark leaf/{kind}", leaves[::2]),
        (f"light leaf/{kind}", leaves[1::2]),
    )


def _leaves(kind: str, size: Size, ph: float, *, rng: np.random.Generator) -> tuple[list[Shape], list[Shape]]:
    """The leaves and the stems of a plant of `size` in a pot `ph` high, metres."""
    w, _, h = size
    count = {"broad": 16, "grass": 44, "trailing": 26, "rubber": 18}[kind]
    leaves, stems = [], []
    for k in range(count):
        a = k * 2.39996 + rng.normal(0, 0.25)
        q = (k + 0.5) / count
        if kind == "grass":
            reach, z = rng.uniform(0.2, 0.48) * w, ph + (h - ph) * rng.uniform(0.6, 1.0)
            leaves.append(_blade(a, reach, ph, z, 0.012 * w / 0.3, rng.uniform(0.1, 0.5)))
        elif kind == "trailing":
            reach, z = 0.15 * w + 0.33 * w * q, ph + (h - ph) * (1 - q * 0.9) * rng.uniform(0.8, 1.0)
            leaves.append(_leaf(a, reach, z, 0.20 * w, 0.10 * w, -0.4 - 0.8 * q))
        elif kind == "rubber":
            z = ph + (h - ph) * (0.22 + 0.70 * q)
            leaves.append(_leaf(a, 0.07 * w, z, 0.40 * w * (1.05 - 0.5 * q), 0.16 * w, 0.55 - 0.2 * q))
        else:
            reach, z = (0.14 + 0.22 * rng.random()) * w, ph + (h - ph) * rng.uniform(0.35, 0.85)
            tip = np.array([reach * np.cos(a), reach * np.sin(a), z])
            stems.append(tube(np.stack([(0, 0, ph * 0.8), tip * [0.5, 0.5, 0.75], tip]), 0.0035 * w / 0.3, 5))
            leaves.append(_leaf(a, reach, z, 0.26 * w, 0.17 * w, rng.uniform(-0.35, 0.25)))
    if kind == "rubber":
        stems.append(tube([(0, 0, ph * 0.8), (0.01 * w, 0, (h + ph) / 2), (0, 0, h * 0.93)], 0.012 * w / 0.4, 7))
    return leaves, stems


def _leaf(angle: float, reach: float, z: float, length: float, width: float, rise: float) -> Shape:
    """A pointed leaf that starts `reach` from the stem and arches over, seen from both sides."""
    s, t = np.linspace(0, 1, 7), np.linspace(-1, 1, 5)
    half = width / 2 * np.sin(np.pi * s**0.75) ** 0.8
    out = reach + length * s
    up = z + length * (rise * s - 0.55 * s**2)
    x = out[:, None] + 0 * t
    y = half[:, None] * t
    zz = up[:, None] + 0.25 * half[:, None] * np.abs(t)
    return sheet(np.stack([x, y, zz], -1).transpose(1, 0, 2)).turned(angle).two_sided()


def _blade(angle: float, reach: float, z0: float, z1: float, width: float, droop: float) -> Shape:
    s = np.linspace(0, 1, 6)
    out, up = reach * s**1.8, z0 * 0.85 + (z1 - z0 * 0.85) * (s - droop * s**3) / (1 - droop * 0.6)
    half = width / 2 * (1 - s**2.5) + 0.0005
    p = np.stack([np.stack([out, half, up], 1), np.stack([out, -half, up], 1)])
    return sheet(p).turned(angle).two_sided()

"""Machines of the household that stand on the floor."""

from __future__ import annotations

import numpy as np

from embodied.assets.built.parametric import BuildRequest, parts_of, plain
from embodied.assets.built.primitives import box, cylinder, lathe
from embodied.assets.records import MeshPart


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

"""Lamps: pendants, ceiling lamps, downlights, sconces, floor and bedside lamps. Shades and bulbs glow."""

from __future__ import annotations

import itertools

import numpy as np

from embodied.assets.built.parametric import LIGHTS, BuildRequest, parts_of, plain, tinted
from embodied.assets.built.primitives import Shape, ball, box, cylinder, joined, lathe, quads, sheet, tube
from embodied.assets.records import Finish, MeshPart


def _bulb(z: float, r: float = 0.03) -> Shape:
    """A glowing bulb whose middle is at z."""
    return ball(r, 12, 9).scaled(1, 1, 1.15).moved(0, 0, z)


def _canopy(h: float) -> Shape:
    """The cap that hides the hook in the ceiling, at h."""
    return lathe([(0, h - 0.03), (0.05, h - 0.03), (0.055, h - 0.02), (0.055, h), (0, h)], 20)


def _drum(r0: float, r1: float, z0: float, z1: float, segments: int = 32) -> Shape:
    """A fabric shade, open above and below."""
    return lathe([(r0, z0), (r1, z1)], segments).two_sided()


def _cloth(spec: BuildRequest) -> Finish:
    return tinted(spec.material("shade", "linen/1"), LIGHTS["shade"])


def pendant(spec: BuildRequest) -> list[MeshPart]:
    """Canopy, cord and a shade: 'dome', 'drum', 'globe' or 'cone'."""
    w, _, h = spec.size
    r, kind = w / 2, spec.word("kind", "dome")
    body = min(h * 0.45, w * {"dome": 0.55, "drum": 0.6, "globe": 1.0, "cone": 0.75}[kind])
    cord = tube([(0, 0, body - 0.01), (0, 0, h - 0.02)], 0.003, 6)
    socket = lathe([(0, body - 0.045), (0.02, body - 0.045), (0.022, body), (0.012, body + 0.03), (0, body + 0.03)], 16)
    rim, mount = spec.metal("black"), [_canopy(h), cord, socket]
    if kind == "globe":
        return parts_of((rim, mount), ("opal", ball(r, 28, 17).moved(0, 0, r)))
    if kind == "drum":
        around = [(r * 0.97 * np.cos(t), r * 0.97 * np.sin(t), 0.006) for t in np.linspace(0, 6.283, 33)[:-1]]
        ring, shade = tube(around, 0.003, 5, closed=True), _drum(r, r * 0.96, 0, body)
        return parts_of((rim, [*mount, ring]), (_cloth(spec), shade), ("bulb", _bulb(body * 0.5)))
    t = np.linspace(0, 1, 12)
    outer = np.stack([r * (1 - 0.82 * t), body * t], 1)
    if kind == "dome":
        outer = np.stack([r * np.cos(t * 1.42), body * np.sin(t * np.pi / 2)], 1)
    shell = lathe([*outer, (0.0, body)], 32, 0.9)
    inner = lathe([(0.0, body - 0.004), *(outer[::-1] * [0.985, 0.985])], 32, 0.9)
    return parts_of((rim, [*mount, shell]), (plain((0.95, 0.94, 0.90), 0.5), inner), ("bulb", _bulb(body * 0.45)))


def flush(spec: BuildRequest) -> list[MeshPart]:
    """A flat bowl of opal glass, or a fabric drum with a diffuser, under the ceiling."""
    w, _, h = spec.size
    r = w / 2
    base = lathe([(0, h - 0.02), (r * 0.92, h - 0.02), (r * 0.94, h), (0, h)], 32)
    if spec.params.get("kind") == "drum":
        glass = lathe([(0, 0.012), (r * 0.97, 0.012), (r * 0.97, 0.018), (0, 0.018)], 36)
        hoop = lambda z: [(r * 0.985, z), (r, z), (r, z + 0.006), (r * 0.985, z + 0.006), (r * 0.985, z)]
        hoops = [lathe(hoop(z), 36) for z in (0.0, h - 0.010)]
        nut = lathe([(0, 0.002), (0.010, 0.003), (0.013, 0.008), (0.008, 0.012), (0, 0.012)], 16, 0.9)
        shade = _drum(r * 0.995, r * 0.995, 0.002, h - 0.006, 36)
        return parts_of(("white", base), (spec.metal("steel"), [*hoops, nut]), (_cloth(spec), shade), ("opal", glass))
    t = np.linspace(0, np.pi / 2, 10)
    low = 0.012
    curve = np.stack([r * 0.96 * np.sin(t), low + (h - 0.02 - low) * (1 - np.cos(t))], 1)
    bowl = lathe([*curve, (r * 0.96, h - 0.012), (0, h - 0.012)], 36, 0.6)
    lip = [(r * 0.93, h - 0.03), (r * 0.985, h - 0.03), (r, h - 0.022), (r, h - 0.004), (r * 0.93, h - 0.002)]
    turn = [(0, 0), (0.006, 0.001), (0.009, 0.006), (0.007, 0.011), (0.016, 0.014), (0.016, 0.017), (0, 0.017)]
    rim, nut = lathe(lip, 36), lathe(turn, 16, 0.9)
    return parts_of((spec.metal("steel"), [base, rim, nut]), ("opal", bowl))


def panel(spec: BuildRequest) -> list[MeshPart]:
    """A square pane of opal glass that bulges out of a sloping metal frame, with a nut in its middle."""
    w, d, h = spec.size
    rows = [(0.5, h), (0.5, 0.55 * h), (0.46, 0.22 * h), (0.40, 0.22 * h), (0.385, 0.45 * h)]
    rings = [np.array([(-a, -a, z), (a, -a, z), (a, a, z), (-a, a, z)]) * [w, d, 1] for a, z in rows]
    frame = quads(
        [
            [outer[k], inner[k], inner[(k + 1) % 4], outer[(k + 1) % 4]]
            for outer, inner in itertools.pairwise(rings)
            for k in range(4)
        ]
    )
    t = np.linspace(-1, 1, 11)
    x, y = np.meshgrid(t, t)
    rise = np.maximum(np.abs(x), np.abs(y)) ** 3 * h * 0.25
    pane = sheet(np.stack([x * 0.395 * w, y * 0.395 * d, 0.12 * h + rise], -1))
    nut = lathe([(0, 0), (0.008, 0.001), (0.012, 0.004), (0.008, 0.007), (0.018, 0.010), (0, 0.012)], 16)
    return parts_of(
        (spec.metal("steel"), [frame, nut]),
        (plain((0.97, 0.96, 0.93), 0.25, emission=LIGHTS["panel"]), pane.reversed()),
    )


def bar(spec: BuildRequest) -> list[MeshPart]:
    """A wooden bar on a rod from the ceiling, three bell-shaped shades of opal glass below it."""
    w, d, h = spec.size
    r = d / 2
    high = r * 1.9
    beam = high + 0.05
    rim = spec.metal("black")
    wood = box([-w / 2 + r * 0.5, -0.014, beam], [w / 2 - r * 0.5, 0.014, beam + 0.03], 0.003)
    rod = tube([(0, 0, beam + 0.02), (0, 0, h - 0.02)], 0.006, 8)
    t = np.linspace(0, 1, 9)
    bell = np.stack([r * (1 - 0.72 * t**1.6), high * t], 1)
    shade = lathe([*bell, (0.02, high + 0.004)], 24, 0.9).two_sided()
    lip = lathe([(r * 0.97, 0), (r, 0), (r, 0.004), (r * 0.97, 0.004), (r * 0.97, 0)], 24)
    crown = [(0, high - 0.01), (r * 0.34, high - 0.01), (r * 0.34, high + 0.02), (0.012, high + 0.04), (0, beam)]
    cap = lathe(crown, 16)
    places = (-w / 2 + r, 0.0, w / 2 - r)
    return parts_of(
        (spec.material("wood", "walnut/0"), wood),
        (rim, [rod, _canopy(h), *(s.moved(x) for x in places for s in (cap, lip))]),
        ("opal", [shade.moved(x) for x in places]),
        ("bulb", [_bulb(high * 0.45, r * 0.34).moved(x) for x in places]),
    )


def downlight(spec: BuildRequest) -> list[MeshPart]:
    """A recessed spotlight: a ring and a glowing disc."""
    w, _, h = spec.size
    r = w / 2
    ring = lathe([(r * 0.72, h * 0.7), (r * 0.75, 0.001), (r * 0.9, 0), (r, h * 0.5), (r, h), (0, h)], 24, 0.5)
    disc = lathe([(0, h * 0.55), (r * 0.74, h * 0.55), (r * 0.74, h * 0.7), (0, h * 0.7)], 24)
    return parts_of((spec.metal("white"), ring), (plain((1.0, 0.97, 0.92), 0.3, emission=LIGHTS["downlight"]), disc))


def sconce(spec: BuildRequest) -> list[MeshPart]:
    """A wall lamp: plate, arm and a fabric shade or an opal globe."""
    w, d, h = spec.size
    r = min(w / 2, d * 0.4)
    back, y = d / 2, -d / 2 + r
    plate = cylinder(0.05, 0, 0.015, 0.004, 20).hung(0, back, h * 0.35)
    s = np.linspace(0, 1, 8)
    arm = tube(np.stack([0 * s, back - (back - y) * s, h * 0.35 - 0.25 * h * np.sin(np.pi * s) * 0.5], 1), 0.007, 8)
    rim = spec.metal("brass")
    if spec.params.get("kind") == "globe":
        return parts_of((rim, [plate, arm]), ("opal", ball(r, 20, 13).moved(0, y, h - r)))
    stem = tube([(0, y, h * 0.35), (0, y, h * 0.55)], 0.007, 8)
    shade = _drum(r, r * 0.7, h * 0.4, h, 24).moved(0, y, 0)
    return parts_of((rim, [plate, arm, stem]), (_cloth(spec), shade), ("bulb", _bulb(h * 0.66, 0.024).moved(0, y, 0)))


def standing(spec: BuildRequest) -> list[MeshPart]:
    """Foot, stem or tripod, and a fabric shade: floor lamps and table lamps alike."""
    w, _, h = spec.size
    r, kind = w / 2, spec.word("kind", "stem")
    tall = h > 0.9
    sh = min(h * (0.22 if tall else 0.45), w * 0.85)
    z0 = h - sh
    stem = _stem(kind, r, z0, tall)
    spider = [
        tube([(-r * 0.8, 0, h - 0.03), (r * 0.8, 0, h - 0.03)], 0.002, 5),
        tube([(0, -r * 0.8, h - 0.03), (0, r * 0.8, h - 0.03)], 0.002, 5),
        tube([(0, 0, z0), (0, 0, h - 0.03)], 0.003, 5),
    ]
    body = spec.material("body", "brass/0") if "body" in spec.params else spec.metal("brass")
    shade = _drum(r, r * float(spec.params.get("taper", 0.8)), z0, h - 0.004)
    return parts_of((body, stem), (spec.metal("brass"), spider), (_cloth(spec), shade), ("bulb", _bulb(z0 + sh * 0.45)))


def _stem(kind: str, r: float, top: float, tall: bool) -> Shape:
    """The stand of a shade of radius `r` that begins at the height `top`: 'tripod', 'ceramic' or 'stem' on a foot."""
    if kind == "tripod":
        ways = [(np.cos(a), np.sin(a)) for a in (2 * np.pi * k / 3 + 0.5 for k in range(3))]
        feet = [[(0.02 * c, 0.02 * s, top + 0.02), (r * 0.92 * c, r * 0.92 * s, 0.0)] for c, s in ways]
        legs = [tube(leg, [0.010, 0.014], 8) for leg in feet]
        return joined(*legs, cylinder(0.035, 0, 0.03, 0.006, 16).moved(0, 0, top - 0.005))
    if kind == "ceramic":
        t = np.linspace(0, 1, 12)
        belly = np.stack([r * (0.28 + 0.30 * np.sin(np.pi * t**0.8)), t * (top - 0.03)], 1)
        return lathe([(0, 0), *belly, (0.012, top - 0.01), (0.012, top + 0.03), (0, top + 0.03)], 28, 0.9)
    foot = min(0.15 if tall else 0.075, r * 0.75)
    stem = [(0.012, 0.03), (0.011, top + 0.05), (0, top + 0.05)]
    return lathe([(0, 0), (foot, 0), (foot, 0.012), (foot * 0.9, 0.02), *stem], 28, 0.8)


def desk_lamp(spec: BuildRequest) -> list[MeshPart]:
    """Weighted foot, two arms, a metal head that looks down."""
    w, d, h = spec.size
    foot = cylinder(min(0.09, d * 0.45), 0, 0.022, 0.006, 24).moved(-w * 0.22, 0, 0)
    a, b, c = np.array([-w * 0.22, 0, 0.02]), np.array([-w * 0.38, 0, h * 0.55]), np.array([w * 0.12, 0, h * 0.97])
    hinge = ball(0.012, 10, 7)
    arms = [tube([a, b], 0.006, 8), tube([b, c], 0.006, 8), hinge.moved(*b), hinge.moved(*c)]
    head = lathe([(0.075, -0.085), (0.055, -0.03), (0.028, 0.0), (0.022, 0.03), (0, 0.03)], 24, 0.9)
    inner = lathe([(0, -0.002), (0.026, -0.004), (0.053, -0.033), (0.073, -0.085)], 24, 0.9)
    tilt = 0.35
    place = [s.turned(-tilt, "y").moved(w * 0.2, 0, h * 0.9) for s in (head, inner, _bulb(-0.05, 0.022))]
    return parts_of(
        (spec.metal("black"), [foot, *arms, place[0]]), (plain((0.93, 0.92, 0.88), 0.4), place[1]), ("bulb", place[2])
    )

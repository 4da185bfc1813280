"""Lamps, whose shades and bulbs glow: pendants, ceiling lamps, downlights, sconces, floor and bedside lamps; and what
else hangs on wires and pipes: switches, sockets, radiators and washing machines."""

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
        for x in np.linspace(-w / 2 + 0.022, w / 2 - 0.022, max(4, round(w / 0.055))):
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

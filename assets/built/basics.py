"""Beds, sofas, tables, chairs, a toilet and a television of simple shape, where no furniture models are installed."""

import numpy as np

from embodied.assets.built.parametric import BuildRequest, handle, parts_of, plain
from embodied.assets.built.primitives import Shape, bar, box, cylinder, lathe, pillow
from embodied.assets.records import MeshPart


def bed(spec: BuildRequest) -> list[MeshPart]:
    """A frame with a headboard at the back, a mattress and one pillow for each 0.8 m of its width."""
    w, d, h = spec.size
    top = float(spec.params.get("lying", 0.48))
    rail, thick = top - 0.24, 0.035
    frame = [
        box([-w / 2, d / 2 - thick, 0], [w / 2, d / 2, h], 0.006),
        box([-w / 2, -d / 2, 0.1], [w / 2, -d / 2 + thick, rail + 0.06], 0.006),
        *(box([s - thick / 2, -d / 2, 0.1], [s + thick / 2, d / 2, rail + 0.06], 0.004) for s in _edges(w, thick)),
        *(box([x - 0.03, -d / 2, 0], [x + 0.03, -d / 2 + 0.06, 0.1]) for x in _edges(w, 0.06)),
        box([-w / 2 + thick, -d / 2 + thick, rail - 0.03], [w / 2 - thick, d / 2 - thick, rail]),
    ]
    inner = w - 2 * thick - 0.01
    mattress = box([-inner / 2, -d / 2 + thick, rail], [inner / 2, d / 2 - thick, top - 0.02], 0.03)
    cover = box([-inner / 2 - 0.012, -d / 2 + thick, rail + 0.06], [inner / 2 + 0.012, d / 2 - 0.62, top], 0.03)
    count = max(1, round(w / 0.8))
    each = inner / count
    one = pillow(each * 0.86, 0.42, 0.15)
    pillows = [one.moved(-inner / 2 + each * (k + 0.5), d / 2 - 0.3, top + 0.04) for k in range(count)]
    return parts_of(
        (spec.material("wood", "oak/0"), frame),
        (spec.finish("cotton/0"), [mattress, *pillows]),
        (spec.material("cloth", "linen/2"), cover),
    )


def sofa(spec: BuildRequest) -> list[MeshPart]:
    """Seat, back and arms with loose cushions, one for each 0.75 m; an armchair when it is narrow."""
    w, d, h = spec.size
    arm, back, seat = min(0.18, w * 0.2), 0.22, float(spec.params.get("seat", 0.43))
    inner = w - 2 * arm
    body = [
        box([-w / 2, -d / 2 + 0.02, 0.1], [w / 2, d / 2, seat - 0.14], 0.02),
        box([-w / 2, d / 2 - back, 0.1], [w / 2, d / 2, h], 0.05),
        *(box([x - arm / 2, -d / 2, 0.1], [x + arm / 2, d / 2, seat + 0.2], 0.04) for x in _edges(w, arm)),
    ]
    count = max(1, round(inner / 0.75))
    each = inner / count
    cushions = []
    for k in range(count):
        x = -inner / 2 + each * (k + 0.5)
        low, high = [x - each / 2 + 0.004, -d / 2, seat - 0.14], [x + each / 2 - 0.004, d / 2 - back, seat]
        cushions.append(box(low, high, 0.035))
        lean = pillow(each * 0.95, h - seat + 0.02, 0.17).turned(np.pi / 2 + 0.18, "x")
        cushions.append(lean.moved(x, d / 2 - back - 0.04, (h + seat) / 2))
    feet = [cylinder(0.022, 0, 0.1).moved(x, y) for x in _edges(w, 0.12) for y in _edges(d, 0.12)]
    return parts_of((spec.material("cloth", "tweed/0"), [*body, *cushions]), (spec.finish("walnut/0"), feet))


def table(spec: BuildRequest) -> list[MeshPart]:
    """A top on four legs with an apron; params['drawers'] puts drawers under the right side, as desks have."""
    w, d, h = spec.size
    leg = float(spec.params.get("leg", 0.055))
    wood = [box([-w / 2, -d / 2, h - 0.03], [w / 2, d / 2, h], 0.004)]
    wood += [
        box([x - leg / 2, y - leg / 2, 0], [x + leg / 2, y + leg / 2, h - 0.03], 0.003)
        for x in _edges(w, leg + 0.02)
        for y in _edges(d, leg + 0.02)
    ]
    apron = min(0.08, h * 0.15)
    wood += [
        box([-w / 2 + leg, y - 0.009, h - 0.03 - apron], [w / 2 - leg, y + 0.009, h - 0.03]) for y in _edges(d, leg)
    ]
    grips = []
    count = int(spec.params.get("drawers", 0))
    if count:
        x0, x1, low = w / 2 - leg - 0.42, w / 2 - leg, h - 0.04 - 0.15 * count
        wood.append(box([x0, -d / 2 + 0.04, low], [x1, d / 2 - 0.03, h - 0.03], 0.002))
        for k in range(count):
            z = low + 0.15 * k
            wood.append(box([x0 + 0.004, -d / 2 + 0.02, z + 0.004], [x1 - 0.004, -d / 2 + 0.04, z + 0.146], 0.002))
            grips.append(handle((x0 + x1) / 2, z + 0.075, -d / 2 + 0.02))
    return parts_of((spec.material("wood", "oak/0"), wood), (spec.metal("steel"), grips))


def chair(spec: BuildRequest) -> list[MeshPart]:
    """A seat at 0.45 m on four legs, and a back of slats."""
    w, d, h = spec.size
    seat, leg = 0.45, 0.034
    wood = [box([-w / 2, -d / 2, seat - 0.028], [w / 2, d / 2 - 0.02, seat - 0.004], 0.008)]
    wood += [bar([x, -d / 2 + leg, 0], [x, -d / 2 + leg, seat - 0.02], leg, leg, 0.003) for x in _edges(w, leg)]
    wood += [bar([x, d / 2 - leg, 0], [x, d / 2 - leg / 2, h], leg, leg, 0.003) for x in _edges(w, leg)]
    wood += [
        box([-w / 2 + leg, d / 2 - leg, z], [w / 2 - leg, d / 2 - leg + 0.016, z + 0.07], 0.004)
        for z in np.linspace(seat + 0.14, h - 0.075, 3)
    ]
    wood += [bar([x, -d / 2 + leg, 0.2], [x, d / 2 - leg, 0.2], 0.02, 0.02) for x in _edges(w, leg)]
    cushion = pillow(w * 0.92, (d - 0.03) * 0.92, 0.06).moved(0, -0.012, seat + 0.012)
    return parts_of((spec.material("wood", "oak/0"), wood), (spec.material("cloth", "linen/3"), cushion))


def office_chair(spec: BuildRequest) -> list[MeshPart]:
    """A padded seat and back on a column with five wheels."""
    w, d, h = spec.size
    seat, reach = 0.47, min(w, d) / 2 - 0.03
    dark: list[Shape] = [cylinder(0.028, 0.09, seat - 0.06)]
    for angle in np.arange(5) * 2 * np.pi / 5 + np.pi / 10:
        x, y = reach * np.cos(angle), reach * np.sin(angle)
        dark += [bar([0, 0, 0.1], [x, y, 0.07], 0.04, 0.03), cylinder(0.028, 0, 0.056).moved(x, y)]
    dark.append(bar([0, d * 0.3, seat - 0.05], [0, d / 2 - 0.03, h - 0.3], 0.06, 0.02))
    pads = [
        pillow(w * 0.8, d * 0.78, 0.11).moved(0, -d * 0.05, seat - 0.01),
        pillow(w * 0.74, h - seat - 0.1, 0.1).turned(np.pi / 2, "x").moved(0, d / 2 - 0.06, (h + seat) / 2 + 0.05),
    ]
    return parts_of(("black", dark), (spec.material("cloth", "tweed/0"), pads))


def toilet(spec: BuildRequest) -> list[MeshPart]:
    """A bowl with its lid closed before a cistern, the back of which stands at the wall."""
    w, d, h = spec.size
    rim, tank = 0.40, 0.18
    bowl = lathe([(0, 0), (0.11, 0), (0.1, 0.05), (0.1, 0.16), (0.19, 0.34), (0.2, rim - 0.03), (0, rim - 0.03)], 28)
    lid = lathe([(0, rim - 0.03), (0.2, rim - 0.03), (0.2, rim - 0.008), (0.19, rim), (0, rim)], 28)
    length = (d - tank) / 0.4
    place = {"y": -d / 2 + (d - tank) / 2}
    oval = [s.scaled(w / 0.42, length, 1.0).moved(**place) for s in (bowl, lid)]
    cistern = [
        box([-w / 2 + 0.01, d / 2 - tank, rim - 0.02], [w / 2 - 0.01, d / 2, h - 0.03], 0.02),
        box([-w / 2, d / 2 - tank - 0.01, h - 0.03], [w / 2, d / 2, h - 0.006], 0.008),
        box([-0.1, d / 2 - tank - 0.08, 0], [0.1, d / 2, rim - 0.02], 0.02),
    ]
    button = cylinder(0.025, h - 0.006, h).moved(0, d / 2 - tank / 2)
    return parts_of(("porcelain", [*oval, *cistern]), (spec.metal("chrome"), button))


def bathtub(spec: BuildRequest) -> list[MeshPart]:
    """A panelled tub: a rim around a basin that narrows towards its ground, and a tap at the head."""
    w, d, h = spec.size
    rim = 0.07
    inside, deep = [(-w / 2 + rim, -d / 2 + rim), (w / 2 - rim, d / 2 - rim)], 0.1
    (x0, y0), (x1, y1) = inside
    shell = [
        box([-w / 2, -d / 2, 0], [w / 2, y0, h], 0.012),
        box([-w / 2, y1, 0], [w / 2, d / 2, h], 0.012),
        box([-w / 2, y0, 0], [x0, y1, h], 0.012),
        box([x1, y0, 0], [w / 2, y1, h], 0.012),
        box([x0, y0, 0], [x1, y1, deep]),
    ]
    tap = [
        bar([x0 - 0.02, 0, h], [x0 - 0.02, 0, h + 0.12], 0.03, 0.03),
        bar([x0 - 0.02, 0, h + 0.12], [x0 + 0.12, 0, h + 0.1], 0.026, 0.02),
    ]
    return parts_of(("porcelain", shell), (spec.metal("chrome"), tap))


def television(spec: BuildRequest) -> list[MeshPart]:
    """A dark screen in a narrow frame on a foot."""
    w, d, h = spec.size
    y = -0.015
    case = [box([-w / 2, y, 0.06], [w / 2, y + 0.03, h], 0.004), box([-0.04, y + 0.005, 0.01], [0.04, y + 0.03, 0.1])]
    foot = box([-w * 0.2, -d / 2, 0], [w * 0.2, d / 2, 0.012], 0.003)
    screen = box([-w / 2 + 0.01, y - 0.001, 0.072], [w / 2 - 0.01, y, h - 0.01])
    return parts_of(("black", [*case, foot]), (plain((0.02, 0.02, 0.025), 0.08), screen))


def low_cabinet(spec: BuildRequest) -> list[MeshPart]:
    """A sideboard or television stand: doors side by side under a top, on short legs."""
    w, d, h = spec.size
    foot = 0.1
    wood = [box([-w / 2, -d / 2 + 0.02, foot], [w / 2, d / 2, h], 0.003)]
    wood += [cylinder(0.018, 0, foot).moved(x, y) for x in _edges(w, 0.12) for y in _edges(d, 0.12)]
    edges, grips = np.linspace(-w / 2, w / 2, max(2, round(w / 0.5)) + 1), []
    for k, (a, b) in enumerate(zip(edges, edges[1:])):
        wood.append(box([a + 0.003, -d / 2, foot + 0.012], [b - 0.003, -d / 2 + 0.02, h - 0.02], 0.002))
        grips.append(handle(b - 0.05 if k % 2 == 0 else a + 0.05, (h + foot) / 2, -d / 2, upright=True))
    return parts_of((spec.material("wood", "oak/0"), wood), (spec.metal("black"), grips))


def _edges(length: float, inset: float) -> tuple[float, float]:
    """Middles of two things of size `inset` at either end of `length`, around zero."""
    return (inset - length) / 2, (length - inset) / 2

"""Shelves, bookcases, wardrobes, boxes and floor cushions."""

import itertools

import numpy as np

from embodied.assets.built import parametric
from embodied.assets.built.primitives import bar, box, pillow
from embodied.assets.records import MeshPart, Size, SupportSurface

BOARD = 0.022


def shelf(spec: parametric.BuildRequest) -> list[MeshPart]:
    """A board on two brackets."""
    w, d, h = spec.size
    plank = box([-w / 2, -d / 2, h - 0.028], [w / 2, d / 2, h], 0.003)
    irons = []
    for x in (-w / 2 + 0.12, w / 2 - 0.12):
        irons += [
            box([x - 0.012, d / 2 - 0.005, 0], [x + 0.012, d / 2, h - 0.028], 0.001),
            box([x - 0.012, -d * 0.3, h - 0.034], [x + 0.012, d / 2, h - 0.028]),
            bar([x, d / 2 - 0.004, 0.02], [x, -d * 0.25, h - 0.034], 0.010, 0.008),
        ]
    return parametric.parts_of((spec.material("wood", "oak/0"), plank), (spec.metal("black"), irons))


def _levels(h: float, count: int) -> np.ndarray:
    """Undersides of the boards of a bookcase with `count` shelves, and its top."""
    return np.linspace(0.06, h - BOARD, count + 1)


def bookcase(spec: parametric.BuildRequest) -> list[MeshPart]:
    """Sides, boards, a plinth and a thin back."""
    w, d, h = spec.size
    z = _levels(h, int(spec.params.get("shelves", 5)))
    sides = [
        box([-w / 2, -d / 2, 0], [-w / 2 + BOARD, d / 2, h], 0.002),
        box([w / 2 - BOARD, -d / 2, 0], [w / 2, d / 2, h], 0.002),
    ]
    boards = [box([-w / 2 + BOARD, -d / 2 + 0.002, a], [w / 2 - BOARD, d / 2 - 0.006, a + BOARD], 0.0015) for a in z]
    back = box([-w / 2 + BOARD, d / 2 - 0.006, 0.06], [w / 2 - BOARD, d / 2, h])
    plinth = box([-w / 2 + BOARD, -d / 2 + 0.02, 0], [w / 2 - BOARD, -d / 2 + 0.038, 0.06])
    return parametric.parts_of((spec.material("wood", "oak/0"), [*sides, *boards, plinth, back]))


def shelf_surfaces(size: Size, params: parametric.ParamValues) -> tuple[SupportSurface, ...]:
    """Support surfaces of `bookcase`, from below, and its top."""
    w, d, h = size
    z = _levels(h, int(params.get("shelves", 5)))
    inner = [
        parametric.surface(f"shelf_{k + 1}", float(a + BOARD), w - 2 * BOARD, d - 0.008, float(b - a - BOARD), 0.008)
        for k, (a, b) in enumerate(itertools.pairwise(z))
    ]
    return (*inner, parametric.surface("top", h, w, d, 9.0 if h < 1.9 else 0.5))


def top_surface(size: Size, params: parametric.ParamValues) -> tuple[SupportSurface, ...]:
    """The top of something tall and flat."""
    w, d, h = size
    return (parametric.surface("top", h, w, d, 9.0 if h < 1.9 else 0.5),)


def wardrobe(spec: parametric.BuildRequest) -> list[MeshPart]:
    """Hinged doors over a plinth, with long handles; one leaf a mirror where params['mirror'] is 1."""
    w, d, h = spec.size
    y, low = -d / 2 + 0.002, 0.07
    leaves = max(2, round(w / 0.5))
    edges = np.linspace(-w / 2, w / 2, leaves + 1)
    style = spec.word("style", "flat")
    doors, grips, glass = [], [], []
    for k, (a, b) in enumerate(itertools.pairwise(edges)):
        doors.append(parametric.front(a, b, low, h - 0.02, y, style))
        grips.append(
            parametric.handle(
                b - 0.035 if k % 2 == 0 else a + 0.035, h * 0.5, y, spec.word("handle", "bar"), True, 0.22
            )
        )
        if spec.params.get("mirror") and k == leaves // 2:
            glass.append(box([a + 0.02, y - 0.004, low + 0.03], [b - 0.02, y + 0.001, h - 0.05], 0.001))
    body = parametric.carcass((-w / 2, y + 0.02, low), (w / 2, d / 2, h))
    plinth = box([-w / 2 + 0.01, -d / 2 + 0.05, 0], [w / 2 - 0.01, d / 2 - 0.02, low])
    top = box([-w / 2, -d / 2, h - 0.018], [w / 2, d / 2, h], 0.002)
    return parametric.parts_of(
        (spec.material("front", "lacquer_white/0"), [*doors, body, top]),
        ("black", plinth),
        parametric.joints(doors),
        (spec.metal("steel"), grips),
        ("mirror", glass),
    )


def bedside(spec: parametric.BuildRequest) -> list[MeshPart]:
    """A bedside table on feet: two drawers, or one over an open shelf where params["drawers"] is 1."""
    w, d, h = spec.size
    open_below = spec.params.get("drawers") == 1
    board, foot, lip = 0.02, (0.03 if open_below else 0.05), (0.007 if open_below else 0.03)
    top_y = -d / 2 + lip
    y = top_y + (0.022 if open_below else 0.003)
    x, low, high = w / 2 - 0.008, foot + board, h - 0.022
    split = 0.64 * h + board if open_below else (low + high) / 2
    body = [
        box([-w / 2, top_y, high], [w / 2, d / 2, h], 0.004),
        box([-x, y, foot], [-x + board, d / 2 - 0.004, high], 0.002),
        box([x - board, y, foot], [x, d / 2 - 0.004, high], 0.002),
        box([-x + board, y + 0.004, foot], [x - board, d / 2 - 0.004, low], 0.001),
        box([-x + board, d / 2 - 0.012, low], [x - board, d / 2 - 0.004, high]),
    ]
    if open_below:
        body.append(box([-x + board, y + 0.004, split - board], [x - board, d / 2 - 0.012, split], 0.001))
    feet = [
        box([a - 0.016, b - 0.016, 0], [a + 0.016, b + 0.016, foot + 0.002], 0.004)
        for a in (-x + 0.03, x - 0.03)
        for b in (y + 0.03, d / 2 - 0.04)
    ]
    rows = [(split, high)] if open_below else [(low, split), (split, high)]
    edge = x - board - 0.001
    drawers = [parametric.front(-edge, edge, a + 0.001, b - 0.001, y, "flat", 0.018) for a, b in rows]
    grip = "knob" if open_below else "bar"
    grips = [parametric.handle(0, (a + b) / 2 + (0 if open_below else 0.03), y, grip, False, 0.16) for a, b in rows]
    wood = spec.material("wood", "oak/0")
    return parametric.parts_of(
        (wood, [*body, *feet]),
        (spec.material("front", "oak/0") if "front" in spec.params else wood, drawers),
        parametric.joints(drawers),
        (spec.metal("steel"), grips),
    )


def storage_box(spec: parametric.BuildRequest) -> list[MeshPart]:
    """A box with a lid and a label holder."""
    w, d, h = spec.size
    body = box([-w / 2 + 0.004, -d / 2 + 0.004, 0], [w / 2 - 0.004, d / 2 - 0.004, h * 0.85], 0.004)
    lid = box([-w / 2, -d / 2, h * 0.72], [w / 2, d / 2, h], 0.005)
    label = box([-0.035, -d / 2 + 0.002, h * 0.36], [0.035, -d / 2 + 0.005, h * 0.52], 0.001)
    return parametric.parts_of((spec.material("skin", "linen/2"), [body, lid]), ("steel", label))


def bean_bag(spec: parametric.BuildRequest) -> list[MeshPart]:
    """A floor cushion, thick and round."""
    w, d, h = spec.size
    return parametric.parts_of((spec.material("cloth", "linen/9"), pillow(w, d, h, 16, 0.28).moved(0, 0, h / 2)))

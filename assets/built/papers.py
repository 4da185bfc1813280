"""Books, papers, frames and gadgets."""

import numpy as np

from embodied.assets.built import primitives
from embodied.assets.built.parametric import CLOTHS, BuildRequest, FinishedShapes, parts_of, plain, whole_image
from embodied.assets.records import MeshPart

PALE = 1.35
"""Sum of a cloth's channels from which on it is printed dark."""


def _book(
    w: float, d: float, h: float, *, rng: np.random.Generator
) -> tuple[primitives.Shape, primitives.Shape, primitives.Shape | None]:
    """A standing book, spine to -y: cover, pages, a band on its spine."""
    c = 0.0022
    cover = primitives.joined(
        primitives.box([-w / 2, -d / 2, 0], [-w / 2 + c, d / 2, h], 0.0008),
        primitives.box([w / 2 - c, -d / 2, 0], [w / 2, d / 2, h], 0.0008),
        primitives.box([-w / 2 + c * 0.5, -d / 2, 0], [w / 2 - c * 0.5, -d / 2 + c, h], 0.0008),
    )
    pages = primitives.box([-w / 2 + c, -d / 2 + c, 0.003], [w / 2 - c, d / 2 - 0.004, h - 0.003])
    band = None
    if rng.random() < 0.7:
        z = h * rng.uniform(0.55, 0.8)
        t = h * rng.uniform(0.03, 0.14)
        band = primitives.box([-w / 2 + 0.001, -d / 2 - 0.0003, z], [w / 2 - 0.001, -d / 2 + 0.001, z + t])
    return cover, pages, band


def _words(low: float, high: float, count: int, *, rng: np.random.Generator) -> np.ndarray:
    """(count, 2) where words of a line of print begin and end."""
    ends = np.sort(rng.uniform(low, high, count - 1)) if count > 1 else np.zeros(0)
    starts, stops = np.concatenate([[low], ends + 0.002]), np.concatenate([ends - 0.002, [high]])
    return np.stack([starts, np.maximum(stops, starts + 0.003)], axis=1)


def _on_spine(w: float, d: float, h: float, *, rng: np.random.Generator) -> primitives.Shape:
    """The title on the spine of a standing book: words that run upwards."""
    tall = min(0.32 * w, rng.uniform(0.004, 0.009))
    low = rng.uniform(0.12, 0.3) * h
    z = _words(low, low + rng.uniform(0.2, 0.38) * h, int(rng.integers(1, 4)), rng=rng)
    y, x = np.full_like(z[:, 0], -d / 2 - 0.0006), np.full_like(z[:, 0], tall / 2)
    corners = [(-x, y, z[:, 0]), (x, y, z[:, 0]), (x, y, z[:, 1]), (-x, y, z[:, 1])]
    return primitives.quads(np.stack([np.stack(c, axis=1) for c in corners], axis=1))


def _on_front(w: float, d: float, h: float, *, rng: np.random.Generator) -> primitives.Shape:
    """Title, rule and author on the front (-x) of a standing book whose spine looks to -y."""
    lines = []
    top, tall = h * rng.uniform(0.78, 0.88), h * rng.uniform(0.035, 0.06)
    for k, high in ((0, tall), (1, tall), (2, 0.004), (7, 0.6 * tall)):
        reach = d * rng.uniform(0.18, 0.36)
        words = _words(-reach, reach, 1 if k == 2 else int(rng.integers(1, 4)), rng=rng)
        lines += [(y0, y1, top - 1.7 * k * tall, top - 1.7 * k * tall + high) for y0, y1 in words]
    x = -w / 2 - 0.0006
    return primitives.quads([[(x, y1, z0), (x, y0, z0), (x, y0, z1), (x, y1, z1)] for y0, y1, z0, z1 in lines])


def _ink(cloth: int) -> str:
    """Gilt on dark cloth, dark print on light cloth."""
    return "ink" if sum(CLOTHS[cloth]) > PALE else "gilt"


def book_row(spec: BuildRequest) -> list[MeshPart]:
    """Books side by side, of many heights and colours; the last ones may lean."""
    (w, d, h), rng = spec.size, spec.rng
    by_color: dict[int, list[primitives.Shape]] = {}
    titles: dict[str, list[primitives.Shape]] = {"gilt": [], "ink": []}
    pages, bands = [], []
    (prints,) = rng.spawn(1)
    x = -w / 2
    palette = rng.permutation(len(CLOTHS))[: int(rng.integers(5, 10))]
    first = True
    while True:
        t = float(np.clip(rng.lognormal(-3.6, 0.45), 0.012, 0.06))
        if x + t > w / 2 - 0.004:
            t = w / 2 - x
        tall, deep = (1.0, 1.0) if first else (rng.uniform(0.72, 1.0), rng.uniform(0.75, 1.0))
        cover, leaves, band = _book(t - 0.0008, d * deep, h * tall, rng=rng)
        shift = {"x": x + t / 2, "y": -d / 2 + d * deep / 2 + (0 if first else rng.uniform(0, 0.01))}
        cloth = int(palette[rng.integers(len(palette))])
        by_color.setdefault(cloth, []).append(cover.moved(**shift))
        titles[_ink(cloth)].append(_on_spine(t, d * deep, h * tall, rng=prints).moved(**shift))
        pages.append(leaves.moved(**shift))
        if band is not None:
            bands.append(band.moved(**shift))
        x, first = x + t, False
        if x > w / 2 - 0.012:
            break
    return parts_of(
        *((plain(CLOTHS[k], 0.75, specular=0.25), s) for k, s in sorted(by_color.items())),
        ("paper", pages),
        ("gilt", bands),
        *titles.items(),
    )


def book_stack(spec: BuildRequest) -> list[MeshPart]:
    """Books lying on one another, each turned a little; one book where params['count'] is 1."""
    (w, d, h), rng = spec.size, spec.rng
    count = int(spec.params.get("count", 3))
    heights = rng.uniform(0.7, 1.3, count)
    covers: list[FinishedShapes] = []
    z, pages = 0.0, []
    (prints,) = rng.spawn(1)
    colours = rng.permutation(len(CLOTHS))
    for k, t in enumerate(heights / heights.sum() * h):
        shrink = 1.0 - 0.06 * k
        inner = t, d * 0.94 * shrink, w * 0.94 * shrink
        cover, leaves, _ = _book(*inner, rng=rng)
        print_ = _on_spine(*inner, rng=prints)
        if k == count - 1:
            print_ = primitives.joined(print_, _on_front(*inner, rng=prints))
        angle = 0.0 if count == 1 else rng.normal(0, 0.12)
        place = [
            s.turned(np.pi / 2, "y").moved(-w * 0.47 * shrink, 0, t / 2).turned(angle).moved(0, 0, z)
            for s in (cover, leaves, print_)
        ]
        cloth = int(colours[k % len(CLOTHS)])
        covers += [(plain(CLOTHS[cloth], 0.6, specular=0.3), place[0]), (_ink(cloth), place[2])]
        pages.append(place[1])
        z += t
    return parts_of(*covers, ("paper", pages))


def magazine(spec: BuildRequest) -> list[MeshPart]:
    """A magazine lying flat, its leaves rising a little at the open side."""
    w, d, h = spec.size
    x, y = np.meshgrid(np.linspace(-w / 2, w / 2, 9), np.linspace(-d / 2, d / 2, 5))
    grid = np.stack([x, y, h * (0.55 + 0.45 * ((x + w / 2) / w) ** 2)], -1)
    cover = spec.material("cover", "magazine_cover/0")
    top = whole_image(primitives.sheet(grid), cover, -w / 2, w / 2, -d / 2, d / 2, "xy", keep_aspect=False)
    base = primitives.quads([[(-w / 2, d / 2, 0), (w / 2, d / 2, 0), (w / 2, -d / 2, 0), (-w / 2, -d / 2, 0)]])
    return parts_of((cover, top), ("paper", [primitives.skirt(grid), base]))


def papers(spec: BuildRequest) -> list[MeshPart]:
    """Sheets of paper in a loose pile."""
    (w, d, h), rng = spec.size, spec.rng
    leaves = []
    for k, z in enumerate(np.linspace(0, h * 0.92, 6)):
        leaf = primitives.box([-w * 0.46, -d * 0.46, 0], [w * 0.46, d * 0.46, h * 0.16])
        leaf = leaf.turned(rng.normal(0, 0.05) if k else 0.0)
        leaves.append(leaf.moved(rng.normal(0, 0.004), rng.normal(0, 0.004), z))
    return parts_of(("paper", leaves))


def photo_frame(spec: BuildRequest) -> list[MeshPart]:
    """A small standing frame with a photograph."""
    w, _, h = spec.size
    f, tilt = 0.016, 0.22
    boards = primitives.frame(-w / 2, w / 2, 0, h, (0, 0.012), f, 0.002)
    art = spec.material("art", "art_sea/0")
    inside = -w / 2 + f, w / 2 - f, f, h - f
    image = whole_image(primitives.upright(*inside, 0.004), art, *inside)
    back = primitives.box([-w / 2 + 0.004, 0.010, 0.004], [w / 2 - 0.004, 0.013, h - 0.004])
    leg = primitives.bar([0, h * 0.13 + 0.012, h * 0.6], [0, h * 0.34, 0.002], 0.035, 0.003)
    wood = {"brass": "brass", "black": "black", "white": "porcelain"}.get(spec.word("frame", "oak"), "oak/0")
    lean = [s.turned(-tilt, "x") for s in (primitives.joined(*boards), image, back)]
    return parts_of((spec.named(wood), lean[0]), (art, lean[1]), ("black", [lean[2], leg]))


def alarm_clock(spec: BuildRequest) -> list[MeshPart]:
    """A round bedside clock on two feet: two bells with a hammer between them under a bow, a rim around the dial."""
    w, d, h = spec.size
    r = w * 0.46
    zc = h * 0.43
    back = [(0, 0), (r * 0.86, 0), (r * 0.97, d * 0.12), (r, d * 0.3)]
    case = [*back, (r, d * 0.62), (r * 0.94, d * 0.7), (r * 0.9, d * 0.62)]
    around = [(r * 0.90, d * 0.62), (r * 0.90, d * 0.73), (r * 0.96, d * 0.75), (r * 1.0, d * 0.7), (r * 1.0, d * 0.62)]
    shell, ring = (primitives.lathe(profile, 36, 0.9).hung(0, d * 0.4, zc) for profile in (case, around[::-1]))
    face = spec.finish("clock_face/0")
    disc = primitives.cylinder(r * 0.9, 0, 0.001, 0, 36).hung(0, d * 0.4 - d * 0.66, zc)
    disc = whole_image(disc, face, -r * 0.9, r * 0.9, zc - r * 0.9, zc + r * 0.9)
    t = np.linspace(0, np.pi / 2, 6)
    cap = primitives.lathe(
        [(0, -0.002), (r * 0.36, -0.002), *np.stack([r * 0.38 * np.cos(t), r * 0.30 * np.sin(t)], 1)], 20, 0.9
    )
    nail = [(0, -r * 0.3), (r * 0.05, -r * 0.3), (r * 0.05, r * 0.36), (r * 0.09, r * 0.38), (0, r * 0.42)]
    pin = primitives.lathe(nail, 8, 0.9)
    bells = [
        s.turned(side * 0.55, "y").moved(side * r * 0.56, 0, zc + r * 0.98) for side in (-1, 1) for s in (cap, pin)
    ]
    hammer = [
        primitives.tube([(0, 0, zc + r * 0.9), (0, 0, zc + r * 1.16)], 0.0016, 6),
        primitives.ball(0.0045, 8, 6).moved(0, 0, zc + r * 1.18),
    ]
    a = np.linspace(0.25, np.pi - 0.25, 12)
    bow = primitives.tube(np.stack([r * 0.6 * np.cos(a), 0 * a, zc + r * 1.02 + r * 0.42 * np.sin(a)], 1), 0.0016, 6)
    feet = [
        primitives.joined(
            primitives.tube([(s * r * 0.5, 0, zc - r * 0.75), (s * r * 0.78, 0, 0.005)], [0.003, 0.004], 7),
            primitives.ball(0.0055, 8, 6).moved(s * r * 0.78, 0, 0.0055),
        )
        for s in (-1, 1)
    ]
    skin = spec.word("metal", "brass")
    bright = "brass" if skin == "brass" else "chrome"
    return parts_of((skin, shell), (bright, [ring, *bells, *hammer, bow, *feet]), (face, disc))


def remote(spec: BuildRequest) -> list[MeshPart]:
    w, d, h = spec.size
    body = primitives.box([-w / 2, -d / 2, 0], [w / 2, d / 2, h * 0.88], h * 0.25)
    keys = [
        primitives.box([x - 0.004, y - 0.003, h * 0.85], [x + 0.004, y + 0.003, h], 0.0008)
        for x in np.linspace(-0.3, 0.3, 3) * w
        for y in np.linspace(-0.34, 0.28, 7) * d
    ]
    power = primitives.box([-0.32 * w, 0.38 * d, h * 0.85], [-0.18 * w, 0.42 * d, h], 0.0008)
    return parts_of(
        (plain((0.06, 0.06, 0.065), 0.45), body),
        (plain((0.35, 0.35, 0.36), 0.6), keys),
        (plain((0.7, 0.12, 0.10), 0.5), power),
    )


def keys(spec: BuildRequest) -> list[MeshPart]:
    """A ring with three keys fanned out and a leather tag."""
    _, d, h = spec.size
    around = [(0.016 * np.cos(t), 0.016 * np.sin(t), 0) for t in np.linspace(0, 6.283, 19)[:-1]]
    ring = primitives.tube(around, 0.0011, 6, closed=True).moved(0, d * 0.3, h * 0.5)
    made = []
    for k, a in enumerate((-2.1, -1.5, -1.0)):
        bow = primitives.lathe([(0.004, 0), (0.011, 0), (0.011, 0.002), (0.004, 0.002), (0.004, 0)], 16).moved(0.013)
        blade = primitives.joined(
            primitives.box([0.022, -0.0035, 0], [0.052, 0.0035, 0.002]),
            *[primitives.box([x, -0.0055, 0], [x + 0.003, -0.003, 0.002]) for x in (0.036, 0.042, 0.047)],
        )
        made.append(primitives.joined(bow, blade).turned(a).moved(0, d * 0.3, 0.001 + 0.0022 * k))
    tag = primitives.box([0.014, -0.010, 0], [0.060, 0.010, 0.003], 0.001).turned(0.3).moved(0, d * 0.3, 0.001)
    return parts_of(("steel", [ring, made[0], made[2]]), ("brass", made[1]), (plain((0.36, 0.22, 0.13), 0.6), tag))


def tissue_box(spec: BuildRequest) -> list[MeshPart]:
    w, d, h = spec.size
    top = h * 0.62
    x, y = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9))
    rise = (1 - np.maximum(np.abs(x), np.abs(y)) ** 2) * (0.75 + 0.25 * np.sin(4 * x + 3 * y)) * (h - top)
    tissue = primitives.sheet(
        np.stack([x * 0.05 + 0.01 * np.sin(5 * y), y * 0.022, top - 0.004 + np.clip(rise, 0, None)], -1)
    )
    slot = primitives.lathe([(0.0, 0.0), (1.0, 0.0), (1.0, 0.0008), (0.0, 0.0008)], 24)
    return parts_of(
        (spec.material("skin", "cotton/3"), primitives.box([-w / 2, -d / 2, 0], [w / 2, d / 2, top], 0.003)),
        ("black", slot.scaled(w * 0.32, d * 0.2, 1).moved(0, 0, top - 0.0004)),
        (plain((0.95, 0.95, 0.95), 0.95, specular=0.05), tissue.two_sided()),
    )


def pencil_cup(spec: BuildRequest) -> list[MeshPart]:
    (w, _, h), rng = spec.size, spec.rng
    r, high = w / 2, h * 0.55
    tints = ((0.80, 0.60, 0.16), (0.18, 0.32, 0.55), (0.68, 0.17, 0.15), (0.10, 0.10, 0.11), (0.22, 0.45, 0.28))
    pens = []
    for k in range(6):
        a = k * 2.4 + rng.uniform(0, 0.6)
        tip = np.array([0.85 * r * np.cos(a), 0.85 * r * np.sin(a), h * rng.uniform(0.82, 1.0)])
        foot = np.array([-0.5 * r * np.cos(a), -0.5 * r * np.sin(a), 0.006])
        pens.append((plain(tints[k % 5], 0.4), primitives.tube([foot, tip], 0.0037, 6)))
        pens.append(
            (plain((0.82, 0.68, 0.48), 0.7), primitives.tube([tip, tip + (tip - foot) * 0.07], [0.0037, 0.0006], 6))
        )
    skin = spec.material("skin", "leather/2") if "skin" in spec.params else plain((0.10, 0.10, 0.105), 0.5)
    wall = [(0, 0), (r * 0.98, 0), (r, high), (r - 0.003, high), (r * 0.98 - 0.003, 0.004), (0, 0.004)]
    return parts_of((skin, primitives.lathe(wall, 24)), *pens)

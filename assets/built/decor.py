"""Pictures, posters, mirrors, clocks, vases and house plants."""

import itertools

import numpy as np
import shapely
from scipy.interpolate import PchipInterpolator

from embodied.assets.built.parametric import BuildRequest, parts_of, plain, whole_image
from embodied.assets.built.primitives import Shape, ball, border, box, flat, frame, lathe, sheet, tube, upright
from embodied.assets.records import MeshPart, Size


def picture(spec: BuildRequest) -> list[MeshPart]:
    """Framed art: a moulded frame, a mat where params['mat'] > 0, the picture, glass over paper."""
    w, d, h = spec.size
    wood = spec.named(spec.word("frame", "oak/0"))
    f = float(spec.params.get("width", 0.022)) * min(1.0, min(w, h) / 0.4)
    m = float(spec.params.get("mat", 0.0)) * min(w, h)
    y0, y1 = -d / 2, d / 2
    moulding = []
    lines = [(0.0, y1), (0.0, y0 + 0.004), (0.25 * f, y0), (0.8 * f, y0 + 0.001), (f, y0 + 0.006), (f, y0 + 0.012)]
    for outer, inner in itertools.pairwise(lines):
        strip = border(-w / 2, w / 2, 0, h, outer, inner)
        upright_grain = (np.arange(len(strip.uv)) // 4 % 2 == 1)[:, None]
        uv = np.where(upright_grain, strip.uv[:, ::-1], strip.uv)
        moulding.append(Shape(strip.vertices, strip.faces, strip.normals, uv))
    back = upright(w / 2, -w / 2, 0, h, y1)
    art = spec.material("art", "art_hills/0")
    g = f + m
    x0, x1, z0, z1 = -w / 2 + g, w / 2 - g, g, h - g
    image = whole_image(upright(x0, x1, z0, z1, y0 + 0.0125), art, x0, x1, z0, z1)
    mat = [border(-w / 2, w / 2, 0, h, (f, y0 + 0.012), (g, y0 + 0.012))] if m > 0 else []
    return parts_of((wood, moulding), ("paper", [*mat, back]), (art, image))


def canvas(spec: BuildRequest) -> list[MeshPart]:
    """A painting on a stretched canvas without a frame."""
    w, d, h = spec.size
    art = spec.material("art", "art_brushwork/0")
    return parts_of((art, whole_image(box([-w / 2, -d / 2, 0], [w / 2, d / 2, h], 0.002), art, -w / 2, w / 2, 0, h)))


def poster(spec: BuildRequest) -> list[MeshPart]:
    """Unframed paper on the wall, its corners coming off a little."""
    w, d, h = spec.size
    x, z = np.meshgrid(np.linspace(-w / 2, w / 2, 9), np.linspace(0, h, 9))
    curl = (np.abs(x) / (w / 2)) ** 6 * (np.abs(z - h / 2) / (h / 2)) ** 6
    y = d / 2 - 0.001 - curl * (d - 0.001) * spec.rng.uniform(0.5, 1.0, (9, 9))
    art = spec.material("art", "art_poster/0")
    return parts_of((art, whole_image(sheet(np.stack([x, y, z], -1), 0.0004), art, -w / 2, w / 2, 0, h)))


def mirror(spec: BuildRequest) -> list[MeshPart]:
    """A looking-glass in a slim frame; round where params['round'] is 1."""
    w, d, h = spec.size
    y0, f = -d / 2, float(spec.params.get("width", 0.016))
    rim = spec.named(spec.word("frame", "black"))
    if spec.params.get("round"):
        ring = lathe([(0.5 - f / w, 0), (0.5, 0), (0.5, d), (0.5 - f / w, d), (0.5 - f / w, 0)], 48)
        ring = ring.turned(np.pi / 2, "x").scaled(w, 1, h).moved(0, d / 2, h / 2)
        disc = lathe([(0.5 - f / w, 0), (0, 0)], 48)
        disc = disc.turned(np.pi / 2, "x").scaled(w, 1, h).moved(0, y0 + 0.006, h / 2)
        disc = Shape(disc.vertices, disc.faces, np.tile([0.0, -1.0, 0.0], (len(disc.vertices), 1)), disc.uv)
        back = lathe([(0, 0), (0.49, 0), (0.49, 0.004), (0, 0.004)], 32)
        back = back.turned(np.pi / 2, "x").scaled(w, 1, h).moved(0, d / 2, h / 2)
        return parts_of((rim, ring), ("black", back), ("mirror", disc))
    x, boards = w / 2 - f, frame(-w / 2, w / 2, 0, h, (y0, d / 2), f, 0.002)
    glass, back = upright(-x, x, f, h - f, y0 + 0.006), upright(x, -x, f, h - f, d / 2)
    return parts_of((rim, boards), ("black", back), ("mirror", glass))


def wall_clock(spec: BuildRequest) -> list[MeshPart]:
    """A round case with a printed dial behind glass."""
    w, d, h = spec.size
    case = lathe([(0, 0), (0.5, 0), (0.5, 0.7 * d), (0.485, d), (0.455, d), (0.45, 0.75 * d), (0.45, 0.72 * d)], 40)
    case = case.turned(np.pi / 2, "x").scaled(w, 1, h).moved(0, d / 2, h / 2)
    t = np.linspace(0, 2 * np.pi, 41)[:-1]
    disc = flat(shapely.Polygon(np.stack([0.452 * np.cos(t), 0.452 * np.sin(t)], 1)), 0.0).turned(np.pi / 2, "x")
    disc = disc.scaled(w, 1, h).moved(0, d / 2 - 0.72 * d, h / 2)
    face = spec.material("face", "clock_face/0")
    disc = whole_image(disc, face, -w * 0.452, w * 0.452, h * 0.048, h * 0.952)
    return parts_of((spec.metal("black"), case), (face, disc))


def vase(spec: BuildRequest) -> list[MeshPart]:
    """A turned vase, with dry branches where params['branches'] is 1."""
    (w, _, h), rng = spec.size, spec.rng
    branches = bool(spec.params.get("branches"))
    body = h * 0.42 if branches else h
    belly, neck, at = rng.uniform(0.42, 0.5), rng.uniform(0.16, 0.28), rng.uniform(0.3, 0.55)
    t = np.linspace(0, 1, 22)
    r = PchipInterpolator([0, at, 0.85, 1], [0.28, belly, neck, neck * 1.35])(t)
    r = r / r.max() * (0.5 if not branches else 0.34)
    inner = np.maximum(r - 0.035, 0.02)
    profile = [
        (0, 0.004),
        (r[0] * w - 0.006, 0.004),
        (r[0] * w - 0.006, 0),
        *zip(r * w, t * (body - 0.002) + 0.0005),
        ((r[-1] + inner[-1]) / 2 * w, body),
        *[(a * w, b * (body - 0.004)) for a, b in zip(inner[:8:-1], t[:8:-1])],
        (0, body * 0.4),
    ]
    clay = f"glaze/{spec.word('glaze', 'white')}"
    twigs, buds = [], []
    if branches:
        for _ in range(7):
            a, lean = rng.uniform(0, 6.28), rng.uniform(0.04, 0.5) * w * 0.9
            s = np.linspace(0, 1, 6)
            z = body * 0.75 + (h - body * 0.75) * s * rng.uniform(0.82, 1.0)
            bow = np.stack([np.cos(a) * lean * s**1.5, np.sin(a) * lean * s**1.5, z], 1)
            bow[1:-1, :2] += rng.normal(0, 0.006, (4, 2))
            twigs.append(tube(bow, np.linspace(0.0028, 0.0012, 6), 5))
            for q in np.linspace(0.45, 1, 6):
                i = min(5, round(q * 5))
                buds.append(ball(0.009, 6, 5).scaled(1, 1, 1.5).moved(*(bow[i] + rng.normal(0, 0.008, 3))))
    return parts_of(
        (clay, lathe(profile, 28, 0.9)), (plain((0.32, 0.23, 0.16), 0.9), twigs), (plain((0.86, 0.80, 0.72), 0.9), buds)
    )


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

"""Pictures and patterns that are used once, not tiled: wall art, rugs (u along their length), dials, covers."""

from collections.abc import Callable

import cv2
import numpy as np

from embodied.assets.materials.maps import Canvas, Colors, Maps, maps_of, mix, rgb, smooth_step
from embodied.assets.records import Color


def _canvas(on: Canvas, color: Color, grain: float = 0.015) -> np.ndarray:
    return on.rgb(color) * (1 + grain * on.noise(1.2, 1.2))[..., None]


def _fill(image: np.ndarray, points: np.ndarray, color: Color | np.ndarray, alpha: float = 1.0) -> np.ndarray:
    """A filled polygon (k, 2) in [0, 1] with y down, antialiased, painted into `image`."""
    return _ink(image, points, 0.0, color, alpha, lambda mask, p: cv2.fillPoly(mask, [p], 255, cv2.LINE_AA, 4))


def _stroke(
    image: np.ndarray, points: np.ndarray, width: float, color: Color | np.ndarray, alpha: float = 1.0
) -> np.ndarray:
    """A line through points (k, 2) of `width` in [0, 1], painted into `image`."""
    thick = max(1, round(width * len(image)))
    draw = lambda mask, p: cv2.polylines(mask, [p], False, 255, thick, cv2.LINE_AA, 4)
    return _ink(image, points, width, color, alpha, draw)


def _ink(
    image: np.ndarray,
    points: np.ndarray,
    margin: float,
    color: Color | np.ndarray,
    alpha: float,
    draw: Callable[[np.ndarray, np.ndarray], object],
) -> np.ndarray:
    """Paint what `draw(mask, points)` marks, touching only the box around the points."""
    n = len(image)
    low = np.clip(np.floor((points.min(0) - margin) * n).astype(int) - 2, 0, n)
    high = np.clip(np.ceil((points.max(0) + margin) * n).astype(int) + 3, 0, n)
    (x0, y0), (x1, y1) = low, high
    if x0 >= x1 or y0 >= y1:
        return image
    mask = np.zeros((y1 - y0, x1 - x0), np.uint8)
    draw(mask, np.round((points * n - low) * 16).astype(np.int32))
    image[y0:y1, x0:x1] = mix(image[y0:y1, x0:x1], rgb(color), mask.astype(np.float32) / 255 * alpha)
    return image


def _rectangle(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def _blob(
    at: np.ndarray | tuple[float, float], radius: float, wobble: float, *, rng: np.random.Generator
) -> np.ndarray:
    a = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    r = np.ones_like(a)
    for k in range(1, 5):
        r += wobble / k * np.sin(k * a + rng.uniform(0, 6.28)) * rng.uniform(0.4, 1)
    return np.asarray(at) + radius * np.stack([r * np.cos(a), r * np.sin(a) * rng.uniform(0.7, 1.2)], 1)


def shapes(on: Canvas, ground: Color, colors: Colors) -> Maps:
    """Cut-paper shapes and a few lines, as in prints of the 1950s."""
    rng = on.rng
    image = _canvas(on, ground)
    spots = rng.permutation([(0.35, 0.35), (0.65, 0.3), (0.5, 0.62), (0.3, 0.72), (0.72, 0.7)])
    for k, at in enumerate(spots):
        shade = rgb(colors[k % len(colors)])
        image = _fill(image, _blob(at, rng.uniform(0.10, 0.2), 0.25, rng=rng), shade, 0.94)
    for _ in range(3):
        t = np.linspace(0, 1, 40)
        start, swing = rng.uniform(0.2, 0.8, 2), rng.uniform(-0.3, 0.3, (3, 2))
        bends = (t, np.sin(np.pi * t), np.sin(2 * np.pi * t))
        line = start + sum(s * bend[:, None] for s, bend in zip(swing, bends))
        image = _stroke(image, line, 0.006, (0.12, 0.12, 0.13))
    return maps_of(image * (1 + 0.02 * on.fbm(8, 120, 1.0))[..., None], 0.85)


def fields(on: Canvas, colors: Colors) -> Maps:
    """Soft-edged fields of colour, one above the other."""
    n = on.n
    y, x = np.mgrid[0:n, 0:n] / n
    warp = 0.012 * on.fbm(3, 60, 1.4)
    image = on.rgb(colors[0])
    edges = np.cumsum([0.08, *on.rng.uniform(0.2, 0.34, len(colors) - 1)])
    edges = edges / edges[-1] * 0.93
    for k, c in enumerate(colors[1:]):
        top, bottom = edges[k] + 0.015, edges[k + 1] - 0.015
        inside = smooth_step(np.minimum(y + warp - top, bottom - y - warp), -0.012, 0.02)
        inside *= smooth_step(np.minimum(x + warp - 0.08, 0.92 - x - warp), -0.012, 0.02)
        image = mix(image, rgb(c) * (1 + 0.05 * on.fbm(2, 90, 1.2))[..., None], inside * 0.93)
    return maps_of(image, 0.8)


def hills(on: Canvas, sky: Colors, far: Color, near: Color, layers: int = 6, sun: bool = True) -> Maps:
    """Ridges behind ridges in haze under a graded sky."""
    n, rng = on.n, on.rng
    y, x = on.shares()
    image = mix(on.rgb(sky[0]), rgb(sky[1]), smooth_step(y, 0.0, 0.65))
    image *= (1 + 0.03 * on.fbm(1.5, 30, 1.5, 4.0) * (1 - y))[..., None]
    if sun:
        d = np.hypot(x - rng.uniform(0.25, 0.75), (y - rng.uniform(0.28, 0.42)))
        image = mix(image, rgb((1.0, 0.96, 0.85)), 0.9 * (1 - smooth_step(d, 0.035, 0.042)) + 0.35 * np.exp(-d * 7))
    for k in range(layers):
        base = 0.48 + 0.5 * (k / layers) ** 1.2
        ridge = np.zeros(n)
        t = np.arange(n) / n
        for f in range(1, 40):
            ridge += rng.normal() * f**-1.45 * np.sin(2 * np.pi * (f * t * (1 + 0.3 * k) / 2 + rng.random()))
        ridge = base - 0.085 * ridge / (1 + 0.3 * k)
        inside = smooth_step(y - ridge[None].astype(np.float32), -0.001, 0.002)
        c = rgb(far) + (rgb(near) - rgb(far)) * (k / max(layers - 1, 1)) ** 1.1
        haze = np.clip((y - ridge[None]) * 2.2, 0, 1)
        shade = mix(on.rgb(c), np.minimum(rgb(c) * 0.75 + rgb(sky[1]) * 0.25, 1.0), haze.astype(np.float32))
        image = mix(image, shade * (1 + 0.03 * on.noise(1.5, 1.5))[..., None], inside)
    return maps_of(image, 0.5)


def sea(on: Canvas, sky: Colors, water: Colors) -> Maps:
    """A level horizon, clouds and glittering water."""
    y, x = on.shares()
    clouds = smooth_step(on.fbm(1.5, 60, 1.6, 2.5), 0.2, 2.0)
    up = mix(mix(on.rgb(sky[0]), rgb(sky[1]), smooth_step(y, 0, 0.55)), rgb((0.97, 0.95, 0.92)), 0.6 * clouds)
    depth = np.clip((y - 0.55) / 0.45, 1e-3, 1)
    waves = on.noise(14, 1.2) * np.clip(depth * 2, 0.2, 1)
    path = np.exp(-(((x - 0.55) / (0.05 + 0.25 * depth)) ** 2))
    down = mix(on.rgb(water[0]), rgb(water[1]), depth) * (1 + 0.08 * waves)[..., None]
    down = mix(down, rgb((0.98, 0.93, 0.83)), 0.5 * path * smooth_step(waves, 0.4, 1.6))
    return maps_of(np.where((y < 0.55)[..., None], up, down), 0.45)


def botanical(on: Canvas, ground: Color, ink: Color, fern: bool = True) -> Maps:
    """One pressed or drawn plant on paper, with a line of writing below."""
    rng = on.rng
    image = _canvas(on, ground)
    t = np.linspace(0, 1, 50)
    stem = np.stack([0.5 + rng.uniform(-0.10, 0.10) * np.sin(np.pi * t * 0.8), 0.86 - 0.70 * t], 1)
    image = _stroke(image, stem, 0.005, ink)
    pairs = 15 if fern else 7
    for k in range(pairs):
        f = (k + 0.6) / pairs
        at = stem[min(49, int(f * 49))]
        for side in (-1, 1):
            length = (0.24 if fern else 0.22) * np.sin(np.pi * (0.22 + 0.72 * (1 - f)) ** 0.9) * rng.uniform(0.92, 1.05)
            angle = -np.pi / 2 + side * (0.95 - 0.35 * f) + rng.normal(0, 0.04)
            shade = rgb(ink) * rng.uniform(0.85, 1.25)
            d = np.array([np.cos(angle), np.sin(angle)])
            if fern:
                image = _stroke(image, at + np.linspace(0, 1, 6)[:, None] * d * length, 0.002, shade)
                for q in np.linspace(0, 1, 9)[1:]:
                    for w in (-1, 1):
                        pinna = _leaf_shape(at + d * length * q, angle + w * 1.0, 0.055 * (1.05 - q), 0.010)
                        image = _fill(image, pinna, shade, 0.9)
            else:
                image = _fill(image, _leaf_shape(at, angle, length, 0.24 * length), shade, 0.9)
                image = _stroke(image, at + np.linspace(0, 0.92, 6)[:, None] * d * length, 0.002, rgb(ground) * 0.92)
    pen = 0.40
    while pen < 0.60:
        word = rng.uniform(0.008, 0.03)
        line = np.stack([np.linspace(pen, pen + word, 8), 0.925 + rng.normal(0, 0.004, 8)], 1)
        image = _stroke(image, line, 0.0025, (0.25, 0.23, 0.2), 0.8)
        pen += word + 0.008
    return maps_of(image, 0.85)


def _leaf_shape(at: np.ndarray, angle: float, length: float, half: float) -> np.ndarray:
    t = np.linspace(0, 1, 14)
    w = half * np.sin(np.pi * t) ** 0.85
    p = np.concatenate([np.stack([t * length, w], 1), np.stack([t * length, -w], 1)[::-1]])
    c, s = np.cos(angle), np.sin(angle)
    return p @ np.array([[c, s], [-s, c]]) + at


def brushwork(on: Canvas, ground: Color, colors: Colors) -> Maps:
    """Abstract painting: loaded brush strokes over one another."""
    rng = on.rng
    image = _canvas(on, ground, grain=0.03)
    y, x = on.shares()
    for _ in range(26):
        at, angle = rng.uniform(0.05, 0.95, 2), rng.normal(0.5, 0.6)
        long, wide = rng.uniform(0.15, 0.42), rng.uniform(0.03, 0.10)
        u = (x - at[0]) * np.cos(angle) + (y - at[1]) * np.sin(angle)
        v = -(x - at[0]) * np.sin(angle) + (y - at[1]) * np.cos(angle) + 0.25 * u * u
        bristles = np.interp(v, np.linspace(-wide, wide, 60), rng.normal(0, 1, 60)).astype(np.float32)
        ragged = 0.25 * long * bristles * 0.35
        inside = smooth_step(wide - np.abs(v), 0.0, 0.008) * smooth_step(long - np.abs(u) + ragged, 0.0, 0.05)
        c = rgb(colors[rng.integers(len(colors))]) * (1 + 0.09 * bristles)[..., None]
        image = mix(image, c, inside * 0.92)
    return maps_of(image, 0.55)


def still_life(on: Canvas, ground: Color, table: Color, fruit: Colors) -> Maps:
    """A bowl of fruit against a dark wall, in soft paint."""
    rng = on.rng
    y, x = on.shares()
    lit = np.exp(-(((x - 0.35) / 0.4) ** 2) - ((y - 0.35) / 0.4) ** 2)
    image = mix(on.rgb(ground), rgb(ground) * 1.6 + 0.03, lit)
    below = smooth_step(y + 0.004 * on.fbm(3, 40, 1.4), 0.66, 0.668)
    image = mix(image, rgb(table) * (1.1 - 0.4 * x)[..., None], below)
    for k in range(7):
        cx, cy = 0.28 + 0.075 * k + rng.normal(0, 0.015), 0.56 - 0.06 * (k % 2) + rng.normal(0, 0.012)
        r = rng.uniform(0.06, 0.085)
        d = np.hypot(x - cx, y - cy) / r
        light = np.clip(0.35 + 0.75 * (1 - np.hypot(x - cx + 0.4 * r, y - cy + 0.45 * r) / (1.5 * r)), 0.15, 1.2)
        image = mix(image, rgb(fruit[k % len(fruit)]) * light[..., None], 1 - smooth_step(d, 0.95, 1.02))
    bowl = ((x - 0.5) / 0.30) ** 2 + ((y - 0.60) / 0.17) ** 2
    inside = (1 - smooth_step(bowl, 0.97, 1.03)) * smooth_step(y, 0.60, 0.606)
    image = mix(image, rgb((0.62, 0.66, 0.70)) * (1.05 - 0.9 * np.abs(x - 0.42))[..., None], inside)
    image = image * (1 + 0.03 * on.fbm(10, 200, 0.9))[..., None]
    return maps_of(image, 0.5)


def poster(on: Canvas, ground: Color, ink: Color, accent: Color) -> Maps:
    """A typographic poster: a large shape, a heading and lines of small print."""
    rng = on.rng
    image = _canvas(on, ground, grain=0.008)
    kind = int(rng.integers(3))
    a = np.linspace(0, 2 * np.pi, 100)
    if kind == 0:
        for r in np.linspace(0.30, 0.06, 5):
            ring = np.stack([0.5 + r * np.cos(a), 0.40 + r * np.sin(a)], 1)
            image = _fill(image, ring, accent if round(r * 100) % 12 < 6 else ink)
    elif kind == 1:
        for k in range(6):
            bar = _rectangle(0.2 + 0.1 * k, 0.14, 0.26 + 0.1 * k, 0.2 + 0.08 * k)
            image = _fill(image, bar, accent if k % 2 else ink)
    else:
        half = np.linspace(0, np.pi, 50)
        for k in range(4):
            arch = np.stack([0.5 + 0.28 * np.cos(half), 0.22 + 0.13 * k + 0.12 - 0.12 * np.sin(half)], 1)
            image = _fill(image, arch, accent if k % 2 else ink)
    for row, (h, w) in enumerate(((0.05, 0.62), (0.012, 0.4), (0.012, 0.46), (0.012, 0.33))):
        top = 0.78 + (0.075 if row else 0) + 0.026 * row
        x = 0.19
        while x < 0.19 + w:
            step = h * rng.uniform(0.5, 0.8)
            image = _fill(image, _rectangle(x, top, x + step, top + h), ink)
            x += step + h * (0.28 if rng.random() < 0.8 else 0.8)
    return maps_of(image, 0.75)


def oriental(on: Canvas, field: Color, border: Color, accent: Color, line: Color = (0.12, 0.10, 0.10)) -> Maps:
    """A knotted rug: medallion, mirrored field ornaments, main and guard borders."""
    rng = on.rng
    s = on.n // 4
    y, x = np.mgrid[0:s, 0:s].astype(np.float32) / s
    x, y = (x - 0.5) * 2, (y - 0.5) * 2
    ax, ay = np.abs(x), np.abs(y)
    image = rgb(field, (s, s))
    tints = [rgb(c) for c in (border, accent, line, (0.82, 0.74, 0.60))]
    for k in range(26):
        cx, cy, r = rng.uniform(0.05, 0.72), rng.uniform(0.05, 0.66), rng.uniform(0.02, 0.055)
        d = np.hypot(ax - cx, ay - cy) / r
        a = np.arctan2(ay - cy, ax - cx)
        image = mix(image, tints[k % 4], 1 - smooth_step(d * (1 + 0.35 * np.cos(rng.integers(4, 7) * a)), 0.9, 1.05))
    for r, c in ((0.42, tints[2]), (0.40, tints[0]), (0.31, tints[3]), (0.28, rgb(field) * 0.8), (0.15, tints[1])):
        star = np.hypot(ax, ay * 1.1) * (1 + 0.10 * np.cos(8 * np.arctan2(ay, ax)))
        image = mix(image, c, 1 - smooth_step(star, r - 0.008, r + 0.008))
    corner = np.hypot(ax - 0.8, ay - 0.76) * (1 + 0.10 * np.cos(8 * np.arctan2(ay - 0.76, ax - 0.8)))
    image = mix(image, tints[0], 1 - smooth_step(corner, 0.25, 0.265))
    edge = np.minimum(1 - ax, 1 - ay)
    for outer, inner, k in ((0.0, 0.24, 2), (0.012, 0.05, 1), (0.055, 0.185, 0), (0.19, 0.23, 3)):
        image = np.where(((edge > outer) & (edge < inner))[..., None], tints[k], image)
    along = np.where(1 - ax < 1 - ay, y, x)
    motif = np.cos(along * np.pi * 13) * 0.04 - np.abs(edge - 0.12)
    image = mix(image, tints[3], (motif > -0.012).astype(np.float32) * (np.abs(edge - 0.12) < 0.05))
    image = mix(image, tints[1], (np.cos(along * np.pi * 26) > 0.3).astype(np.float32) * (np.abs(edge - 0.21) < 0.012))
    return _pile(on, cv2.resize(image, (on.n, on.n), interpolation=cv2.INTER_CUBIC), 0.09)


def kilim(on: Canvas, colors: Colors) -> Maps:
    """Flat-woven bands of stepped diamonds."""
    n, rng = on.n, on.rng
    s = 160
    image = np.zeros((s, s, 3), np.float32)
    edge, k = 0, 0
    tints = [rgb(c) for c in colors]
    while edge < s:
        width = int(rng.integers(6, 30))
        a, b = tints[k % len(tints)], tints[(k + 1 + int(rng.integers(len(tints) - 1))) % len(tints)]
        rows = slice(edge, min(s, edge + width))
        v = (np.arange(s)[rows] - edge - width / 2)[None]
        period = max(8, 2 * (width // 2))
        u = np.abs((np.arange(s) % period) - period / 2)[:, None]
        stepped = (
            (np.floor(u / 2) + np.floor(np.abs(v) / 2)) * 2 < period / 2
            if width > 11
            else (np.arange(s)[:, None] // 4 % 2 == 0) & (v > -99)
        )
        image[:, rows] = np.where(stepped[..., None], b, a)
        edge, k = edge + width, k + 1
    image = cv2.resize(image, (n, n), interpolation=cv2.INTER_NEAREST)
    return _pile(on, image, 0.05)


def berber(on: Canvas, ground: Color, line: Color, diamonds: int = 3) -> Maps:
    """A shaggy light rug with a hand-drawn lattice of dark lines."""
    y, x = on.shares()
    wob = 0.006 * on.fbm(3, 40, 1.4)
    f = np.minimum(*(np.abs(((x * diamonds * 1.5 + s * y * diamonds + wob * 4) % 1) - 0.5) for s in (1, -1)))
    return _pile(on, mix(on.rgb(ground), rgb(line), 1 - smooth_step(f, 0.018, 0.032)), 0.13)


def bordered(on: Canvas, field: Color, border: Color, bands: tuple[tuple[float, float], ...] = ((0.0, 0.09),)) -> Maps:
    """Plain with one or more bands along the edge."""
    y, x = on.shares()
    edge = np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y))
    image = on.rgb(field)
    for a, b in bands:
        image = mix(image, rgb(border), ((edge >= a) & (edge < b)).astype(np.float32))
    return _pile(on, image, 0.09)


def modern(on: Canvas, colors: Colors) -> Maps:
    """Large overlapping arcs and fields in a few muted colours."""
    rng = on.rng
    image = on.rgb(colors[0])
    for k in range(6):
        blob = _blob(rng.uniform(0, 1, 2), rng.uniform(0.18, 0.4), 0.2, rng=rng)
        image = _fill(image, blob, colors[1 + k % (len(colors) - 1)])
    return _pile(on, image, 0.09)


def striped(on: Canvas, colors: Colors, count: int = 14) -> Maps:
    """Cross stripes of several widths."""
    n = on.n
    widths = on.rng.uniform(0.4, 1.6, count)
    band = np.searchsorted((np.cumsum(widths) / widths.sum()), (np.arange(n) + 0.5) / n)
    return _pile(on, np.broadcast_to(rgb(colors)[band % len(colors)][None], (n, n, 3)).copy(), 0.06)


def rings(on: Canvas, colors: Colors, count: int = 9) -> Maps:
    """Concentric rings for a round braided rug."""
    y, x = on.shares() - 0.5
    r = np.hypot(x, y) * 2 * count
    image = rgb(colors)[np.clip(r.astype(int), 0, 99) % len(colors)]
    braid = 0.5 + 0.5 * np.cos(2 * np.pi * (r % 1 - 0.5)) * np.cos(np.arctan2(y, x) * 90 + (r.astype(int) % 2) * np.pi)
    return _pile(on, image * (0.9 + 0.15 * braid)[..., None], 0.05)


def _pile(on: Canvas, image: np.ndarray, depth: float) -> Maps:
    tuft, fine, wear = on.noise(2.2, 1.4), on.noise(0.8, 0.8), on.fbm(2, 30, 1.2)
    out = image * (1 + depth * (0.5 * tuft + 0.5 * fine) + 0.02 * wear)[..., None]
    return maps_of(out, 0.96, 0.01, 0.97)


def dial(on: Canvas, face: Color, ink: Color, numerals: bool = True, hour: float = 10.15) -> Maps:
    """A clock face with hands."""
    n = on.n
    image = on.rgb(face)
    font, scale, thick = cv2.FONT_HERSHEY_SIMPLEX, n / 500, max(1, n // 170)
    for k in range(60):
        a = k * np.pi / 30
        d = np.array([np.sin(a), -np.cos(a)])
        big = k % 5 == 0
        tick = 0.5 + np.array([0.44, 0.385 if big else 0.42])[:, None] * d
        image = _stroke(image, tick, 0.010 if big else 0.004, ink)
        if big and numerals:
            text = str(k // 5 or 12)
            (w, h), _ = cv2.getTextSize(text, font, scale, thick)
            p = 0.5 + 0.32 * d
            mask = np.zeros((n, n), np.uint8)
            at = round(p[0] * n - w / 2), round(p[1] * n + h / 2)
            cv2.putText(mask, text, at, font, scale, 255, thick, cv2.LINE_AA)
            image = mix(image, rgb(ink), mask.astype(np.float32) / 255)
    for turn, long, wide in ((hour / 12, 0.22, 0.022), (hour % 1, 0.34, 0.014)):
        a = 2 * np.pi * turn
        d = np.array([np.sin(a), -np.cos(a)])
        image = _stroke(image, 0.5 + np.array([-0.05, long])[:, None] * d, wide, ink)
    return maps_of(image, 0.4)


def cover(on: Canvas, ground: Color, ink: Color, picture: Color) -> Maps:
    """A magazine cover: a title, a photograph of sorts, teasers."""
    n, rng = on.n, on.rng
    down = np.linspace(0, 1, n, dtype=np.float32)[:, None] * np.ones((n, n), np.float32)
    sky = mix(on.rgb(picture), rgb(picture) * 0.45, down)
    image = sky * (1 + 0.10 * on.fbm(1.5, 60, 1.5))[..., None]
    image = _fill(image, _blob((0.5, 0.62), 0.26, 0.15, rng=rng), ground, 0.85)
    for x, w in ((0.08, 0.13), (0.23, 0.11), (0.36, 0.14), (0.52, 0.10), (0.64, 0.12), (0.78, 0.13)):
        image = _fill(image, _rectangle(x, 0.06, x + w, 0.19), ink)
        image = _fill(image, _rectangle(x + 0.03, 0.10, x + w - 0.03, 0.15), picture)
    for k in range(5):
        high, low = 0.72 + 0.04 * k, 0.735 + 0.04 * k
        teaser = [(0.08, high), (0.08 + rng.uniform(0.15, 0.3), high), (0.08 + 0.2, low), (0.08, low)]
        image = _fill(image, np.array(teaser), ink)
    return maps_of(image, 0.3)

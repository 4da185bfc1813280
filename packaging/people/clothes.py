"""Clothes over a body: MakeHuman's helper meshes, made loose, pushed off what they cover and cut along bones."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from body import layer
from mesh import Layer, clipped, hemmed, noise, pushed, smoothed, subdivided
from scipy.spatial import cKDTree

from embodied.assets.people.pose import JOINTS

ORDER = list(JOINTS)
TIGHTS_UV, SKIRT_UV = 20.6, 23.2
"""Metres to a unit of the helpers' uv, of a grown-up."""


@dataclass(frozen=True, eq=False)
class Wearer:
    """A body that gets dressed."""

    place: np.ndarray
    joints: Mapping[str, np.ndarray]
    height: float
    rng: np.random.Generator

    @property
    def scale(self) -> float:
        return self.height / 1.75

    @property
    def height_of_head(self) -> float:
        """Against that of a grown-up."""
        return float(np.linalg.norm(self.joints["left_eye"] - self.joints["right_eye"])) / 0.062


Field = Callable[[Layer], np.ndarray]
"""(n,) metres inside the edge of a garment, at vertices of any layer."""


def share(x: Layer, *names: str) -> np.ndarray:
    """(n,) the weight of joints of both sides."""
    return x.weights[:, [k for k, j in enumerate(ORDER) if j.partition("_")[2] in names or j in names]].sum(1)


def along(w: Wearer, x: Layer, first: str, second: str, third: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How far along a limb (0, 1 and 2 at its joints), off its bones (n, 3), and its length, metres."""
    sides = np.where(x.place[:, 0] > 0, 0, 1)
    a, b, c = (np.array([w.joints[f"{s}_{j}"] for s in ("left", "right")])[sides] for j in (first, second, third))
    part = lambda p, q: np.einsum("ni,ni->n", x.place - p, q - p) / np.einsum("ni,ni->n", q - p, q - p)
    s, t = np.clip(part(a, b), 0, 1), np.clip(part(b, c), 0, 1.2)
    foot = np.where((s < 1)[:, None], a + s[:, None] * (b - a), b + t[:, None] * (c - b))
    return s + np.where(s < 1, 0, t), x.place - foot, np.linalg.norm(b - a, axis=1)


ARM, LEG = ("upper_arm", "forearm", "hand"), ("thigh", "shin", "foot")


def arm_share(x: Layer) -> np.ndarray:
    return share(x, "upper_arm", "forearm", "hand", "fingers", "fingertips")


def sleeve(w: Wearer, end: float) -> Field:
    """Up to so far along the arm: 1 is the elbow, 2 the wrist."""

    def field(x: Layer) -> np.ndarray:
        s, _, length = along(w, x, *ARM)
        mask = np.clip(2.5 * arm_share(x) - 0.5, 0, 1)
        return (end - s * mask) * length

    return field


def leg(w: Wearer, end: float) -> Field:
    """Up to so far along the leg: 1 is the knee, 2 the ankle."""

    def field(x: Layer) -> np.ndarray:
        s, _, length = along(w, x, *LEG)
        return np.where(
            arm_share(x) > 0.5, -1.0, (end - s * np.clip(2 * share(x, "thigh", "shin", "foot", "toes"), 0, 1)) * length
        )

    return field


def below(z: float) -> Field:
    """Below a height of the trunk; no arms."""
    return lambda x: np.where(arm_share(x) > 0.4, -1.0, z - x.place[:, 2])


def above(z: float) -> Field:
    """Above a height of the trunk, and arms."""
    return lambda x: np.where(arm_share(x) > 0.6, 1.0, x.place[:, 2] - z)


def neckline(w: Wearer, high: float, depth: float = 0.0, slope: float = 1.6) -> Field:
    """Below a ring around the neck, `high` metres above its joint; with a V so deep in front."""
    x0, y0, z0 = w.joints["neck"]

    def field(x: Layer) -> np.ndarray:
        p = x.place
        ring = (z0 + high * (1.35 - 0.35 * w.scale) + 0.75 * (p[:, 1] - y0)) - p[:, 2]
        vee = z0 - depth + slope * np.abs(p[:, 0] - x0) - p[:, 2]
        return np.minimum(ring, np.where(p[:, 1] < y0 + 0.01, vee, 1.0)) if depth else ring

    return field


def open_front(w: Wearer, gap: float, flare: float = 0.0) -> Field:
    """Without a strip in front, `gap` metres wide at the neck."""

    def field(x: Layer) -> np.ndarray:
        p = x.place
        half = gap / 2 + flare * np.maximum(w.joints["neck"][2] - p[:, 2], 0)
        behind = p[:, 1] - w.joints["chest"][1] + 0.02
        return np.where(arm_share(x) < 0.5, np.maximum(np.abs(p[:, 0]) - half, behind), 1.0)

    return field


def meet(*fields: Field) -> Field:
    return lambda x: np.minimum.reduce([f(x) for f in fields])


def rounded(one: Field, other: Field, radius: float = 0.06) -> Field:
    """Inside both, their corner rounded off."""

    def field(x: Layer) -> np.ndarray:
        a, b = one(x), other(x)
        near = np.clip(radius - np.stack([a, b]), 0, None)
        return np.where(near.min(0) > 0, radius - np.hypot(*near), np.minimum(a, b))

    return field


Shell = tuple[np.ndarray, np.ndarray]
"""Places and normals of what is worn so far."""


def _loose(
    w: Wearer, x: Layer, joints: tuple[str, str, str], mask: np.ndarray, radii: list[tuple[float, float]]
) -> Layer:
    """A limb's cloth at least so wide (radius by place along it)."""
    s, off, _ = along(w, x, *joints)
    far = np.linalg.norm(off, axis=1)
    wish = np.interp(s, *zip(*radii)) * w.scale
    grow = np.where((s > 0.05) & (far > 1e-6), np.maximum(wish / np.maximum(far, 1e-6), 1), 1)
    grow = 1 + (grow - 1) * np.clip(3 * mask - 1.5, 0, 1)
    return x.moved(x.place + off * (grow - 1)[:, None])


def tights(w: Wearer) -> Layer:
    x = subdivided(layer("helper-tights", w.place))
    x.data[:, 6:8] *= TIGHTS_UV * w.scale
    return x


def garment(
    w: Wearer,
    base: Layer,
    edge: Field,
    shell: Shell,
    *,
    gap: float,
    soft: int = 12,
    legs: list[tuple[float, float]] | None = None,
    arms: list[tuple[float, float]] | None = None,
    folds: float = 0.002,
    cloth: float = 0.004,
    ease: float = 0.0,
) -> Layer:
    """Cloth on a body.

    Args:
      edge: where it ends.
      shell: what is below it, `gap` metres off.
      soft: how much of the body's relief it bridges.
      legs, arms: least radius by place along the limb, metres.
      folds: their height, metres.
      ease: how far it hangs off where it hangs free, metres.
    """
    x = clipped(base, edge(base) + 0.05 * w.scale)
    x = pushed(x, shell, gap)
    x = smoothed(x, soft)
    if legs:
        x = _loose(w, x, LEG, share(x, "thigh", "shin", "foot"), legs)
    if arms:
        x = _loose(w, x, ARM, arm_share(x), arms)
    x = smoothed(x, 3)
    stretch = x.place * [1, 1, 2.2]
    wave = noise(stretch, 0.13 * w.scale, w.rng) + 0.6 * noise(stretch, 0.06 * w.scale, w.rng)
    calm = np.clip(edge(x) / 0.05, 0.15, 1)
    x = x.moved(x.place + x.normals() * (folds * calm * wave + ease)[:, None])
    x = pushed(smoothed(pushed(x, shell, gap), 4), shell, 0.5 * gap)
    x = clipped(smoothed(x, 1, 0.3), edge(x))
    return hemmed(x, cloth)


def grown(shell: Shell, x: Layer) -> Shell:
    """The shell with what is worn over it, but for the insides of hems."""
    normals = x.normals()
    near = cKDTree(shell[0]).query(x.place)[1]
    outside = np.einsum("ni,ni->n", normals, shell[1][near]) > 0.4
    return np.vstack([shell[0], x.place[outside]]), np.vstack([shell[1], normals[outside]])


@dataclass(frozen=True)
class Worn:
    """A garment on somebody."""

    name: str
    layer: Layer
    look: Mapping[str, object]


def dress(w: Wearer, clothes: Mapping[str, Mapping[str, object]]) -> tuple[list[Worn], list[Field]]:
    """All clothes, the innermost first, and the fields inside which the skin is hidden."""
    body = layer("body", w.place)
    shell: Shell = (body.place, body.normals())
    worn: list[tuple[Worn, Field | None]] = []
    for name, row in clothes.items():
        kind, looks = GARMENTS[str(row["kind"])], {k: v for k, v in row.items() if k != "kind"}
        options = {k: looks.pop(k) for k in ("length", "sleeves", "neck", "vee", "width") if k in looks}
        sole = {"color": looks.pop("sole", [0.85, 0.84, 0.8]), "roughness": 0.7}
        for suffix, x, edge in kind(w, shell, **options):
            worn.append((Worn(name + suffix, x, sole if suffix == "_sole" else dict(looks)), edge))
            shell = grown(shell, x)
    hidden = [edge for _, edge in worn if edge]
    for k, (item, _) in enumerate(worn):  # what is covered goes, or it would show in some pose
        above_it = [
            edge for other, edge in worn[k + 1 :] if edge and other.name.split("_")[0] != item.name.split("_")[0]
        ]
        if above_it:
            cut = clipped(item.layer, 0.025 * w.scale - np.maximum.reduce([f(item.layer) for f in above_it]))
            worn[k] = (dataclasses.replace(item, layer=cut), None)
    return [item for item, _ in worn], hidden


Made = list[tuple[str, Layer, Field | None]]


def _waist(w: Wearer, up: float) -> float:
    return float(w.joints["pelvis"][2] + up * w.scale)


def shirt(
    w: Wearer,
    shell: Shell,
    length: float = -0.1,
    sleeves: float = 0.62,
    neck: float = 0.0,
    vee: float = 0.0,
    width: float = 1.0,
) -> Made:
    edge = meet(above(_waist(w, length)), sleeve(w, sleeves), neckline(w, neck, vee))
    wide = [(0.25, 0.057), (0.62, 0.061), (1.0, 0.047), (1.9, 0.039)]
    x = garment(
        w, tights(w), edge, shell, gap=0.006, soft=14, arms=[(s, r * width) for s, r in wide], folds=0.0022, ease=0.003
    )
    return [("", x, edge)]


def jumper(
    w: Wearer,
    shell: Shell,
    length: float = -0.1,
    sleeves: float = 1.93,
    neck: float = 0.02,
    vee: float = 0.0,
    width: float = 1.1,
) -> Made:
    edge = meet(above(_waist(w, length)), sleeve(w, sleeves), neckline(w, neck, vee))
    wide = [(0.25, 0.059), (1.0, 0.049), (1.7, 0.042), (1.93, 0.034)]
    x = garment(
        w,
        tights(w),
        edge,
        shell,
        gap=0.009,
        soft=22,
        arms=[(s, r * width) for s, r in wide],
        folds=0.003,
        cloth=0.007,
        ease=0.005,
    )
    return [("", x, edge)]


def cardigan(
    w: Wearer,
    shell: Shell,
    length: float = -0.16,
    sleeves: float = 1.9,
    neck: float = 0.03,
    vee: float = 0.0,
    width: float = 1.15,
) -> Made:
    edge = meet(
        above(_waist(w, length)), sleeve(w, sleeves), rounded(neckline(w, neck), open_front(w, 0.09 * w.scale, 0.14))
    )
    wide = [(0.25, 0.061), (1.0, 0.052), (1.9, 0.042)]
    x = garment(
        w,
        tights(w),
        edge,
        shell,
        gap=0.01,
        soft=20,
        arms=[(s, r * width) for s, r in wide],
        folds=0.003,
        cloth=0.008,
        ease=0.006,
    )
    return [("", x, edge)]


def trousers(w: Wearer, shell: Shell, length: float = 1.93, width: float = 1.0) -> Made:
    edge = meet(below(_waist(w, 0.07)), leg(w, length))
    wide = [(0.3, 0.09), (1.0, 0.076 * width), (1.5, 0.071 * width), (2.0, 0.071 * width)]
    x = garment(w, tights(w), edge, shell, gap=0.005, soft=10, legs=wide, folds=0.0024)
    return [("", x, edge)]


def skirt(w: Wearer, shell: Shell, length: float = 1.0, width: float = 1.0) -> Made:
    """To so far down the leg: 1 is the knee."""
    x = subdivided(layer("helper-skirt", w.place))
    x.data[:, 6:8] *= SKIRT_UV * w.scale
    hip, knee, ankle = (w.joints[f"left_{j}"][2] for j in ("thigh", "shin", "foot"))
    hem = float(np.interp(length, [0, 1, 2], [hip, knee, ankle]))
    edge: Field = lambda y: y.place[:, 2] - hem
    down = np.clip((_waist(w, 0.0) - x.place[:, 2]) / 0.6, 0, 1)
    angle = np.arctan2(x.place[:, 0], -x.place[:, 1])
    pleats = 0.012 * w.scale * width * down * np.cos(11 * angle + 2 * noise(x.place, 0.5, w.rng))
    x = pushed(smoothed(x, 4), shell, 0.006)
    out = x.normals() * [1, 1, 0]
    x = clipped(x.moved(x.place + out * pleats[:, None]), edge(x))
    hide: Field = lambda y: np.where(
        arm_share(y) > 0.3, -1.0, np.minimum(y.place[:, 2] - hem - 0.02, _waist(w, 0.06) - y.place[:, 2])
    )
    return [("", hemmed(x, 0.004), hide)]


def dress_(
    w: Wearer,
    shell: Shell,
    length: float = 1.05,
    sleeves: float = 0.5,
    neck: float = -0.01,
    vee: float = 0.0,
    width: float = 1.0,
) -> Made:
    below_it = skirt(w, shell, length, width)
    top = shirt(w, grown(shell, below_it[0][1]), length=0.05, sleeves=sleeves, neck=neck, vee=vee, width=width)
    return [("_skirt", *below_it[0][1:]), ("", *top[0][1:])]


def apron(w: Wearer, shell: Shell, length: float = 0.75, width: float = 1.0) -> Made:
    """A bib and a front; no straps."""
    made: Made = []
    hip, knee = (w.joints[f"left_{j}"][2] for j in ("thigh", "shin"))
    hem, top = hip + length * (knee - hip), w.joints["chest"][2] + 0.09 * w.scale
    front = lambda half: lambda y: np.minimum(half * w.scale - np.abs(y.place[:, 0]), -y.place[:, 1])
    x = subdivided(layer("helper-skirt", w.place))
    x.data[:, 6:8] *= SKIRT_UV * w.scale
    edge = meet(lambda y: y.place[:, 2] - hem, front(0.15 * width))
    x = clipped(pushed(smoothed(x, 6), shell, 0.008), edge(x))
    made.append(("", hemmed(x, 0.003), None))
    bib = meet(above(_waist(w, 0.04)), below(top), front(0.125 * width))
    made.append(("_bib", garment(w, tights(w), bib, grown(shell, x), gap=0.006, soft=20, folds=0.001), None))
    return made


def socks(w: Wearer, shell: Shell, length: float = 1.8) -> Made:
    edge = lambda y: np.minimum(-leg(w, length)(y), share(y, "shin", "foot", "toes") - 0.5)
    x = garment(w, tights(w), edge, shell, gap=0.003, soft=6, folds=0.0006, cloth=0.003)
    return [("", x, edge)]


SOLE = 0.024
"""How high a shoe lifts a body, metres."""


def shoes(w: Wearer, shell: Shell, length: float = 1.97) -> Made:
    """Shoes from the feet; up to so far along the leg from below."""
    edge = lambda y: np.minimum(-leg(w, length)(y), share(y, "shin", "foot", "toes") - 0.5)
    x = tights(w)
    x = smoothed(pushed(clipped(x, edge(x) + 0.03), shell, 0.002), 30)
    x = hemmed(clipped(x.moved(x.place + 0.008 * x.normals()), edge(x)), 0.005)
    foot = x.place.copy()
    low = foot[:, 2] < 0.03 * w.scale
    drop = np.clip(1 - foot[:, 2] / (0.03 * w.scale), 0, 1)
    out = x.normals() * [1, 1, 0]
    foot += out * (0.004 * (drop > 0))[:, None]
    foot[low, 2] = np.minimum(foot[low, 2], -SOLE + (foot[low, 2] + 0.008) * 0.6)
    foot[:, 2] = np.maximum(foot[:, 2], -SOLE)
    x = x.moved(foot)
    split = foot[:, 2] + 0.001
    return [("", clipped(x, split), edge), ("_sole", clipped(x, -split), None)]


GARMENTS = {
    "shirt": shirt, "jumper": jumper, "cardigan": cardigan, "trousers": trousers, "skirt": skirt, "dress": dress_, "apron": apron, "socks": socks, "shoes": shoes,
}  # fmt: skip

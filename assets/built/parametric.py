"""Assets that code builds to measure; finishes, cabinet work and other things that builders share."""

import dataclasses
import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from embodied.assets.built.primitives import Shape, border, box, fitted, frame, joined, lathe, part, tube
from embodied.assets.json_file import from_plain, read_toml
from embodied.assets.records import Asset, Color, Finish, MeshPart, Size, SupportSurface

FinishOf = Callable[[str], Finish]
ParamValues = Mapping[str, str | float]
"""Details of a thing beside its size: the row's `look`, over which a placement lays its own params."""
FinishedShapes = tuple[Finish | str, list[Shape] | Shape]
"""A finish, or the name of a plain one, and what has it."""


@dataclass(frozen=True)
class _BuiltFinishes:
    """The content of finishes.toml."""

    finishes: Mapping[str, Finish]
    tints: Mapping[str, Color]
    lights: Mapping[str, Color]
    cloths: tuple[Color, ...]
    """Of covers of books."""


_READ = from_plain(_BuiltFinishes, read_toml(Path(__file__).with_name("finishes.toml")))
PLAIN, TINTS, LIGHTS, CLOTHS = _READ.finishes, _READ.tints, _READ.lights, _READ.cloths


@dataclass(frozen=True, eq=False)
class BuildRequest:
    """The size, material and details that one thing should have."""

    size: Size
    params: ParamValues
    finish: FinishOf
    rng: np.random.Generator

    def word(self, name: str, default: str) -> str:
        """The word that the params have under a name."""
        return str(self.params.get(name, default))

    def metal(self, default: str = "steel") -> Finish:
        """The metal that params['metal'] names: a plain finish or a material key."""
        return self.named(self.word("metal", default))

    def named(self, name: str) -> Finish:
        """A plain finish or a material by its name."""
        return PLAIN[name] if name in PLAIN else self.finish(name)

    def material(self, name: str, default: str) -> Finish:
        """The finish of the material key in params[name]."""
        return self.finish(self.word(name, default))


Build = Callable[[BuildRequest], list[MeshPart]]
"""Parts in the asset's frame, base at z = 0, front along -y."""


@dataclass(frozen=True, eq=False)
class ParametricAsset:
    """An asset that code builds to measure."""

    asset: Asset
    """As it is with its own size and params."""
    make: Callable[[tuple[float, float, float], tuple[tuple[str, str | float], ...], FinishOf], tuple[MeshPart, ...]]
    """make(size, params, finish): parts whose bounding box is exactly `size`."""
    params: ParamValues
    """The parameters it takes, with the values they have where nobody names others."""


def built_parts(
    key: str, build: Build, usual: ParamValues, size: Size, params: Sequence[tuple[str, str | float]], finish: FinishOf
) -> tuple[MeshPart, ...]:
    """The thing `key` at `size`, `params` laid over its `usual` ones; details depend on the key and the param `seed`.

    Raises:
      ValueError: a length that is not positive.
    """
    if min(size) <= 0:
        raise ValueError(f"{key} cannot be made {size} m large; all three lengths must be positive")
    values = {**usual, **dict(params)}
    text = f"{key}|{values.get('seed', 0)}"
    words = np.frombuffer(hashlib.sha256(text.encode()).digest(), dtype="<u4")
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence(words.tolist())))
    x, y, z = size
    return fitted(build(BuildRequest((float(x), float(y), float(z)), values, finish, rng)), size)


def plain(
    color: Color, roughness: float = 0.5, metallic: float = 0.0, emission: Color | None = None, specular: float = 0.5
) -> Finish:
    """A finish of one colour (sRGB)."""
    return Finish(color=(*color, 1.0), roughness=roughness, metallic=metallic, emission=emission, specular=specular)


def tinted(finish: Finish, emission: Color) -> Finish:
    """The same finish, glowing."""
    return dataclasses.replace(finish, emission=emission)


def whole_image(
    shape: Shape, finish: Finish, x0: float, x1: float, z0: float, z1: float, axes: str = "xz", keep_aspect: bool = True
) -> Shape:
    """uv such that one copy of the finish's picture lies over x0..x1, z0..z1 (cropped to its shape)."""
    tile = finish.tile or 1.0
    w, h = x1 - x0, z1 - z0
    fill = (1.0, 1.0) if not keep_aspect else (min(1.0, w / h), min(1.0, h / w))
    i, j = "xyz".index(axes[0]), "xyz".index(axes[1])
    u = 0.5 + ((shape.vertices[:, i] - x0) / w - 0.5) * fill[0]
    v = 0.5 + ((shape.vertices[:, j] - z0) / h - 0.5) * fill[1]
    return Shape(shape.vertices, shape.faces, shape.normals, np.stack([u, v], 1) * tile)


def surface(
    name: str,
    z: float,
    width: float,
    depth: float,
    headroom: float = 9.0,
    margin: float = 0.02,
    x: float = 0.0,
    y: float = 0.0,
) -> SupportSurface:
    """A support surface centred at (x, y), `margin` inside the given width and depth."""
    w, d = width / 2 - margin, depth / 2 - margin
    return SupportSurface(name, z, x - w, y - d, x + w, y + d, headroom)


def front(x0: float, x1: float, z0: float, z1: float, y: float, style: str = "flat", thick: float = 0.02) -> Shape:
    """A door or drawer front whose face is at y: 'flat' or 'shaker' (frame and sunk panel)."""
    g = 0.002
    x0, x1, z0, z1 = x0 + g, x1 - g, z0 + g, z1 - g
    rail = min(0.06, (x1 - x0) * 0.28, (z1 - z0) * 0.3)
    if style != "shaker" or z1 - z0 < 0.13:
        return box([x0, y, z0], [x1, y + thick, z1], 0.0018)
    panel = box([x0 + rail - 0.002, y + 0.009, z0 + rail - 0.002], [x1 - rail + 0.002, y + 0.0118, z1 - rail + 0.002])
    rails = frame(x0, x1, z0, z1, (y, y + 0.0105), rail, 0.0015)  # whole ones are dark where they are in the panel
    return joined(*rails, *frame(x0, x1, z0, z1, (y + 0.0105, y + thick), rail), panel)


def joints(fronts: Sequence[Shape]) -> tuple[str, list[Shape]]:
    """The dark of the joints around doors and drawers with its finish: a narrow frame a little behind each."""
    frames = []
    for shape in fronts:
        (x0, y, z0), (x1, _, z1) = shape.vertices.min(0), shape.vertices.max(0)
        frames.append(border(x0, x1, z0, z1, (-0.002, y + 0.003), (0.0018, y + 0.003)))
    return "gap", frames


def handle(x: float, z: float, y: float, style: str = "bar", upright: bool = False, length: float = 0.14) -> Shape:
    """A handle on a front at y: 'bar', 'knob' or 'cup'; cups belong on drawers, the doors beside them have knobs."""
    if style == "knob" or (style == "cup" and upright):
        knob = [(0, 0), (0.006, 0), (0.0055, 0.012), (0.014, 0.018), (0.015, 0.024), (0.011, 0.029), (0, 0.03)]
        return lathe(knob, 12).hung(x, y, z)
    if style == "cup":
        t = np.linspace(0, np.pi, 9)
        half = np.stack([np.cos(t) * 0.045, 0 * t, np.sin(t) * 0.02], 1)
        return tube(half + [0, -0.012, -0.008], 0.007, 6).moved(x, y, z)
    h = length / 2
    along, out = np.array([0, 0, 1.0] if upright else [1.0, 0, 0]), np.array([0, -0.028, 0])
    low, high = -h * along, h * along
    ends = [tube(np.array(p) + [x, y, z], 0.0042, 6) for p in ([low, low + out], [high + out, high])]
    grip = tube(np.array([low + out - 0.014 * along, high + out + 0.014 * along]) + [x, y, z], 0.0055, 8)
    return joined(*ends, grip)


def carcass(low: tuple[float, float, float], high: tuple[float, float, float], top: bool = True) -> Shape:
    """Open-fronted box from corner to corner: two sides, bottom, back, and unless told otherwise a top."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    board = 0.018
    shapes = [
        box([x0, y0, z0], [x0 + board, y1, z1], 0.001),
        box([x1 - board, y0, z0], [x1, y1, z1], 0.001),
        box([x0 + board, y0, z0], [x1 - board, y1, z0 + board], 0.001),
    ]
    if top:
        shapes.append(box([x0 + board, y0, z1 - board], [x1 - board, y1, z1], 0.001))
    shapes.append(box([x0 + board, y1 - 0.006, z0 + board], [x1 - board, y1, z1 - board]))
    return joined(*shapes)


def parts_of(*pairs: FinishedShapes) -> list[MeshPart]:
    """One MeshPart per (finish or the name of a plain one, shapes), leaving out empty ones."""
    made = []
    for f, shapes in pairs:
        shapes = [shapes] if isinstance(shapes, Shape) else list(shapes)
        if shapes:
            made.append(part(PLAIN[f] if isinstance(f, str) else f, *shapes))
    return made

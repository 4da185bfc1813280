"""Looks of imported models: materials as a physically based renderer needs them, guessed from names and numbers; and
covers, what untextured cloth, leather and wood wears: threads, folds, grain, in the part's own colour.

A cover is a tile of factors with mean 1 that a part's colour is multiplied by, laid on by projection along the axes
of the model: along the longest side of each board for wood, upright for cloth.
"""

import dataclasses
import functools
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from embodied.assets.importing.meshing import face_normals
from embodied.assets.importing.obj import MtlMaterial
from embodied.assets.json_file import read_toml
from embodied.assets.materials.maps import Canvas, blurred
from embodied.assets.materials.textile import folds, leather
from embodied.assets.materials.wood import furniture
from embodied.assets.records import Finish

MIRROR = re.compile(r"mirror|espejo|miroir|spiegel|reflejo", re.IGNORECASE)
METAL_NAMES = re.compile(
    r"metal|chrom|steel|inox|alumin|\balu\b|brass|bronze|copper|gold|silver|iron|nickel|acero|laton|hierro|"
    r"cromo|zinc|platin",
    re.IGNORECASE,
)
CLOTH = re.compile(
    r"cloth|fabric|tissu|tela|textil|cushion|pillow|almohad|coj[ií]n|sheet|sabana|blanket|towel|toalla|carpet|"
    r"wool|cotton|mattress|colch|coussin|drap|matelas|rug|felt|velvet|shirt|pants|jean|hair|skin|curtain",
    re.IGNORECASE,
)
GLASS_NAMES = re.compile(r"glass|vidrio|cristal|verre|glas\b|crystal", re.IGNORECASE)
SHINY = re.compile(r"ceramic|porcelain|enamel|lacquer|varnish|gloss|plastic|acryl|leather|cuero|cuir", re.IGNORECASE)
WHITEST = 0.92
"""Largest sRGB value kept: white paint reflects about 0.83 of the light, never all of it."""


def finish_of(material: MtlMaterial, has_texture: bool) -> Finish:
    """The Finish of an MTL material, its texture apart.

    Roughness follows Blinn-Phong's exponent n by alpha = sqrt(2 / (n + 2)) (Walter et al. 2007,
    section 5.2: Phong lobes match a Beckmann lobe of that width), faded to matt where Ks is dark;
    exporters' default of Ns 96, Ks 0.5 thereby comes out as satin.
    """
    name = material.name
    color = np.minimum(np.array(material.diffuse), WHITEST)
    strength = float(max(material.specular)) if material.illum >= 2 else 0.0
    lobe = float(np.sqrt(np.sqrt(2.0 / (max(material.shininess, 0.0) + 2.0))))
    roughness = float(np.clip(0.88 + min(1.0, strength) * (lobe - 0.88), 0.12, 0.95))
    specular, metallic, alpha = 0.5, 0.0, material.opacity
    if MIRROR.search(name) and not has_texture:
        return Finish((0.9, 0.9, 0.9, 1.0), roughness=0.03, metallic=1.0, mirror=True)
    if CLOTH.search(name):
        roughness, specular = max(roughness, 0.9), 0.1
    elif METAL_NAMES.search(name) and not has_texture:
        if color.max() > 0.3:
            metallic, roughness = 1.0, min(max(roughness, 0.2), 0.4)
            color = np.maximum(color, 0.45 * color / color.max())
        else:
            roughness = min(roughness, 0.45)
    elif alpha < 0.95 and not has_texture:
        roughness, alpha = min(roughness, 0.08), max(alpha, 0.12)
        if GLASS_NAMES.search(name):
            alpha = min(alpha, 0.35)
    elif SHINY.search(name):
        roughness = min(roughness, 0.4)
    roughness = roughness if material.roughness is None else material.roughness
    metallic = metallic if material.metallic is None else material.metallic
    red, green, blue = (round(float(c), 4) for c in color)
    return Finish(
        (red, green, blue, round(max(alpha, 0.1), 3)),
        roughness=round(roughness, 3),
        metallic=metallic,
        specular=specular,
    )


LOOK_WORDS: dict[str, dict[str, Any]] = {
    word: {name: tuple(value) if name == "color" else value for name, value in row.items()}
    for word, row in read_toml(Path(__file__).with_name("looks.toml")).items()
}
"""Words by which a reviewer corrects a material in catalogue.json."""


def corrected(finish: Finish, look: str) -> tuple[Finish, bool]:
    """`finish` after a reviewer's words, and whether its texture stays.

    Args:
      look: words of LOOK_WORDS, '#rrggbb' (sRGB; drops the texture), 'alpha=0.3', in any order.

    Raises:
      ValueError: an unknown word.
    """
    keep = True
    for word in look.split():
        if word in LOOK_WORDS:
            change = LOOK_WORDS[word]
            keep = keep and "color" not in change
        elif re.fullmatch(r"#[0-9a-fA-F]{6}", word):
            rgb = [int(word[i : i + 2], 16) / 255 for i in (1, 3, 5)]
            change = {"color": (*(round(min(c, WHITEST), 4) for c in rgb), finish.color[3])}
            keep = False
        elif re.fullmatch(r"alpha=(0?\.[0-9]+|[01](\.0*)?)", word):
            change = {"color": (*finish.color[:3], float(word[6:]))}
        else:
            raise ValueError(f"unknown look {word!r}; use {sorted(LOOK_WORDS)}, '#rrggbb' or 'alpha=0.3'")
        finish = dataclasses.replace(finish, **change)
    return finish, keep


LEATHER = re.compile(r"leather|cuero|cuir|leder|\bskai\b", re.IGNORECASE)
WOOD = re.compile(
    r"wood|madera|madeira|fusta|bois|holz|legno|timber|plank|(?<![a-z])oak|walnut|beech|mah[ao]g|cherry|teak|[vw]enge|"
    r"\bpine\b",
    re.IGNORECASE,
)
BODY = re.compile(r"hair|skin", re.IGNORECASE)
"""Covers that are matt as cloth is, and not woven."""
PIXELS = 512
"""Side of a tile: what textures of models are shrunk to."""
THREADS = 5.0
"""Pixels by which a tile is blurred until its folds alone are left."""
FOLDED = ("cloth", "bedding")
"""Covers whose folds textures get, too."""
BRIGHTEST, DARKEST = 0.95, 0.02
"""sRGB that no texel passes."""
FOLD_ROUNDS = 6
"""Times that directions are averaged over neighbours."""
STEEP = 0.45
"""Cosine to an axis below which cloth is not projected along it: stretched to more than twice its length."""
BEND = np.cos(np.radians(40.0))
"""Cosine of the angle at which one board ends and the next begins."""


@dataclass(frozen=True)
class Covering:
    tile: float
    """Side of the square that a tile covers, metres."""
    draw: Callable[[Canvas], np.ndarray]
    """(n, n, 3) or (n, n, 1) factors, mean about 1."""
    detail: str
    """The detail that it shows from nearby (embodied.render.detail)."""
    grained: bool = False
    """Runs along the longest side of every board."""


def _threads(on: Canvas, strength: float) -> np.ndarray:
    up, level = on.noise(0.7, 14), on.noise(14, 0.7)
    return (1 + strength * (up + level) / np.sqrt(2)).astype(np.float32)


def _cloth(on: Canvas) -> np.ndarray:
    clouds = 1 + 0.02 * on.fbm(4, 60, 1.2)
    return (_threads(on, 0.045) * clouds * folds(on, 0.10, 0.028))[..., None]


def _bedding(on: Canvas) -> np.ndarray:
    return (_threads(on, 0.02) * folds(on, 0.18, 0.065) * folds(on, 0.05, 0.025))[..., None]


def _leather(on: Canvas) -> np.ndarray:
    grain = leather(on, (0.5, 0.5, 0.5)).color[..., :1] / 0.5
    return (1 + 0.5 * (grain - 1)) * folds(on, 0.12, 0.018)[..., None]


def _wood(on: Canvas, species: str) -> np.ndarray:
    color = furniture(on, species, 3).color
    return color / color.mean((0, 1))


def _terry(on: Canvas) -> np.ndarray:
    loops = 1 + 0.10 * on.noise(2.5, 2.5) + 0.03 * on.fbm(4, 30, 1.2)
    return (loops * folds(on, 0.12, 0.04))[..., None]


def _chipboard(on: Canvas) -> np.ndarray:
    return (1 + 0.05 * (on.noise(5, 2) + on.noise(2, 5)) + 0.03 * on.noise(1, 1))[..., None]


COVERS = {
    "cloth": Covering(0.6, _cloth, "weave"),
    "bedding": Covering(1.1, _bedding, "weave"),
    "terry": Covering(0.6, _terry, "nap"),
    "leather": Covering(0.5, _leather, "pebbles"),
    "chipboard": Covering(0.5, _chipboard, "plaster"),
    "wood": Covering(1.0, functools.partial(_wood, species="oak"), "pores", grained=True),
    "dark wood": Covering(1.0, functools.partial(_wood, species="walnut"), "pores", grained=True),
}
"""By the word that a reviewer says for it, but for dark wood, which follows from the colour."""
WOODEN = 0.12
"""How much redder than blue, as a share of the brightest channel, what shows its grain must be: the rest is painted."""
OTHER = {"paint", "plastic", "ceramic", "chrome", "metal", "matt"}
"""Words of a reviewer after which a name says nothing."""
DARK = 0.42
"""sRGB mean below which wood is drawn as walnut."""


def cover_of(name: str, color: tuple[float, ...], look: str, *, textured: bool, clear: bool) -> str | None:
    """The cover of a material: what its `look` says, or else its name; None for none.

    Args:
      color: sRGB.
      clear: it is glass, metal or a mirror, which wears none but with a texture.
    """
    words = look.split()
    if "plain" in words or (clear and not textured):
        return None
    matter = next((w for w in words if w in COVERS), None)
    if matter is None and (textured or not set(words) & OTHER):
        matter = _named(name)
    if matter != "wood" or textured:
        return matter
    red, green, blue = color[:3]
    if red - blue < WOODEN * max(color[:3]) or not red >= green >= blue:
        return None
    return "dark wood" if sum(color[:3]) / 3 < DARK else "wood"


def _named(name: str) -> str | None:
    patterns = (("leather", LEATHER), ("cloth", CLOTH), ("wood", WOOD))
    return next((cover for cover, pattern in patterns if pattern.search(name) and not BODY.search(name)), None)


@functools.lru_cache(maxsize=64)
def picture(cover: str, color: tuple[float, ...]) -> Image.Image:
    """The tile of a cover in a colour (sRGB)."""
    shown = np.clip(_factors(cover) * np.asarray(color[:3], np.float32), DARKEST, BRIGHTEST)
    return Image.fromarray(np.round(shown * 255).astype(np.uint8), "RGB")


@functools.cache
def _factors(cover: str) -> np.ndarray:
    made = COVERS[cover]
    factors = made.draw(Canvas(PIXELS, made.tile, np.random.default_rng(sorted(COVERS).index(cover))))
    return np.broadcast_to(factors / factors.mean((0, 1)), (PIXELS, PIXELS, 3))


def creased(image: Image.Image, cover: str, vertices: np.ndarray, faces: np.ndarray, uv: np.ndarray) -> Image.Image:
    """A texture of cloth with the folds of a cover, whole tiles of them to each of its repeats; itself where those are
    smaller than half a tile.

    Args:
      uv: (m, 3, 2) of the corners of a part.
    """
    across, down = (round(extent / COVERS[cover].tile) for extent in _extent(vertices[faces], uv))
    if not (across and down):
        return image  # repeats too often to hold folds
    tile = blurred(_factors(cover)[..., :3].mean(-1), THREADS)
    shade = np.asarray(Image.fromarray(np.tile(tile, (down, across))).resize(image.size, Image.Resampling.BOX))
    pixels = np.asarray(image, np.float32).copy()
    pixels[..., :3] = np.clip(pixels[..., :3] * shade[..., None], 255 * DARKEST, 255 * BRIGHTEST)
    return Image.fromarray(np.round(pixels).astype(np.uint8), image.mode)


def _extent(corners: np.ndarray, uv: np.ndarray) -> tuple[float, float]:
    """Metres that a texture's width and height cover on triangles (m, 3, 3), in the median by area."""
    sides, turns = corners[:, 1:] - corners[:, :1], uv[:, 1:] - uv[:, :1]
    area = turns[:, 0, 0] * turns[:, 1, 1] - turns[:, 0, 1] * turns[:, 1, 0]
    sound = np.abs(area) > 1e-9
    if not sound.any():
        return 0.0, 0.0
    sides, turns, area = sides[sound], turns[sound], area[sound, None]
    u = (sides[:, 0] * turns[:, 1, 1, None] - sides[:, 1] * turns[:, 0, 1, None]) / area
    v = (sides[:, 1] * turns[:, 0, 0, None] - sides[:, 0] * turns[:, 1, 0, None]) / area
    weight = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return _median(np.linalg.norm(u, axis=1), weight), _median(np.linalg.norm(v, axis=1), weight)


def _median(values: np.ndarray, weight: np.ndarray) -> float:
    order = np.argsort(values)
    sums = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(sums, sums[-1] / 2)])


def laid_on(cover: str, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(m, 3, 2) uv of the corners of a part (metres, z up) for the tile of a cover."""
    made = COVERS[cover]
    unit = face_normals(vertices, faces)
    unit /= np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-30)
    seen_along = np.abs(unit).argmax(1)
    if not made.grained:
        around = np.abs(_evened(vertices, faces, unit)).argmax(1)
        steep = np.abs(np.take_along_axis(unit, around[:, None], 1)[:, 0]) < STEEP
        seen_along = np.where(steep, seen_along, around)
    u_axis, v_axis = np.array([1, 0, 0])[seen_along], np.array([2, 2, 1])[seen_along]
    shift = np.zeros((len(faces), 2))
    if made.grained:
        board = _boards(faces, unit)
        turned = _longest(vertices, faces, board)[board] == v_axis
        u_axis, v_axis = np.where(turned, v_axis, u_axis), np.where(turned, u_axis, v_axis)
        shift = np.random.default_rng(0).random((board.max() + 1, 2))[board]
    corners = vertices[faces]
    across = np.take_along_axis(corners, u_axis[:, None, None].repeat(3, 1), 2)[..., 0]
    along = np.take_along_axis(corners, v_axis[:, None, None].repeat(3, 1), 2)[..., 0]
    return np.stack([across, along], axis=-1) / made.tile + shift[:, None]


def _evened(vertices: np.ndarray, faces: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """(m, 3) directions of faces averaged over those around, lest the folds of a blanket cut its cloth to pieces."""
    for _ in range(FOLD_ROUNDS):
        sums = np.zeros((len(vertices), 3))
        for k in range(3):
            np.add.at(sums, faces[:, k], unit)
        unit = sums[faces].sum(1)
        unit /= np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-30)
    return unit


def _boards(faces: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """(m,) number of the board of each face: faces that meet at less than BEND's angle belong together."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, edge = np.unique(edges, axis=0, return_inverse=True)
    face = np.repeat(np.arange(len(faces)), 3)
    order = np.argsort(edge.reshape(-1), kind="stable")
    edge, face = edge.reshape(-1)[order], face[order]
    meets = (edge[1:] == edge[:-1]) & (np.einsum("ij,ij->i", unit[face[1:]], unit[face[:-1]]) > BEND)
    links = coo_matrix((np.ones(int(meets.sum())), (face[1:][meets], face[:-1][meets])), shape=(len(faces),) * 2)
    return connected_components(links, directed=False)[1]


def _longest(vertices: np.ndarray, faces: np.ndarray, board: np.ndarray) -> np.ndarray:
    """(boards,) the axis along which each board is longest."""
    low, high = np.full((board.max() + 1, 3), np.inf), np.full((board.max() + 1, 3), -np.inf)
    for k in range(3):
        np.minimum.at(low, board, vertices[faces[:, k]])
        np.maximum.at(high, board, vertices[faces[:, k]])
    return (high - low).argmax(1)

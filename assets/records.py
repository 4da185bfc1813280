"""The asset records: what a thing is, how it looks, where it may stand, how a model is imported."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

Color = tuple[float, float, float]
"""sRGB in [0, 1], or linear radiance where it says so."""

Size = tuple[float, float, float]
"""Width, depth and height, metres."""

ROOM_KINDS = (
    "living_room", "kitchen", "dining_room", "main_bedroom", "bedroom", "kids_room", "guest_room", "bathroom",
    "toilet", "hall", "corridor", "study", "laundry_room", "pantry", "closet", "library", "playroom", "gym",
    "garage", "family_room", "sun_room", "workshop", "stairwell",
)  # fmt: skip
"""Every room kind a house may hold; catalogue weights and generators use these keys only."""

SUPPORTS = ("floor", "against_wall", "corner", "surface", "wall", "ceiling")
"""How an asset is held up: free on the floor, on the floor with its back to a wall, on the
floor in a corner, on another object's support surface, hung on a wall, hung from the ceiling.
What goes in a corner has its back (+y) to one wall and, by its tag, its left side ('corner_left',
-x) or its right side ('corner_right', +x) to the other."""


IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
"""The row-major 3x3 rotation that turns nothing."""


DETAILS = ("weave", "nap", "pores", "pebbles", "plaster", "stipple")
"""Details of matter from nearby, by number: cloth its threads; carpets, towels and velvet; wood, along u; leather;
plaster and stone; rolled paint."""


@dataclass(frozen=True)
class Finish:
    """How one part of a mesh looks. Colours are sRGB in [0, 1]."""

    color: tuple[float, float, float, float] = (0.8, 0.8, 0.8, 1.0)
    texture: str | None = None
    """Path of an sRGB colour map; multiplies nothing: where present it replaces `color` (alpha apart)."""
    roughness: float = 0.8
    metallic: float = 0.0
    specular: float = 0.5
    """Dielectric reflectance scale as in the principled BSDF: 0.5 is F0 = 0.04, 0 for cloth."""
    emission: tuple[float, float, float] | None = None
    """Linear relative radiance when the lamp is on; None for things that do not glow."""
    mirror: bool = False
    tile: float | None = None
    """Side in metres of the square that the maps of a tileable material cover; whoever builds a
    mesh with such a finish divides metres by it to get uv. None for maps of imported models."""
    detail: str | None = None
    """The detail that it shows from nearby, one of DETAILS; None for what is smooth."""


@dataclass(frozen=True, eq=False)
class MeshPart:
    """One mesh of one finish, in the asset's own frame.

    The frame: metres, z up, x to the right of somebody who faces the thing's front, the
    front looks along -y, origin at the centre of the base of the bounding box.
    """

    vertices: np.ndarray
    """(n, 3) float32, metres."""
    faces: np.ndarray
    """(m, 3) int32, counter-clockwise seen from outside."""
    normals: np.ndarray
    """(n, 3) float32, unit."""
    uv: np.ndarray
    """(n, 2) float32, u right and v up as in OBJ; may leave [0, 1] where the texture repeats."""
    finish: Finish


def bounds(parts: Sequence[MeshPart]) -> np.ndarray:
    """(2, 3) lowest and highest corner of all parts, metres."""
    return np.array([np.min([p.vertices.min(0) for p in parts], 0), np.max([p.vertices.max(0) for p in parts], 0)])


@dataclass(frozen=True)
class SupportSurface:
    """A horizontal rectangle of an asset that small things may stand on, in its own frame."""

    name: str
    """'top', 'seat', 'shelf_1' (from below), 'basin_rim', ..."""
    z: float
    x0: float
    y0: float
    x1: float
    y1: float
    headroom: float
    """Free height above it in metres; large (9.0) where open."""


@dataclass(frozen=True)
class Asset:
    """One model of the catalogue."""

    key: str
    """'<pack>/<model>', e.g. 'scopia/bed1', or 'built/<maker>' for things made in code."""
    object_class: str
    """Singular English noun phrase, lower case: 'armchair', 'dining table'."""
    name: str
    """Natural name with what sets it apart: 'grey armchair', 'round wooden table'."""
    size: tuple[float, float, float]
    """Width (x), depth (y), height (z) in metres."""
    support: str
    """One of SUPPORTS."""
    rooms: Mapping[str, float] = field(default_factory=dict)
    """Room kind to weight; empty for assets that only functional groups place."""
    synonyms: tuple[str, ...] = ()
    """Other nouns people use for it ('couch' for 'sofa')."""
    colours: tuple[str, ...] = ()
    materials: tuple[str, ...] = ()
    """Material words: 'wood', 'glass', 'metal', 'fabric', 'leather', 'ceramic', ..."""
    on: tuple[str, ...] = ()
    """For support 'surface': object classes whose surfaces it naturally rests on."""
    elevation: float = 0.0
    """Base height above the floor for support 'wall'; drop below the ceiling for 'ceiling'."""
    clearance: float = 0.0
    """Free depth needed before its front, metres."""
    surfaces: tuple[SupportSurface, ...] = ()
    tags: tuple[str, ...] = ()
    """Functional tags the generator asks for: 'double', 'single', 'round', 'floor_lamp', ..."""
    emits: tuple[float, float, float] | None = None
    """Linear relative radiance of its lamp when on; None for things that give no light."""
    pack: str = ""
    creator: str = ""
    licence: str = ""


@dataclass(frozen=True)
class ImportRecipe:
    """All that decides what an import gives, beside the pack itself."""

    key: str
    size: tuple[float, float, float]
    """Width, depth, height, metres."""
    yaw: float = 0.0
    """Degrees counter-clockwise that bring the model's front to -y."""
    rotation: tuple[float, ...] = IDENTITY
    two_sided: tuple[str, ...] = ()
    """Materials whose faces are also seen from behind: leaves, sheets; '*' is all of them."""
    flipped: tuple[str, ...] = ()
    """Materials whose faces the pack winds inside out."""
    glow: tuple[str, ...] = ()
    """Materials that glow when the lamp is on."""
    emits: tuple[float, float, float] | None = None
    dropped: tuple[str, ...] = ()
    """Materials that are left out: shadows painted on the floor, helper planes."""
    looks: tuple[tuple[str, str], ...] = ()
    """Material and the reviewer's words for it (embodied.assets.importing.looks.corrected)."""
    faces: int = 0
    """Face budget; 0 takes FACE_BUDGETS."""
    model: str = ""
    """The model that this one is a variant of, where it is one."""

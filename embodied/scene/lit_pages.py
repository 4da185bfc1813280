"""LitPages: what baked light hands to the renderers. A house's surfaces with their light painted on."""

from dataclasses import dataclass

import numpy as np

ANYWHERE = "*"
"""Room of what moves and may be in any."""
CLEAR = 0.1
"""Roughness up to which what is seen through is glass; curtains are rougher."""


@dataclass(frozen=True, eq=False)
class LitMesh:
    """The share of one owner in one page."""

    owner: str
    """Placement id or shell id, as in Part.owner."""
    kind: str
    """As in Part.kind."""
    room: str
    """As in Part.room."""
    page: int
    """Index into LitPages.pages."""
    vertices: np.ndarray
    """(n, 3) float32, metres, world."""
    faces: np.ndarray
    """(m, 3) int32, counter-clockwise seen from the visible side; list a two-sided face twice."""
    uv: np.ndarray
    """(n, 2) float32 in [0, 1]: u to the right, v DOWN (v = 0 is the upper edge of row 0 of the page)."""
    alpha: float = 1.0
    """Opacity; below 1 for glass and sheer curtains."""
    gloss: tuple[float, float] | None = None
    """Mean roughness and specular (0.5 is F0 = 0.04, 0 reflects nothing) over its area; None: unknown, so matte."""


@dataclass(frozen=True, eq=False)
class LitPages:
    """A house as it is displayed: what a texel says is what a pixel shows, no lamp is added."""

    meshes: tuple[LitMesh, ...]
    pages: tuple[np.ndarray, ...]
    """Each (h, w, 3) uint8, sRGB, row 0 on top."""
    digest: str
    """Hex digest of what the light depends on; part of the key of every panorama made with it."""
    owners: tuple[str, ...] = ()
    """parts.owners(house) of the house that was lit; checked by the renderer where given."""


def glass_surfaces(mesh: LitMesh) -> int:
    """How many surfaces of glass one looks through: four of double glazing, two of another pane; 0 where it is none."""
    if mesh.alpha >= 0.9 or mesh.gloss is None or mesh.gloss[0] > CLEAR:
        return 0
    return 4 if mesh.kind == "opening" else 2

"""How finely and how long a house is lit."""

from dataclasses import dataclass
from pathlib import Path

from embodied.assets.closure import code_digest
from embodied.assets.json_file import from_plain, read_toml

UNCOUNTED_BY_LIGHT = (
    "embodied.assets", "embodied.assets.catalogue", "embodied.assets.data", "embodied", "embodied.light",
    "embodied.light.settings", "embodied.scene.house_meshes", "tqdm",
)  # fmt: skip
"""Modules that the code of a bake does not count: what builds a house's parts and the settings, since the parts and the
settings themselves are in a bake's key; what packages offer by name; the progress bar."""


def light_code() -> str:
    """Digest of the code and the libraries that bake; bakes made by others are made anew."""
    return code_digest("embodied.light.baking.house", without=UNCOUNTED_BY_LIGHT)


@dataclass(frozen=True)
class LightSettings:
    """Everything a bake depends on besides the house."""

    density: float = 32.0
    """Luxels per metre on walls, floors and ceilings."""
    budget: float = 4000.0
    """Luxels per piece of furniture."""
    sky_rays: int = 10
    """Rays per luxel and window."""
    lamp_rays: int = 10
    other_rays: int = 24
    """Rays per luxel outdoors; of what metals mirror, as `compose` says."""
    sun_rays: int = 12
    """Rays over the sun's disc per texel near a shadow's edge."""
    patches: int = 64
    """Small lights that stand for the sun's patches in one room."""
    bounce_rays: int = 4
    """Rays per luxel that carry light from bounce to bounce."""
    seen_rays: int = 16
    """Rays per luxel, those among them, that gather what is seen."""
    sharpness: float = 1.0
    """Texels per metre, times those that patterns need to look sharp from nearby (`atlas.fineness`)."""
    tolerance: float = 0.10
    """Relative difference from the path tracer that a luxel may have (`embodied.light.baking.check`)."""
    rows: int = 1024
    """Of the picture of the outdoors, from zenith to nadir."""
    jpeg: int = 92
    """Quality of the picture pages on disk."""
    texels: float = 29e6
    """Of all pages together, before packing; patterns of large houses are drawn coarser to keep to it
    (`atlas.coarsened`)."""


QUALITIES = from_plain(dict[str, LightSettings], read_toml(Path(__file__).with_name("qualities.toml")))
"""Named settings: for data sets, for looking, for pictures of single houses."""


def settings_of(quality: str) -> LightSettings:
    """Settings by name.

    Raises:
      ValueError: no such quality.
    """
    if quality not in QUALITIES:
        raise ValueError(f"light quality {quality!r} is unknown; use one of {sorted(QUALITIES)}")
    return QUALITIES[quality]

"""PictureSettings: how large and how well a house is drawn."""

from __future__ import annotations

from dataclasses import dataclass

QUALITIES = ("none", "unlit", "fast", "normal", "glossy", "reference")
"""From no pictures at all, through even light from all sides ('unlit') and light that was baked quickly ('fast') or
well ('normal'), to rays into that light ('glossy') and the path tracer alone ('reference')."""
DRAWN = ("unlit", "fast", "normal")
"""Qualities that a Renderer draws, from anywhere."""
TRACED = ("glossy", "reference")
"""Qualities whose panoramas are ray-traced, from the viewpoints only."""
BACKENDS = ("classic", "filament")
"""Who draws colours: MuJoCo's OpenGL, or its Filament through Vulkan. Depth and ids are always the classic one's."""
LOOKS = ("matte", "gloss")
"""What baked light is shown with: what the pages hold, or reflections by rays from what is seen laid over it."""
SIZES = (8, 4096)
"""Smallest and largest side of a cube face, pixels."""


@dataclass(frozen=True)
class PictureSettings:
    """All that decides what pictures of a house look like, besides the house."""

    size: int = 256
    """Side of a cube face, pixels."""
    quality: str = "unlit"
    """One of QUALITIES."""
    backend: str = "classic"
    """One of BACKENDS."""
    light: str | None = None
    """Light settings by name (embodied.light); those that the quality stands for if None."""
    look: str | None = None
    """One of LOOKS; 'gloss' is for the qualities 'fast' and 'normal' of the classic renderer, and what None stands for
    there; elsewhere it stands for 'matte'."""
    rays: int | None = None
    """Per pixel, of qualities in TRACED; None: as many as embodied.light.reference.RAYS has for the quality."""

    def __post_init__(self) -> None:
        if self.quality not in QUALITIES:
            raise ValueError(f"quality {self.quality!r} is unknown; use one of {QUALITIES}")
        if self.backend not in BACKENDS:
            raise ValueError(f"backend {self.backend!r} is unknown; use one of {BACKENDS}")
        check_size(self.size)
        if self.backend == "filament" and self.quality not in ("fast", "normal"):
            raise ValueError(
                f"backend 'filament' draws qualities 'fast' and 'normal', not {self.quality!r}; use backend 'classic'"
            )
        if self.look not in (None, *LOOKS):
            raise ValueError(f"look {self.look!r} is unknown; use one of {LOOKS}")
        if self.look == "gloss" and not self._baked:
            raise ValueError(
                f"look 'gloss' is laid over what the classic renderer draws in qualities 'fast' and 'normal', not over "
                f"{self.quality!r} by {self.backend!r}; use look 'matte'"
            )
        if self.light is not None and not self.lit:
            raise ValueError(f"quality {self.quality!r} is without light, so light={self.light!r} means nothing")

        if self.rays is not None and (self.quality not in TRACED or self.rays < 1):
            raise ValueError(
                f"rays={self.rays} should be at least 1, and quality one of {TRACED}, which are traced; it is "
                f"{self.quality!r}"
            )

    @property
    def lit(self) -> bool:
        """Whether the house is lit before it is drawn."""
        return self.quality not in ("none", "unlit")

    @property
    def lit_by(self) -> str | None:
        """Name of the light settings that the house is lit with; None where it is not lit."""
        if not self.lit:
            return None
        return self.light or ("fast" if self.quality == "fast" else "normal")

    @property
    def shown_with(self) -> str:
        """One of LOOKS: `look`, or what it stands for where it is None."""
        return self.look or ("gloss" if self._baked else "matte")

    @property
    def _baked(self) -> bool:
        """Whether the classic renderer draws pages of baked light, over which gloss can be laid."""
        return self.quality in ("fast", "normal") and self.backend == "classic"


def check_size(size: int) -> None:
    """Refuse a side of a cube face that cannot be drawn.

    Raises:
      ValueError: says what can.
    """
    if not SIZES[0] <= size <= SIZES[1]:
        raise ValueError(f"size is {size} pixels; a cube face needs {SIZES[0]} to {SIZES[1]}")

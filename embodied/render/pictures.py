"""PictureSettings: how pictures of a house are made."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

_STORED: Mapping[str, tuple[str, str, str]] = {
    "none": ("none", "classic", "matte"),
    "unlit": ("unlit", "classic", "matte"),
    "fast": ("fast", "classic", "gloss"),
    "normal": ("normal", "classic", "gloss"),
    "fast-matte": ("fast", "classic", "matte"),
    "normal-matte": ("normal", "classic", "matte"),
    "fast-filament": ("fast", "filament", "matte"),
    "normal-filament": ("normal", "filament", "matte"),
    "traced": ("glossy", "classic", "matte"),
    "reference": ("reference", "classic", "matte"),
}
"""The quality, backend and look that a kind of pictures is stored under in files of panoramas and features."""
TRACED = ("traced", "reference")
"""Kinds whose panoramas are ray-traced, from the viewpoints only."""
KINDS = tuple(_STORED)
"""'none': no pictures. 'unlit': even light from all sides. 'fast', 'normal': light that is baked quickly or well, with
reflections; '-matte': without reflections; '-filament': by MuJoCo's Filament renderer. 'traced': rays into baked light.
'reference': the path tracer alone."""
PICTURES = KINDS[1:]
DRAWN = tuple(k for k in PICTURES if k not in TRACED)
"""Kinds that a Renderer draws, from anywhere."""
SIZES = (8, 4096)
"""Smallest and largest side of a cube face, pixels."""


@dataclass(frozen=True)
class PictureSettings:
    """All that decides what pictures of a house look like, besides the house.

    Examples:
      >>> embodied.PictureSettings.of('fast', size=512).lit
      True
    """

    size: int = 256
    """Side of a cube face, pixels."""
    kind: str = "unlit"
    """One of KINDS."""
    light: str | None = None
    """Light settings by name (embodied.light); those that the kind stands for if None."""
    rays: int | None = None
    """Per pixel, of kinds in TRACED; None: as many as embodied.light.tracing.reference.RAYS has for the kind."""

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"pictures {self.kind!r} are unknown; use one of {', '.join(KINDS)}")
        check_size(self.size)
        if self.light is not None and not self.lit:
            raise ValueError(f"pictures {self.kind!r} are without light, so light={self.light!r} means nothing")
        if self.rays is not None and (not self.traced or self.rays < 1):
            raise ValueError(
                f"rays={self.rays} should be at least 1, for pictures that are traced ({' or '.join(TRACED)}); these "
                f"are {self.kind!r}"
            )

    @classmethod
    def of(cls, pictures: PictureSettings | str, **changes: Any) -> PictureSettings:
        """Settings from a kind, or from other settings: `PictureSettings.of("fast", size=512)`.

        Args:
          changes: fields that differ.
        """
        return dataclasses.replace(cls(kind=pictures) if isinstance(pictures, str) else pictures, **changes)

    @classmethod
    def from_stored(cls, stored: Mapping[str, Any]) -> Self:
        """The settings that `stored` made a record of.

        Raises:
          ValueError: another version has other words for it.
        """
        words = (stored.get("quality"), stored.get("backend"), stored.get("look", "matte"))
        kind = next((k for k, named in _STORED.items() if named == words), None)
        if kind is None or not isinstance(stored.get("size"), int):
            raise ValueError(f"pictures stored as {words} are unknown; draw them again")
        found = cls(stored["size"], kind, rays=stored.get("rays"))
        light = stored.get("light")
        return found if light in (None, found.lit_by) else dataclasses.replace(found, light=light)

    def stored(self) -> dict[str, object]:
        """What files of panoramas record of it."""
        quality, backend, look = _STORED[self.kind]
        return (
            {"size": self.size, "quality": quality, "backend": backend, "light": self.lit_by}
            | ({} if look == "matte" else {"look": look})
            | ({} if self.rays is None else {"rays": self.rays})
        )

    @property
    def lit(self) -> bool:
        """Whether the house is lit before it is drawn."""
        return self.kind not in ("none", "unlit")

    @property
    def lit_by(self) -> str | None:
        """Name of the light settings that the house is lit with; None where it is not lit."""
        if not self.lit:
            return None
        return self.light or ("fast" if self.kind.startswith("fast") else "normal")

    @property
    def gloss(self) -> bool:
        """Whether reflections are laid over baked light."""
        return self.kind in ("fast", "normal")

    @property
    def matte(self) -> PictureSettings:
        """The same without reflections."""
        return dataclasses.replace(self, kind=f"{self.kind}-matte") if self.gloss else self

    @property
    def filament(self) -> bool:
        """Whether MuJoCo's Filament renderer draws the colours."""
        return self.kind.endswith("-filament")

    @property
    def traced(self) -> bool:
        """Whether panoramas are ray-traced."""
        return self.kind in TRACED


def check_size(size: int) -> None:
    """Refuse a side of a cube face that cannot be drawn.

    Raises:
      ValueError: says what can.
    """
    if not SIZES[0] <= size <= SIZES[1]:
        raise ValueError(f"size is {size} pixels; a cube face needs {SIZES[0]} to {SIZES[1]}")

"""How pictures of a house are made: without light, in baked light, or by tracing rays."""

import contextlib
import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

FACE_SIZES = (8, 4096)
"""Smallest and largest side of a cube face, pixels."""
BAKED_QUALITIES = ("fast", "normal", "high")
"""Names of embodied.light.settings.QUALITIES."""


def check_size(size: int) -> None:
    """Refuse a side of a cube face that cannot be drawn.

    Raises:
      ValueError: says what can.
    """
    if not FACE_SIZES[0] <= size <= FACE_SIZES[1]:
        raise ValueError(f"size is {size} pixels; a cube face needs {FACE_SIZES[0]} to {FACE_SIZES[1]}")


def _check_quality(quality: str) -> None:
    if quality not in BAKED_QUALITIES:
        raise ValueError(f"light of quality {quality!r} is unknown; use one of {', '.join(BAKED_QUALITIES)}")


@dataclass(frozen=True)
class _CubeFaces:
    size: int = dataclasses.field(default=256, kw_only=True)
    """Side of a cube face, pixels."""

    def __post_init__(self) -> None:
        check_size(self.size)


@dataclass(frozen=True)
class Unlit(_CubeFaces):
    """Even light from all sides; nothing is computed beforehand.

    Examples:
      >>> embodied.Unlit(size=64).word
      'unlit'
    """

    quality: ClassVar[None] = None
    """The house is not lit before it is drawn."""
    word: ClassVar[str] = "unlit"
    """The name on the command line."""


@dataclass(frozen=True)
class Baked(_CubeFaces):
    """Light that is computed once, with all bounces, and painted on the house.

    Examples:
      >>> embodied.Baked("fast", gloss=False, size=512).word
      'fast-matte'
    """

    quality: str = "normal"
    """Of the light, one of BAKED_QUALITIES."""
    gloss: bool = True
    """Reflections are laid over the light of every view."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_quality(self.quality)

    @property
    def word(self) -> str:
        """The name on the command line."""
        return self.quality if self.gloss else f"{self.quality}-matte"


@dataclass(frozen=True)
class Traced(_CubeFaces):
    """Ray-traced panoramas, from the viewpoints only.

    Examples:
      >>> embodied.Traced(rays=16, reference=True).word
      'reference'
    """

    rays: int | None = None
    """Per pixel; as many as embodied.light.tracing.reference.RAYS has where None."""
    quality: str = "normal"
    """Of the baked light that the rays end in, or that only sets the exposure of a reference."""
    reference: bool = False
    """Paths are traced to the lamps and the sky, without baked light."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_quality(self.quality)
        if self.rays is not None and self.rays < 1:
            raise ValueError(f"rays={self.rays} should be at least 1 per pixel")

    @property
    def word(self) -> str:
        """The name on the command line."""
        return "reference" if self.reference else "traced"


PictureSettings = Unlit | Baked | Traced
"""All that decides what pictures of a house look like, besides the house."""
_EVERY: tuple[PictureSettings, ...] = (
    Unlit(),
    *(Baked(quality, gloss) for gloss in (True, False) for quality in BAKED_QUALITIES),
    Traced(),
    Traced(reference=True),
)
WORDS_FOR_PICTURES: Mapping[str, PictureSettings] = {pictures.word: pictures for pictures in _EVERY}
PICTURES = tuple(word for word in WORDS_FOR_PICTURES if not word.startswith("high"))
"""The words of the command line; light of high quality is for single pictures."""
DRAWN = tuple(word for word in PICTURES if not isinstance(WORDS_FOR_PICTURES[word], Traced))
"""Those that a Renderer draws, from anywhere."""


def parse_pictures(pictures: PictureSettings | str, size: int | None = None) -> PictureSettings:
    """Settings, from one of PICTURES or as they are.

    Args:
      size: side of a cube face, pixels, instead of that of `pictures`.

    Raises:
      ValueError: an unknown word or an impossible size.
    """
    if isinstance(pictures, str):
        if pictures not in WORDS_FOR_PICTURES:
            raise ValueError(f"pictures {pictures!r} are unknown; use one of {', '.join(PICTURES)}")
        pictures = WORDS_FOR_PICTURES[pictures]
    return pictures if size is None else dataclasses.replace(pictures, size=size)


def matte(pictures: PictureSettings) -> PictureSettings:
    """The same without reflections."""
    return dataclasses.replace(pictures, gloss=False) if isinstance(pictures, Baked) else pictures


def recorded(pictures: PictureSettings) -> dict[str, object]:
    """The facts that files of panoramas record; `from_recorded` reads them."""
    facts: dict[str, object] = {"size": pictures.size, "backend": "classic", "light": pictures.quality}
    match pictures:
        case Unlit():
            return facts | {"quality": "unlit"}
        case Baked():
            return facts | {"quality": pictures.quality} | ({"look": "gloss"} if pictures.gloss else {})
        case Traced():
            rays = {} if pictures.rays is None else {"rays": pictures.rays}
            return facts | {"quality": "reference" if pictures.reference else "glossy"} | rays


def from_recorded(facts: Mapping[str, Any]) -> PictureSettings:
    """The settings that `recorded` wrote down, among other facts.

    Raises:
      ValueError: another version wrote other ones.
    """
    known = {name: facts[name] for name in ("size", "quality", "backend", "light", "look", "rays") if name in facts}
    for word in PICTURES:
        with contextlib.suppress(TypeError, ValueError):
            settings = from_words({"kind": word, **known})
            if recorded(settings) == known:
                return settings
    raise ValueError(f"pictures recorded as {known} are unknown; draw them again")


def in_words(pictures: PictureSettings) -> dict[str, object]:
    """The settings as a run's facts have them, with the command line's word."""
    facts = {"size": pictures.size, "kind": pictures.word, "light": pictures.quality}
    return facts | {"rays": pictures.rays if isinstance(pictures, Traced) else None}


def from_words(facts: Mapping[str, Any]) -> PictureSettings:
    """The settings of `in_words`.

    Raises:
      ValueError: an unknown word, or a number that is impossible.
      TypeError: something that such pictures do not have.
    """
    changes = {"quality": facts.get("light"), "rays": facts.get("rays")}
    pictures = parse_pictures(str(facts.get("kind")), facts.get("size"))
    return dataclasses.replace(pictures, **{name: value for name, value in changes.items() if value is not None})

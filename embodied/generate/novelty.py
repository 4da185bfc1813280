"""Materials that each style of a house chooses from; houses of familiar or of novel things: which models, and which
look, houses to learn from never hold.

Names of materials only ('oak_planks/0'); assets.materials makes them. The table is style_finishes.toml beside this
module.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from embodied.assets.catalogue import Catalogue
from embodied.assets.json_file import from_plain, read_toml
from embodied.assets.records import Asset
from embodied.house.validation import STYLES
from embodied.seeds import FAMILIAR, NOVEL, novel_among

NOVEL_STYLE = "colourful"
"""The look that is kept from learning: nearly all of its floors, tiles and wallpapers are its own."""
KITCHEN_LINE = "line_"
"""Tags that begin so name kitchen units that go together; a line is familiar or novel as a whole."""


def furnishable(catalogue: Catalogue, novelty: str | None) -> Catalogue:
    """The catalogue that a house of this novelty is furnished from.

    A quarter of the models of each object class, and a quarter of the kitchen lines, are novel. Classes of few models
    have them in both: what is new is what things look like, not what there is.
    """
    if novelty is None:
        return catalogue
    new = _novel_models(catalogue)
    if novelty == FAMILIAR:
        return catalogue.only(a.key for a in catalogue.assets.values() if a.key not in new)
    replaced = {_group(catalogue.assets[key]) for key in new}
    return catalogue.only(a.key for a in catalogue.assets.values() if a.key in new or _group(a) not in replaced)


def styles_of(novelty: str | None) -> tuple[str, ...]:
    """The styles that a house of this novelty may have."""
    if novelty is None:
        return STYLES
    return tuple(s for s in STYLES if (s == NOVEL_STYLE) == (novelty == NOVEL))


def finishes_of(style: str, novelty: str | None) -> StyleFinishes:
    """Materials that a style chooses from; in novel houses only what no other style has, where that is a choice.

    Paints and carpets are everybody's, and so are the walls of children's rooms and the floors of garages.
    """
    finishes = STYLE_FINISHES[style]
    if novelty != NOVEL:
        return finishes
    other_styles = [keys for other in STYLE_FINISHES.values() if other is not finishes for keys in vars(other).values()]
    everybodys = (FINISH_TABLE.kids, FINISH_TABLE.kids_papers, FINISH_TABLE.rough)
    others = {key for keys in (*other_styles, *everybodys) for key in keys}
    own = {field: tuple(k for k in keys if k not in others) for field, keys in vars(finishes).items()}
    return dataclasses.replace(finishes, **{field: keys for field, keys in own.items() if len(keys) > 1})


@functools.lru_cache(maxsize=4)
def _novel_models(catalogue: Catalogue) -> frozenset[str]:
    """Keys of the novel models."""
    groups: dict[str, dict[str, list[str]]] = {}
    for asset in catalogue.assets.values():
        name = next(iter(_lines(asset)), asset.key)
        groups.setdefault(_group(asset), {}).setdefault(name, []).append(asset.key)
    return frozenset(
        key for alternatives in groups.values() for name in novel_among(alternatives) for key in alternatives[name]
    )


def _group(asset: Asset) -> str:
    """The group of an asset's alternatives: its class, or the kitchen lines; what fits several lines is everybody's."""
    lines = _lines(asset)
    return asset.object_class if not lines else KITCHEN_LINE if len(lines) == 1 else asset.key


def _lines(asset: Asset) -> list[str]:
    """The kitchen lines that an asset belongs to."""
    return [tag for tag in asset.tags if tag.startswith(KITCHEN_LINE)]


@dataclass(frozen=True)
class StyleFinishes:
    """Material keys that a style chooses from."""

    woods: tuple[str, ...]
    stones: tuple[str, ...]
    """Tile and stone floors of hall, kitchen and sun room."""
    carpets: tuple[str, ...]
    walls: tuple[str, ...]
    """Light colours; a house takes three."""
    accents: tuple[str, ...]
    papers: tuple[str, ...]
    wet_floors: tuple[str, ...]
    wet_walls: tuple[str, ...]
    doors: tuple[str, ...]
    front_doors: tuple[str, ...]
    frames: tuple[str, ...] = ("paint_white/0",)
    ceilings: tuple[str, ...] = ("paint_white/0", "paint_white/0", "plaster_white/0")


@dataclass(frozen=True)
class FinishTable:
    """The content of style_finishes.toml."""

    styles: Mapping[str, StyleFinishes]
    """By the names of embodied.house.validation.STYLES."""
    rough: tuple[str, ...]
    """Floors of garages and workshops, whatever the style."""
    kids: tuple[str, ...]
    """Walls of children's rooms, whatever the style."""
    kids_papers: tuple[str, ...]
    """Their accents."""


FINISH_TABLE = from_plain(FinishTable, read_toml(Path(__file__).with_name("style_finishes.toml")))
STYLE_FINISHES = FINISH_TABLE.styles

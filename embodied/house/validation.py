"""Houses from files: checks that they name things that exist, and the lightings that are kept beside them."""

import dataclasses
import difflib
import logging
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from embodied.assets.cache import write_json
from embodied.assets.catalogue import Catalogue
from embodied.assets.json_file import load_json
from embodied.assets.materials import MATERIALS
from embodied.assets.moving_parts import OPEN
from embodied.house.house import House, HouseError, Placement, Sky, check

STYLES = ("light", "warm", "dark", "classic", "colourful")
"""Names of the palettes and styles of a house's furnishing; embodied.generate.finishes says what each chooses from."""


def load_house(path: Path, catalogue: Catalogue) -> House:
    """House.load, refusing what `catalogue` does not know; raises HouseError with the file's name.

    Examples:
      >>> embodied.load_house(Path('house.json'), catalogue) == house
      True
    """
    house = House.load(path)
    try:
        check_known(house, catalogue)
    except HouseError as e:
        raise HouseError(f"{path}: {e}") from e
    return house


def check_known(house: House, catalogue: Catalogue) -> None:
    """Refuse a house that names what neither the catalogue nor the materials hold.

    `embodied.house.house.check` asks whether a house can be; this asks whether it can be drawn.

    Raises:
      HouseError: an unknown style, material, asset, object class, surface or parameter.
    """
    if house.style not in STYLES:
        raise HouseError(f"the house has the unknown style {house.style!r}; use one of {STYLES}")
    for r in house.rooms:
        for finish in (r.floor_finish, r.wall_finish, r.ceiling_finish, r.skirting_finish, r.accent_finish):
            _check_material(f"room {r.id!r}", finish)
    for opening in house.openings:
        _check_material(f"opening {opening.id!r}", opening.leaf_finish)
    for p in house.placements:
        _check_placement(house, p, catalogue)


def _check_material(owner: str, key: str | None) -> None:
    if key is not None and key not in MATERIALS:
        raise HouseError(f"{owner} has the unknown material {key!r}; {_near(key, MATERIALS)}")


def _check_placement(house: House, p: Placement, catalogue: Catalogue) -> None:
    asset = catalogue.assets.get(p.asset)
    if asset is None:
        raise HouseError(
            f"object {p.id!r} is the unknown asset {p.asset!r}; {_near(p.asset, catalogue.assets)}; "
            "`embodied assets list` names them all, --own adds folders of your own"
        )
    if p.object_class != asset.object_class:
        raise HouseError(
            f"object {p.id!r} is called a {p.object_class!r}, its asset {p.asset!r} is a {asset.object_class!r}"
        )
    if p.surface is not None:
        parent = house.placement_by_id.get(p.parent or "")
        below = catalogue.assets.get(parent.asset) if parent is not None else None
        names = [s.name for s in below.surfaces] if below is not None else []
        if p.surface not in names:
            raise HouseError(
                f"object {p.id!r} lies on the unknown surface {p.surface!r} of {p.parent!r}, which has {names}; "
                "name one of these"
            )
    known = catalogue.parameters(p.asset)
    for name, value in p.params:
        if name.startswith(OPEN):
            try:
                catalogue.mesh(p.asset, p.size, p.params)
            except ValueError as e:
                raise HouseError(f"object {p.id!r} has {name}={value!r}: {e}") from None
            continue
        if name not in known:
            raise HouseError(
                f"object {p.id!r} has the unknown parameter {name!r}; {p.asset!r} takes {sorted(known) or 'none'}"
            )
        if isinstance(value, str) != isinstance(known[name], str) or (
            isinstance(value, float) and not math.isfinite(value)
        ):
            raise HouseError(f"object {p.id!r} has {name}={value!r}; a value like {known[name]!r} is wanted")
        if isinstance(value, str) and known[name] in MATERIALS:
            _check_material(f"object {p.id!r}", value)


def _near(word: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(word, list(known), 3, 0.5)
    return f"did you mean {' or '.join(map(repr, close))}?" if close else "none has a name like it"


LIGHTINGS_FILE = "lights.json"
"""In the folder of a house.json."""
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Lighting:
    sky: Sky
    on: tuple[str, ...]
    """Ids of the lamps that are on."""


@dataclass(frozen=True)
class HouseLightings:
    """The content of lights.json."""

    house: str
    """Digest of the house.json that they belong to."""
    lightings: tuple[Lighting, ...]
    """In the first of them the house is shown."""


def save_lightings(folder: Path, lightings: Sequence[House]) -> None:
    """Write lights.json beside a folder's house.json, which stays as it is.

    Args:
      lightings: the folder's house in other sky and with other lamps on; it is shown as the first.
    """
    house = House.load(folder / "house.json")
    lit = tuple(Lighting(h.sky, tuple(x.id for x in h.lights if x.on)) for h in lightings)
    write_json(folder / LIGHTINGS_FILE, dataclasses.asdict(HouseLightings(house.digest, lit)), indent=1)


def load_lit_house(folder: Path, catalogue: Catalogue) -> House:
    """The house of a folder, in the first lighting of its lights.json if it has one of this house.

    Raises:
      FileNotFoundError: no house.json.
      HouseError: a house or a lighting that cannot be, or things that `catalogue` does not know.
      RecordError: a damaged lights.json.
    """
    house = load_house(folder / "house.json", catalogue)
    path = folder / LIGHTINGS_FILE
    if not path.exists():
        return house
    stored = load_json(path, HouseLightings)
    if stored.house != house.digest or not stored.lightings:
        log.warning("%s lights another house than the house.json beside it; run embodied light again", path)
        return house
    sky, on = stored.lightings[0].sky, set(stored.lightings[0].on)
    lights = tuple(dataclasses.replace(x, on=x.id in on) for x in house.lights)
    house = dataclasses.replace(house, sky=sky, lights=lights)
    try:
        check(house)
    except HouseError as e:
        raise HouseError(f"{path}: {e}") from e
    return house

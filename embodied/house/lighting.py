"""The lightings of a house, kept beside its file: the sky and the lamps with which a folder's house is shown."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from embodied.assets.cache import write_json
from embodied.assets.catalogue import Catalogue
from embodied.assets.json_file import load_json
from embodied.house.house import House, HouseError, Sky, check
from embodied.house.validation import load_house

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

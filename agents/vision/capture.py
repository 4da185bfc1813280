"""Goal images that were taken at another time than the agent is there, and features of both.

In place recognition these are changes of appearance (hour, weather, lamps), of the scene (people, things) and of the
camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from embodied.agents.vision.config import LATER_CAMERA, SAME_TIME
from embodied.agents.vision.drawn import pictures_of
from embodied.agents.vision.features import feature_path, load_features
from embodied.assets.cache import digest, write_json
from embodied.assets.catalogue import load_catalogue
from embodied.assets.closure import code_digest
from embodied.assets.json_file import read_json
from embodied.datasets.store import Dataset
from embodied.generate.rearrange import rearranged
from embodied.house.house import House
from embodied.interface import Route
from embodied.light import lightings_of
from embodied.records import load_lines
from embodied.render.photograph import PhotoCamera
from embodied.render.pictures import PictureSettings

LATER_DAY, LATER_LIGHTING = 1, 1
"""Of pictures taken later: the day of embodied.generate.rearrange, and the number in embodied.light.lightings_of."""
FEATURE_ENDINGS = {SAME_TIME: "", LATER_CAMERA: f"+light{LATER_LIGHTING}+day{LATER_DAY}+robot"}
"""Of the names of files with features, after the house."""
CAMERAS_OF = {SAME_TIME: PhotoCamera(), LATER_CAMERA: PhotoCamera("robot", seed=LATER_DAY)}


def house_at(data: Dataset, name: str, goal_image: str, cache: Path) -> House:
    """A house of a data set as goal images show it."""
    place = data.place(name)
    if goal_image == SAME_TIME:
        return place.house
    starts = [route.path[0] for route in load_lines(data.folder / "houses" / name / "routes.jsonl", Route)]
    house = rearranged(place.house, place.graph, load_catalogue(cache), starts, day=LATER_DAY)
    return lightings_of(house, LATER_LIGHTING + 1)[-1]


def digest_at(data: Dataset, name: str, goal_image: str, cache: Path) -> str:
    """The digest of that house, kept in the cache: another day takes a second to make."""
    if goal_image == SAME_TIME:
        return data.place(name).house.digest
    key = digest([data.digest, name, LATER_LIGHTING, LATER_DAY, code_digest("embodied.agents.vision.capture")])
    path = cache / "days" / f"{key[:32]}.json"
    if not path.exists():
        write_json(path, {"house": house_at(data, name, goal_image, cache).digest})
    return str(read_json(path)["house"])


def captured_path(data: Dataset, name: str, goal_image: str, encoder: str, pictures: PictureSettings) -> Path:
    """The file with the features of goal images of a house; `encoder` is a digest."""
    return feature_path(data.folder / "features", encoder, name + FEATURE_ENDINGS[goal_image], pictures)


def house_features(
    data: Dataset,
    names: Sequence[str],
    encoder: str,
    picture_kind: str | None,
    cache: Path,
    goal_image: str = SAME_TIME,
) -> dict[str, np.ndarray]:
    """(n, 36, D) features of some houses, as goal images show them; `encoder` is a digest.

    Raises:
      FileNotFoundError: features are missing.
      ValueError: they are damaged, or another house's.
    """
    features = {}
    for name in sorted(names):
        pictures = pictures_of(data, name, picture_kind)
        path = captured_path(data, name, goal_image, encoder, pictures)
        source = digest_at(data, name, goal_image, cache)
        features[name] = load_features(path, encoder=encoder, source=source, pictures=pictures)
    return features

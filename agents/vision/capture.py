"""Pictures that were taken at another time than the agent is there, and their features.

In place recognition these are changes of appearance (hour, weather, lamps), of the scene (people, things) and of the
camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from embodied.agents.vision.bank import FeatureBank
from embodied.agents.vision.config import CaptureCondition
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
from embodied.render.pictures import PictureSettings


def house_at(data: Dataset, name: str, condition: CaptureCondition, cache: Path) -> House:
    """A house of a data set as it is under a condition."""
    place = data.place(name)
    if not condition.day:
        return lightings_of(place.house, condition.lighting + 1)[-1]
    routes = load_lines(data.folder / "houses" / name / "routes.jsonl", Route)
    starts = [r.path[0] for r in routes]
    house = rearranged(place.house, place.graph, load_catalogue(cache), starts, day=condition.day)
    return lightings_of(house, condition.lighting + 1)[-1]


def digest_at(data: Dataset, name: str, condition: CaptureCondition, cache: Path) -> str:
    """The digest of that house, kept in the cache: another day takes a second to make."""
    if not condition.day:
        return house_at(data, name, condition, cache).digest
    code = code_digest("embodied.agents.vision.capture")
    key = digest([data.digest, name, condition.lighting, condition.day, code])
    path = cache / "days" / f"{key[:32]}.json"
    if not path.exists():
        write_json(path, {"house": house_at(data, name, condition, cache).digest})
    return str(read_json(path)["house"])


def captured_path(
    data: Dataset, name: str, condition: CaptureCondition, encoder: str, pictures: PictureSettings
) -> Path:
    """The file with the features of pictures of a house under a condition; `encoder` is a digest."""
    return feature_path(data.folder / "features", encoder, name + condition.name, pictures)


def with_goal_images(
    bank: FeatureBank,
    data: Dataset,
    names: Sequence[str],
    condition: CaptureCondition,
    encoder: str,
    cache: Path,
    picture_kind: str | None = None,
) -> FeatureBank:
    """The bank whose goal images were taken under a condition.

    Raises:
      FileNotFoundError: features are missing.
    """
    if condition == CaptureCondition():
        return bank
    captured = {}
    for name in names:
        pictures = pictures_of(data, name, picture_kind)
        path, source = captured_path(data, name, condition, encoder, pictures), digest_at(data, name, condition, cache)
        captured[name], _ = load_features(path, encoder=encoder, source=source, pictures=pictures)
    return bank.with_goal_images(captured)

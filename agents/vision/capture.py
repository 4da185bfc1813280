"""Pictures that were taken at another time than the agent is there, and their features.

In place recognition these are changes of appearance (hour, weather, lamps), of the scene (people, things), of the
camera, and of the viewpoint's field of view.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from embodied.agents.vision.bank import FeatureBank
from embodied.agents.vision.config import CaptureCondition
from embodied.agents.vision.drawn import pictures_of
from embodied.agents.vision.encoder import Encoder
from embodied.agents.vision.features import EQUIRECT, VIEW_SIZE, encode_panoramas, feature_path, load_features, margin
from embodied.agents.vision.strip import HEIGHT, VFOV, WIDTH
from embodied.assets.cache import digest, write_json
from embodied.assets.catalogue import load_catalogue
from embodied.assets.closure import code_digest
from embodied.assets.json_file import read_json
from embodied.datasets.store import Dataset
from embodied.generate.rearrange import rearranged
from embodied.house.house import House
from embodied.interface import TURNS, VIEWS, Route
from embodied.light import lightings_of
from embodied.records import load_lines
from embodied.render.panorama import Panorama
from embodied.render.photograph import PhotoCamera
from embodied.render.pictures import PictureSettings
from embodied.seeds import stream


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


def photographed(
    encoder: Encoder, panoramas: Iterator[Panorama], condition: CaptureCondition, house: str
) -> np.ndarray:
    """(n, 36, D) float16 features of panoramas as the camera of a condition takes them; of one view, row 12
    holds it and the others are zero."""
    if condition.camera == "ideal" and not condition.view:
        return encode_panoramas(encoder, panoramas)
    camera, out = PhotoCamera(condition.camera, seed=condition.day), []
    for node, panorama in enumerate(panoramas):
        if condition.view:
            yaw = float(stream(0, "occasion", condition.name, house, node).uniform(0, 2 * np.pi))
            picture = camera.photographed(panorama.view_rgb(yaw, 0.0, VFOV, VIEW_SIZE), VFOV, house, node)
            features = np.zeros((VIEWS, encoder.size), np.float32)
            features[TURNS] = encoder.encode_strips(strip_around(picture)[None])[0, TURNS]
        else:
            strip = camera.photographed(panorama.equirect(EQUIRECT), None, house, node)[margin()]
            features = encoder.encode_strips(strip[None])[0]
        out.append(features)
    return np.stack(out).astype(np.float16)


def strip_around(picture: np.ndarray) -> np.ndarray:
    """(192, 576, 3) uint8 with a perspective view (240, 320, 3) in its middle, mirrored over and over where nothing is
    known: encoders of strips see it as they see that part of a panorama."""
    height, width = picture.shape[:2]
    focal, rows, columns = height / 2 / math.tan(VFOV / 2), round(math.degrees(VFOV) * EQUIRECT / 180), 120
    up, left = (np.radians((np.arange(n) - (n - 1) / 2) * 180 / EQUIRECT) for n in (rows, columns))
    x = np.tile(np.tan(left) * focal, (rows, 1)) + (width - 1) / 2
    y = np.tan(up)[:, None] / np.cos(left) * focal + (height - 1) / 2
    sharp = height / rows  # pixels of the picture for one of the strip
    patch = cv2.remap(
        cv2.GaussianBlur(picture, (0, 0), 0.4 * sharp),
        x.astype(np.float32),
        y.astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REFLECT,
    )
    beyond = [((whole - part) // 2,) * 2 for whole, part in zip((HEIGHT, WIDTH), patch.shape)]
    return np.pad(patch, [*beyond, (0, 0)], mode="symmetric")

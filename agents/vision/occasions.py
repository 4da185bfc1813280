"""Pictures that were taken at another time than the agent is there: what they are, and their features.

In place recognition these are changes of appearance (hour, weather, lamps), of the scene (people, things), of the
camera, and of the viewpoint's field of view.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from embodied.agents.vision.bank import FeatureBank
from embodied.agents.vision.drawn import pictures_of
from embodied.agents.vision.encoder import Encoder
from embodied.agents.vision.features import (
    EQUIRECT,
    VIEW_SIZE,
    encode_panoramas,
    feature_path,
    has_features,
    load_features,
    margin,
    save_features,
)
from embodied.agents.vision.strip import HEIGHT, VFOV, WIDTH
from embodied.assets.cache import digest, write_json
from embodied.assets.catalogue import load_catalogue
from embodied.assets.closure import code_digest
from embodied.assets.json_file import read_json
from embodied.datasets.store import Dataset
from embodied.generate.another_day import another_day
from embodied.house.house import House
from embodied.interface import TURNS, VIEWS, Route
from embodied.light import lightings_of
from embodied.records import load_lines
from embodied.render.panorama import Panorama
from embodied.render.photograph import PhotoCamera
from embodied.render.pictures import PictureSettings
from embodied.seeds import stream
from embodied.world import open_world


@dataclass(frozen=True)
class Occasion:
    """How a picture differs from what the agent sees at the same place."""

    lighting: int = 0
    """Which of embodied.light.lightings_of: another hour, weather and lamps; 0 is the house's own."""
    day: int = 0
    """Which day of embodied.generate.another_day: people elsewhere, small things moved; 0 is the agent's own."""
    camera: str = "ideal"
    """What took it, one of embodied.render.photograph.CAMERAS: exposure, balance, lens, noise, JPEG."""
    view: bool = False
    """A single view of 60 degrees along a drawn direction instead of a panorama."""

    @property
    def name(self) -> str:
        """What its features are filed under, after the house."""
        parts = [f"light{self.lighting}" * bool(self.lighting), f"day{self.day}" * bool(self.day)]
        parts += [self.camera * (self.camera != "ideal"), "view" * self.view]
        return "".join(f"+{p}" for p in parts if p)


OCCASIONS: Mapping[str, Occasion] = {
    "same": Occasion(),
    "camera": Occasion(camera="robot"),
    "hour": Occasion(lighting=1),
    "day": Occasion(day=1),
    "day-camera": Occasion(day=1, camera="robot"),
    "day-view": Occasion(day=1, camera="robot", view=True),
    "later": Occasion(lighting=1, day=1),
    "later-camera": Occasion(lighting=1, day=1, camera="robot"),
    "later-view": Occasion(lighting=1, day=1, camera="robot", view=True),
}
"""What --shown may name, from what the agent sees itself to a single view at another hour of another day."""


def house_at(data: Dataset, name: str, occasion: Occasion, cache: Path) -> House:
    """A house of a data set as it is on an occasion."""
    place = data.place(name)
    routes = load_lines(data.folder / "houses" / name / "routes.jsonl", Route)
    starts = [r.path[0] for r in routes]
    house = another_day(place.house, place.graph, load_catalogue(cache), starts, day=occasion.day)
    return lightings_of(house, occasion.lighting + 1)[-1]


def digest_at(data: Dataset, name: str, occasion: Occasion, cache: Path) -> str:
    """The digest of that house, kept in the cache: another day takes a second to make."""
    code = code_digest("embodied.agents.vision.occasions")
    key = digest([data.digest, name, occasion.lighting, occasion.day, code])
    path = cache / "days" / f"{key[:32]}.json"
    if not path.exists():
        write_json(path, {"house": house_at(data, name, occasion, cache).digest})
    return str(read_json(path)["house"])


def make_shown(
    data: Dataset, name: str, occasions: Sequence[Occasion], encoder: Encoder, cache: Path, pictures: PictureSettings
) -> list[Path]:
    """Make the features of pictures of one house on several occasions where they are missing; returns what is new."""
    made = []
    for at in sorted(set(occasions), key=lambda o: (o.lighting, o.day)):
        house, path = house_at(data, name, at, cache), shown_path(data, name, at, encoder.digest, pictures)
        if has_features(path, encoder, house, pictures):
            continue
        with open_world(house, load_catalogue(cache), cache, pictures, graph=data.place(name).graph) as world:
            world.render_all()  # kept: several occasions show the same pictures
            panoramas = (world.panorama(v) for v in range(len(world.graph.positions)))
            save_features(path, photographed(encoder, panoramas, at, name), encoder, house.digest, pictures)
        made.append(path)
    return made


def photographed(encoder: Encoder, panoramas: Iterator[Panorama], occasion: Occasion, house: str) -> np.ndarray:
    """(n, 36, D) float16 features of panoramas as an occasion's camera takes them; of one view, row 12 holds it and
    the others are zero."""
    if occasion.camera == "ideal" and not occasion.view:
        return encode_panoramas(encoder, panoramas)
    camera, out = PhotoCamera(occasion.camera, seed=occasion.day), []
    for node, panorama in enumerate(panoramas):
        if occasion.view:
            yaw = float(stream(0, "occasion", occasion.name, house, node).uniform(0, 2 * np.pi))
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


def shown_path(data: Dataset, name: str, occasion: Occasion, encoder: str, pictures: PictureSettings) -> Path:
    """Where the features of pictures of a house on an occasion are kept."""
    return feature_path(data.folder / "features", encoder, name + occasion.name, pictures)


def showing(
    bank: FeatureBank,
    data: Dataset,
    names: Sequence[str],
    occasion: Occasion,
    encoder: str,
    cache: Path,
    picture_kind: str | None = None,
) -> FeatureBank:
    """The bank whose pictures were taken on an occasion.

    Raises:
      FileNotFoundError: features are missing.
    """
    if occasion == Occasion():
        return bank
    shown = {}
    for name in names:
        pictures = pictures_of(data, name, picture_kind)
        path, source = shown_path(data, name, occasion, encoder, pictures), digest_at(data, name, occasion, cache)
        shown[name], _ = load_features(path, encoder=encoder, source=source, pictures=pictures)
    return bank.showing(shown)

"""Feature extraction: the features of the houses of a data set, made where they are missing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from embodied.agents.common.parallel import use_threads
from embodied.agents.vision.capture import captured_path, digest_at, house_at
from embodied.agents.vision.config import CaptureCondition
from embodied.agents.vision.drawn import drawn_world, pictures_of
from embodied.agents.vision.encoder import Encoder
from embodied.agents.vision.features import EQUIRECT, encode_strips, has_features, margin, save_features
from embodied.datasets.store import Dataset
from embodied.render.photograph import PhotoCamera
from embodied.render.pictures import Traced
from embodied.world import World

AS_SEEN = CaptureCondition()


def features_of(world: World, encoder: Encoder, condition: CaptureCondition = AS_SEEN) -> np.ndarray:
    """(n, 36, D) float16 features of the panoramas of a house, as the camera of `condition` takes them."""
    if isinstance(world.pictures, Traced) or condition != AS_SEEN:
        world.render_all()  # kept: they cost minutes a house, and several conditions show the same
    camera, house = PhotoCamera(condition.camera, seed=condition.day), world.house.name
    seen = (world.panorama(node).equirect(EQUIRECT) for node in range(len(world.graph.positions)))
    photographs = (camera.photographed(picture, None, house, node) for node, picture in enumerate(seen))
    return encode_strips(encoder, (photograph[margin()] for photograph in photographs))


@dataclass(frozen=True)
class Extractor:
    """Extracts the features of one house after the other; small, so that it can be sent to other processes."""

    data: Path
    """Folder of the data set, which keeps the features."""
    encoder: Encoder
    cache: Path
    picture_kind: str | None = None
    """Of the pictures, as embodied.agents.vision.drawn.pictures_of takes it."""
    conditions: tuple[CaptureCondition, ...] = (AS_SEEN,)
    threads: int = 1

    def missing(self, name: str) -> list[CaptureCondition]:
        """The conditions under which a house has no features; those of one day and hour stand together."""
        data = Dataset(self.data)
        pictures = pictures_of(data, name, self.picture_kind)
        return [
            at
            for at in sorted(set(self.conditions), key=lambda c: (c.lighting, c.day))
            if not has_features(
                captured_path(data, name, at, self.encoder.digest, pictures),
                self.encoder,
                digest_at(data, name, at, self.cache),
                pictures,
            )
        ]

    def __call__(self, name: str) -> str:
        """Extract the missing features of a house; returns a line about it."""
        use_threads(self.threads)
        data, conditions = Dataset(self.data), self.missing(name)
        pictures = pictures_of(data, name, self.picture_kind)
        for at in conditions:
            house = house_at(data, name, at, self.cache)
            with drawn_world(data, name, self.cache, pictures, house) as world:
                path = captured_path(data, name, at, self.encoder.digest, pictures)
                save_features(path, features_of(world, self.encoder, at), self.encoder, house.digest, pictures)
        ways = ", ".join(at.name or "as seen" for at in conditions)
        return f"{name}: {ways}; {pictures.word} pictures of {pictures.size} pixels"

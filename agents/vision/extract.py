"""Feature extraction: the features of the houses of a data set, made where they are missing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from embodied.agents.common.parallel import use_threads
from embodied.agents.vision.capture import CAMERAS_OF, captured_path, digest_at, house_at
from embodied.agents.vision.config import SAME_TIME
from embodied.agents.vision.drawn import drawn_world, pictures_of
from embodied.agents.vision.encoder import Encoder
from embodied.agents.vision.features import EQUIRECT, encode_strips, has_features, margin, save_features
from embodied.datasets.store import Dataset
from embodied.render.pictures import Traced
from embodied.world import World


def features_of(world: World, encoder: Encoder, goal_image: str = SAME_TIME) -> np.ndarray:
    """(n, 36, D) float16 features of the panoramas of a house, as the camera of such goal images takes them."""
    if isinstance(world.pictures, Traced) or goal_image != SAME_TIME:
        world.render_all()  # kept: they cost minutes a house
    camera, house = CAMERAS_OF[goal_image], world.house.name
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
    goal_images: tuple[str, ...] = (SAME_TIME,)
    """Some of embodied.agents.vision.config.GOAL_IMAGES."""
    threads: int = 1

    def missing(self, name: str) -> list[str]:
        """The goal images of which a house has no features."""
        data, encoder = Dataset(self.data), self.encoder
        pictures = pictures_of(data, name, self.picture_kind)

        def is_there(goal_image: str) -> bool:
            path = captured_path(data, name, goal_image, encoder.digest, pictures)
            return has_features(path, encoder, digest_at(data, name, goal_image, self.cache), pictures)

        return [goal_image for goal_image in dict.fromkeys(self.goal_images) if not is_there(goal_image)]

    def __call__(self, name: str) -> str:
        """Extract the missing features of a house; returns a line about it."""
        use_threads(self.threads)
        data, missing = Dataset(self.data), self.missing(name)
        pictures = pictures_of(data, name, self.picture_kind)
        for goal_image in missing:
            house = house_at(data, name, goal_image, self.cache)
            with drawn_world(data, name, self.cache, pictures, house) as world:
                path = captured_path(data, name, goal_image, self.encoder.digest, pictures)
                save_features(path, features_of(world, self.encoder, goal_image), self.encoder, house.digest, pictures)
        return f"{name}: {', '.join(missing)}; {pictures.word} pictures of {pictures.size} pixels"

"""The pictures of a data set's houses as encoders look at them: how they are drawn, and strips with labels."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import joblib

from embodied.agents.vision.config import RENDER_PRESETS, drawing
from embodied.agents.vision.labels import HouseStrips, all_classes, look
from embodied.assets.catalogue import load_catalogue
from embodied.datasets.store import Dataset
from embodied.house.house import House
from embodied.render.pictures import PictureSettings
from embodied.world import World, open_world


def pictures_of(data: Dataset, name: str, picture_kind: str | None = None) -> PictureSettings:
    """How the pictures of a house are drawn that features are made from.

    Args:
      picture_kind: one of RENDER_PRESETS; None takes the panoramas that the data set holds, and plain ones where it
        holds none.
    """
    drawn = data.drawn_pictures(name)
    if drawn is None or picture_kind not in (None, drawn.word):
        return RENDER_PRESETS[picture_kind or "unlit"]
    return drawn


def drawings_of(data: Dataset, names: Sequence[str], picture_kind: str | None = None) -> str:
    """How the pictures of some houses are drawn, in words: 'unlit_192', or several of them."""
    return ", ".join(sorted({drawing(pictures_of(data, name, picture_kind)) for name in names}))


def drawn_world(data: Dataset, name: str, cache: Path, pictures: PictureSettings, lit: House | None = None) -> World:
    """A house drawn so: the panoramas that the data set holds, if they are, else new ones, and those are left alone.

    Args:
      lit: the house in another light than its own.
    """
    place, catalogue = data.place(name), load_catalogue(cache)
    if lit in (None, place.house) and pictures == data.drawn_pictures(name):
        return data.open_world(name, catalogue, cache, pictures)
    return open_world(lit or place.house, catalogue, cache, pictures, graph=place.graph)


@dataclass(frozen=True)
class StripSource:
    """The strips of a data set's houses, drawn so, kept in a folder."""

    data: Path
    """Folder of the data set."""
    folder: Path
    cache: Path
    picture_kind: str | None = None
    """As `pictures_of` takes it."""
    lit: int = 0
    """So many training houses are seen in light ('fast')."""
    workers: int = 1
    """Houses drawn side by side."""

    def training_strips(self, names: Sequence[str], note: Callable[[str], None]) -> list[HouseStrips]:
        """The strips of training houses, the first `lit` of them in light."""
        in_light = dataclasses.replace(self, picture_kind="fast")
        return [*in_light.strips(names[: self.lit], note), *self.strips(names[self.lit :], note)]

    def strips(self, names: Sequence[str], note: Callable[[str], None]) -> list[HouseStrips]:
        """The strips of houses, drawn where they are missing."""
        data = Dataset(self.data)
        jobs = (joblib.delayed(self._draw)(n) for n in names if not self._path(data, n).exists())
        for name in joblib.Parallel(n_jobs=self.workers, return_as="generator_unordered")(jobs):
            note(f"drawn: {name}")
        return [HouseStrips.load(self._path(data, n)) for n in names]

    def _path(self, data: Dataset, name: str) -> Path:
        """The file in which the strips of a house are."""
        return self.folder / drawing(pictures_of(data, name, self.picture_kind)) / f"{name}.npz"

    def _draw(self, name: str) -> str:
        data = Dataset(self.data)
        pictures, classes = pictures_of(data, name, self.picture_kind), all_classes(load_catalogue(self.cache))
        with drawn_world(data, name, self.cache, pictures) as world:
            look(world, classes).save(self._path(data, name))
        return name

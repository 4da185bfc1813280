"""The data of NAV: paths of a data set `vln` or `hanna` with their wordings (3.2.4.2, C.1.1; docs/sources.md, S142)."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from embodied.agents.common.more_paths import more_routes
from embodied.agents.common.vocabulary import build_vocabulary
from embodied.agents.common.word_vectors import vocabulary_with
from embodied.agents.iliad.nav.config import NavConfig
from embodied.agents.iliad.nav.student import NavEyes
from embodied.agents.iliad.nav.world import Trip, trips_of
from embodied.agents.vision.config import drawing
from embodied.agents.vision.drawn import pictures_of
from embodied.agents.vision.features import feature_path, load_bank
from embodied.assets.cache import digest
from embodied.datasets.store import Dataset, dataset_of

NAV_SPLITS = {"train": "train", "validation": "val_unseen", "test": "test_unseen"}
"""NAV's splits and the data set's: other houses in each."""


@dataclass(frozen=True, eq=False)
class NavData:
    """All that worlds and teachers are made of."""

    source: Dataset
    eyes: NavEyes
    splits: Mapping[str, Sequence[Trip]]
    """'train': paths with all of their wordings. 'validation' and 'test': paths of other houses; each wording is a trip
    of its own."""
    pictures: str
    """How what is seen was drawn: 'fast_256', 'unlit_192', or several of them."""

    @property
    def digest(self) -> str:
        """Names the content: the data set, its paths, and who looks at which pictures."""
        trips = {part: [(t.world, t.path, t.requests) for t in many] for part, many in self.splits.items()}
        return digest([self.source.digest, trips, self.eyes.bank.digest, self.pictures])


def nav_data(folder: Path, config: NavConfig, encoder: str, picture_kind: str | None, cache: Path) -> NavData:
    """A data set `vln` or `hanna` with features as the data of NAV.

    Args:
      encoder: digest of the encoder that made the features.
      picture_kind: of the pictures, as in embodied.agents.vision.run.pictures_of.
      cache: where catalogue, sightings and more paths are kept.

    Raises:
      FileNotFoundError, ValueError: a data set of another kind, or without such features.
    """
    source = dataset_of(folder, "vln", "hanna")
    houses = {part: source.names(name) for part, name in NAV_SPLITS.items()}
    splits = {part: [t for n in names for t in trips_of(n, source.routes(n))] for part, names in houses.items()}
    for name in houses["train"] if config.more_paths else ():
        more = more_routes(source, name, config.more_paths, seed=config.data_seed, cache=cache)
        splits["train"] += trips_of(name, more)
    for part in ("validation", "test"):
        splits[part] = [dataclasses.replace(trip, requests=(r,)) for trip in splits[part] for r in trip.requests]
    names = tuple(name for many in houses.values() for name in many)
    places = {name: source.place(name) for name in names}
    pictures = {name: pictures_of(source, name, picture_kind) for name in names}
    paths: dict[str, Path] = {n: feature_path(source.folder / "features", encoder, n, pictures[n]) for n in names}
    vocabulary = build_vocabulary(request for trip in splits["train"] for request in trip.requests)
    words = vocabulary_with(vocabulary.words, config.word_vectors)
    eyes = NavEyes(places, load_bank(paths, encoder, places, pictures), words)
    drawn = ", ".join(sorted({drawing(p) for p in pictures.values()}))
    return NavData(source, eyes, splits, drawn)

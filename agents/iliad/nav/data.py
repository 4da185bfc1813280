"""The data of NAV: paths of a data set `vln` or `hanna` with their wordings (3.2.4.2, C.1.1; docs/sources.md, S142)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from embodied.agents.common.more_paths import SaidBy, more_routes
from embodied.agents.common.vocabulary import build_vocabulary
from embodied.agents.common.word_vectors import vocabulary_with
from embodied.agents.iliad.nav.config import NavConfig
from embodied.agents.iliad.nav.student import NavEyes
from embodied.agents.iliad.nav.world import Trip, trips_of
from embodied.agents.vision.config import drawing
from embodied.agents.vision.drawn import pictures_of
from embodied.agents.vision.features import feature_path, load_bank
from embodied.assets.cache import digest
from embodied.datasets.store import Dataset
from embodied.novelty import FAMILIAR
from embodied.tasks.vln import vln_task

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


def nav_data(
    source: Dataset, config: NavConfig, encoder: str, picture_kind: str | None = None, *, cache: Path | None = None
) -> NavData:
    """A data set `vln` or `hanna` with features as the data of NAV.

    Args:
      encoder: digest of the encoder that made the features.
      picture_kind: of the pictures, as in embodied.agents.vision.run.pictures_of.
      cache: where catalogue, sightings and more paths are kept; only they need it.

    Raises:
      FileNotFoundError, ValueError: no features of this encoder, or others.
    """
    novelty = FAMILIAR if config.speakers == FAMILIAR else None
    if cache is None and (config.more_paths or novelty):
        raise ValueError("more_paths and speakers need the cache: people name what can be seen in the houses")
    spoken = SaidBy(novelty, source, cache=cache) if cache and novelty else source
    houses = {part: source.names(name) for part, name in NAV_SPLITS.items()}
    splits = {part: [trip for name in names for trip in house_trips(spoken, name)] for part, names in houses.items()}
    if cache is not None and config.more_paths:
        for name in houses["train"]:
            routes = more_routes(source, name, config.more_paths, seed=config.data_seed, cache=cache, novelty=novelty)
            splits["train"] += trips_of([vln_task(name, route) for route in routes])
    for part in ("validation", "test"):
        splits[part] = [one for trip in splits[part] for one in each_wording(trip)]
    names = tuple(name for many in houses.values() for name in many)
    places = {name: source.place(name) for name in names}
    pictures = {name: pictures_of(source, name, picture_kind) for name in names}
    paths: dict[str, Path] = {n: feature_path(source.folder / "features", encoder, n, pictures[n]) for n in names}
    vocabulary = build_vocabulary(request for trip in splits["train"] for request in trip.requests)
    words = vocabulary_with(vocabulary.words, config.word_vectors)
    eyes = NavEyes(places, load_bank(paths, encoder, places, pictures), words)
    drawn = ", ".join(sorted({drawing(p) for p in pictures.values()}))
    return NavData(source, eyes, splits, drawn)


def house_trips(source: Dataset, name: str) -> list[Trip]:
    """The paths of a house with all of their wordings."""
    return trips_of([vln_task(name, route) for route in source.routes(name)])


def each_wording(trip: Trip) -> list[Trip]:
    """Each wording of a trip as a trip of its own, as validation and test have them."""
    return [Trip(trip.world, trip.start, trip.path, (request,)) for request in trip.requests]

"""The data of NAV: paths of a data set `vln` or `hanna` with their wordings (3.2.4.2, C.1.1; docs/sources.md, S142)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from embodied.agents.iliad.nav.student import NavEyes
from embodied.agents.iliad.nav.world import Trip
from embodied.assets.cache import digest
from embodied.datasets.store import Dataset

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

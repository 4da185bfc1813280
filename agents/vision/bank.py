"""FeatureBank: features of many worlds in one tensor, by Sight, and of pictures that were taken at another time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import torch

from embodied.gym.semantic_features import SightRows
from embodied.interface import VIEWS, Sight, Viewpoint, is_picture, viewpoint


class FeatureBank:
    """A FeatureSource over (36, D) feature sets that are already computed, as one tensor on a device."""

    def __init__(
        self, worlds: Mapping[str, np.ndarray], digest: str, live: Callable[[Sight], np.ndarray] | None = None
    ) -> None:
        """Args:
          worlds: world name -> (nodes, 36, D) features, float16 or float32.
          digest: of the encoder that agents must have learned from to be shown them.
          live: makes those (36, D) of a house with other doors closed, when they are first asked for.

        Raises:
          ValueError: another shape, or no world.
        """
        self._rows = SightRows(worlds)
        self._table = torch.from_numpy(self._rows.filled(worlds))
        self._shown: int | None = None
        self._live, self._other_doors = live, dict[Viewpoint, int]()
        self.size, self.digest = self._rows.size, digest

    def to(self, device: torch.device | str) -> FeatureBank:
        """The bank on another device; this one stays."""
        return self._with(_table=self._table.to(device))

    def with_goal_images(self, pictures: Mapping[str, np.ndarray]) -> FeatureBank:
        """The bank with other features for pictures (embodied.interface.is_picture): of the same worlds, taken at
        another time."""
        if SightRows(pictures).spans != self._rows.spans or SightRows(pictures).size != self._rows.size:
            raise ValueError("pictures must be of the same worlds, with as many nodes and features")
        table = torch.from_numpy(self._rows.filled(pictures)).to(self._table.device)
        return self._with(_table=torch.cat([self._table, table]), _shown=len(self._table))

    def blind(self) -> FeatureBank:
        """The bank in which everything is black: all features are zero."""
        nothing = np.zeros((VIEWS, self.size), np.float32)
        return self._with(_table=torch.zeros_like(self._table), _live=lambda sight: nothing, _other_doors={})

    def features(self, sight: Sight) -> np.ndarray:
        """(36, D) float32, in absolute order."""
        return self._table[self._row(sight)].cpu().numpy()

    def gather(self, sights: Sequence[Sight | None]) -> torch.Tensor:
        """(n, 36, D) features of several sights, zeros for None."""
        rows = torch.tensor([0 if s is None else self._row(s) for s in sights], device=self._table.device)
        known = torch.tensor([s is not None for s in sights], device=self._table.device)
        return self._table[rows] * known[:, None, None]

    def _with(self, **changed: object) -> FeatureBank:
        other = object.__new__(FeatureBank)
        other.__dict__.update(self.__dict__, **changed)
        return other

    def _row(self, sight: Sight) -> int:
        at = viewpoint(sight)
        if at.world not in self._rows.spans and self._live is not None:
            if at not in self._other_doors:
                self._other_doors[at] = len(self._table)
                made = torch.from_numpy(self._live(sight)).to(self._table)
                self._table = torch.cat([self._table, made[None]])
            return self._other_doors[at]
        row = self._rows.row(sight)
        if self._shown is not None and is_picture(sight):
            return row + self._shown
        return row

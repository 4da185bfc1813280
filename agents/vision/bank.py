"""FeatureBank: features of many worlds in one tensor, by Sight, and of pictures that were taken at another time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch

from embodied.gym.semantic_features import SightRows
from embodied.interface import Sight, is_picture


class FeatureBank:
    """A FeatureSource over (36, D) feature sets that are already computed, as one tensor on a device."""

    def __init__(self, worlds: Mapping[str, np.ndarray], digest: str) -> None:
        """Args:
          worlds: world name -> (nodes, 36, D) features, float16 or float32.
          digest: of the encoder that agents must have learned from to be shown them.

        Raises:
          ValueError: another shape, or no world.
        """
        self._rows = SightRows(worlds)
        self._table = torch.from_numpy(self._rows.filled(worlds))
        self._shown: int | None = None
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
        return self._with(_table=torch.zeros_like(self._table))

    def features(self, sight: Sight) -> np.ndarray:
        """(36, D) float32, in absolute order."""
        return self._table[self._row(sight)].cpu().numpy()

    def gather(self, sights: Sequence[Sight | None]) -> torch.Tensor:
        """(n, 36, D) features of several sights, zeros for None."""
        rows = torch.tensor([0 if s is None else self._row(s) for s in sights], device=self._table.device)
        known = torch.tensor([s is not None for s in sights], device=self._table.device)
        return self._table[rows] * known[:, None, None]

    def look(self, sights: Sequence[Sight], views: Sequence[int]) -> torch.Tensor:
        """(n, D) features of one view of each sight."""
        rows = torch.tensor([self._row(s) for s in sights], device=self._table.device)
        return self._table[rows, torch.tensor(views, device=self._table.device)]

    def _with(self, **changed: object) -> FeatureBank:
        other = object.__new__(FeatureBank)
        other.__dict__.update(self.__dict__, **changed)
        return other

    def _row(self, sight: Sight) -> int:
        row = self._rows.row(sight)
        if self._shown is not None and is_picture(sight):
            return row + self._shown
        return row

"""FeatureBank: the features of many worlds in one tensor, looked up by Sight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch

from embodied.gym.semantic_features import SightRows
from embodied.interface import Sight


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
        self.size, self.digest = self._rows.size, digest

    def to(self, device: torch.device | str) -> FeatureBank:
        """The bank on another device; this one stays."""
        other = object.__new__(FeatureBank)
        other.__dict__.update(self.__dict__, _table=self._table.to(device))
        return other

    def features(self, sight: Sight) -> np.ndarray:
        """(36, D) float32, in absolute order."""
        return self._table[self._rows.row(sight)].cpu().numpy()

    def gather(self, sights: Sequence[Sight | None]) -> torch.Tensor:
        """(n, 36, D) features of several sights, zeros for None."""
        rows = torch.tensor([0 if s is None else self._rows.row(s) for s in sights], device=self._table.device)
        known = torch.tensor([s is not None for s in sights], device=self._table.device)
        return self._table[rows] * known[:, None, None]

    def look(self, sights: Sequence[Sight], views: Sequence[int]) -> torch.Tensor:
        """(n, D) features of one view of each sight."""
        rows = torch.tensor([self._rows.row(s) for s in sights], device=self._table.device)
        return self._table[rows, torch.tensor(views, device=self._table.device)]

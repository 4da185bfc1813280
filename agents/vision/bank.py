"""FeatureBank: the features of many worlds in one tensor, looked up by Sight; of every lighting that a world is seen
in, and of pictures that were taken at another time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch

from embodied.gym.semantic_features import SightRows
from embodied.interface import Sight, is_picture, viewpoint


class FeatureBank:
    """A FeatureSource over (36, D) feature sets that are already computed, as one tensor on a device."""

    def __init__(
        self, worlds: Mapping[str, np.ndarray], digest: str, others: Sequence[Mapping[str, np.ndarray]] = ()
    ) -> None:
        """Args:
          worlds: world name -> (nodes, 36, D) features, float16 or float32.
          digest: of the encoder that agents must have learned from to be shown them.
          others: the same worlds in other lightings, shown only by what `relit` returns.

        Raises:
          ValueError: another shape, or no world.
        """
        self._rows = SightRows(worlds)
        for other in others:
            if SightRows(other).spans != self._rows.spans or SightRows(other).size != self._rows.size:
                raise ValueError("every lighting must show the same worlds with as many nodes and features")
        self._table = torch.from_numpy(np.concatenate([self._rows.filled(w) for w in (worlds, *others)]))
        self._lighting = dict.fromkeys(self._rows.spans, 0)
        self.lightings = 1 + len(others)
        self._shown: int | None = None
        self.size, self.digest = self._rows.size, digest

    def to(self, device: torch.device | str) -> FeatureBank:
        """The bank on another device; this one stays."""
        return self._with(_table=self._table.to(device))

    def relit(self, rng: np.random.Generator) -> FeatureBank:
        """The bank that shows every world in one of its lightings, drawn evenly; this one goes on as it is."""
        drawn = rng.integers(self.lightings, size=len(self._rows.spans)).tolist()
        return self._with(_lighting=dict(zip(self._rows.spans, drawn, strict=True)))

    def showing(self, pictures: Mapping[str, np.ndarray]) -> FeatureBank:
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
        return row + self._rows.count * self._lighting[viewpoint(sight).world]

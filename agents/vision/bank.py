"""FeatureBank: the features of many worlds in one tensor, looked up by Sight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch

from embodied.interface import VIEWS, Sight


class FeatureBank:
    """A FeatureSource over (36, D) feature sets that are already computed.

    It is allowed to look inside a Sight; policies are not.
    """

    def __init__(self, worlds: Mapping[str, np.ndarray], digest: str) -> None:
        """Args:
        worlds: world name -> (nodes, 36, D) features, float16 or float32.
        digest: names the encoder that made them.
        """
        sizes = {name: array.shape[1:] for name, array in worlds.items()}
        if not worlds or any(len(s) != 2 or s[0] != VIEWS for s in sizes.values()) or len(set(sizes.values())) != 1:
            raise ValueError(f"features must all be (nodes, {VIEWS}, D) with one D, got {dict(sorted(sizes.items()))}")
        self.digest = digest
        self.size = next(iter(sizes.values()))[1]
        self._first, at = {}, 0
        for name in sorted(worlds):
            self._first[name] = (at, at + len(worlds[name]))
            at += len(worlds[name])
        self._table = torch.zeros(at, VIEWS, self.size)
        for name, (a, b) in self._first.items():
            self._table[a:b] = torch.from_numpy(np.asarray(worlds[name], dtype=np.float32))

    def to(self, device: torch.device | str) -> FeatureBank:
        """The bank on another device; this one stays."""
        other = object.__new__(FeatureBank)
        other.__dict__.update(self.__dict__, _table=self._table.to(device))
        return other

    def row(self, sight: Sight) -> int:
        """Row of a sight in the table."""
        span = self._first.get(sight._world)
        if span is None or not 0 <= sight._node < span[1] - span[0]:
            raise KeyError(
                f"no features of node {sight._node} of world {sight._world!r}; make them with `embodied features`"
            )
        return span[0] + sight._node

    def features(self, sight: Sight) -> np.ndarray:
        """(36, D) float32, in absolute order."""
        return self._table[self.row(sight)].cpu().numpy()

    def gather(self, sights: Sequence[Sight | None]) -> torch.Tensor:
        """(n, 36, D) features of several sights, zeros for None."""
        rows = torch.tensor([0 if s is None else self.row(s) for s in sights], device=self._table.device)
        known = torch.tensor([s is not None for s in sights], device=self._table.device)
        return self._table[rows] * known[:, None, None]

"""What a study cost: seconds of processor time of its agents, over all sessions."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from assets.cache import write_json
from embodied.records import read_json


class ProcessorTime:
    """Seconds of processor time that a study's agents took to train, and to judge, the latter kept in its folder."""

    def __init__(self, folder: Path) -> None:
        self._path, self._training = folder / "judging_seconds.json", dict[str, float]()
        self._judging: dict[str, float] = read_json(self._path) if self._path.exists() else {}

    def trained(self, variant: str, seconds: float) -> None:
        """Count one more training seed of a variant; NaN where nobody counted."""
        self._training[variant] = self._training.get(variant, 0.0) + seconds

    def judged(self, where: tuple[str, str, int], seconds: float) -> None:
        """Count what it took to judge (variant, split, training seed); what was played before costs nothing to read,
        so that the most that it ever took is kept."""
        key = ", ".join(map(str, where))
        self._judging[key] = max(seconds, self._judging.get(key, 0.0))
        write_json(self._path, self._judging, indent=1)

    def of(self, variants: Iterable[str], plays: Iterable[tuple[str, str, int]]) -> tuple[float, float]:
        """Hours to train and to judge."""
        judging = math.fsum(self._judging[", ".join(map(str, where))] for where in plays)
        return math.fsum(self._training[v] for v in variants) / 3600, judging / 3600

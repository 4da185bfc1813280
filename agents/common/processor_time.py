"""What a study cost: processor time, over all sessions."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from assets.cache import write_json
from embodied.records import read_json


class ProcessorTime:
    """Seconds of processor time that a study's agents took to train, and to judge; the latter are kept in a file."""

    def __init__(self, path: Path) -> None:
        self._path, self._training = path, dict[str, list[float | None]]()
        self._judging: dict[str, float] = read_json(path) if path.exists() else {}

    def trained(self, variant: str, seconds: float | None) -> None:
        """Count one more agent of a variant; None where nobody counted."""
        self._training.setdefault(variant, []).append(seconds)

    def judged(self, seconds: dict[str, float]) -> None:
        """Count what it took to play, by what was played. What was played before costs nothing to read, so the most
        that it ever took is kept."""
        self._judging |= {what: max(took, self._judging.get(what, 0.0)) for what, took in seconds.items()}
        write_json(self._path, self._judging, indent=1)

    def hours(self, variants: Iterable[str], played: Iterable[str]) -> tuple[float, float] | None:
        """To train and to judge; None if somebody did not count."""
        training = [seconds for v in variants for seconds in self._training[v]]
        if None in training:
            return None
        return math.fsum(s for s in training if s) / 3600, math.fsum(self._judging[what] for what in played) / 3600

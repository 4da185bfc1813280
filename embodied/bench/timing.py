"""Timing a thing several times and saying what came out."""

from __future__ import annotations

import contextlib
import os
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from embodied.threads import processors


@dataclass(frozen=True)
class Measure:
    """One line of a benchmark table."""

    name: str
    value: float
    """Median over the repeats."""
    unit: str
    """'ms', 's', '1/s', 'MiB', 'x' (so many times as fast) or 'share' (of another time)."""
    low: float
    high: float
    """10th and 90th percentile."""
    repeats: int
    aim: float | None = None
    """The project's promise; None where it promises nothing."""

    @property
    def met(self) -> bool | None:
        """The aim is met: rates and ratios must reach it, the rest must stay below."""
        if self.aim is None:
            return None
        return self.value >= self.aim if self.unit in ("1/s", "x") else self.value <= self.aim


@dataclass(frozen=True)
class Report:
    """A benchmark's result that is no list of measures."""

    facts: dict
    text: str
    """Markdown."""


def measure(
    name: str,
    body: Callable[[], object],
    unit: str = "ms",
    *,
    repeats: int = 9,
    warm: int = 1,
    per: int = 1,
    aim: float | None = None,
    clock: Callable[[], float] = time.perf_counter,
) -> Measure:
    """Time `body` `repeats` times after `warm` untimed calls.

    Args:
      per: how many things one call does; times are given per thing, rates per second.
      clock: time.process_time counts the processor time of all threads: what one core alone would take.
    """
    for _ in range(warm):
        body()
    seconds = []
    for _ in range(repeats):
        start = clock()
        body()
        seconds.append((clock() - start) / per)
    scale = {"ms": 1e3, "s": 1.0}
    values = [1.0 / s for s in seconds] if unit == "1/s" else [s * scale[unit] for s in seconds]
    return from_values(name, values, unit, aim=aim)


@contextlib.contextmanager
def one_core() -> Iterator[None]:
    """OpenCV keeps to one core inside."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)


def from_values(name: str, values: Sequence[float], unit: str, *, aim: float | None = None) -> Measure:
    """A line from values that were measured already."""
    low, middle, high = np.quantile(values, [0.1, 0.5, 0.9])
    return Measure(name, float(middle), unit, float(low), float(high), len(values), aim)


def share(name: str, part: Measure, whole: Measure, unit: str = "share", *, aim: float | None = None) -> Measure:
    """`part` over `whole`, both from one run: of times, the share of the first; of rates, that of the second's time.
    In 'x', how many times as fast: of times, the second; of rates, the first."""
    repeats = min(part.repeats, whole.repeats)
    return Measure(name, part.value / whole.value, unit, part.low / whole.high, part.high / whole.low, repeats, aim)


def machine() -> dict[str, object]:
    """Facts about the machine that the numbers were made on."""
    return {
        "cores": processors(),
        "machine": platform.machine(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "load": [round(x, 2) for x in os.getloadavg()],
    }


def table(measures: Sequence[Measure]) -> str:
    """The measures as a Markdown table."""
    lines = ["| measured | median | 10-90 % | n | aim |", "|---|---|---|---|---|"]
    for m in measures:
        aim = (
            ""
            if m.aim is None
            else f"{'>=' if m.unit in ('1/s', 'x') else '<='} {m.aim:g} {'met' if m.met else 'MISSED'}"
        )
        lines.append(f"| {m.name} | {m.value:.4g} {m.unit} | {m.low:.4g}-{m.high:.4g} | {m.repeats} | {aim} |")
    return "\n".join(lines)

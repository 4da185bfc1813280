"""Timing a thing several times and saying what came out."""

import contextlib
import os
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from embodied.software import processors


@dataclass(frozen=True)
class Measure:
    """One line of a benchmark table."""

    name: str
    value: float
    """Median over the repeats."""
    unit: str
    """'ms', 's', '1/s' or 'share' (of another time)."""
    low: float
    high: float
    """10th and 90th percentile."""
    repeats: int


def measure(
    name: str,
    body: Callable[[], object],
    unit: str = "ms",
    *,
    repeats: int = 9,
    warm: int = 1,
    per: int = 1,
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
    return from_values(name, values, unit)


@contextlib.contextmanager
def one_core() -> Iterator[None]:
    """OpenCV keeps to one core inside."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)


def from_values(name: str, values: Sequence[float], unit: str) -> Measure:
    """A line from values that were measured already."""
    low, middle, high = np.quantile(values, [0.1, 0.5, 0.9])
    return Measure(name, float(middle), unit, float(low), float(high), len(values))


def machine() -> dict[str, object]:
    """Facts about the machine that the numbers were made on."""
    system = {"machine": platform.machine(), "system": platform.platform(), "python": platform.python_version()}
    return {"cores": processors(), **system, "load": [round(x, 2) for x in os.getloadavg()]}


def table(measures: Sequence[Measure]) -> str:
    """The measures as a Markdown table."""
    lines = ["| measured | median | 10-90 % | n |", "|---|---|---|---|"]
    for m in measures:
        lines.append(f"| {m.name} | {m.value:.4g} {m.unit} | {m.low:.4g}-{m.high:.4g} | {m.repeats} |")
    return "\n".join(lines)

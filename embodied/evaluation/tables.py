"""Tables of agents over episodes, with 95 % confidence intervals, as Markdown, CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.stats
from scipy.special import stdtrit

from assets.cache import write_bytes
from embodied.evaluation import metrics
from embodied.interface import Episode

if TYPE_CHECKING:
    from embodied.navigation.graph import NavGraph

PERCENT = (
    "success",
    "spl",
    "oracle success",
    "room success",
    "subtask success",
    "weighted success",
    "success progress",
    "mistake repeat",
    "request repeat",
    "target success (HANNA)",
    "room success (VNLA)",
    "success (R2R)",
    "oracle success (R2R)",
)
"""Columns shown in per cent."""


@dataclass(frozen=True)
class Estimate:
    mean: float
    half: float
    """Half the width of the 95 % confidence interval."""
    n: int
    """Episodes that count."""


@dataclass(frozen=True)
class Row:
    """One agent on one split."""

    agent: str
    split: str
    seed: int
    episodes: int
    houses: int
    values: Mapping[str, Estimate]


def estimate(values: Sequence[float], groups: Sequence[str], repeats: Sequence[int] | None = None) -> Estimate:
    """Mean with a 95 % interval by Student's t, whose standard error is clustered by house.

    The t of k houses has k - 1 degrees of freedom (2.09 for 20 houses, 3.18 for 4): the standard
    error is itself estimated from so many independent values (Cameron and Miller 2015, section VI).
    Episodes of one house share its rooms and its routes, so they are not independent; with a
    single house the interval treats them as if they were. NaN values do not count.

    Args:
      repeats: the training seed behind each value. Where there are several, values of one seed are not independent
        either: the variances of both clusterings are added and that of their crossing subtracted (Cameron, Gelbach
        and Miller 2011), never below the larger of the two; degrees of freedom by Satterthwaite.
    """
    seeds = repeats if repeats is not None else [0] * len(groups)
    kept = [(v, g, r) for v, g, r in zip(values, groups, seeds, strict=True) if not math.isnan(v)]
    n = len(kept)
    if n == 0:
        return Estimate(float("nan"), float("nan"), 0)
    mean = math.fsum(v for v, _, _ in kept) / n
    alone = len(set(groups)) == 1
    houses = [str(i) if alone else g for i, (_, g, _) in enumerate(kept)]
    off = [v - mean for v, _, _ in kept]
    by_house, k = _clustered(off, houses)
    if len(set(seeds)) == 1:
        return Estimate(mean, _t(k - 1) * math.sqrt(by_house), n)
    by_seed, m = _clustered(off, [str(r) for _, _, r in kept])
    crossed, _ = _clustered(off, [f"{h} {r}" for h, (_, _, r) in zip(houses, kept, strict=True)])
    variance = max(by_house + by_seed - crossed, by_house, by_seed)
    parts = by_house**2 / max(k - 1, 1) + by_seed**2 / max(m - 1, 1)
    freedom = (by_house + by_seed) ** 2 / parts if parts else 1.0
    return Estimate(mean, _t(freedom) * math.sqrt(variance), n)


def _clustered(off: Sequence[float], clusters: Sequence[str]) -> tuple[float, int]:
    """The variance of a mean from which values are `off`, and how many clusters there are."""
    sums: dict[str, float] = {}
    for value, cluster in zip(off, clusters, strict=True):
        sums[cluster] = sums.get(cluster, 0.0) + value
    k = len(sums)
    return math.fsum(s * s for s in sums.values()) / len(off) ** 2 * (k / (k - 1) if k > 1 else 0.0), k


def _t(freedom: float) -> float:
    return float(stdtrit(freedom, 0.975)) if freedom > 0 else 0.0


def difference(
    first: Sequence[Episode], second: Sequence[Episode], name: str, graphs: Mapping[str, NavGraph]
) -> Estimate:
    """How far the metric `name` of `first` lies above that of `second`, task by task, clustered by house and seed.

    Args:
      first, second: the same tasks as often, by agents that were trained from as many seeds: each seed's episodes
        follow each other.

    Raises:
      ValueError: the tasks are not the same.
    """
    if [e.task.id for e in first] != [e.task.id for e in second]:
        raise ValueError("only agents that were given the same tasks in the same order can be compared task by task")
    metric = {**metrics.PER_EPISODE, **metrics.PER_KIND.get(first[0].task.kind, {})}[name]
    off = [
        metric(a, graphs[a.task.world]) - metric(b, graphs[b.task.world]) for a, b in zip(first, second, strict=True)
    ]
    return estimate(off, [e.task.world for e in first], repeats_of(first))


def repeats_of(episodes: Sequence[Episode]) -> list[int]:
    """Which pass over the tasks each episode belongs to: a task that comes again begins another seed's."""
    seen: dict[str, int] = {}
    out = []
    for e in episodes:
        out.append(seen.get(e.task.id, 0))
        seen[e.task.id] = out[-1] + 1
    return out


def across_seeds(values: Sequence[float]) -> Estimate:
    """Mean over repeats with Student's 95 % interval; NaN half width for a single one."""
    n = len(values)
    half = math.nan if n < 2 else float(scipy.stats.t.ppf(0.975, n - 1) * np.std(values, ddof=1) / math.sqrt(n))
    return Estimate(float(np.mean(values)), half, n)


def ratio(
    pairs: Sequence[tuple[float, float]], groups: Sequence[str], repeats: Sequence[int] | None = None
) -> Estimate:
    """Sum of firsts over sum of seconds (the repeat rates of Table 4.6), clustered likewise."""
    total = sum(b for _, b in pairs)
    if total == 0:
        return Estimate(float("nan"), float("nan"), 0)
    mean = sum(a for a, _ in pairs) / total
    scale = len(pairs) / total
    residuals = estimate([(a - mean * b) * scale for a, b in pairs], groups, repeats)
    return Estimate(mean, residuals.half, round(total))


def row(agent: str, split: str, episodes: Sequence[Episode], graphs: Mapping[str, NavGraph], *, seed: int) -> Row:
    """Every metric of the kind of task and the repeat rates, over the episodes of one agent.

    Args:
      episodes: those of several training seeds follow each other, over the same tasks.

    Raises:
      ValueError: no episodes.
    """
    if not episodes:
        raise ValueError(f"{agent!r} played no episodes of {split!r}; a table needs at least one")
    groups, passes = [e.task.world for e in episodes], repeats_of(episodes)
    values = {
        name: estimate([f(e, graphs[e.task.world]) for e in episodes], groups, passes)
        for name, f in {**metrics.PER_EPISODE, **metrics.PER_KIND.get(episodes[0].task.kind, {})}.items()
    }
    if episodes[0].task.kind == "ask":
        pairs = [(metrics.price(e, graphs[e.task.world]), metrics.success(e, graphs[e.task.world])) for e in episodes]
        values["price per success"] = ratio(pairs, groups, passes)
    used = [metrics.usage(e) for e in episodes]
    if any(used):
        for name, count in metrics.USAGE.items():
            values[name] = estimate([count(u) if u else 0.0 for u in used], groups, passes)
    repeats = {"mistake repeat": metrics.mistake_repeats, "request repeat": metrics.request_repeats}
    if episodes[0].task.kind == "vnla":  # where turning on the spot is no mistake
        del repeats["mistake repeat"]
    for name, f in repeats.items():
        values[name] = ratio([f(e, graphs[e.task.world]) for e in episodes], groups, passes)
    return Row(agent, split, seed, len(episodes), len(set(groups)), values)


def shown(name: str, value: Estimate) -> str:
    """'45.4 ± 1.2', in per cent where the column is one; '–' where nothing counts."""
    if value.n == 0 or math.isnan(value.mean):
        return "–"
    k = 100.0 if name in PERCENT else 1.0
    digits = 1 if name in PERCENT else 2
    return f"{k * value.mean:.{digits}f} ± {k * value.half:.{digits}f}"


def heading(name: str) -> str:
    return f"{name} (%)" if name in PERCENT else name


def markdown(rows: Sequence[Row], columns: Sequence[str] | None = None) -> str:
    """One line per row, with the episode and house counts and the seed."""
    columns = list(columns or dict.fromkeys(name for r in rows for name in r.values))
    nothing = Estimate(math.nan, math.nan, 0)
    head = ["agent", "split", *(heading(c) for c in columns), "episodes", "houses", "seed"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for r in rows:
        cells = [r.agent, r.split, *(shown(c, r.values.get(c, nothing)) for c in columns), r.episodes, r.houses, r.seed]
        lines.append("| " + " | ".join(str(c) for c in cells) + " |")
    return "\n".join(lines) + "\n"


def as_csv(rows: Sequence[Row]) -> str:
    """Long form: one line per row and metric."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["agent", "split", "seed", "episodes", "houses", "metric", "mean", "half_width_95", "n"])
    for r in rows:
        for name, v in r.values.items():
            writer.writerow(
                [r.agent, r.split, r.seed, r.episodes, r.houses, name, _number(v.mean), _number(v.half), v.n]
            )
    return out.getvalue()


def as_json(rows: Sequence[Row]) -> str:
    body = [
        {
            "agent": r.agent,
            "split": r.split,
            "seed": r.seed,
            "episodes": r.episodes,
            "houses": r.houses,
            "values": {
                k: {"mean": _number(v.mean), "half_width_95": _number(v.half), "n": v.n} for k, v in r.values.items()
            },
        }
        for r in rows
    ]
    return json.dumps(body, indent=1) + "\n"


def _number(x: float) -> float | None:
    return None if math.isnan(x) else float(np.round(x, 9))


def save(rows: Sequence[Row], folder: Path, name: str) -> tuple[Path, ...]:
    """Write name.md, name.csv and name.json into `folder`."""
    folder = Path(folder)
    paths = tuple(folder / f"{name}{suffix}" for suffix in (".md", ".csv", ".json"))
    for path, text in zip(paths, (markdown(rows), as_csv(rows), as_json(rows)), strict=True):
        write_bytes(path, text.encode())
    return paths

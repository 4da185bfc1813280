"""Tables of agents over episodes, with 95 % confidence intervals, as Markdown and JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from embodied.assets.cache import write_bytes
from embodied.interface import Episode
from embodied.kinds import metrics
from embodied.kinds.task_kind import KINDS, kind_named

if TYPE_CHECKING:
    from embodied.navigation.graph import NavGraph

PERCENT = (
    *("success", "strict success", "spl", "oracle success", "mistake repeat", "request repeat"),
    *("target success (HANNA)", "room success (VNLA)", "success (R2R)", "oracle success (R2R)"),
    *("right place first", "precision", "recall", "question precision", "blockers cleared", "ask F1"),
)
"""Columns of all kinds and of learners shown in per cent; those of one kind of task say so (Metric)."""
SHARES = ("success", "strict success", "oracle success")
"""Those that are 0 or 1 of an episode."""


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


@dataclass(frozen=True)
class Samples:
    """Numbers to be averaged, one per episode, sentence or run."""

    values: tuple[float, ...]
    groups: tuple[str, ...] = ()
    """Groups of the values, such as houses; values of one group are not independent. (): each stands alone."""
    weights: tuple[float, ...] = ()
    """Number that each value is out of; the mean is then the ratio of both sums. (): out of one."""
    share: bool = False
    """Each value is 0 or 1."""


def interval(runs: Sequence[Samples]) -> Estimate:
    """The estimate of what was counted in one run per training seed; see `estimate`."""
    each = [(v, g, w, k) for k, run in enumerate(runs) for v, g, w in _rows(run)]
    if not each:
        return Estimate(math.nan, math.nan, 0)
    values, groups, weights, repeats = zip(*each, strict=True)
    ratio = weights if any(run.weights for run in runs) else None
    return estimate(values, groups, repeats, weights=ratio, share=all(run.share for run in runs))


def less(first: Samples, second: Samples) -> Samples:
    """How far `first` lies above `second`, value by value, which stand for the same tasks in the same order.

    Raises:
      ValueError: they do not.
    """
    if first.groups != second.groups or len(first.values) != len(second.values):
        raise ValueError("only agents that were given the same tasks in the same order can be compared task by task")
    pairs = zip(_linear(first), _linear(second), strict=True)
    return Samples(tuple(a - b for a, b in pairs), first.groups)


def _linear(run: Samples) -> tuple[float, ...]:
    """The values; of a ratio what varies about as it does, with its mean (the delta method)."""
    total = math.fsum(run.weights)
    if not run.weights:
        return run.values
    if not total:
        return (math.nan,) * len(run.values)
    ratio, scale = math.fsum(run.values) / total, len(run.values) / total
    return tuple(ratio + (v - ratio * w) * scale for v, w in zip(run.values, run.weights, strict=True))


def _rows(run: Samples) -> list[tuple[float, str, float]]:
    n = len(run.values)
    return [*zip(run.values, run.groups or map(str, range(n)), run.weights or (1.0,) * n, strict=True)]


def estimate(
    values: Sequence[float],
    groups: Sequence[str],
    repeats: Sequence[int] | None = None,
    *,
    weights: Sequence[float] | None = None,
    share: bool = False,
) -> Estimate:
    """Mean with a 95 % interval by Student's t: tasks nested in houses, crossed with training seeds.

    Episodes of one house share its rooms and its routes, so they are not independent: the standard error is clustered
    by house, and the t of k houses has k - 1 degrees of freedom (2.09 for 20 houses, 3.18 for 4), since it is itself
    estimated from so many independent values (Cameron and Miller 2015, section VI). With a single house the interval
    treats episodes as if they were independent. Episodes of one training seed are not independent either: the variances
    of both clusterings are added and that of their crossing subtracted (Cameron, Gelbach and Miller 2011), never below
    the larger of the two; degrees of freedom by Satterthwaite. Where each house (or value) has one seed alone, the
    seeds are the clusters. NaN values do not count; of a single value there is no interval.

    Args:
      repeats: the training seed behind each value.
      weights: what each value is out of; the mean is then the ratio of both sums (Table 4.6).
      share: values are 0 or 1. Where all are alike, such as 40 of 40, the interval reaches to the exact bound of
        Clopper and Pearson (1934), 91.2 %, each task counted once however many seeds were judged on it.
    """
    seeds = repeats if repeats is not None else [0] * len(groups)
    outs = weights if weights is not None else [1.0] * len(groups)
    kept = [(v, g, r, w) for v, g, r, w in zip(values, groups, seeds, outs, strict=True) if not math.isnan(v)]
    total = math.fsum(w for *_, w in kept)
    if not total:
        return Estimate(math.nan, math.nan, 0)
    n, mean = len(kept), math.fsum(v for v, *_ in kept) / total
    count = round(total) if weights is not None else n
    alone = len({g for _, g, *_ in kept}) == 1
    houses = [str(i) if alone else g for i, (_, g, *_) in enumerate(kept)]
    off = [(v - mean * w) * n / total for v, _, _, w in kept]
    runs = [str(r) for _, _, r, _ in kept]
    if share and mean in (0.0, 1.0):
        return Estimate(mean, 1 - 0.025 ** (len(set(runs)) / n), count)
    if n == 1:
        return Estimate(mean, math.nan, count)
    by_house, k = _clustered(off, houses)
    if len(set(runs)) == 1:
        return Estimate(mean, _t(k - 1) * math.sqrt(by_house), count)
    by_seed, m = _clustered(off, runs)
    crossed, cells = _clustered(off, [f"{h} {r}" for h, r in zip(houses, runs, strict=True)])
    if cells == k:  # no house was seen by two seeds
        return Estimate(mean, _t(m - 1) * math.sqrt(by_seed), count)
    variance = max(by_house + by_seed - crossed, by_house, by_seed)
    parts = by_house**2 / max(k - 1, 1) + by_seed**2 / max(m - 1, 1)
    freedom = (by_house + by_seed) ** 2 / parts if parts else 1.0
    return Estimate(mean, _t(freedom) * math.sqrt(variance), count)


def _clustered(off: Sequence[float], clusters: Sequence[str]) -> tuple[float, int]:
    """The variance of a mean from which values are `off`, and how many clusters there are."""
    sums: dict[str, float] = {}
    for value, cluster in zip(off, clusters, strict=True):
        sums[cluster] = sums.get(cluster, 0.0) + value
    k = len(sums)
    return math.fsum(s * s for s in sums.values()) / len(off) ** 2 * (k / (k - 1) if k > 1 else 0.0), k


def _t(freedom: float) -> float:
    return float(stdtrit(freedom, 0.975)) if freedom > 0 else 0.0


def measured(episodes: Sequence[Episode], graphs: Mapping[str, NavGraph]) -> dict[str, Samples]:
    """Every metric of the kind of task and the repeat rates, one value per episode."""
    houses, kind = tuple(e.task.world for e in episodes), kind_named(episodes[0].task.kind)
    of = lambda f: tuple(f(e, graphs[e.task.world]) for e in episodes)
    samples = {name: Samples(of(f), houses, share=name in SHARES) for name, f in metrics.PER_EPISODE.items()}
    for name, metric in kind.metrics.items():
        samples[name] = Samples(of(metric.of), houses, of(metric.per) if metric.per else (), metric.share)
    if kind.help != "none":
        samples |= _asking([*of(metrics.ask_counts)], houses)
    used = [metrics.usage(e) for e in episodes]
    if any(used):
        for name, count in metrics.USAGE.items():
            samples[name] = Samples(tuple(float(count(u)) if u else 0.0 for u in used), houses)
    repeats = {"mistake repeat": metrics.mistake_repeats, "request repeat": metrics.request_repeats}
    if kind.monocular:  # turning on the spot is no mistake
        del repeats["mistake repeat"]
    for name, f in repeats.items():
        again, total = zip(*of(f), strict=True)
        samples[name] = Samples(tuple(map(float, again)), houses, tuple(map(float, total)))
    return samples


def _asking(counts: Sequence[metrics.AskCounts], houses: tuple[str, ...]) -> dict[str, Samples]:
    """The measures of `metrics.ask_counts`."""
    ratio = lambda some, all_: Samples(tuple(map(float, some)), houses, tuple(map(float, all_)))
    needed, blockers = [c.needed for c in counts], [c.needed + c.left for c in counts]
    return {
        "question precision": ratio(needed, (c.questions for c in counts)),
        "blockers cleared": ratio(needed, blockers),
        "ask F1": ratio((2 * n for n in needed), (c.questions + b for c, b in zip(counts, blockers, strict=True))),
    }


def row(agent: str, split: str, episodes: Sequence[Episode], graphs: Mapping[str, NavGraph], *, seed: int) -> Row:
    """The metrics of `measured` over the episodes of one agent.

    Raises:
      ValueError: no episodes.
    """
    if not episodes:
        raise ValueError(f"{agent!r} played no episodes of {split!r}; a table needs at least one")
    values = {name: interval([samples]) for name, samples in measured(episodes, graphs).items()}
    return Row(agent, split, seed, len(episodes), len({e.task.world for e in episodes}), values)


def in_percent(name: str) -> bool:
    """True for a column that is shown in per cent."""
    return name in PERCENT or any(name in k.metrics and k.metrics[name].percent for k in KINDS.known.values())


def shown(name: str, value: Estimate) -> str:
    """'45.4 ± 1.2', in per cent where the column is one; '–' where nothing counts."""
    if value.n == 0 or math.isnan(value.mean):
        return "–"
    k, digits = (100.0, 1) if in_percent(name) else (1.0, 2)
    mean = f"{k * value.mean:.{digits}f}"
    return mean if math.isnan(value.half) else f"{mean} ± {k * value.half:.{digits}f}"


def heading(name: str) -> str:
    return f"{name} (%)" if in_percent(name) else name


def markdown(rows: Sequence[Row], columns: Sequence[str] | None = None) -> str:
    """One line per row, with the episode and house counts and the seed.

    Examples:
      >>> table = embodied.markdown(rows, ['success', 'spl'])
    """
    columns = list(columns or dict.fromkeys(name for r in rows for name in r.values))
    nothing = Estimate(math.nan, math.nan, 0)
    head = ["agent", "split", *(heading(c) for c in columns), "episodes", "houses", "seed"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for r in rows:
        cells = [r.agent, r.split, *(shown(c, r.values.get(c, nothing)) for c in columns), r.episodes, r.houses, r.seed]
        lines.append("| " + " | ".join(str(c) for c in cells) + " |")
    return "\n".join(lines) + "\n"


def as_json(rows: Sequence[Row]) -> str:
    plain = lambda v: {"mean": _number(v.mean), "half_width_95": _number(v.half), "n": v.n}
    body = [{**vars(r), "values": {k: plain(v) for k, v in r.values.items()}} for r in rows]
    return json.dumps(body, indent=1) + "\n"


def _number(x: float) -> float | None:
    return None if math.isnan(x) else float(np.round(x, 9))


def save(rows: Sequence[Row], folder: Path, name: str) -> tuple[Path, ...]:
    """Write name.md and name.json into `folder`."""
    folder = Path(folder)
    paths = tuple(folder / f"{name}{suffix}" for suffix in (".md", ".json"))
    for path, text in zip(paths, (markdown(rows), as_json(rows)), strict=True):
        write_bytes(path, text.encode())
    return paths

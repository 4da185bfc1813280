"""Figures 4.5 and 4.6: which requests are made where and when, and what costs change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from agents.hari.networks import INTENTIONS
from assets.cache import atomic_path
from embodied.evaluation.tables import Estimate

COLOURS = {"CUR": "#2b6cb0", "GOAL": "#c05621", "SUB": "#2f855a", "DO": "#a0aec0", "DONE": "#4a5568"}
WORDS = {"unseen_start": "unseen start", "unseen_object": "unseen object", "unseen_env": "unseen environment"}


def requests_figure(per_condition: Mapping[str, Mapping[str, Estimate]], path: Path) -> None:
    """Figure 4.5a: requests of each kind per episode, by condition."""
    figure = Figure(figsize=(5.2, 3.2), layout="constrained")
    axes = figure.subplots()
    for k, name in enumerate(("CUR", "GOAL", "SUB")):
        x = np.arange(len(per_condition)) + 0.26 * (k - 1)
        bars = [c[name] for c in per_condition.values()]
        axes.bar(x, [b.mean for b in bars], 0.24, yerr=[b.half for b in bars], color=COLOURS[name], label=name)
    axes.set_xticks(range(len(per_condition)), [WORDS.get(c, c) for c in per_condition])
    axes.set_ylabel("requests per episode")
    axes.legend(frameon=False)
    _save(figure, path)


def times_figure(counts: np.ndarray, path: Path) -> None:
    """Figure 4.5b: share of running episodes that choose each intention, by time step.

    Args:
      counts: (H, 5), see agents.hari.study.intentions_by_time.
    """
    figure = Figure(figsize=(5.2, 3.2), layout="constrained")
    axes = figure.subplots()
    running = counts.sum(1)
    kept = running > 0
    below = np.zeros(int(kept.sum()))
    for k, name in enumerate(INTENTIONS):
        share = 100 * counts[kept, k] / running[kept]
        axes.bar(
            np.flatnonzero(kept) + 1, share, bottom=below, width=1.0, color=COLOURS[name.upper()], label=name.upper()
        )
        below = below + share
    axes.set_xlabel("time step")
    axes.set_ylabel("share of running episodes (%)")
    axes.legend(frameon=False, ncols=5, loc="upper center", bbox_to_anchor=(0.5, 1.15))
    _save(figure, path)


def costs_figure(
    costs: Sequence[float],
    success: Mapping[tuple[str, int], Sequence[Estimate]],
    actions: Mapping[str, Sequence[float]],
    path: Path,
) -> None:
    """Figure 4.6: (a) success against the cost of an action per condition and horizon, (b) actions at the longest."""
    figure = Figure(figsize=(9, 3.9), layout="constrained")
    left, right = figure.subplots(1, 2)
    horizons = sorted({h for _, h in success})
    for (condition, h), found in success.items():
        style = dict(zip(horizons, (":", "--", "-"), strict=False)).get(h, "-")
        colour = dict(zip(WORDS, ("#2b6cb0", "#c05621", "#2f855a"), strict=True)).get(condition, "#4a5568")
        label = f"{WORDS.get(condition, condition)}, H = {h}"
        mean, half = [100 * e.mean for e in found], [100 * e.half for e in found]
        left.errorbar(costs, mean, half, ls=style, marker="os^"[horizons.index(h) % 3], color=colour, label=label)
    for name, numbers in actions.items():
        right.plot(costs, numbers, marker="o", color=COLOURS[name], label=name)
    for axes, title in ((left, "success (%)"), (right, "actions per episode")):
        axes.set_xscale("log")
        axes.set_xticks(costs, [f"{c:g}" for c in costs])
        axes.minorticks_off()
        axes.set_xlabel("cost of an action")
        axes.set_ylabel(title)
        axes.legend(frameon=False, fontsize=7, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.16))
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=140, format="png")

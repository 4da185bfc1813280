"""Figure 3.7, and success against the quality of descriptions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from assets.cache import atomic_path
from embodied.evaluation.tables import Estimate

COLOURS = ("#2b6cb0", "#c05621", "#718096", "#2f855a")
DASHES = ("-", "--", ":", "-")
"""So that two learners who learn nothing are both seen."""
LABELS = {"success": "validation success (%)", "training success": "cumulative training success (%)"}


def curves_figure(curves: Mapping[str, Mapping[str, Sequence[tuple[float, Estimate]]]], path: Path) -> None:
    """Figure 3.7: success on held-out requests and of all training episodes so far, one curve per learner.

    Args:
      curves: learner, what -> (episodes, mean over seeds) of each validation.
    """
    figure = Figure(figsize=(8, 3.2), layout="constrained")
    for axes, (what, label) in zip(figure.subplots(1, 2), LABELS.items(), strict=True):
        highest = 0.0
        for colour, dashes, (name, both) in zip(COLOURS, DASHES, curves.items(), strict=False):
            at = np.array([n / 1000 for n, _ in both[what]])
            mean = 100 * np.array([e.mean for _, e in both[what]])
            half = 100 * np.nan_to_num([e.half for _, e in both[what]])
            axes.plot(at, mean, dashes, color=colour, label=name)
            axes.fill_between(at, mean - half, mean + half, color=colour, alpha=0.2, linewidth=0)
            highest = max(highest, *mean)
        axes.set_xlabel("training episodes (thousands)")
        axes.set_ylabel(label)
        top = 100.0 if highest > 50 else max(1.5 * highest, 1.0)
        axes.set_ylim(-0.02 * top, top)
        axes.grid(alpha=0.3)
    figure.axes[0].legend(fontsize=8)
    _save(figure, path)


def describer_figure(found: Mapping[float, Estimate], path: Path) -> None:
    """Test success against the share of wrong descriptions."""
    figure = Figure(figsize=(4, 3.2), layout="constrained")
    axes = figure.subplots()
    half = 100 * np.nan_to_num([e.half for e in found.values()])
    axes.errorbar([100 * w for w in found], [100 * e.mean for e in found.values()], half, marker="o", capsize=3)
    axes.set_xlabel("wrong descriptions (%)")
    axes.set_ylabel("test success (%)")
    axes.set_ylim(0, 100)
    axes.grid(alpha=0.3)
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    with atomic_path(Path(path)) as temporary:
        figure.savefig(temporary, dpi=130, format="png")

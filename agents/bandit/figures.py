"""Figures 3.4 and 3.5, and the same for navigation from ratings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from assets.cache import atomic_path
from embodied.evaluation.tables import Estimate

BLUE, GREY = "#2b6cb0", "#a0aec0"
LABELS = {"granularity": "steps of the scale g", "variance": "variance λ", "skew": "skew ρ"}


def curves_figure(curves: Mapping[str, Sequence[Estimate]], path: Path) -> None:
    """Figure 3.4: gain against passes over the rated set, one panel per score."""
    figure = Figure(figsize=(8, 3.2), layout="constrained")
    for axes, (name, curve) in zip(figure.subplots(1, len(curves)), curves.items(), strict=True):
        axes.errorbar(
            range(1, len(curve) + 1),
            [e.mean for e in curve],
            [_half(e) for e in curve],
            marker="o",
            capsize=3,
            color=BLUE,
        )
        axes.axhline(0, color=GREY, linewidth=1)
        axes.set_xlabel("pass over the rated sentences")
        axes.set_ylabel(f"Δ {name}")
        axes.set_xticks(range(1, len(curve) + 1))
        axes.grid(alpha=0.3)
    _save(figure, path)


def gains_figure(
    found: Mapping[str, Mapping[float, Mapping[str, Estimate]]], clean: Mapping[str, Estimate], path: Path
) -> None:
    """Figure 3.5: gain per perturbation (columns) and score (rows); the band is the clean rater's.

    Args:
      found: perturbation, its strength, score -> gain.
      clean: score -> gain under the clean rater.
    """
    figure = Figure(figsize=(3.4 * len(found), 2.7 * len(clean)), layout="constrained")
    grid = np.atleast_2d(figure.subplots(len(clean), len(found), sharey="row", squeeze=False))
    for row, (score, band) in zip(grid, clean.items(), strict=True):
        for axes, (name, values) in zip(row, found.items(), strict=True):
            _panel(axes, values, score, band)
            axes.set_xlabel(LABELS[name])
        row[0].set_ylabel(f"Δ {score}")
    grid[0, 0].legend(fontsize=8)
    _save(figure, path)


def _panel(axes: Axes, values: Mapping[float, Mapping[str, Estimate]], score: str, band: Estimate) -> None:
    """One perturbation at all strengths, side by side at equal distances."""
    at = range(len(values))
    axes.axhspan(band.mean - _half(band), band.mean + _half(band), color=GREY, alpha=0.35, label="clean rater")
    axes.axhline(band.mean, color=GREY, linewidth=1)
    axes.errorbar(
        at,
        [e[score].mean for e in values.values()],
        [_half(e[score]) for e in values.values()],
        marker="o",
        markersize=4,
        capsize=3,
        color=BLUE,
        label="this rater",
    )
    axes.axhline(0, color="black", linewidth=0.8)
    axes.set_xticks(at, [f"{v:g}" for v in values])
    axes.grid(alpha=0.3)


def _half(e: Estimate) -> float:
    return 0.0 if np.isnan(e.half) else e.half


def _save(figure: Figure, path: Path) -> None:
    with atomic_path(Path(path)) as temporary:
        figure.savefig(temporary, dpi=130, format="png")

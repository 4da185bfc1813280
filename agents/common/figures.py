"""The figures of a study: D.1, D.2, learning curves, and success against the number of training houses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from assets.cache import atomic_path
from embodied.evaluation.tables import Estimate

BLUE, GREY = "#2b6cb0", "#a0aec0"


def requests_figure(behaviour: Mapping[str, Any], path: Path) -> None:
    """Figure D.1: (a) share of steps that ask, (b) how often each condition is predicted and true."""
    figure = Figure(figsize=(8, 3), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1, 2))
    share = 100 * behaviour["request share"]
    left.bar(["asks", "moves"], [share, 100 - share], color=[BLUE, GREY])
    left.set_ylabel("share of steps (%)")
    left.set_title("(a) requests")
    _pairs(right, behaviour["conditions"], ("predicted_share", "true_share"), ("predicted", "true"))
    right.set_title("(b) conditions, where help could be asked")
    _save(figure, path)


def conditions_figure(behaviour: Mapping[str, Any], path: Path) -> None:
    """Figure D.2: accuracy, precision, recall and F1 of the predicted conditions."""
    figure = Figure(figsize=(8, 3), layout="constrained")
    _pairs(
        figure.subplots(),
        behaviour["conditions"],
        ("accuracy", "precision", "recall", "f1"),
        ("accuracy", "precision", "recall", "F1"),
    )
    _save(figure, path)


def houses_figure(curves: Mapping[str, Sequence[tuple[int, Estimate]]], path: Path) -> None:
    """Success with 95 % intervals against the number of training houses, one curve per split."""
    figure = Figure(figsize=(5, 3.4), layout="constrained")
    axes = figure.subplots()
    for split, points in curves.items():
        axes.errorbar(
            [n for n, _ in points],
            [100 * e.mean for _, e in points],
            [100 * e.half for _, e in points],
            marker="o",
            capsize=3,
            label=split,
        )
    axes.set_xscale("log", base=2)
    ticks = sorted({n for points in curves.values() for n, _ in points})
    axes.set_xticks(ticks, [str(n) for n in ticks])
    axes.set_xlabel("training houses")
    axes.set_ylabel("success (%)")
    axes.set_ylim(0, 100)
    axes.legend()
    axes.grid(alpha=0.3)
    _save(figure, path)


def requests_curves(curves: Mapping[str, Sequence[tuple[Estimate, Estimate]]], path: Path) -> None:
    """Success against requests per task with 95 % intervals, one curve per kind of rule.

    Args:
      curves: kind of rule to (requests, success) of each of its settings.
    """
    figure = Figure(figsize=(5, 3.4), layout="constrained")
    axes = figure.subplots()
    for kind, points in curves.items():
        axes.errorbar(
            [r.mean for r, _ in points],
            [100 * s.mean for _, s in points],
            [100 * s.half for _, s in points],
            [r.half for r, _ in points],
            marker="o",
            markersize=4,
            capsize=2,
            label=kind,
        )
    axes.set_xlabel("requests per task")
    axes.set_ylabel("success (%)")
    axes.set_xlim(left=0)
    axes.set_ylim(0, 100)
    axes.legend()
    axes.grid(alpha=0.3)
    _save(figure, path)


def realism_figure(arms: Mapping[str, Sequence[Estimate]], ways: Sequence[str], path: Path) -> None:
    """Success with 95 % intervals in houses drawn in several `ways`, one line per kind of agent."""
    figure = Figure(figsize=(5, 3.4), layout="constrained")
    axes = figure.subplots()
    for k, (arm, points) in enumerate(arms.items()):
        at = [i + 0.06 * (k - (len(arms) - 1) / 2) for i in range(len(ways))]
        heights, halves = [100 * e.mean for e in points], [100 * e.half for e in points]
        axes.errorbar(at, heights, halves, marker="o", markersize=4, capsize=2, label=arm)
    axes.set_xticks(range(len(ways)), ways)
    axes.set_xlabel("pictures of the houses it is judged in")
    axes.set_ylabel("success (%)")
    axes.set_ylim(0, 100)
    axes.legend(title="learned from", fontsize=8)
    axes.grid(alpha=0.3)
    _save(figure, path)


def curves_figure(validations: Mapping[str, Sequence[Mapping[str, float]]], path: Path) -> None:
    """Validation success and requests against updates, one curve per agent.

    Args:
      validations: agent to the lines of its validation.jsonl.
    """
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for k, (agent, lines) in enumerate(validations.items()):
        updates = [line["update"] for line in lines]
        style = {"color": f"C{k % 10}", "linestyle": ("-", "--")[k // 10 % 2], "marker": "o", "markersize": 3}
        left.plot(updates, [100 * line["success"] for line in lines], label=agent, **style)
        right.plot(updates, [line["requests"] for line in lines], **style)
    left.set_ylabel("validation success (%)")
    left.set_ylim(0, 100)
    figure.legend(fontsize=8, loc="outside right center")
    right.set_ylabel("requests per task")
    right.set_ylim(bottom=0)
    for axes in (left, right):
        axes.set_xlabel("updates")
        axes.grid(alpha=0.3)
    _save(figure, path)


def _pairs(axes: Axes, conditions: Sequence[Mapping[str, Any]], fields: Sequence[str], labels: Sequence[str]) -> None:
    width = 0.8 / len(fields)
    for k, (name, label) in enumerate(zip(fields, labels, strict=True)):
        heights = [100 * (c[name] or 0.0) for c in conditions]  # None: the condition was never true or never said
        axes.bar([i + (k + 0.5) * width - 0.4 for i in range(len(heights))], heights, width, label=label)
    axes.set_xticks(range(len(conditions)), [c["reason"].replace("_", " ") for c in conditions])
    axes.set_ylabel("%")
    axes.set_ylim(0, 100)
    axes.legend(fontsize=8)


def _save(figure: Figure, path: Path) -> None:
    with atomic_path(Path(path)) as temporary:
        figure.savefig(temporary, dpi=130, format="png")

"""A table of a study as data: rows, columns, and how it is drawn, those of data/tables.toml among them; and, stored, as
a page and as a figure."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure as Picture

from embodied.assets.cache import atomic_path
from embodied.assets.json_file import read_toml


@dataclass(frozen=True)
class StudyRow:
    """One row: what is trained for it and how that is judged."""

    label: str
    train: Mapping[str, Any] | None = field(default_factory=dict)
    """Differences from the settings of the study; None for a row that does not learn."""
    judge: Mapping[str, Any] = field(default_factory=dict)
    """Who plays, and how, in the learner's words."""
    minus: StudyRow | None = None
    """The row whose numbers are subtracted, task by task and seed by seed."""
    x: float | None = None
    """Its position in a figure."""
    series: str = ""
    """The curve of the figure that it belongs to."""


@dataclass(frozen=True)
class Figure:
    """A figure of a table: its rows over their `x`, one curve per series and column; without any x its columns."""

    columns: tuple[str, ...]
    xlabel: str
    ylabel: str
    log: bool = False
    """True if x grows by factors."""
    share: bool = False
    """True if what is drawn lies between 0 and 1."""


@dataclass(frozen=True)
class StudyTable:
    """A table as data."""

    title: str
    rows: tuple[StudyRow, ...]
    columns: tuple[str, ...] = ()
    """Names of what is counted; none for all that is."""
    splits: tuple[str, ...] = ("",)
    """Splits that agents are judged in; '' where there is nothing to choose."""
    compared: tuple[tuple[StudyRow, StudyRow], ...] = ()
    """Pairs that differ in one thing, whose difference is told task by task."""
    figure: Figure | None = None
    pooled: tuple[str, ...] = ()
    """Names of what is counted over all splits together."""


@functools.cache
def study_tables(learner: str) -> Mapping[str, StudyTable]:
    """The tables of a learner by name, of data/tables.toml, which says what its entries mean."""
    return {n: _table(t) for n, t in read_toml(Path(__file__).parent / "data" / "tables.toml")[learner].items()}


def _table(plain: Mapping[str, Any]) -> StudyTable:
    rows: dict[str, StudyRow] = {}
    for row in (*plain.get("others", ()), *plain["rows"]):
        changed = {} if row.pop("learns", True) else {"train": None}
        minus = rows[row["minus"]] if "minus" in row else None
        rows[row["label"]] = StudyRow(**{**row, **changed, "minus": minus})
    figure = plain.get("figure")
    return StudyTable(
        plain["title"],
        tuple(rows[row["label"]] for row in plain["rows"]),
        tuple(plain.get("columns", ())),
        tuple(plain.get("splits", ("",))),
        tuple((rows[a], rows[b]) for a, b in plain.get("compared", ())),
        None if figure is None else Figure(**{**figure, "columns": tuple(figure["columns"])}),
        tuple(plain.get("pooled", ())),
    )


def page(body: Mapping[str, Any], picture: str | None = None) -> str:
    """A table as Markdown, the paper's numbers in brackets."""
    columns = body["columns"]
    heads = ["", *(c["title"] + (f" ({c['unit']})" if c["unit"] else "") for c in columns)]
    lines = [f"# {body['title']}", "", _line(heads), _line(["---"] * len(heads))]
    for row in body["rows"]:
        lines.append(_line([row["label"], *(_cell(row, c["key"], c["unit"]) for c in columns)]))
    if picture:
        lines += ["", f"![{body['title']}]({picture})"]
    intervals = "Intervals: 95 %, tasks within houses, crossed with training seeds; Student's t."
    lines += ["", f"{body['settings']} {intervals}"]
    lines += [f"In brackets the numbers of {body['paper']}."] if body["paper"] else []
    return "\n".join([*lines, "", *(f"- {note}" for note in body["notes"]), ""])


def draw(table: StudyTable, body: Mapping[str, Any], path: Path) -> None:
    """The figure of a table, as PNG."""
    spec = table.figure
    assert spec is not None, "only tables with a figure are drawn"
    curves: dict[str, list[tuple[float, Mapping[str, float]]]] = {}
    figure = Picture(figsize=(6, 3.6), layout="constrained")
    axes = figure.subplots()
    of = {row["label"]: row["values"] for row in body["rows"]}
    placed = any(row.x is not None for row in table.rows)
    for row in table.rows:
        for k, (key, value) in enumerate(_wanted(of.get(row.label, {}), spec.columns)):
            what = key.partition("_at_")[0].replace("_", " ")
            name = f"{row.series if row.x is not None else row.label} {what}".strip()
            if placed and row.x is None:
                axes.axhline(value["mean"], linestyle="--", linewidth=1, color="grey", label=name)
            else:
                x = _place(key, k) if row.x is None else row.x
                curves.setdefault(name, []).append((x, value))
    for name, points in curves.items():
        mean, half = [v["mean"] for _, v in points], [v["half_width"] or 0.0 for _, v in points]
        axes.errorbar([x for x, _ in points], mean, half, marker="o", markersize=3, capsize=2, label=name)
    axes.set_xlabel(spec.xlabel)
    axes.set_ylabel(spec.ylabel)
    if spec.log:
        axes.set_xscale("log")
    if spec.share:
        axes.set_ylim(-0.02, 1.02)
    axes.grid(alpha=0.3)
    figure.legend(fontsize=7, loc="outside right upper")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=130, format="png")


def _wanted(values: Mapping[str, Any], columns: Sequence[str]) -> list[tuple[str, Any]]:
    """The columns of a figure, by how their names begin."""
    return [(key, v) for key, v in values.items() if v["mean"] is not None and key.startswith(tuple(columns))]


def _place(key: str, k: int) -> float:
    """The position at which a column is drawn: the number that its name holds, else one after the other."""
    number = re.search(r"_at_([0-9.]+)", key)
    return float(number[1]) if number else float(k)


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _cell(row: Mapping[str, Any], key: str, unit: str) -> str:
    """'45.4 ± 1.2 (45.43)'."""
    value, printed = row["values"].get(key), row["printed"].get(key)
    if value is None or value["mean"] is None:
        return "–"
    digits = 1 if unit == "%" else 2
    shown = f"{value['mean']:.{digits}f}"
    if value["half_width"] is not None:
        shown += f" ± {value['half_width']:.{digits}f}"
    return shown if printed is None else f"{shown} ({printed:g})"

"""A table of a study as data: rows, columns, and how it is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


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

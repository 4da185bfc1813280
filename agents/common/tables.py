"""A study's table as Markdown: our numbers with those that were printed elsewhere in brackets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from embodied.evaluation.tables import Estimate, shown

Printed = Mapping[str, Sequence[float | None]]
"""Column to the numbers that were printed of a row, one per split, the first ones; None where we cannot cite one."""


def side_by_side(
    title: str,
    splits: Sequence[str],
    columns: Sequence[str],
    lines: Sequence[tuple[str, Printed]],
    value: Callable[[str, str, str], Estimate],
    how: str,
) -> str:
    """The table and what it was made with.

    Args:
      lines: label of each row and what was printed of it.
      value: (label, split, column) -> our number.
      how: the sentences below it.
    """
    heads = [f"{column} {split}" for split in splits for column in columns]
    text = [f"# {title}", "", "| agent | " + " | ".join(heads) + " |", "|" + "---|" * (1 + len(heads))]
    for label, printed in lines:
        cells = []
        for k, split in enumerate(splits):
            for column in columns:
                cell, theirs = shown(column, value(label, split, column)), printed.get(column, ())
                known = theirs[k] if k < len(theirs) else None
                cells.append(cell if known is None else f"{cell} ({known:g})")
        text.append(f"| {label} | " + " | ".join(cells) + " |")
    return "\n".join([*text, "", how, ""])

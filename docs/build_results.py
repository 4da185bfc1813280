"""Writes the tables of docs/results/data/*.json into the pages that show them and into README.md, and a page with all
tables.

    python docs/build_results.py            # writes
    python docs/build_results.py --check    # exits 1 where a page is not what the data say

A page shows a table between two comments; `columns` chooses columns by key, `rows` chooses rows and may rename them,
and `brief` leaves out the command. Notes and all settings are on the page of all tables:

    <!-- table: hanna-4.5 columns: success_unseen_houses rows: Learned | No ask = No help brief -->
    <!-- end -->

Rows of several tables stand side by side so, each group as "table column: label / label = title":

    <!-- beside: Seeing / Blind of: hanna-sight success_test_unseen: Seeing / Blind = HANNA | find-find ... -->
    <!-- end -->
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path

HERE = Path(__file__).parent
DATA = HERE / "results" / "data"
DETAILS = HERE / "results" / "details.md"
README = HERE.parent / "README.md"
PLACE = re.compile(
    r"(<!-- table: (?P<name>[\w.-]+)(?: columns: (?P<columns>[^>]*?))?(?: rows: (?P<rows>[^>]*?))?(?P<brief> brief)?"
    r" -->\n).*?<!-- end -->",
    re.DOTALL,
)
BESIDE = re.compile(r"(<!-- beside: (?P<columns>[^>]*?) of: (?P<rows>[^>]*?) -->\n).*?<!-- end -->", re.DOTALL)
LONGEST_CAPTION = 40
"""Words."""
SENTENCE_END = re.compile(r"(?<=[.])\s+(?=[A-Z0-9])")
OLDER = "Measured with an earlier version."


def load(name: str) -> dict:
    """The table of that name.

    Raises:
      FileNotFoundError: no such table.
    """
    return json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))


def number(value: float, digits: int) -> str:
    return f"{value:,.{digits}f}".replace("-", "−")


def most_digits(table: dict, column: dict) -> int:
    """Most decimals that a column is written with: one for per cent, three for numbers without an interval."""
    intervals = any(v.get("half_width") is not None for row in table["rows"] if (v := row["values"].get(column["key"])))
    return 1 if column.get("unit") == "%" else 2 if intervals else 3


def digits_of(table: dict, key: str) -> int:
    """How many decimals most numbers of a column are stored with."""
    written = [decimals(v) for row in table["rows"] if (v := row["values"].get(key)) and v.get("mean") is not None]
    return max(set(written), key=lambda n: (written.count(n), n), default=0)


def decimals(value: dict) -> int:
    """How many decimals a number is stored with."""
    numbers = [x for part in ("mean", "half_width") if (x := value.get(part)) is not None and x != int(x)]
    return max((len(repr(x).partition(".")[2]) for x in numbers), default=0)


def cell(row: dict, key: str, digits: int, most: int) -> str:
    """'56.4 ± 6.2 (45.43)': the mean, half of its 95 % interval, and what was printed in the paper."""
    value = row["values"].get(key)
    if value is None:
        return ""
    if value.get("mean") is None and "text" not in value:  # nothing to divide by
        return "–"
    digits = min(max(digits, decimals(value)), most)
    text = value["text"] if "text" in value else number(value["mean"], digits)
    if value.get("half_width") is not None:
        text += f" ± {number(value['half_width'], digits)}"
    printed = row.get("printed", {}).get(key)
    return text if printed is None else f"{text} ({printed:g})"


def markdown(table: dict, columns: str | None = None, rows: str | None = None, *, brief: bool = False) -> str:
    """The table, its caption and, unless `brief`, the commands that make it."""
    keys = [c.strip() for c in columns.split(",")] if columns else [c["key"] for c in table["columns"]]
    shown = {c["key"]: c for c in table["columns"]}
    chosen = [shown[key] for key in keys]
    titles = [c["title"] + (f", {c['unit']}" if c.get("unit") else "") for c in chosen]
    lines = [f"| {table.get('row_title', '')} | " + " | ".join(titles) + " |", "|" + "---|" * (len(chosen) + 1)]
    digits = {c["key"]: (digits_of(table, c["key"]), most_digits(table, c)) for c in chosen}
    named = {row["label"]: row for row in table["rows"]}
    wanted = [part.strip().partition(" = ") for part in rows.split(" | ")] if rows else []
    for row, title in [(named[x], y or x) for x, _, y in wanted] or [(row, row["label"]) for row in table["rows"]]:
        lines.append(f"| {title} | " + " | ".join(cell(row, k, *digits[k]) for k in digits) + " |")
    text = "\n".join(lines) + f"\n\n{caption(table)}\n"
    return text + (f"\n```\n{table['command']}\n```\n" if table["command"] and not brief else "")


def caption(table: dict) -> str:
    """The title of a table and as many sentences of its settings as `LONGEST_CAPTION` leaves room for."""
    text = f"*{table['title']}" + (f" ({table['paper']})" if table["paper"] else "") + ".*"
    if any(row.get("printed") for row in table["rows"]):
        text += " In brackets: the paper's number."
    for sentence in SENTENCE_END.split(table["settings"]):
        if len(f"{text} {sentence}".split()) > LONGEST_CAPTION:
            break
        text += f" {sentence}"
    return text


def filled(text: str) -> str:
    """A page with its tables."""

    def table(m: re.Match[str]) -> str:
        made = markdown(load(m["name"]), m["columns"], m["rows"], brief=bool(m["brief"]))
        return f"{m[1]}{made}<!-- end -->" if m["brief"] else f"{m[1]}\n{made}\n<!-- end -->"

    return BESIDE.sub(lambda m: f"{m[1]}\n{beside(m['columns'], m['rows'])}\n<!-- end -->", PLACE.sub(table, text))


def beside(columns: str, groups: str) -> str:
    """One number of several rows of a table, side by side; one line for each table."""
    titles = columns.split(" / ")
    lines = [f"|  | {' | '.join(titles)} |", "|" + "---|" * (len(titles) + 1)]
    for group in groups.split(" | "):
        (where, labels), title = group.rpartition(" = ")[0].split(": ", 1), group.rpartition(" = ")[2]
        name, key = where.split()
        table = load(name)
        rows, (column,) = {r["label"]: r for r in table["rows"]}, [c for c in table["columns"] if c["key"] == key]
        digits = digits_of(table, key), most_digits(table, column)
        cells = [cell({"values": rows[x]["values"]}, key, *digits) for x in labels.split(" / ")]
        lines.append(f"| {title} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def details() -> str:
    """The page with every table in full."""
    parts = ["# All tables\n\nEvery stored table in full, as `docs/results/data` has it.\n"]
    for path in sorted(DATA.glob("*.json")):
        table = json.loads(path.read_text(encoding="utf-8"))
        parts += [f"## {table['table']}\n\n{markdown(table, brief=True)}", table["settings"]]
        parts += [] if (table["identity"] or {}).get("judged", {}).get("code") else [OLDER]
        parts.append("".join(f"- {note}\n" for note in table["notes"]))
        parts += [f"```\n{table['command']}\n```\n"] if table["command"] else []
    return "\n\n".join(parts)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing, exit 1 where a page is out of date")
    args = parser.parse_args()
    stale = []
    for page in (README, *sorted(HERE.rglob("*.md"))):
        text = page.read_text(encoding="utf-8")
        if page != DETAILS and (new := filled(text)) != text:
            stale.append(page)
            if not args.check:
                page.write_text(new, encoding="utf-8")
    if args.check:
        for page in stale:
            print(f"{page} is not what docs/results/data says; run python docs/build_results.py", file=sys.stderr)
        return int(bool(stale))
    DETAILS.write_text(details(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""docs/architecture.md and its picture name what is there, and the picture's floors are those of the imports."""

from __future__ import annotations

import ast
import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import cv2
import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
UNSAID = {"__init__", "__main__"}


@pytest.fixture(scope="module")
def drawing() -> SimpleNamespace:
    return SimpleNamespace(**runpy.run_path(str(ROOT / "docs" / "draw_architecture.py"), run_name="draw_architecture"))


def rooms() -> set[str]:
    """Folders and modules of embodied/."""
    there = ROOT / "embodied"
    folders = {p.name for p in there.iterdir() if (p / "__init__.py").exists()}
    return (folders | {p.stem for p in there.glob("*.py")}) - UNSAID


def arrows() -> set[tuple[str, str]]:
    """(room, room it imports from) within embodied/, for types, too."""
    found = set()
    for path in (ROOT / "embodied").rglob("*.py"):
        me = path.relative_to(ROOT / "embodied").parts[0].removesuffix(".py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                names = [f"{node.module}.{a.name}" for a in node.names] if node.module == "embodied" else [node.module]
                found |= {(me, n.split(".")[1]) for n in names if n.startswith("embodied.")}
    return {(a, b) for a, b in found if a != b and {a, b} <= rooms()}


def test_the_picture_holds_every_room_of_embodied(drawing):
    drawn = {name for _, _, floor in drawing.FLOORS for name, _ in floor}
    assert drawn == rooms()


def test_the_page_names_every_room_of_embodied():
    unnamed = {name for name in rooms() if not re.search(rf"`{name}[`/.]|embodied/{name}\b", PAGE)}
    assert not unnamed


def test_every_file_and_folder_that_the_page_names_is_there():
    named = set(re.findall(r"`((?:assets|embodied|agents|viz|tests|docs|examples)/[\w./]*)`", PAGE))
    assert len(named) > 20
    assert not {name for name in named if not (ROOT / name).exists()}


@pytest.mark.slow
def test_imports_follow_the_floors_of_the_picture(drawing):
    """Up within a column, left between columns."""
    columns = ("ground", "place", "play", "use")
    at = {n: (columns.index(c), k) for k, (c, _, floor) in enumerate(drawing.FLOORS) for n, _ in floor}
    assert not [(me, other) for me, other in arrows() if at[me][0] > 0 and not at[other] < at[me]]


@pytest.mark.slow
def test_the_picture_can_be_drawn_again(drawing, tmp_path):
    drawing.draw(tmp_path / "again.png")
    again, kept = cv2.imread(str(tmp_path / "again.png")), cv2.imread(str(ROOT / "docs" / "architecture.png"))
    assert again.shape == kept.shape and abs(again.astype(int) - kept).mean() < 8, (
        "run python docs/draw_architecture.py"
    )

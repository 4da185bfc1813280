"""One word per idea: a public class name means one thing in the whole project, and tests bear their subject's."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("assets", "embodied", "agents", "viz")
TWICE = {"SimState", "Simulator", "ViewPoint"}
"""Names that stand for two classes: mattersim's dialects bear those of the program that each of them imitates."""


@pytest.mark.slow
def test_a_public_class_name_stands_for_one_class():
    homes = defaultdict(list)
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    homes[node.name].append(path.relative_to(ROOT).as_posix())
    assert {name: where for name, where in homes.items() if len(where) > 1 and name not in TWICE} == {}
    assert all(len(homes[name]) > 1 for name in TWICE), "an exception that is none any more"


def test_every_test_file_bears_the_name_of_what_it_tests():
    """Of a module or folder, alone or with a topic behind it; CONTRIBUTING.md says what the few others are about."""
    rooms = {p.stem for top in PACKAGES for p in (ROOT / top).rglob("*.py")}
    rooms |= {p.name for top in (*PACKAGES, "examples") for p in (ROOT / top, *(ROOT / top).rglob("*")) if p.is_dir()}
    listed = set(re.findall(r"^\| `test_(\w+)` \|", (ROOT / "CONTRIBUTING.md").read_text(), re.MULTILINE))
    files = {p.stem.removeprefix("test_") for p in (ROOT / "tests").glob("test_*.py")}
    strange = {name for name in files if not any(f"{name}_".startswith(f"{room}_") for room in rooms)}
    assert strange == listed

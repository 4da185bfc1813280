"""One word per idea: a public class name means one thing in the whole project."""

from __future__ import annotations

import ast
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

"""Checks names and docstrings, which no linter of Python knows: `make lint` runs it over all packages.

    python packaging/lint_words.py [FOLDER ...]    # exits 1 where a rule is broken; all packages without folders

A docstring begins with a verb or a noun, a local variable says what it holds, and a name can be searched for: a class
name stands once in the repository, the name of a constant in at most three files.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("agents", "assets", "embodied", "viz")
QUESTIONS = re.compile(r"(What|Whether|Where|Whose|Whom)\b")
"""No docstring begins so."""
VAGUE = {"found", "gone", "mine", "said", "told"}
"""No local variable is called so: how a value was come by does not say what it is."""
CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]*")
MOST_FILES = 3
"""Files in which a constant of one name may be defined."""


def docstrings(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and text of all docstrings: of modules, classes, functions, constants and fields."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        for statement in body if isinstance(body, list) else ():
            text = getattr(getattr(statement, "value", None), "value", None)
            if isinstance(statement, ast.Expr) and isinstance(text, str):
                yield statement.lineno, text.strip()


def local_names(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and name of all variables and arguments of functions."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            for node in ast.walk(function):
                if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                    yield node.lineno, node.id
                elif isinstance(node, ast.arg):
                    yield node.lineno, node.arg


def constants(tree: ast.Module) -> set[str]:
    """Names of a module's constants."""
    targets = []
    for statement in tree.body:
        if isinstance(statement, ast.Assign):
            targets += statement.targets
        elif isinstance(statement, ast.AnnAssign):
            targets.append(statement.target)
    names = {n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)}
    return {name for name in names if len(name) > 1 and CONSTANT.fullmatch(name)}


def faults(sources: dict[str, ast.Module]) -> Iterator[tuple[str, str]]:
    """File and message of all broken rules in sources, by path."""
    classes, files = defaultdict(set), defaultdict(set)
    for path, tree in sources.items():
        for line, text in docstrings(tree):
            if QUESTIONS.match(text):
                yield path, f"{line}: a docstring begins with {text.split()[0]!r}; begin with a verb or a noun"
        for line, name in sorted({(line, name) for line, name in local_names(tree) if name in VAGUE}):
            yield path, f"{line}: {name!r} does not say what it holds"
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                classes[node.name].add((path, node.lineno))
        for name in constants(tree):
            files[name].add(path)
    for name, places in classes.items():
        for path, line in sorted(places) if len(places) > 1 else ():
            yield path, f"{line}: class {name} is defined {len(places)} times"
    for name, paths in files.items():
        for path in sorted(paths) if len(paths) > MOST_FILES else ():
            yield path, f"1: constant {name} is defined in {len(paths)} files"


def main() -> int:
    folders = sys.argv[1:] or PACKAGES
    paths = [p for package in PACKAGES for p in sorted((ROOT / package).rglob("*.py"))]
    sources = {p.relative_to(ROOT).as_posix(): ast.parse(p.read_text(encoding="utf-8")) for p in paths}
    chosen = tuple(f"{Path(folder).as_posix().rstrip('/')}" for folder in folders)
    broken = sorted((p, text) for p, text in faults(sources) if p.startswith(chosen))
    for path, text in broken:
        print(f"{path}:{text}")
    return int(bool(broken))


if __name__ == "__main__":
    sys.exit(main())

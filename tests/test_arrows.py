"""Heavy libraries stay where they belong; the order of our own imports is in pyproject.toml (import-linter)."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from setuptools import find_packages

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("assets", "embodied", "agents", "viz")
"""Folders with code; all are imported as `embodied` or parts of it."""
MAY_IMPORT = {
    "assets": {"assets"},
    "embodied": {"assets", "embodied"},
    "agents": {"assets", "embodied", "agents"},
    "viz": {"assets", "embodied", "viz"},
}
HOMES = {
    "torch": ("agents/",),
    "rerun": ("viz/",),
    "mitsuba": ("embodied/light/",),
    "drjit": ("embodied/light/",),
    "mujoco": (
        "embodied/gl.py",
        "embodied/scene/",
        "embodied/render/",
        "embodied/envs/driven.py",
        "embodied/light/",
        "embodied/bench/",
    ),
    "dm_control": ("embodied/envs/driven.py",),
    "OpenGL": ("embodied/gl.py", "embodied/render/"),
    "gymnasium": ("embodied/gym/", "agents/"),
    "starlette": ("embodied/serve/",),
    "uvicorn": ("embodied/serve/",),
    "warp": ("embodied/render/warp.py",),
}
"""Heavy library -> path prefixes of the files that may import it."""
COMPOSERS = ("embodied/cli/",)
"""The console command puts everything together, so it may import agents and viz."""


def sources() -> list[Path]:
    return sorted(p for package in PACKAGES for p in (ROOT / package).rglob("*.py"))


def imported(path: Path) -> list[str]:
    """Every module name that `path` imports, nested imports included."""
    names = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.append(node.module)
        elif isinstance(node, ast.ImportFrom):
            names.append(path.relative_to(ROOT).parts[0])
    return names


def folder_of(name: str) -> str:
    """The folder of ours in which the module `name` lies, or the top name of a library."""
    top, _, rest = name.partition(".")
    inner = rest.partition(".")[0]
    return inner if top == "embodied" and inner in PACKAGES else top


def wrong_arrows(path: Path) -> list[str]:
    """The imports of `path` that its folder may not make."""
    where = path.relative_to(ROOT).as_posix()
    package, wrong = where.split("/")[0], []
    for name in imported(path):
        top = folder_of(name)
        if top in PACKAGES and top not in MAY_IMPORT[package] and not where.startswith(COMPOSERS):
            wrong.append(f"{where} imports {name}")
        if top in HOMES and not where.startswith(HOMES[top]):
            wrong.append(f"{where} imports {name}, which lives in {', '.join(HOMES[top])}")
    return wrong


def test_imports_follow_the_arrows_of_the_design():
    wrong = [w for path in sources() for w in wrong_arrows(path)]
    assert not wrong, "\n".join(wrong)


def test_opengl_is_loaded_by_the_raster_alone_and_the_raster_when_it_draws():
    drawing = ("OpenGL", "mujoco.egl", "mujoco.osmesa", "embodied.render.raster")
    early = []
    for path in sources():
        for node in ast.parse(path.read_text()).body:
            names = [a.name for a in node.names] if isinstance(node, ast.Import | ast.ImportFrom) else []
            if isinstance(node, ast.ImportFrom):
                names = [f"{node.module}.{name}" for name in names]
            early += [f"{path.stem}: {name}" for name in names if name.startswith(drawing)]
    assert early == ["raster: OpenGL.GL"]


def test_a_wrong_arrow_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setattr("test_arrows.ROOT", tmp_path)
    bad = tmp_path / "assets" / "bad.py"
    bad.parent.mkdir()
    bad.write_text("import torch\nfrom embodied.house.house import House\n")
    assert len(wrong_arrows(bad)) == 2


def test_options_of_all_commands_load_no_heavy_library():
    program = """
import importlib, pkgutil, sys
import embodied.cli
for module in pkgutil.iter_modules(embodied.cli.__path__):
    importlib.import_module("embodied.cli." + module.name)
print(*sorted({"torch", "mujoco", "mitsuba", "rerun", "trimesh", "gymnasium", "embodied.viz"} & set(sys.modules)))
"""
    said = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert said.split() == [], "commands import these late, inside `run`"


@pytest.mark.parametrize("package", PACKAGES)
def test_every_folder_with_code_is_a_package_of_the_wheel(package):
    on_disk = {p.parent.relative_to(ROOT).as_posix().replace("/", ".") for p in (ROOT / package).rglob("*.py")}
    packed = set(find_packages(str(ROOT), include=[f"{package}*"]))
    assert on_disk <= packed, f"add an __init__.py to {sorted(on_disk - packed)}"

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
HOMES = {
    "torch": ("agents/",),
    "rerun": ("viz/",),
    "mitsuba": ("embodied/light/",),
    "drjit": ("embodied/light/",),
    "mujoco": tuple(
        f"embodied/{p}"
        for p in (
            "gl.py",
            "world.py",
            "scene/",
            "render/",
            "envs/driven.py",
            "gym/bring.py",
            "gym/robot.py",
            "light/",
            "bench/",
        )
    ),
    "dm_control": (),
    "OpenGL": ("embodied/gl.py", "embodied/render/"),
    "gymnasium": ("embodied/gym/", "agents/"),
    "starlette": ("embodied/serve/",),
    "uvicorn": ("embodied/serve/",),
    "warp": ("embodied/render/warp.py",),
}
"""Heavy library -> path prefixes of the files that may import it."""


def sources() -> list[Path]:
    return sorted(p for package in PACKAGES for p in (ROOT / package).rglob("*.py"))


def test_heavy_libraries_are_imported_where_they_belong_alone():
    wrong = []
    for path in sources():
        nodes = list(ast.walk(ast.parse(path.read_text())))
        names = {a.name for n in nodes if isinstance(n, ast.Import) for a in n.names}
        names |= {n.module for n in nodes if isinstance(n, ast.ImportFrom) and n.level == 0 and n.module}
        where = path.relative_to(ROOT).as_posix()
        for library in sorted({name.split(".")[0] for name in names} & set(HOMES)):
            if not where.startswith(HOMES[library]):
                wrong.append(f"{where} imports {library}, which lives in {', '.join(HOMES[library])}")
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

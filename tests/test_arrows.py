"""Imports go one way: assets <- embodied <- agents, embodied <- viz; heavy libraries stay where they belong."""

from __future__ import annotations

import ast
import graphlib
import tomllib
from pathlib import Path

import pytest
from setuptools import find_packages

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("assets", "embodied", "agents", "viz")
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
}
"""Heavy library -> path prefixes of the files that may import it."""
COMPOSERS = ("embodied/cli/",)
"""The console command puts everything together, so it may import agents and viz (late, inside `run`)."""
OPTIONS = "embodied/cli/learning.py"
"""Needs the learners' settings, which are free of torch, and is itself imported late."""


GROUND = {
    "assets.cache",
    "assets.closure",
    "assets.records",
    "embodied.distribution",
    "embodied.errors",
    "embodied.geometry",
    "embodied.novelty",
    "embodied.seeds",
}
"""Rooms that anybody above them may import; they are not named in ARROWS."""
ARROWS = """
assets.rows <-
assets.materials <- assets.closure assets.rows
assets.built <- assets.materials assets.rows
assets.importing <- assets.materials assets.rows
assets.catalogue <- assets.materials assets.rows assets.built assets.importing
assets.attribution <- assets.rows assets.catalogue
embodied.gl <-
embodied.locks <-
embodied.house <- assets.materials assets.catalogue
embodied.navigation <- embodied.house
embodied.scene <- assets.catalogue embodied.gl assets.built embodied.house
embodied.generate <- assets.catalogue embodied.house embodied.navigation
embodied.interface <- assets.catalogue embodied.house embodied.navigation
embodied.action_spaces <- embodied.navigation embodied.interface
embodied.language <- assets.catalogue embodied.interface
embodied.records <- embodied.interface
embodied.render <- embodied.gl assets.catalogue assets.materials embodied.house embodied.navigation embodied.scene
    embodied.interface
embodied.light <- assets.catalogue embodied.house embodied.scene embodied.render
embodied.mattersim <- embodied.render
embodied.teachers <- embodied.navigation embodied.interface embodied.action_spaces
embodied.policies <- embodied.interface embodied.action_spaces embodied.language embodied.teachers
embodied.tasks <- embodied.house embodied.interface embodied.teachers
embodied.world <- embodied.gl assets.catalogue embodied.house embodied.navigation embodied.scene embodied.interface
    embodied.render embodied.light
embodied.assistants <- embodied.house embodied.navigation embodied.interface embodied.teachers embodied.tasks
embodied.envs <- assets.catalogue embodied.house embodied.navigation embodied.scene embodied.interface
    embodied.action_spaces embodied.language embodied.teachers embodied.assistants
embodied.datasets <- embodied.locks assets.catalogue embodied.house embodied.navigation embodied.generate
    embodied.interface embodied.action_spaces embodied.language embodied.records embodied.render embodied.mattersim
    embodied.teachers embodied.tasks embodied.world embodied.assistants embodied.envs
embodied.bench <- embodied.gl assets.catalogue embodied.house embodied.navigation embodied.scene embodied.generate
    embodied.interface embodied.records embodied.language embodied.render embodied.light embodied.mattersim
    embodied.tasks embodied.world embodied.assistants embodied.envs embodied.datasets embodied.gym
embodied.evaluation <- embodied.navigation embodied.interface embodied.policies embodied.envs
    embodied.datasets
embodied.gym <- assets.catalogue embodied.house embodied.navigation embodied.generate embodied.interface
    embodied.language embodied.render embodied.tasks embodied.world embodied.assistants embodied.envs embodied.datasets
    embodied.evaluation
embodied.cli <- agents.common.shipped embodied.locks embodied.gl viz.sinks agents.common assets.importing assets.catalogue
    assets.attribution embodied.house embodied.navigation embodied.scene embodied.generate embodied.interface
    embodied.language embodied.records embodied.render viz.video embodied.light viz.report embodied.policies
    embodied.tasks embodied.world embodied.assistants viz.recording embodied.envs embodied.datasets embodied.bench
    embodied.evaluation agents.vision agents.hanna agents.hari agents.vnla agents.bandit agents.iliad agents.hanna.evaluation
    agents.hanna.judging agents.hanna.study agents.vision.study agents.hanna.realism
embodied.__main__ <- embodied.cli
agents.common.shipped <-
agents.common.device <-
agents.common.tensor_file <-
agents.common.checkpoint_file <-
agents.common <- agents.common.device agents.common.checkpoint_file agents.common.tensor_file agents.vision embodied.interface
    embodied.records embodied.locks embodied.envs embodied.datasets embodied.evaluation
agents.common.figures <- embodied.evaluation
agents.common.tables <- embodied.evaluation
agents.vision <- agents.common.shipped agents.common.device assets.catalogue embodied.house embodied.scene
    embodied.interface embodied.generate embodied.light embodied.render embodied.world embodied.datasets embodied.gym agents.common.tensor_file
    agents.common.checkpoint_file embodied.locks embodied.records
agents.vision.study <- agents.common.device agents.common agents.vision embodied.datasets embodied.evaluation
    embodied.locks embodied.records
agents.hanna <- agents.common.shipped agents.common embodied.interface embodied.teachers embodied.policies embodied.envs
    embodied.datasets embodied.evaluation agents.vision agents.common.tensor_file embodied.records
agents.hari <- agents.common agents.common.checkpoint_file embodied.interface embodied.action_spaces embodied.records
    embodied.teachers embodied.assistants embodied.envs embodied.datasets embodied.evaluation agents.common.tensor_file
    agents.vision embodied.render embodied.locks
agents.iliad <- agents.common embodied.action_spaces embodied.assistants embodied.interface embodied.navigation
    embodied.teachers assets.catalogue embodied.language embodied.tasks embodied.envs embodied.datasets
    embodied.evaluation embodied.records agents.vision agents.hanna agents.common.tensor_file embodied.locks
agents.bandit <- embodied.locks agents.common agents.common.checkpoint_file embodied.navigation embodied.interface
    embodied.records embodied.datasets embodied.evaluation agents.vision agents.hanna agents.common.tensor_file
agents.vnla <- agents.common agents.hanna agents.vision agents.common.tensor_file agents.common.tables embodied.interface
    embodied.action_spaces embodied.language embodied.records embodied.teachers embodied.policies embodied.assistants
    embodied.envs embodied.datasets embodied.evaluation
agents.hanna.evaluation <- embodied.navigation embodied.interface embodied.teachers agents.common agents.vision agents.hanna
agents.hanna.judging <- agents.common embodied.interface embodied.records embodied.datasets embodied.evaluation
    agents.vision agents.hanna agents.hanna.evaluation embodied.locks
agents.hanna.study_tables <- agents.hanna.evaluation
agents.common.processor_time <- embodied.records
agents.hanna.study <- agents.common.processor_time agents.hanna.study_tables embodied.navigation agents.common agents.common.tables
    embodied.interface embodied.datasets embodied.evaluation agents.common.figures agents.vision agents.hanna agents.hanna.evaluation
    agents.hanna.judging embodied.locks
agents.hanna.realism <- agents.common agents.common.figures agents.hanna agents.vision embodied.datasets embodied.evaluation
    embodied.interface embodied.locks
viz.sinks <-
viz.house3d <- embodied.scene
viz.blueprint <- embodied.house embodied.interface embodied.render
viz.story <- embodied.interface
viz.video <- embodied.interface
viz.report <- embodied.interface embodied.records
viz.recording <- embodied.interface embodied.render viz.house3d viz.story embodied.world viz.sinks embodied.navigation
    viz.blueprint viz.described
viz.described <- embodied.assistants embodied.house embodied.interface
"""
"""Every room (a module or folder of a package) and the rooms that it imports, GROUND apart, for type checkers only or
late, too; from below to above, by package. A new arrow is a decision: it belongs here, and no circle may come of it."""
PLAY = [
    "embodied.interface",
    "embodied.records",
    "embodied.action_spaces",
    "embodied.language",
    "embodied.teachers",
    "embodied.tasks",
    "embodied.policies",
    "embodied.assistants",
    "embodied.envs",
]
"""Who wants what, who says what, what happens: without pictures."""
PICTURES = {"embodied.render", "embodied.light", "embodied.world"}


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


def wrong_arrows(path: Path) -> list[str]:
    """The imports of `path` that its folder may not make."""
    where = path.relative_to(ROOT).as_posix()
    package, wrong = where.split("/")[0], []
    for name in imported(path):
        top = name.split(".")[0]
        if top in PACKAGES and top not in MAY_IMPORT[package] and not where.startswith(COMPOSERS):
            wrong.append(f"{where} imports {name}")
        if top in HOMES and not where.startswith(HOMES[top]):
            wrong.append(f"{where} imports {name}, which lives in {', '.join(HOMES[top])}")
    return wrong


@pytest.mark.slow
def test_imports_follow_the_arrows_of_the_design():
    wrong = [w for path in sources() for w in wrong_arrows(path)]
    assert not wrong, "\n".join(wrong)


def test_a_wrong_arrow_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setattr("test_arrows.ROOT", tmp_path)
    bad = tmp_path / "assets" / "bad.py"
    bad.parent.mkdir()
    bad.write_text("import torch\nfrom embodied.house.house import House\n")
    assert len(wrong_arrows(bad)) == 2


def test_only_the_command_line_composes_agents_and_viz():
    for path in sources():
        where = path.relative_to(ROOT).as_posix()
        if where.startswith(COMPOSERS) and where != OPTIONS:
            top_level = [n for n in ast.parse(path.read_text()).body if isinstance(n, (ast.Import, ast.ImportFrom))]
            names = [a.name for n in top_level for a in n.names] + [getattr(n, "module", "") or "" for n in top_level]
            assert not {n.split(".")[0] for n in names} & {"agents", "viz"}, f"{where} must import agents and viz late"


def room_of(module: str) -> str:
    return ".".join(module.split(".")[:2])


def module_of(path: Path) -> str:
    return path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".").removesuffix(".__init__")


def found_arrows() -> dict[str, set[str]]:
    """Room -> rooms that its files import."""
    modules = {module_of(p) for p in sources()}
    arrows: dict[str, set[str]] = {}
    for path in sources():
        here = arrows.setdefault(room_of(module_of(path)), set())
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.module:
                whole = [f"{node.module}.{a.name}" for a in node.names]
                names = [name if name in modules else node.module for name in whole]
            here |= {room_of(n) for n in names if n.split(".")[0] in PACKAGES}
    return {room: there - {room} for room, there in arrows.items()}


def listed_arrows() -> dict[str, set[str]]:
    lines = ARROWS.replace("\n    ", " ").split("\n")
    rows = [line.partition("<-") for line in lines if line]
    return {room.strip(): set(there.split()) for room, _, there in rows}


@pytest.mark.slow
def test_rooms_import_what_the_list_says_and_nothing_else():
    found, listed = found_arrows(), listed_arrows()
    rooms = set(found) - GROUND - set(PACKAGES)
    assert rooms == set(listed), "a room without a line, or a line without a room"
    new = {f"{a} <- {b}" for a in rooms for b in found[a] - listed[a] - GROUND}
    gone = {f"{a} <- {b}" for a in rooms for b in listed[a] - found[a]}
    assert not new and not gone, f"not in the list: {sorted(new)}; no longer needed: {sorted(gone)}"


@pytest.mark.slow
def test_there_is_no_circle_not_even_of_types():
    order = list(graphlib.TopologicalSorter(found_arrows()).static_order())
    assert order.index("embodied.house") < order.index("embodied.generate") < order.index("embodied.world")
    assert order.index("embodied.interface") < order.index("embodied.envs") < order.index("embodied.datasets")


@pytest.mark.slow
def test_play_knows_nothing_of_pictures():
    found = found_arrows()
    waiting, reached = list(PLAY), set()
    while waiting:
        room = waiting.pop()
        if room not in reached:
            reached.add(room)
            waiting += found[room]
    assert not reached & PICTURES


def test_a_circle_and_a_new_arrow_are_noticed(tmp_path, monkeypatch):
    monkeypatch.setattr("test_arrows.ROOT", tmp_path)
    for name, text in {"a": "def f():\n    from embodied import b\n", "b": "import embodied.a\n"}.items():
        (tmp_path / "embodied").mkdir(exist_ok=True)
        (tmp_path / "embodied" / f"{name}.py").write_text(text)
    assert found_arrows() == {"embodied.a": {"embodied.b"}, "embodied.b": {"embodied.a"}}
    with pytest.raises(graphlib.CycleError):
        test_there_is_no_circle_not_even_of_types()


@pytest.mark.parametrize("package", PACKAGES)
def test_every_folder_with_code_is_a_package_of_the_wheel(package):
    found = set(
        find_packages(
            str(ROOT),
            include=tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]["find"][
                "include"
            ],
        )
    )
    on_disk = {p.parent.relative_to(ROOT).as_posix().replace("/", ".") for p in (ROOT / package).rglob("*.py")}
    assert on_disk <= found, f"add an __init__.py to {sorted(on_disk - found)}"

"""What pip installs, under which name, and whether Python finds ours and nobody else's."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from embodied.cli.origins import PACKAGES
from embodied.distribution import DISTRIBUTION

ROOT = Path(__file__).resolve().parent.parent


def doctor(cwd: Path, *folders: Path) -> subprocess.CompletedProcess[str]:
    """`embodied doctor` with `folders` in PYTHONPATH, started in `cwd`; only the check of the packages is done."""
    code = (
        "import sys\n"  # without the finder of an editable installation, which would mix both projects' modules
        "sys.meta_path = [f for f in sys.meta_path if 'Editable' not in getattr(f, '__name__', '')]\n"
        "from embodied import cli\n"
        "import importlib; chosen = importlib.import_module\n"
        "def only(name, *a):\n"
        "    module = chosen(name, *a)\n"
        "    if name == 'embodied.cli.doctor':\n"
        "        module.run = lambda args: (print(module.line(module.packages(args))), 0)[1]\n"
        "    return module\n"
        "cli.importlib.import_module = only\n"
        "raise SystemExit(cli.main(['doctor']))\n"
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(str(f) for f in folders)}
    return subprocess.run([sys.executable, "-c", code], cwd=cwd, env=env, capture_output=True, text=True, timeout=120)


def foreign(folder: Path, name: str) -> Path:
    """A folder with another project's package `name`."""
    (folder / name).mkdir(parents=True)
    (folder / name / "__init__.py").write_text("")
    return folder


def test_our_packages_are_ours(tmp_path):
    said = doctor(tmp_path, ROOT)
    assert said.returncode == 0 and said.stdout.startswith("[ok  ] packages"), said.stdout + said.stderr


def test_another_projects_viz_in_front_of_ours_is_noticed(tmp_path):
    other = foreign(tmp_path / "other", "viz")
    said = doctor(tmp_path, other, ROOT)
    assert said.stdout.startswith("[FAIL] packages") and f"`viz` is imported from {other / 'viz'}" in said.stdout


def test_another_projects_assets_end_in_one_line_instead_of_a_traceback(tmp_path):
    other = foreign(tmp_path / "other", "assets")
    said = doctor(tmp_path, other, ROOT)
    assert said.returncode == 2 and said.stderr.count("\n") == 1, said.stderr
    assert f"`assets` is imported from {other / 'assets'}" in said.stderr and "virtual environment" in said.stderr


def test_a_folder_of_that_name_where_python_is_started_is_noticed(tmp_path):
    """A folder without __init__.py is a package, too, and comes before an editable installation."""
    (tmp_path / "agents").mkdir()
    said = doctor(tmp_path, ROOT)
    assert (
        said.stdout.startswith("[FAIL] packages")
        and f"{tmp_path / 'agents'} when Python is started outside" in said.stdout
    )


def test_another_embodied_that_would_win_elsewhere_is_noticed(tmp_path):
    other = foreign(tmp_path / "other", "embodied")
    said = doctor(ROOT, other)
    assert f"`embodied` would be imported from {other / 'embodied'}" in said.stdout, said.stdout + said.stderr


def test_a_distribution_that_installs_into_our_folders_is_noticed(tmp_path):
    other = foreign(tmp_path / "other", "agents")  # Python 3.12 leaves recorded files out that are not there
    info = other / "openai_agents-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: openai-agents\nVersion: 0.1\n")
    (info / "RECORD").write_text("agents/__init__.py,,\nopenai_agents-0.1.dist-info/METADATA,,\n")
    said = doctor(tmp_path, ROOT, other)
    assert "the distribution openai-agents 0.1 installs agents, too" in said.stdout, said.stdout + said.stderr


def test_the_name_stands_once():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["name"] == DISTRIBUTION


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from a copy of what git tracks."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, files.split("\0")):
        if (ROOT / name).is_file() and name.split("/")[0] in (*PACKAGES, "pyproject.toml", "README.md", "LICENSE"):
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    pip = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", str(out), str(source)]
    subprocess.run(pip, check=True, capture_output=True, timeout=300)
    with zipfile.ZipFile(next(out.glob("*.whl"))) as z:
        yield z


@pytest.mark.slow
def test_the_wheel_holds_the_types_the_weights_and_the_catalogue(wheel):
    names = set(wheel.namelist())
    wanted = {f"{p}/py.typed" for p in PACKAGES} | {
        "agents/weights/encoder.safetensors",
        "agents/weights/detector.safetensors",
        "embodied/serve/static/index.html",
        "embodied/serve/static/app.js",
        "embodied/serve/static/app.css",
        "agents/weights/hanna_mini.safetensors",
        "agents/weights/hari_mini.safetensors",
        "agents/weights/iliad_nav_mini.safetensors",
        "agents/weights/iliad_regex_tiny.safetensors",
        "agents/common/varied.toml",
        "agents/studies/data/printed.json",
        "embodied/datasets/regions.toml",
        "embodied/language/speakers.toml",
    }
    assert not wanted - names
    assert any(n.startswith("assets/data/") and n.endswith(".json") for n in names)
    assert {n.split("/")[0] for n in names if ".dist-info" not in n} == set(PACKAGES)


@pytest.mark.slow
def test_the_wheel_is_named_after_the_distribution(wheel):
    assert Path(wheel.filename).name.startswith(DISTRIBUTION.replace("-", "_") + "-")


def test_the_citation_names_the_version_that_is_packed():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()


SLIM = """
import sys

for name in ("torch", "matplotlib", "rerun", "av", "pyarrow", "trimesh", "safetensors", "sacrebleu", "networkx"):
    sys.modules[name] = None  # importing it fails, as where it is not installed
import embodied.cli.demo, embodied.cli.house, embodied.gym.continuous, embodied.gym.env, embodied.world
from embodied.house.floor_plan import paint_plan
from conftest import two_rooms

assert paint_plan(two_rooms()).width > 100
"""


def test_a_small_installation_has_environments_and_floor_plans():
    run = subprocess.run([sys.executable, "-c", SLIM], cwd=ROOT / "tests", capture_output=True, text=True)
    assert run.returncode == 0, run.stderr[-500:]

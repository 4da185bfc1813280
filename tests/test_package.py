"""What pip installs, under which name, and whether Python finds ours and nobody else's."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from embodied.assets.closure import code_digest
from embodied.software import DISTRIBUTION

ROOT = Path(__file__).resolve().parent.parent
PACKED = ("agents", "assets", "embodied", "viz", "pyproject.toml", "setup.py", "README.md", "LICENSE")
"""What the wheel is built from."""


def test_the_name_stands_once():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["name"] == DISTRIBUTION


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from a copy of what git tracks."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, files.split("\0")):
        if (ROOT / name).is_file() and name.split("/")[0] in PACKED:
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    pip = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", str(out), str(source)]
    subprocess.run(pip, check=True, capture_output=True, timeout=600)
    with zipfile.ZipFile(next(out.glob("*.whl"))) as z:
        yield z


@pytest.mark.slow
def test_the_wheel_holds_the_types_the_weights_and_the_catalogue(wheel):
    names = set(wheel.namelist())
    data = ("safetensors", "toml", "json", "html", "js", "css", "typed")
    files = [p.relative_to(ROOT) for top in PACKED[:4] for p in (ROOT / top).rglob("*") if p.suffix[1:] in data]
    wanted = {(p if p.parts[0] == "embodied" else Path("embodied", p)).as_posix() for p in files}
    assert len(wanted) > 20 and not wanted - names
    assert Path(wheel.filename).name.startswith(DISTRIBUTION.replace("-", "_") + "-")
    assert {n.split("/")[0] for n in names if ".dist-info" not in n} == {"embodied"}


NEIGHBOURS = """
import agents, embodied.agents.common.tensors, embodied.assets.catalogue
from embodied.assets.closure import code_digest
from embodied.gym.registration import register_with_gymnasium

print(agents.__file__, embodied.agents.__file__, code_digest("embodied.assets.catalogue"))
"""


@pytest.mark.slow
def test_a_package_called_agents_and_ours_live_in_one_environment(wheel, tmp_path):
    """As openai-agents, which installs `agents`; the code's digest is the same in a clone and as installed."""
    other, site = tmp_path / "other", tmp_path / "site"
    (other / "agents").mkdir(parents=True)
    (other / "agents" / "__init__.py").write_text("")
    wheel.extractall(site)
    isolated = "import sys; sys.meta_path = [f for f in sys.meta_path if 'Editable' not in str(f)]\n"
    env = {**os.environ, "PYTHONPATH": f"{other}{os.pathsep}{site}"}
    run = subprocess.run(
        [sys.executable, "-c", isolated + NEIGHBOURS], cwd=tmp_path, env=env, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    theirs, ours, code = run.stdout.split()
    assert theirs.startswith(str(other)) and ours.startswith(str(site))
    assert code == code_digest("embodied.assets.catalogue")


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

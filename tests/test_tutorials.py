"""The code of the tutorials, the README and the notebook runs as it stands, in order, on one small data set."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import io
import json
import re
import shlex
import sys
from pathlib import Path

import pytest
from hand_data import drawn_house

from embodied.cli import main, parser
from embodied.light.settings import QUALITIES

ROOT = Path(__file__).resolve().parent.parent
ORDER = ("your_agent", "your_assistant", "train_from_pixels", "imitation_lerobot", "your_furniture", "evaluate")
FEW_RAYS = {"sky_rays": 2, "lamp_rays": 2, "bounce_rays": 4, "seen_rays": 16}
COARSE = dataclasses.replace(QUALITIES["fast"], density=8, budget=100, sharpness=0.1, tolerance=9, **FEW_RAYS)
BLOCK = re.compile(r"^```(python|sh)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def run(page: Path) -> str:
    """What the blocks of a page print: `sh` through our own command line, `python` in one namespace."""
    said, names = io.StringIO(), {"__name__": "__tutorial__"}
    with contextlib.redirect_stdout(said):
        for kind, code in BLOCK.findall(page.read_text(encoding="utf-8")):
            if kind == "python":
                exec(compile(code, str(page), "exec"), names)
                continue
            for line in code.splitlines():
                assert main(shlex.split(line)[1:]) == 0, line
    return said.getvalue()


def commands() -> list[tuple[str, list[str]]]:
    """(file, words) of every command of ours in a code block of the README, the weights' page and the site, and in
    the tables of results."""
    pages = [ROOT / "README.md", ROOT / "agents/weights/README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    lines = [
        (page.name, line.removeprefix(".venv/bin/"))
        for page in pages
        if page.name not in ("command_line.md", "details.md")  # made from the code, and from the data of all tables
        for kind, block in re.findall(r"(?ms)^```(\w*)\n(.*?)^```$", page.read_text(encoding="utf-8"))
        if kind in ("", "sh", "bash")
        for line in block.replace("\\\n", " ").splitlines()
    ]
    tables = sorted((ROOT / "docs/results/data").glob("*.json"))
    lines += [(table.name, line) for table in tables for line in json.loads(table.read_text())["command"].splitlines()]
    return [
        (name, shlex.split(line, comments=True)[1:])
        for name, line in dict.fromkeys(lines)
        if line.startswith("embodied ") and "..." not in line
    ]


def test_every_command_in_the_documentation_is_one_that_the_program_takes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(ROOT / "examples")
    wrong, parser_of = [], functools.cache(lambda *words: parser(words[0], words=words))
    for page, words in commands():
        try:
            parser_of(*words[:2]).parse_args(words)
        except SystemExit:
            wrong.append(f"{page}: embodied {shlex.join(words)}: {capsys.readouterr().err}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.gl
@pytest.mark.slow
def test_every_tutorial_runs_as_it_stands(tmp_path, monkeypatch):
    """But for the houses of its data set, which are made by hand."""
    pytest.importorskip("stable_baselines3")
    monkeypatch.setattr("embodied.datasets.build.make_dataset_house", drawn_house)
    monkeypatch.chdir(tmp_path)
    said = {name: run(ROOT / "docs" / "tutorials" / f"{name}.md") for name in ORDER}
    assert "asks, then wanders" in said["your_agent"]
    request, instruction = re.findall(r"^(?:request|instruction): *(.*)$", said["your_assistant"], re.MULTILINE)
    assert request.startswith("find") and (instruction.startswith("Go ") or instruction == "You are there.")
    assert "next.success" in said["imitation_lerobot"]
    assert float(re.search(r"(\d+)% of the picture is red", said["your_furniture"])[1]) > 0
    assert "every 5" in said["evaluate"]


@pytest.mark.gl
@pytest.mark.slow
def test_the_readme_runs_as_it_stands(monkeypatch):
    """But for how finely the flat is lit, which tests/test_baking.py looks at."""
    monkeypatch.setitem(QUALITIES, "fast", COARSE)
    assert "viewpoints" in run(ROOT / "README.md")


@pytest.mark.gl
@pytest.mark.slow
def test_the_cells_of_the_notebook_run_in_order(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    notebook = json.loads((ROOT / "examples" / "first_steps.ipynb").read_text())
    names: dict[str, object] = {}
    for cell in [c for c in notebook["cells"] if c["cell_type"] == "code"][1:]:  # the first installs
        exec(compile("".join(cell["source"]), "first_steps.ipynb", "exec"), names)
    assert 36 < names["house"].area < 46 and 0 <= names["reward"] + 1 <= 2 and "rgb" in names["observation"]


def test_readme_and_pages_show_what_the_stored_results_say():
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        import build_results
    finally:
        sys.path.remove(str(ROOT / "docs"))
    for page in (build_results.README, *(ROOT / "docs").rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        assert page == build_results.DETAILS or build_results.filled(text) == text, page

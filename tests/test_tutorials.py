"""The code of the tutorials and of the README runs as it stands, in order, on one small data set."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import sys
from pathlib import Path

import pytest

from embodied.cli import main

ROOT = Path(__file__).resolve().parent.parent
ORDER = ("your_agent", "your_assistant", "train_from_pixels", "imitation_lerobot", "your_furniture", "evaluate")
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


@pytest.mark.gl
@pytest.mark.slow
def test_every_tutorial_runs_as_it_stands(tmp_path, shared_cache, monkeypatch):
    pytest.importorskip("stable_baselines3")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("EMBODIED_CACHE", str(shared_cache))
    said = {name: run(ROOT / "docs" / "tutorials" / f"{name}.md") for name in ORDER}
    assert "asks, then wanders" in said["your_agent"]
    request, instruction = re.findall(r"^(?:request|instruction): *(.*)$", said["your_assistant"], re.MULTILINE)
    assert request.startswith("find") and (instruction.startswith("Go ") or instruction == "You are there.")
    assert "next.success" in said["imitation_lerobot"]
    assert float(re.search(r"(\d+)% of the picture is red", said["your_furniture"])[1]) > 0
    assert "every 5" in said["evaluate"]


@pytest.mark.gl
@pytest.mark.slow
def test_the_readme_runs_as_it_stands(shared_cache, monkeypatch):
    monkeypatch.setenv("EMBODIED_CACHE", str(shared_cache))
    assert "viewpoints" in run(ROOT / "README.md")


def test_the_result_pages_show_what_the_data_say():
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        import build_results
    finally:
        sys.path.remove(str(ROOT / "docs"))
    for page in (ROOT / "docs").rglob("*.md"):
        text = page.read_text(encoding="utf-8")
        assert page == build_results.DETAILS or build_results.filled(text) == text, page

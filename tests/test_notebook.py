"""The notebook of examples/ runs from its first cell to its last."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).resolve().parent.parent / "examples" / "first_steps.ipynb"


@pytest.mark.gl
@pytest.mark.slow
def test_the_cells_of_the_notebook_run_in_order(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cells = ["".join(c["source"]) for c in json.loads(NOTEBOOK.read_text())["cells"] if c["cell_type"] == "code"]
    names: dict[str, object] = {}
    for cell in cells[1:]:  # the first installs
        exec(compile(cell, NOTEBOOK.name, "exec"), names)
    assert 36 < names["house"].area < 46 and 0 <= names["reward"] + 1 <= 2 and "rgb" in names["observation"]

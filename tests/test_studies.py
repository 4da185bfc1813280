"""The study engine with a learner of a few lines: each run is made once, nothing is shown under settings that are not
its own, and tables say what they hold."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import torch

from embodied.agents.common.weights import load_weights, save_weights
from embodied.agents.studies.engine import run_study
from embodied.agents.studies.tables import Figure, StudyRow, StudyTable
from embodied.evaluation.tables import Samples
from embodied.locks import LockedError, locked
from embodied.records import identity_of

FAR, NEAR = StudyRow("far", {"aim": 3.0}, x=3.0), StudyRow("near", {"aim": 1.0}, x=1.0)
NOBODY = StudyRow("nobody", None)
TABLE = StudyTable(
    "How near it comes",
    (NOBODY, NEAR, FAR, dataclasses.replace(FAR, label="far less near", minus=NEAR, x=None)),
    ("success", "error"),
    ("easy", "hard"),
    ((FAR, NEAR),),
    Figure(("error",), "aim", "error"),
    ("tries",),
)


@dataclass(frozen=True)
class About:
    aim: float


@dataclass(frozen=True)
class Archer:
    """Learns a number and is judged by how far it is off; its log counts what is done."""

    log: Path
    rate: float = 0.5
    houses: int = 2
    name = "archer"
    threads = 1
    judges = ("embodied.evaluation.tables",)

    def tables(self) -> Mapping[str, StudyTable]:
        return {"1": TABLE, "all": dataclasses.replace(TABLE, columns=(), pooled=(), rows=(NEAR,), figure=None)}

    def seeds(self, row: StudyRow):
        return (0, 1, 2) if row.train is not None else (0,)

    def prepare(self, rows, splits, folder, note) -> None:
        self._did("prepare")

    def prepare_seed(self, rows, seed, folder, note) -> None:
        """Nothing is shared by a seed."""

    def trained(self, train, seed, folder):
        return identity_of("embodied.seeds", settings={"rate": self.rate, "seed": seed, **train})

    def train(self, train, seed, folder, home, note) -> Path:
        self._did("train")
        home.mkdir(parents=True)
        save_weights(home / "best.safetensors", "archer", {"x": torch.tensor([self.rate + seed])}, About(train["aim"]))
        return home / "best.safetensors"

    def judged(self, row, split) -> Mapping[str, Any]:
        return {"houses": self.houses}

    def judge(self, weights, row, split, seed, folder, keep):
        self._did("judge")
        off = 0.0
        if weights is not None:
            tensors, about = load_weights(weights, "archer", About, "train it")
            off = abs(about.aim - float(tensors["x"]))
        houses = tuple(f"house{k}" for k in range(self.houses) for _ in range(2))
        return {
            "success": Samples(tuple(float(off < 1) for _ in houses), houses, share=True),
            "error": Samples(tuple(off + k for k in range(len(houses))), houses),
            "tries": Samples((1.0,) * len(houses), houses, (2.0,) * len(houses)),
        }

    def about(self) -> str:
        return f"Rate {self.rate:g}, {self.houses} houses."

    def _did(self, what: str) -> None:
        with open(self.log, "a") as f:
            f.write(what + "\n")


quiet = lambda line: None


def did(archer: Archer) -> dict[str, int]:
    words = archer.log.read_text().split() if archer.log.exists() else []
    archer.log.unlink(missing_ok=True)
    return {w: words.count(w) for w in ("train", "judge")}


def table(archer: Archer, out: Path, **options) -> dict[str, Any]:
    run_study(archer, ["1"], out, note=quiet, **options)
    return json.loads((out / "archer-1.json").read_text())


def test_each_run_is_trained_and_judged_once_and_its_numbers_are_right(tmp_path):
    archer, out = Archer(tmp_path / "log"), tmp_path / "out"
    body = table(archer, out)
    assert did(archer) == {"train": 2 * 3, "judge": (2 * 3 + 1) * 2}
    assert table(archer, out) == body and did(archer) == {"train": 0, "judge": 0}
    rows = {r["label"]: r["values"] for r in body["rows"]}
    assert (
        rows["near"]["success_easy"]["mean"] == pytest.approx(100 * 2 / 3) and rows["near"]["success_easy"]["n"] == 12
    )
    assert rows["far"]["error_hard"]["mean"] == pytest.approx((2.5 + 1.5 + 0.5) / 3 + 1.5)
    gain = rows["far less near"]["error_easy"]
    assert gain["mean"] == pytest.approx(((2.5 - 0.5) + (1.5 - 0.5) + (0.5 - 1.5)) / 3), "seed by seed, task by task"
    assert rows["far"]["tries"] == {"mean": 0.5, "half_width": 0.0, "n": 48}, "counted over both splits"
    assert rows["nobody"]["error_easy"]["n"] == 4, "who does not learn is judged once"
    assert any(note.startswith("far minus near, error, easy: +0.67 ±") for note in body["notes"])
    assert [c["unit"] for c in body["columns"]][:2] == ["%", ""] and body["settings"] == "Rate 0.5, 2 houses."
    assert (out / "archer-1.png").read_bytes().startswith(b"\x89PNG") and "| far |" in (out / "archer-1.md").read_text()


def test_numbers_of_other_settings_are_never_shown_under_new_ones(tmp_path):
    archer, out = Archer(tmp_path / "log"), tmp_path / "out"
    before = table(archer, out)
    did(archer)
    faster, wider = dataclasses.replace(archer, rate=0.9), dataclasses.replace(archer, houses=3)
    assert table(faster, out, report=True)["rows"] == [before["rows"][0]], "only who does not learn is as it was"
    assert table(wider, out, report=True)["rows"] == [] and did(archer) == {"train": 0, "judge": 0}
    assert table(wider, out)["rows"][1] != before["rows"][1] and did(archer) == {"train": 0, "judge": 14}
    assert table(faster, out)["rows"][1] != before["rows"][1] and did(archer)["train"] == 6
    assert table(archer, out)["rows"] == before["rows"] and did(archer) == {"train": 0, "judge": 0}, "nothing was lost"


def test_weights_that_were_exchanged_are_judged_again(tmp_path):
    archer, out = Archer(tmp_path / "log"), tmp_path / "out"
    before = table(archer, out, rows=["near"])
    did(archer)
    path = next(out.rglob("aim_1.0_seed_0_*/best.safetensors"))
    save_weights(path, "archer", {"x": torch.tensor([9.0])}, About(1.0))
    assert table(archer, out, rows=["near"]) != before and did(archer) == {"train": 0, "judge": 2}


def test_what_other_code_judged_is_judged_again(tmp_path):
    archer, out = Archer(tmp_path / "log"), tmp_path / "out"
    body = table(archer, out)
    did(archer)
    for path in out.rglob("judged/*.json"):
        path.write_text(path.read_text().replace(body["identity"]["judged"]["code"], "0" * 16))
    assert table(archer, out, report=True)["rows"] == [] and table(archer, out)["rows"] == body["rows"]
    assert did(archer) == {"train": 0, "judge": 14}


def test_some_rows_are_had_alone_and_missing_ones_are_named(tmp_path):
    archer, out = Archer(tmp_path / "log"), tmp_path / "out"
    body = table(archer, out, rows=["far"])
    assert did(archer) == {"train": 3, "judge": 6}
    assert [r["label"] for r in body["rows"]] == ["far"] and "Not run: nobody, near, far less near." in body["notes"]
    with pytest.raises(ValueError, match=r"unknown studies \['2'\]; there are \['1', 'all'\]"):
        run_study(archer, ["2"], out, note=quiet)
    with pytest.raises(ValueError, match="unknown rows of these tables"):
        run_study(archer, ["1"], out, rows=["farther"], note=quiet)
    assert did(archer) == {"train": 0, "judge": 0}


def test_two_studies_never_write_into_one_folder(tmp_path):
    with locked(tmp_path), pytest.raises(LockedError):
        run_study(Archer(tmp_path / "log"), ["1"], tmp_path, note=quiet)


@dataclass(frozen=True)
class Interrupted(Archer):
    """One who is stopped when it begins something for the last[0]-th time."""

    last: tuple[int, str] = (2, "train")

    def _did(self, what: str) -> None:
        super()._did(what)
        if (self.log.read_text().split().count(what), what) == self.last:
            raise KeyboardInterrupt


def test_a_study_that_is_stopped_goes_on_and_does_nothing_twice(tmp_path):
    whole = table(Archer(tmp_path / "other log"), tmp_path / "whole")
    for last in ((2, "train"), (5, "judge")):
        with pytest.raises(KeyboardInterrupt):
            table(Interrupted(tmp_path / "log", last=last), tmp_path / "out")
    assert not list((tmp_path / "out").glob("*.json")), "no table is shown of half a study"
    archer = Archer(tmp_path / "log")
    before = did(archer)
    assert table(archer, tmp_path / "out") == whole
    after = did(archer)
    done = {what: before[what] + after[what] for what in before}
    assert done == {"train": 6 + 1, "judge": 14 + 1}, "each once, and what was cut short"


def test_a_table_without_columns_shows_all_that_is_counted(tmp_path):
    run_study(Archer(tmp_path / "log"), ["all"], tmp_path / "out", note=quiet)
    body = json.loads((tmp_path / "out" / "archer-all.json").read_text())
    assert [c["key"] for c in body["columns"]] == [
        f"{m}_{s}" for s in ("easy", "hard") for m in ("success", "error", "tries")
    ]

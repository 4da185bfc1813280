"""Tables of agents: intervals by hand, the rows of all agents, and the command line."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import pytest
from hand_data import built, small_house

from embodied.cli import main
from embodied.cli.evaluate import rows_of
from embodied.datasets.store import Dataset
from embodied.evaluation import tables
from embodied.evaluation.evaluate import agent, evaluate, spread
from embodied.kinds.task_kind import kind_named
from embodied.records import episodes_file


def test_the_interval_of_independent_values_is_the_textbook_one():
    e = tables.estimate([0, 0, 1, 1], ["a"] * 4)
    assert e.mean == 0.5
    assert e.half == pytest.approx(3.182446 * math.sqrt(1 / 3) / 2), "Student's t of 3 degrees of freedom"


def test_houses_that_agree_within_themselves_widen_the_interval():
    together = tables.estimate([0, 0, 1, 1], ["a", "a", "b", "b"])
    mixed = tables.estimate([0, 1, 0, 1], ["a", "a", "b", "b"])
    assert together.half == pytest.approx(12.706205 * math.sqrt(2 * 1 / 16 * 2)) and mixed.half == 0


def test_houses_and_training_seeds_both_widen_the_interval():
    """Two houses in two seeds, one success of four: each clustering has a variance of 1/16, their crossing, too;
    1/16 + 1/16 - 1/16 with (2/16)^2 / (1/16^2 + 1/16^2) = 2 degrees of freedom, Student's t 4.302653."""
    e = tables.estimate([1, 0, 0, 0], ["a", "b", "a", "b"], [0, 0, 1, 1])
    assert e.mean == 0.25 and e.half == pytest.approx(4.302653 * 0.25)
    alike = tables.estimate([1, 0, 1, 0], ["a", "b", "a", "b"], [0, 0, 1, 1])
    assert alike.half == pytest.approx(tables.estimate([1, 0, 1, 0], ["a", "b", "a", "b"]).half), "seeds that agree"


def test_missing_values_do_not_count():
    e = tables.estimate([1.0, float("nan")], ["a", "b"])
    assert (e.mean, e.n) == (1.0, 1)
    assert tables.shown("success", tables.estimate([float("nan")], ["a"])) == "–"


def test_ratios_are_sums_over_sums():
    r = tables.estimate([1, 0], ["a", "b"], weights=[2, 8])
    assert r.mean == pytest.approx(0.1) and r.n == 10 and r.half > 0


@pytest.mark.slow
def test_of_one_value_per_seed_the_interval_is_students_over_seeds():
    runs = [tables.Samples((v,)) for v in (1.0, 2.0, 3.0)]
    e = tables.interval(runs)
    assert e.mean == 2.0 and e.half == pytest.approx(4.302653 / math.sqrt(3), rel=1e-5)
    assert math.isnan(tables.interval(runs[:1]).half), "one seed says nothing about another"


def test_tasks_in_houses_crossed_with_seeds_by_hand():
    """Houses a and b have 1 and 0 by both seeds: seeds add nothing, two houses have one degree of freedom."""
    e = tables.interval([tables.Samples((1.0, 0.0), ("a", "b"))] * 2)
    assert e.mean == 0.5 and e.n == 4
    by_house = (1**2 + 1**2) / 16 * 2  # each house is off by twice a half
    assert e.half == pytest.approx(12.7062 * math.sqrt(by_house), rel=1e-4)
    apart = tables.interval([tables.Samples((1.0, 1.0), ("a", "b")), tables.Samples((0.0, 0.0), ("a", "b"))])
    assert apart.half == pytest.approx(e.half), "and the same with the two exchanged"


def test_forty_of_forty_is_not_certain():
    """Clopper and Pearson: the chance of forty successes is 2.5 % where each has 91.2 %."""
    forty = tables.Samples((1.0,) * 40, tuple("abcd") * 10, share=True)
    assert 1 - tables.interval([forty]).half == pytest.approx(0.9119, abs=1e-4)
    assert tables.interval([forty] * 3).half == tables.interval([forty]).half, "seeds are no other tasks"
    none = dataclasses.replace(forty, values=(0.0,) * 40)
    assert tables.interval([none]).half == tables.interval([forty]).half
    assert tables.interval([dataclasses.replace(forty, share=False)]).half == 0.0


def test_agents_are_compared_task_by_task():
    first, second = (tables.Samples(v, ("a", "a", "b", "b")) for v in ((1.0, 0.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0)))
    assert tables.less(first, second).values == (1.0, 0.0, 1.0, 0.0)
    e = tables.interval([tables.less(first, second)])
    assert e.mean == 0.5 and e.half == 0.0, "both houses gain as much"
    with pytest.raises(ValueError, match="same tasks"):
        tables.less(first, dataclasses.replace(second, groups=("a", "b", "b", "b")))


def test_every_house_gives_its_share_of_a_limited_evaluation(tmp_path):
    tasks = built(tmp_path / "d").tasks("train")
    some = spread(tasks, 6)
    assert sorted(t.world for t in some) == ["train_0000"] * 3 + ["train_0001"] * 3


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hanna", "vnla", "hari", "vln"])
def test_the_rows_come_out_as_they_should(kind, tmp_path):
    data = built(tmp_path / "d", kind)
    split = "test_unseen_env" if kind == "hari" else "test_unseen"
    agents = {name: make() for name, make in kind_named(kind).baselines.items()}
    rows = {r.agent: r.values for r in evaluate(data.split(split), agents, limit=8)}
    assert rows["shortest"]["success"].mean == 1
    assert rows["random walk"]["success"].mean < 0.5
    if kind == "hanna":
        assert rows["shortest"]["spl"].mean == pytest.approx(1)
        assert rows["ask every 5"]["requests"].mean > rows["no ask"]["requests"].mean == 0
    if kind == "vln":
        assert rows["shortest"]["SDTW"].mean == pytest.approx(1) and rows["random walk"]["nDTW"].mean < 1
    with pytest.raises(ValueError, match="unknown agent"):
        agent(kind, "nobody")


@pytest.mark.slow
def test_the_command_prints_and_writes_the_table(tmp_path, capsys):
    data = built(tmp_path / "d")
    order, out = ["evaluate", "hanna", "--data", str(data.folder), "--agent", "shortest"], tmp_path / "out"
    assert main([*order, "random walk", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "| shortest | test_unseen | 100.0 ± 36.9 | 100.0 ± 36.9 | 100.0 ± 0.0 | 0.00 ± 0.00 |" in printed
    assert (out / "table.md").read_text().startswith("| agent | split | success (%)")
    assert {r["agent"] for r in json.loads((out / "table.json").read_text())} == {"shortest", "random walk"}
    assert (out / "episodes_test_unseen_random_walk.jsonl").exists()
    assert json.loads((out / "run.json").read_text())["data"] == data.digest
    assert main(["evaluate", "vnla", "--data", str(data.folder)]) == 2
    assert "data set of 'hanna'" in capsys.readouterr().err


def test_agents_whose_folders_end_alike_have_rows_of_their_own():
    names = ["a/agent", "b/agent/", "team/one", "shortest", "shortest"]
    rows = rows_of(names)
    assert list(rows.values()) == names[:-1], "each is played once"
    assert rows["one"] == "team/one" and rows["a/agent"] == "a/agent"
    files = {episodes_file("s", row) for row in rows}
    assert len(files) == len(rows) and all(Path(f).name == f for f in files)


def test_what_the_listener_makes_of_routes_is_told_for_every_split(tmp_path, capsys, monkeypatch):
    data, counts = built(tmp_path / "d", make_house=small_house), iter([(1, 2), (3, 4)])
    monkeypatch.setattr(Dataset, "open_world", lambda self, name, *_: self.place(name))
    monkeypatch.setattr("embodied.agents.language_models.agent.followed_replies", lambda *_: next(counts))
    order = ["evaluate", "hanna", "--data", str(data.folder), "--agent", "no ask", "--assistant", "hand_chat:Parrot"]
    assert main([*order, "--split", "val_unseen", "test_unseen", "--tasks", "2", "--json"]) == 0
    listener = json.loads(capsys.readouterr().out)["listener"]
    assert listener == {"val_unseen": {"no ask": [1, 2]}, "test_unseen": {"no ask": [3, 4]}}

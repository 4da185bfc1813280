"""A kind of task outside the package, examples/my_task.py, through every command: nothing in the package knows it."""

from __future__ import annotations

import dataclasses
import json
import pickle
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hand_data import drawn_house, hand_house, paint
from hand_worlds import grid_world

from embodied.agents.language_models.prompts import observation_in_words
from embodied.agents.studies.engine import run_study
from embodied.agents.studies.episodes import EpisodeStudy
from embodied.agents.studies.tables import StudyRow, StudyTable
from embodied.cli import main
from embodied.datasets import build
from embodied.datasets.store import Dataset
from embodied.evaluation.evaluate import play
from embodied.interface import Move, Stop, act
from embodied.kinds.metrics import spl, success
from embodied.kinds.task_kind import TaskKind, kind_named, register_kind
from embodied.render.pictures import Baked
from embodied.serve.game import Game, set_table
from embodied.serve.store import Event
from embodied.serve.study import StudyPart

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
NAME = "my_task:VISIT"
COLUMNS = "| agent | split | success (%) | rooms visited (%) | spl (%) | steps | episodes | houses | seed |"


@pytest.fixture(autouse=True)
def in_examples(monkeypatch):
    monkeypatch.chdir(EXAMPLES)
    monkeypatch.setattr(sys, "path", ["", *sys.path])


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """A data set of the kind, built by its command in houses made by hand."""
    folder = tmp_path_factory.mktemp("visit") / "data"
    order = ["dataset", NAME, "--out", str(folder), "--houses", "1", "--tasks", "6", "--pictures", "none"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(EXAMPLES)
        patch.setattr(build, "make_dataset_house", hand_house)
        assert main([*order, "--workers", "1"]) == 0
    return Dataset(folder)


def test_the_measure_is_one_short_file_and_its_tutorial_shows_it():
    code, page = ((EXAMPLES / "my_task.py"), EXAMPLES.parent / "docs/tutorials/your_task.md")
    lines = code.read_text().splitlines()
    assert len(lines) < 120
    blocks = re.findall(r"(?ms)^```python\n(.*?)^```$", page.read_text())[:-1]
    assert not {line for block in blocks for line in block.splitlines() if "..." not in line} - set(lines)


def test_its_tasks_are_evaluated_by_name_with_its_own_columns(data, tmp_path, capsys):
    assert main(["evaluate", NAME, "--data", str(data.folder), "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert (
        COLUMNS in said and "| shortest | test_unseen | 100.0" in said and "| random walk | test_unseen | 0.0" in said
    )
    walk = "embodied.policies.baselines:RandomWalk"
    order = ["evaluate", NAME, "--data", str(data.folder), "--agent", walk, "--json"]
    assert main(order) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["agent"] == walk
    assert main(["view", str(tmp_path)]) == 0


def test_the_expert_visits_all_rooms_and_none_goes_a_shorter_way(data):
    split, kind = data.split("train"), data.task_kind
    for name in kind.baselines:
        for e in play(split.make_env, kind.agent(name), split.tasks, seed=0):
            graph = split.worlds[e.task.world].graph
            assert success(e, graph) == (name == "shortest") and 0 <= spl(e, graph) <= 1
            assert kind.shortest(e, graph) > 0


def test_gymnasium_makes_it_by_its_title(tmp_path):
    worlds = {"grid": grid_world()}
    env = gym.make("my_task:embodied/Visit-v0", worlds=worlds, observations="oracle", cache=tmp_path)
    check_env(env.unwrapped, skip_render_check=True)
    observation, info = env.reset(seed=0)
    assert observation["rooms_left"] == 3 and info["request"].startswith("visit the ")
    assert observation_in_words(env.unwrapped.observed) == "rooms left to visit: 3", "as language models are told"
    copied = pickle.loads(pickle.dumps(env.unwrapped))
    assert copied.step(0)[0]["rooms_left"] == env.step(0)[0]["rooms_left"]
    envs = gym.make_vec("my_task:embodied/Visit-v0", num_envs=2, worlds=worlds, observations="oracle", cache=tmp_path)
    assert envs.reset(seed=0)[0]["rooms_left"].tolist() == [3, 3]


@dataclass(frozen=True)
class VisitStudy(EpisodeStudy):
    """Baselines in the study engine."""

    name = "visit"

    def tables(self):
        rows = [StudyRow(name, None, {"agent": name}) for name in ("random walk", "shortest")]
        return {"visit": StudyTable("Visiting rooms", tuple(rows), ("success", "rooms visited"), ("test_unseen",))}

    def policies(self, agent, judge, split):
        return Dataset(self.data).task_kind.agent(judge["agent"])


def test_the_study_engine_judges_it(data, tmp_path):
    (page,) = run_study(VisitStudy(data.folder, (0,)), ["visit"], tmp_path, note=lambda line: None).values()
    assert "rooms visited, test unseen (%)" in page.read_text() and "100.0" in page.read_text()


def test_a_person_plays_it_in_a_study(data):
    table = set_table(StudyPart("alone", split="test_unseen", assistant="none", tasks=1), data)
    (task,) = table.tasks.values()
    game, expert, rng = Game("g", table, {"agent": "ann"}, False, 0.0, task, 0), data.task_kind.agent("shortest"), None
    for time in range(1, 60):
        (action,), _ = act(expert, [game.observation], [game.situation], None, rngs=[rng])
        body = {"candidate": action.candidate} if isinstance(action, Move) else {}
        game.apply(Event("stopped" if isinstance(action, Stop) else "moved", float(time), body=body))
        if game.over:
            break
    assert success(game.episode, data.place(task.world).graph) == 1


def test_it_is_exported(data, tmp_path):
    assert main(["export", "parquet", "--data", str(data.folder), "--out", str(tmp_path / "tables")]) == 0
    paint(data, Baked("fast", size=16), data.names("train"))
    order = ["export", "lerobot", "--data", str(data.folder), "--out", str(tmp_path / "robot"), "--size", "16"]
    assert main([*order, "--tasks", "2"]) == 0


@pytest.mark.slow
@pytest.mark.gl
def test_its_episodes_are_recorded(tmp_path, monkeypatch):
    monkeypatch.setattr(build, "make_dataset_house", drawn_house)
    data, run = str(tmp_path / "data"), str(tmp_path / "run")
    order = ["dataset", NAME, "--out", data, "--houses", "1", "--tasks", "4", "--pictures", "none", "--workers", "1"]
    assert main(order) == 0
    assert main(["evaluate", NAME, "--data", data, "--out", run, "--agent", "shortest"]) == 0
    file = tmp_path / "episode.rrd"
    assert main(["view", run, "--episode", "0", "--data", data, "--rrd", str(file)]) == 0
    assert file.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("change", "complaint"),
    [({"name": "visit"}, "is named 'module:NAME'"), ({"name": "x:Y", "title": "HANNA"}, "is that of the kind 'hanna'")],
)
def test_a_kind_that_nothing_could_find_is_refused(change, complaint):
    with pytest.raises(ValueError, match=complaint):
        register_kind(dataclasses.replace(kind_named(NAME), **change))


@pytest.mark.parametrize("name", ["hannah", "my_task:ROOMS", "nowhere:VISIT"])
def test_a_wrong_name_says_what_there_is(name):
    with pytest.raises(ValueError, match="unknown task kind|should be a TaskKind|importable module"):
        kind_named(name)


def test_every_shipped_kind_is_found_by_its_file():
    from embodied.kinds.plugins import shipped_kinds

    for name, title in shipped_kinds().items():
        kind = kind_named(name)
        assert isinstance(kind, TaskKind) and (kind.name, kind.title) == (name, title)
        assert kind.expert in kind.baselines and set(kind.test_splits) and np.size(kind.intentions)

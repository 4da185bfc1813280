"""Records of play survive JSON, and what is not one is refused with its place."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from conftest import two_rooms
from hand_hanna import LINE_TASK, grid_setup, line_env

from embodied.evaluation.evaluate import play
from embodied.house.house import House
from embodied.interface import Ask, Episode, FollowRoute, Move, Pose, Route, Stop, Task, Thought
from embodied.policies.baselines import PrivilegedAsking, Shortest, ask_at_random
from embodied.records import RecordError, from_json, load_lines, save_lines, to_json


def test_episodes_with_replies_survive():
    _, _, tasks, make = grid_setup(20)
    for e in play(make, PrivilegedAsking(Shortest(), ask_at_random), tasks, seed=1, agent="asker"):
        assert from_json(Episode, to_json(e)) == e


def test_thoughts_are_kept_to_six_digits():
    env = line_env()
    env.reset(LINE_TASK)
    env.step(Move(0, Thought(np.array([0.25, 0.75]), {"help": 0.1, "nothing": 0.9}, (0.1, 0.2, 0.3))))
    env.step(Stop())
    again = from_json(Episode, to_json(env.episode())).steps[0].action.thought
    assert again.moves.tolist() == [0.25, 0.75] and again.asks["help"] == 0.1 and again.reasons == (0.1, 0.2, 0.3)


def test_files_are_read_line_by_line(tmp_path):
    routes = [Route(f"r{i}", (i, i + 1), 0, 0, "go", "val") for i in range(3)]
    assert save_lines(tmp_path / "routes.jsonl", routes) == 3
    assert list(load_lines(tmp_path / "routes.jsonl", Route)) == routes
    with open(tmp_path / "routes.jsonl", "a") as f:
        f.write('{"id": 3}\n')
    with pytest.raises(RecordError, match=r"routes.jsonl:4: .*lacks the fields \['instruction'"):
        list(load_lines(tmp_path / "routes.jsonl", Route))


def test_goals_and_actions_keep_their_kind():
    task = Task("a/vln/1", "vln", "a", Pose(0), FollowRoute("r", (0, 1)), (1,), "go", 3.0, 9)
    assert from_json(Task, to_json(task)) == task
    with pytest.raises(RecordError, match="FindObject"):
        from_json(Task, to_json(task).replace("FollowRoute", "Nonsense"))
    with pytest.raises(RecordError, match="as JSON"):
        from_json(Task, "{")
    with pytest.raises(RecordError, match="should be an integer"):
        from_json(Task, to_json(task).replace('"horizon":9', '"horizon":"nine"'))
    assert to_json(Ask()).startswith('{"intention":"help","is":"Ask"')


def test_a_field_that_may_be_text_or_number_keeps_which_it_is():
    """Of a curtain's parameters, one is a word and the other a share; houses were refused for the second."""
    house = two_rooms()
    params = (("style", "sheer"), ("open", 0.5), ("folds", 3.0))
    rug = dataclasses.replace(house.placements[0], params=params)
    again = House.from_json(dataclasses.replace(house, placements=(rug,)).to_json())
    assert again.placements[0].params == params

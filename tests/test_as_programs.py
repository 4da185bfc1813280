"""What the authors' programs count otherwise, on episodes by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hand_worlds import grid_world, hand_graph, line_world

from embodied.datasets.store import StoredPlace
from embodied.evaluation import as_programs, metrics
from embodied.interface import (
    Ask,
    Episode,
    FindObject,
    FollowRoute,
    Intention,
    Mode,
    Move,
    Pose,
    Reply,
    Step,
    Stop,
    Subtask,
    Task,
)


def step(action, here, there, mode=Mode.MAIN, target=3, reply=None):
    return Step(Pose(here), mode, "", (target,), "none", (), (), action, reply, Pose(there))


def episode(kind, goal, *steps, start=0):
    what = FollowRoute("r", (start, goal)) if kind == "vln" else FindObject("mug")
    task = Task("t", kind, line_world().house.name, Pose(start), what, (goal,), "", 3.0, 20)
    return Episode(task, steps, "stop")


def told(target):
    return Reply(text="go", subtask=Subtask("r", target))


def test_exactly_three_metres_away_is_no_success_for_room_to_room():
    graph = hand_graph([[0, 0, 1.5], [3, 0, 1.5], [5.9, 0, 1.5]], [[0, 1], [1, 2]], ["hall_1"] * 3)
    three = episode("vln", 1, step(Stop(), 0, 0))
    assert metrics.success(three, graph) == 1.0 and as_programs.r2r_success(three, graph) == 0.0
    less = episode("vln", 1, step(Move(0), 1, 2), step(Stop(), 2, 2), start=2)
    assert metrics.navigation_error(less, graph) == pytest.approx(2.9)
    assert as_programs.r2r_success(less, graph) == as_programs.r2r_oracle_success(less, graph) == 1.0
    assert as_programs.r2r_oracle_success(three, graph) == 0.0


def test_sub_tasks_are_pooled_over_episodes_not_averaged_within():
    graph = line_world().graph
    far = int(np.argmax(graph.distance[0]))
    assert graph.distance[0, far] > 2
    good = [step(Ask(Intention.HELP), 0, 0, reply=told(0)), step(Stop(), 0, 0, Mode.SUB, 0)]
    bad = [step(Ask(Intention.HELP), 0, 0, reply=told(far)), step(Stop(), 0, 0, Mode.SUB, far)]
    one, other = episode("hanna", far, *good, *good, *bad), episode("hanna", far, *bad)
    assert as_programs.hanna_targets(one, graph) == (2, 3) and as_programs.hanna_targets(other, graph) == (0, 1)
    places = {one.task.world: StoredPlace(line_world().house, graph)}
    pooled = as_programs.row("x", "val", [one, other], places, seed=0).values["target success (HANNA)"]
    assert pooled.mean == pytest.approx(2 / 4) and pooled.n == 4
    assert np.mean([metrics.subtask_success(e, graph) for e in (one, other)]) == pytest.approx(1 / 3)


def test_asking_anew_is_judged_where_the_new_route_begins():
    graph = line_world().graph
    far = int(np.argmax(graph.distance[0]))
    again = episode(
        "hanna", far,
        step(Ask(Intention.HELP), 0, 0, reply=told(far)),
        step(Ask(Intention.HELP), 0, far, Mode.SUB, far, reply=told(0)),
    )  # fmt: skip
    assert as_programs.hanna_targets(again, graph) == (1, 2), "the old target was met by the move, the new one is not"


def test_another_room_of_the_same_kind_counts_for_vnla():
    world = grid_world(8)
    house = dataclasses.replace(
        world.house,
        rooms=tuple(
            dataclasses.replace(r, kind="bathroom" if r.id == "bedroom_1" else r.kind) for r in world.house.rooms
        ),
    )
    place, rooms = StoredPlace(house, world.graph), list(world.graph.room_of_node)
    goal, same, other = (rooms.index(r) for r in ("bathroom_1", "bedroom_1", "kitchen_1"))
    for last, theirs, ours in ((goal, 1, 1), (same, 1, 0), (other, 0, 0)):
        ended = episode("vnla", goal, step(Stop(), last, last), start=last)
        assert as_programs.vnla_room_success(ended, place) == theirs
        assert metrics.room_success(ended, world.graph) == ours


def test_a_kind_without_a_program_is_refused():
    with pytest.raises(ValueError, match="no published program judges 'find'"):
        as_programs.row("x", "val", [episode("find", 0)], {}, seed=0)

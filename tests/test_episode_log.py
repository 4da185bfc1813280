"""What a recording tells about an episode: goals, routes and images hold as long as they hold for the agent."""

from __future__ import annotations

import numpy as np
import pytest
from hand_worlds import line_world

from embodied.assistants.descriptions import described
from embodied.interface import (
    Ask,
    Feature,
    FindObject,
    Intention,
    Mode,
    Move,
    Pose,
    Reply,
    Step,
    Stop,
    Subtask,
    Task,
    Viewpoint,
)
from embodied.viz.episode_log import QUESTIONS, EpisodeLog
from embodied.viz.recording import event_text, pixels_towards

GOAL = FindObject("mug", "hall", ("mug_1",))


def task_of(kind):
    return Task(f"line/{kind}/0", kind, "line", Pose(0), GOAL, (3,), "find a mug in a hall", 0.0, 30)


def step_of(action, *, at=0, to=0, mode=Mode.MAIN, targets=(3,), subtask="none", reply=None):
    return Step(Pose(at), mode, "find a mug", targets, subtask, (Intention.HELP,), (), action, reply, Pose(to))


def told(story, *steps):
    for step in steps:
        story.before(step)
        story.after(step)
    return story


def test_the_route_is_spoken_of_until_it_is_left_and_then_the_goal_image_is_looked_for():
    reply = Reply("Go on .", Viewpoint("line", 1), subtask=Subtask("r1", 1, Pose(0), 2, (0, 1, 2)))
    asked = told(EpisodeLog(task_of("hanna")), step_of(Ask(), reply=reply))
    assert asked.route == (0, 1, 2) and asked.image == Viewpoint("line", 1)
    assert asked.dialogue[1:] == ["**Agent** (step 0): Can you help me?", "**Assistant:** Go on."]
    sub = {"mode": Mode.SUB, "targets": (1,), "subtask": "r1"}
    told(asked, step_of(Move(0), to=1, **sub), step_of(Stop(), at=1, to=1, **sub))
    assert asked.route == (0, 1, 2) and asked.image == Viewpoint("line", 1)
    told(asked, step_of(Move(0), at=1, to=2, targets=(2,)))
    assert asked.route == () and asked.image == Viewpoint("line", 2) and asked.nodes == [0, 1, 2]
    assert "leaves the route" in asked.dialogue_text()


def test_requests_that_are_counted_run_out():
    story = EpisodeLog(task_of("vnla"), 2)
    left = [story.left]
    for _ in range(2):
        told(story, step_of(Ask(Intention.HELP), reply=Reply(text="turn left")))
        left.append(story.left)
    assert left == [2, 1, 0] and EpisodeLog(task_of("hanna")).left is None


def test_the_goal_stack_grows_with_a_sub_goal_and_shrinks_when_it_is_dropped():
    world, subtask = line_world(), Subtask("subgoal", 1, path=(0, 1))
    reply = Reply(description=(Feature("room", "hall"),), intention=Intention.SUB, subtask=subtask)
    story = told(EpisodeLog(task_of("hari")), step_of(Ask(Intention.SUB), reply=reply))
    assert story.goals == [3, 1]
    sub = step_of(Move(0), to=1, mode=Mode.SUB, targets=(1,), subtask="subgoal")
    story.before(sub)
    stack = story.stack(world, sub)
    assert stack.startswith("**2. sub-goal from the assistant") and "1. the task" in stack
    story.after(sub)
    story.before(step_of(Move(0), at=1, to=2))
    assert story.goals == [3] and story.route == ()


def test_descriptions_name_the_side_as_seen_from_the_gaze():
    mug = Feature("object", "coffee_cup", 3, 0, 2)
    assert described((Feature("room", "hall"), mug), Pose(0, 0)) == "You are in the hall, with coffee cup (2 m, left)."
    assert "(2 m, ahead)" in described((mug,), Pose(0, 3))
    assert described((Feature("room", "hall"),)) == "Go to a place in the hall."
    assert described((Feature("action", "stop"),)) == "You are there."


def test_a_long_dialogue_keeps_the_request_and_its_end():
    story = told(EpisodeLog(task_of("hanna")), *[step_of(Ask(), reply=Reply(f"answer {i}.")) for i in range(20)])
    lines = story.dialogue_text().split("\n\n")
    assert lines[0].startswith("**Requester:**") and lines[1] == "…" and lines[-1] == "**Assistant:** answer 19."
    assert len(lines) == 6, "six short lines and the gaps between them are eleven rows"


def test_an_answer_too_long_for_the_pane_is_shown_all_the_same():
    story = told(EpisodeLog(task_of("hanna")), *(step_of(Ask(), reply=Reply(t)) for t in ("short.", "long " * 300)))
    assert story.dialogue_text().split("\n\n")[-1].startswith("**Assistant:** long")


def test_names_stand_where_the_panorama_shows_the_thing():
    """512 pixels round, the gaze in the middle; a quarter to the left is 128 pixels to the left."""
    yaw = np.radians([0.0, 90.0, 180.0])
    assert pytest.approx(np.array([[256, 128, 0], [128] * 3])) == pixels_towards(yaw, yaw * 0, Pose(0), 256).T
    assert pixels_towards(yaw, yaw * 0, Pose(0, 3), 256)[:, 0] == pytest.approx([384, 256, 128])


@pytest.mark.parametrize("intention", Intention)
def test_every_question_is_an_event_in_words(intention):
    step = step_of(Ask(intention))
    assert event_text(line_world(), step) == f"asks in the hall 1: {QUESTIONS[intention]}"
    assert event_text(line_world(), step_of(Ask(intention, question="Here?"))).endswith(": Here?")

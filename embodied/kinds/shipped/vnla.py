"""VNLA: find a thing in a kind of room, with an advisor and a request budget (dissertation 4.1)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence

from embodied.assistants.advisor import Advisor
from embodied.envs.vnla import RULES_OF_PLAY, check_rules, fitted
from embodied.interface import Episode, FindObject, Place, Task
from embodied.kinds import task_kind
from embodied.kinds.shipped.hanna import TABLE_4_2
from embodied.language.plain_language import PlainLanguage
from embodied.navigation.graph import NavGraph
from embodied.policies.baselines import RandomWalk, Shortest, SubgoalListener, VnlaAsking
from embodied.tasks.goals import MOST_ACTIONS, help_budget, limit_key, time_limits, vnla_pool, vnla_task
from embodied.teachers.vnla import VnlaTeacher

AS_PUBLISHED = "indirect"
"""Rules as the program plays: help is put into words."""


def tasks(inputs: task_kind.TaskInputs, parts: task_kind.Parts) -> task_kind.PartTasks:
    world, seed = inputs.world, inputs.seed
    plan = VnlaTeacher().plan(world)
    pool = vnla_pool(world, plan, seed=seed, by_room=inputs.rooms)
    task = lambda i: vnla_task(pool, i, world, plan, seed=seed, language=inputs.language)
    return task_kind.parts_of_pool(len(pool), task, parts)


def environments(inputs: task_kind.EnvInputs) -> task_kind.EnvMaker:
    check_rules(inputs.rules)
    teacher, rule = VnlaTeacher(), RULES_OF_PLAY[inputs.rules]
    advisor = inputs.assistant or Advisor(teacher, inputs.language or PlainLanguage())
    return lambda: rule(inputs.worlds, advisor, teacher.moves)


# Time limits of evaluation (docs/sources.md, S45) ------------------------------------------------

Limits = Mapping[tuple[str, str], int]


def learned_limits(training: Sequence[Task], place: Callable[[str], Place]) -> Limits:
    """Time limits by `limit_key`, from the lengths of training tasks."""
    lengths = [
        (*limit_key(place(t.world), t.start.node, t.goal), t.horizon)
        for t in training
        if isinstance(t.goal, FindObject)  # as all of VNLA's are
    ]
    return time_limits(lengths, MOST_ACTIONS)


def limited(task: Task, world: Place, limits: Limits) -> Task:
    """A task with the time limit of its rooms, and the budget that goes with it."""
    assert isinstance(task.goal, FindObject), "VNLA tasks look for objects"
    key = limit_key(world, task.start.node, task.goal)
    horizon = max(task.horizon, limits.get(key, MOST_ACTIONS))
    return dataclasses.replace(task, horizon=horizon, budget=help_budget(horizon))


def room_success(episode: Episode, graph: NavGraph) -> float:
    """1 if the agent ended in a room that holds a goal (docs/sources.md, S5)."""
    rooms = graph.room_of_node
    return float(rooms[episode.nodes[-1]] in {rooms[g] for g in episode.task.goal_nodes})


VNLA = task_kind.register_kind(
    task_kind.TaskKind(
        name="vnla",
        title="VNLA",
        tasks=tasks,
        environment=environments,
        rules=AS_PUBLISHED,
        fitted=fitted,
        help="words",
        baselines={
            "random walk": RandomWalk,
            "shortest": lambda: Shortest(VnlaTeacher()),
            "shortest, random": lambda: VnlaAsking(Shortest(VnlaTeacher()), "random"),
            "listener, none": lambda: VnlaAsking(SubgoalListener(), "none"),
            "listener, first": lambda: VnlaAsking(SubgoalListener(), "first"),
            "listener, random": lambda: VnlaAsking(SubgoalListener(), "random"),
            "listener, teacher": lambda: VnlaAsking(SubgoalListener(), "teacher"),
        },
        expert="shortest, random",
        metrics={"room success": task_kind.Metric(room_success, percent=True, share=True)},
        columns=(
            *("success", "strict success", "oracle success", "room success"),
            *("navigation error", "path length", "requests"),
        ),
        monocular=True,
        paper=TABLE_4_2,
        roomless=True,
        time_limits=task_kind.TimeLimits(learned_limits, limited),
    )
)

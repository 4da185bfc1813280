"""HARI: reach the one place somebody had in mind, by descriptions and sub-goals (dissertation 4.3)."""

import dataclasses
import functools
import itertools
from collections.abc import Mapping

import numpy as np

from embodied.action_spaces import PanoramicMoves
from embodied.assistants.descriptions import DESCRIPTION_ROWS, Describer, description_rows, frequent_classes
from embodied.envs.hari import AS_PRINTED, HariEnv, HariRules
from embodied.interface import Description, Intention, Observation, Place, Reply, Situation, Subtask, Task
from embodied.kinds import task_kind
from embodied.kinds.metrics import asked, moves
from embodied.kinds.splits import SplitPlan, Splits, SplitSizes
from embodied.policies.baselines import HalfwaySkyline, RandomWalk, Shortest
from embodied.seeds import stream
from embodied.tasks.goals import FindConfig, GoalClass, Pool, build_pool, find_instances, find_task

HELD_OBJECTS = 0.15
"""Share of object classes that training never asks for, for validation and for test each."""
UNSEEN = "main_unseen"
"""The whole pool, of a house where nothing is held out."""


LIMITS = FindConfig("hari", reach=2.5, fewest_nodes=5, most_nodes=10, horizon=30)
"""Limits of 4.3.5 and Table E.2; success is to end exactly at the intended node."""
PRETRAINING = dataclasses.replace(LIMITS, fewest_nodes=1)
"""Of pre-training (appendix E)."""


def hari_pool(world: Place, *, seed: int, config: FindConfig = LIMITS) -> Pool:
    """One request per object instance: the node nearest to it is what the human has in mind."""
    classes = tuple(
        GoalClass(x.object_class, x.room_kind, (x.placement,), x.nodes[:1]) for x in find_instances(world, config.reach)
    )
    return build_pool(world, classes, config, seed=seed)


hari_task = functools.partial(find_task, config=LIMITS)
"""Task `index` of the pool, as find_task."""


STACK = 2
"""L, the most goals on the stack (Table E.2)."""
LONGEST_SUBGOAL = 3
"""l_max, nodes (Table E.2)."""


def subgoal(path: tuple[int, ...], longest: int = LONGEST_SUBGOAL) -> int:
    """p_k with k = min(floor(|p| / 2), l_max) on the shortest path p to the goal (4.3.5).

    |p| counts nodes, so next to the goal k = 1 is the goal itself and at the goal k = 0 is here.
    """
    return path[min(len(path) // 2, longest, len(path) - 1)]


def described_subgoal(
    describer: Describer, world: Place, here: int, goal: int, longest: int = LONGEST_SUBGOAL
) -> tuple[tuple[int, ...], Description]:
    """The way to a sub-goal, which it ends at, and its description: dense, or the next action when one step away."""
    path = world.graph.path(here, goal)
    target = subgoal(path, longest)
    way = path[: path.index(target) + 1]
    near = len(way) <= 2
    return way, describer.step(world, here, target) if near else describer.dense(world, target, goal=True)


class HariAssistant:
    """Ever present; SUB is unavailable when the stack is full (4.3.4.2)."""

    def __init__(self, describer: Describer, *, stack: int = STACK, longest: int = LONGEST_SUBGOAL) -> None:
        self._describer, self._stack, self._longest = describer, stack, longest

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        some = (Intention.CUR, Intention.GOAL)
        return (*some, Intention.SUB) if len(situation.extras.goals) < self._stack else some

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        """A dense description, or the next action when asked for a sub-goal one step away.

        Raises:
          ValueError: a question HARI does not know.
        """
        s, say = situation, self._describer
        here, goal = s.pose.node, s.extras.goals[-1]
        if question is Intention.CUR:
            return Reply(description=say.dense(s.world, here), intention=question)
        if question is Intention.GOAL:
            return Reply(description=say.dense(s.world, goal, goal=True), intention=question)
        if question is Intention.SUB:
            way, description = described_subgoal(say, s.world, here, goal, self._longest)
            return Reply(description=description, intention=question, subtask=Subtask("subgoal", way[-1], path=way))
        raise ValueError(f"HARI's assistant answers cur, goal and sub, was asked {question.value!r}")


class Uncooperative(HariAssistant):
    """Answers a question drawn from those that could be asked, whatever was asked (Table 4.7)."""

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        some = self.intentions(situation)
        return super().answer(situation, some[int(rng.integers(len(some)))], rng=rng)


def tasks(inputs: task_kind.TaskInputs, parts: task_kind.Parts) -> task_kind.PartTasks:
    """The conditions of 4.3.5: unseen start room, unseen object class, unseen environment."""
    return {part: _part(inputs, part, n) for part, n in parts}


def _part(inputs: task_kind.TaskInputs, part: str, n: int) -> list[Task]:
    world, seed = inputs.world, inputs.seed
    pool = hari_pool(world, seed=seed, config=PRETRAINING if part.startswith("pretrain") else LIMITS)
    chosen = itertools.islice((i for i in range(len(pool)) if _belongs(pool, i, part, world, seed)), n)
    return [hari_task(pool, i, seed=seed, language=inputs.language) for i in chosen]


def _belongs(pool: Pool, i: int, part: str, world: Place, seed: int) -> bool:
    if part == UNSEEN:
        return True
    goal, start = pool.classes[int(pool.pairs[i, 0])], int(pool.pairs[i, 1])
    held_object = object_part(goal.object_class, seed=seed)
    held_room = room_part(world, str(world.graph.room_of_node[start]), seed=seed)
    if part.startswith("start_"):
        return held_object is None and held_room == part.removeprefix("start_")
    if part.startswith("object_"):
        return held_room is None and held_object == part.removeprefix("object_")
    if held_object is not None or held_room is not None:
        return False
    return part == "main" or (i % 32 == 31) == (part == "pretrain_val")


@functools.cache
def object_part(object_class: str, *, seed: int) -> str | None:
    """'val' or 'test' for object classes that training never asks for, the same in all houses; else None."""
    draw = stream(seed, "held object", object_class).random()
    return "val" if draw < HELD_OBJECTS else "test" if draw < 2 * HELD_OBJECTS else None


def room_part(world: Place, room: str, *, seed: int) -> str | None:
    """'val' or 'test' for the one room each of a house in which training never starts; else None."""
    rooms = sorted({str(r) for r in world.graph.room_of_node})
    if len(rooms) < 4:
        return None
    order = stream(seed, "held room", world.house.name).permutation(len(rooms))
    return {rooms[order[0]]: "val", rooms[order[1]]: "test"}.get(room)


def splits(sizes: SplitSizes) -> Splits:
    third = sizes.each or max(1, sizes.unseen // 3)
    unseen = sizes.each or sizes.unseen
    plan = _split_plans(sizes.tasks, max(1, sizes.tasks // 10), sizes.tasks, (third,) * 3, (third, third, unseen))
    return Splits(sizes.houses, plan)


def _split_plans(
    pretrain: int, pretrain_val: int, train: int, val: tuple[int, int, int], test: tuple[int, int, int]
) -> tuple[SplitPlan, ...]:
    plans = [
        SplitPlan("pretrain", "train", pretrain, "pretrain"),
        SplitPlan("pretrain_val", "train", pretrain_val, "pretrain_val"),
        SplitPlan("train", "train", train, groups=("extra",)),
    ]
    for when, (start, other, env) in (("val", val), ("test", test)):
        plans += [
            SplitPlan(f"{when}_unseen_start", "train", start, f"start_{when}", ("extra",)),
            SplitPlan(f"{when}_unseen_object", "train", other, f"object_{when}", ("extra",)),
            SplitPlan(f"{when}_unseen_env", when, env, UNSEEN),
        ]
    return tuple(plans)


TABLE_E_1 = Splits(
    {"train": 36, "extra": 18, "val": 7, "test": 11},
    _split_plans(82_104, 3_000, 65_133, (1_901, 1_912, 1_967), (1_653, 1_913, 1_777)),
)
"""Dissertation Table E.1. It names 36 houses for pre-training and 18 more for training; the
seen conditions draw from all 54."""


def environments(inputs: task_kind.EnvInputs) -> task_kind.EnvMaker:
    rules: HariRules = inputs.rules
    houses = inputs.worlds.values() if inputs.training is None else inputs.training()
    describer = Describer(frequent_classes(houses, rules.kept))
    kind = HariAssistant if rules.cooperative else Uncooperative
    assistant = inputs.assistant or kind(describer, stack=rules.stack, longest=rules.longest)
    ways = PanoramicMoves()
    return lambda: HariEnv(inputs.worlds, assistant, describer, costs=rules.costs, moves=ways)


def fitted(task: Task, world: Place, rules: HariRules) -> Task:
    """The task with the horizon of the rules."""
    return task if rules.horizon is None else dataclasses.replace(task, horizon=rules.horizon)


FEWEST_GOALS = 3
"""Rows for goals, or more where the rules stack more."""


def specs(candidates: int, rules: HariRules) -> dict[str, task_kind.ArraySpec]:
    """'state' and 'goals': feature sets as rows (assistants.description_arrays), the goals top last."""
    goals = max(FEWEST_GOALS, rules.stack)
    return {
        "state": task_kind.ArraySpec((DESCRIPTION_ROWS, 5), 0, task_kind.UNBOUNDED),
        "goals": task_kind.ArraySpec((goals, DESCRIPTION_ROWS, 5), 0, task_kind.UNBOUNDED),
    }


def encode(o: Observation, specs: Mapping[str, task_kind.ArraySpec]) -> dict[str, np.ndarray]:
    goals = np.zeros(specs["goals"].shape, dtype=np.float32)
    for i, description in enumerate(o.extras.goal_descriptions):
        goals[i] = description_rows(description)
    return {"state": description_rows(o.extras.state_description), "goals": goals}


HARI = task_kind.register_kind(
    task_kind.TaskKind(
        name="hari",
        title="HARI",
        tasks=tasks,
        environment=environments,
        rules=AS_PRINTED,
        fitted=fitted,
        help="descriptions",
        baselines={"random walk": RandomWalk, "shortest": Shortest, "half-way sub-goals": HalfwaySkyline},
        expert="half-way sub-goals",
        needs_stop=True,  # a task is complete by a_done (4.3.2)
        metrics={
            "CUR": task_kind.Metric(asked(Intention.CUR)),
            "GOAL": task_kind.Metric(asked(Intention.GOAL)),
            "SUB": task_kind.Metric(asked(Intention.SUB)),
            "DO": task_kind.Metric(moves),
        },
        columns=("success", "navigation error", "requests", "steps"),
        test_splits=("test_unseen_start", "test_unseen_object", "test_unseen_env"),
        splits=splits,
        paper=TABLE_E_1,
        unseen_part=UNSEEN,
        extras=task_kind.ExtraArrays(specs, encode),
        pictures=False,  # all that its agent perceives are words
        story=task_kind.StoryStyle(goal_stack=True),
    )
)

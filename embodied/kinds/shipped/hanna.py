"""HANNA: find an object with the help of people one meets (dissertation 4.2)."""

import dataclasses
import functools

import numpy as np

from embodied.action_spaces import PanoramicMoves
from embodied.assistants.anna import Anna, Residents, minute_of
from embodied.envs.base import HelpEnv, required
from embodied.interface import Ask, Episode, Mode, Move, Observation, Place, Reply, Stop, Viewpoint
from embodied.kinds import task_kind
from embodied.kinds.splits import Splits, five_splits
from embodied.navigation.doors import lived_name
from embodied.navigation.graph import NavGraph
from embodied.policies import baselines
from embodied.policies.listeners import ListeningInterpreter
from embodied.tasks.goals import FindConfig, Pool, build_pool, find_instances, find_task, goal_classes

TABLE_4_2 = Splits({"train": 51, "val": 7, "test": 10}, five_splits(82_484, 5_001, 5_017, 5_004, 5_012))
"""Houses and splits of the dissertation's Table 4.2."""
NEAR_ENOUGH = 2.0
"""Metres from the target of a sub-task within which it succeeded."""

HANNA_RULES = ("told", "shown", "living", "living-shown")
"""People tell the way, or walk it ahead, too; people stand where routes begin, or are where their day has them."""
LIMITS = FindConfig("hanna", reach=2.5, fewest_nodes=5, most_nodes=15, radius=2.0, horizon=50)
"""Limits of 4.2.5 and Table D.1; training takes 20 steps. An instance counts when a node of its room is within reach;
that node is its goal."""


def hanna_pool(world: Place, *, seed: int) -> Pool:
    classes = goal_classes(find_instances(world, LIMITS.reach), by_room=False, nearest_only=True)
    return build_pool(world, classes, LIMITS, seed=seed)


hanna_task = functools.partial(find_task, config=LIMITS)
"""Task `index` of the pool, as find_task."""


def tasks(inputs: task_kind.TaskInputs, parts: task_kind.Parts) -> task_kind.PartTasks:
    pool = hanna_pool(inputs.world, seed=inputs.seed)
    return task_kind.parts_of_pool(
        len(pool), lambda i: hanna_task(pool, i, seed=inputs.seed, language=inputs.language), parts
    )


class HannaEnv(HelpEnv):
    """Algorithm 7 of dissertation 4.2.2: two modes, people who know routes, images of where to go."""

    residents: Residents | None = None
    """Who live in the houses, and are seen where their day has them."""

    def seen_from(self, node: int) -> str:
        seen = super().seen_from(node)
        if self.residents is None:
            return seen
        return lived_name(seen, self.residents.seen_from(self.task.world, node, minute_of(self.task.id) + self.time))

    def _replied(self, reply: Reply) -> None:
        subtask = required(reply.subtask, "sub-task in the reply")
        self.mode = Mode.SUB  # line 9
        self.instruction = required(reply.text, "text in the reply")  # line 11
        self.target = reply.image  # line 12: I^depart
        self.subtask, self.targets = subtask, (subtask.target,)
        self.pose = subtask.start or self.pose  # line 13: step to the start of the route and look along it
        self.time_on_task = 0

    def _stopped(self) -> None:
        if self.mode is Mode.MAIN:  # lines 17-18
            self.ended = "stop"
            return
        self.mode = Mode.MAIN  # line 20
        self.instruction = self.task.request  # line 21
        goal = required(required(self.subtask, "sub-task").goal, "goal of the sub-task")
        self.target = Viewpoint(self.task.world, goal)  # line 22: I^{g*}, Eq 4.7
        self.targets, self.subtask = (goal,), None  # the program's teacher (docs/sources.md, S14)
        self.time_on_task = 0


class ShowingEnv(HannaEnv):
    """Who tells the way walks it, too, one viewpoint ahead. The agent follows by a rule: other moves are masked, and
    where they end the sub-task ends. It may leave before, by stopping or asking."""

    def _look(self) -> Observation:
        observation, path = super()._look(), self.subtask.path if self.subtask is not None else ()
        if self.pose.node not in path[:-1]:
            return observation
        candidates, ahead = observation.candidates, path[path.index(self.pose.node) + 1]
        allowed = candidates.allowed & (np.array(self.situation.candidate_nodes) == ahead)
        candidates = dataclasses.replace(candidates, allowed=allowed)
        self.situation = dataclasses.replace(self.situation, candidates=candidates)
        self.observation = dataclasses.replace(observation, candidates=candidates)
        return self.observation

    def _moved(self) -> None:
        if self.subtask is not None and self.pose.node == self.subtask.target:
            self._stopped()

    def _replied(self, reply: Reply) -> None:
        super()._replied(reply)
        self._moved()  # the way may end where it begins


def environments(inputs: task_kind.EnvInputs) -> task_kind.EnvMaker:
    worlds = inputs.worlds
    routes = {name: known for name in worlds if (known := inputs.routes(name))}
    if inputs.rules not in HANNA_RULES:
        raise ValueError(f"rules of HANNA should be one of {HANNA_RULES}, got {inputs.rules!r}")
    split = inputs.wording
    living = Residents(worlds, routes, split=split) if inputs.rules.startswith("living") else None
    anna = living or Anna({name: w.graph for name, w in worlds.items()}, routes, split=split)
    moves, rule = PanoramicMoves(), ShowingEnv if inputs.rules.endswith("shown") else HannaEnv

    def make() -> HannaEnv:
        env = rule(worlds, inputs.assistant or anna, moves)
        env.residents = living
        return env

    return make


def subtask_success(episode: Episode, graph: NavGraph) -> float:
    """Share of sub-tasks that were left (departed, asked anew, or cut short) within 2 m of their target.

    NaN without any (docs/sources.md, S6).
    """
    outcomes = []
    for i, step in enumerate(episode.steps):
        if step.mode is not Mode.SUB:
            continue
        last = i + 1 == len(episode.steps) or episode.steps[i + 1].mode is Mode.MAIN
        if isinstance(step.action, (Ask, Stop)) or last:
            node = step.next_pose.node if isinstance(step.action, Move) else step.pose.node
            outcomes.append(graph.distance[node, step.targets[0]] <= NEAR_ENOUGH + 1e-9)
    return float(np.mean(outcomes)) if outcomes else float("nan")


HANNA = task_kind.register_kind(
    task_kind.TaskKind(
        name="hanna",
        title="HANNA",
        tasks=tasks,
        environment=environments,
        rules=HANNA_RULES[0],
        help="words",
        baselines={
            **task_kind.PLAIN_AGENTS,  # in the next three the teacher navigates: they show what asking so costs
            "no ask": lambda: baselines.PrivilegedAsking(baselines.Shortest(), baselines.never_ask),
            "random ask": lambda: baselines.PrivilegedAsking(baselines.Shortest(), baselines.ask_at_random),
            "ask every 5": lambda: baselines.PrivilegedAsking(baselines.Shortest(), baselines.ask_every_5),
            "perfect interpretation": baselines.PerfectInterpreter,
        },
        looking={"scripted listener": ListeningInterpreter},
        expert="perfect interpretation",
        metrics={"subtask success": task_kind.Metric(subtask_success, percent=True)},
        columns=("success", "strict success", "spl", "navigation error", "requests"),
        paper=TABLE_4_2,
        routes=True,
        people=True,
        story=task_kind.StoryStyle(leaving="leaves the route and goes on by itself"),
    )
)

"""VNLA: find a thing in a kind of room, with an advisor and a request budget (dissertation 4.1)."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from embodied import interface
from embodied.action_spaces import WORDS
from embodied.envs.base import HelpEnv, required
from embodied.kinds import task_kind
from embodied.kinds.shipped.hanna import TABLE_4_2
from embodied.language.plain_language import PlainLanguage
from embodied.navigation.graph import NavGraph
from embodied.policies.baselines import RandomWalk, Shortest, SubgoalListener, VnlaAsking
from embodied.tasks.goals import MOST_ACTIONS, help_budget, limit_key, time_limits, vnla_pool, vnla_task
from embodied.teachers.vnla import VnlaTeacher

HELP_STEPS = 4
"""k: how many actions an instruction describes (docs/sources.md, S48)."""


class Advisor:
    """Speaks the teacher's next k actions (4.1) towards the task's goals.

    It uses the teacher's plan because it has perfect knowledge (footnote 1 of 4.1.2); that does
    not make it the teacher: it never labels, it only answers.
    """

    def __init__(self, teacher: VnlaTeacher, language: interface.Language, steps: int = HELP_STEPS) -> None:
        self._teacher, self._language, self._steps = teacher, language, steps

    def intentions(self, situation: interface.Situation) -> tuple[interface.Intention, ...]:
        """Help, everywhere; the environment takes it away when the budget is spent."""
        return (interface.Intention.HELP,)

    def answer(
        self, situation: interface.Situation, question: interface.Intention, *, rng: np.random.Generator
    ) -> interface.Reply:
        s = situation
        words, end = self._teacher.plan(s.world).words(s.pose, s.task.goal_nodes, self._steps)
        path = s.world.graph.path(s.pose.node, end.node)
        subtask = interface.Subtask("subgoal", end.node, start=s.pose, path=path, words=words)
        return interface.Reply(text=self._language.subgoal(words), subtask=subtask)


class VnlaEnv(HelpEnv):
    """VNLA as the authors' program plays it (docs/sources.md, S43): help costs no step.

    The sub-goal is put before the request and stays until the next one; stopping ends the
    episode even inside a sub-goal. After a request the same time step goes on with a move.
    """

    asking_takes_time = False

    def _begin(self) -> None:
        self._answered_at = -1

    def _askable(self, situation: interface.Situation) -> tuple[interface.Intention, ...]:
        return () if self._answered_at == self.time else super()._askable(situation)

    def _replied(self, reply: interface.Reply) -> None:
        self._answered_at = self.time
        self.instruction = f"{reply.text} . {self.task.request}"
        self.subtask = reply.subtask
        self.time_on_task = 0


class DirectVnlaEnv(VnlaEnv):
    """Direct intervention (dissertation 4.1.3): after a request the advisor acts in the agent's place."""

    def _begin(self) -> None:
        super()._begin()
        self._orders: tuple[str, ...] = ()

    def _replied(self, reply: interface.Reply) -> None:
        super()._replied(reply)
        self._orders = required(reply.subtask, "sub-task in the reply").words

    def step(self, action: interface.Action) -> interface.Observation | None:
        """Like HelpEnv.step, but a move or stop is replaced while orders are pending; the Step says by what."""
        self._check(action)
        if self._orders and not isinstance(action, interface.Ask):
            word, self._orders = self._orders[0], self._orders[1:]
            action = (
                interface.Stop(action.thought) if word == "stop" else interface.Move(WORDS.index(word), action.thought)
            )
        return super().step(action)


class MuteDirectVnlaEnv(DirectVnlaEnv):
    """Direct intervention that is not put into words: the agent reads its request throughout."""

    def _replied(self, reply: interface.Reply) -> None:
        time_on_task = self.time_on_task
        super()._replied(reply)
        self.instruction, self.time_on_task = self.task.request, time_on_task  # the instruction has not changed


class Algorithm6Env(HelpEnv):
    """I3L as Algorithm 6 prints it: asking costs a step, the instruction replaces the request,
    and stopping in a sub-task goes back to the request (the operator (+) of 4.1.3 overwrites).

    A sub-task ends in the pose to which the described actions lead (`VnlaTeacher.reference`), which may be a turn
    on the spot: its node alone does not say that anything was done.
    """

    def _replied(self, reply: interface.Reply) -> None:
        self.mode, self.subtask = interface.Mode.SUB, required(reply.subtask, "sub-task in the reply")
        self.instruction = required(reply.text, "text in the reply")  # lines 6-8
        self.targets = (self.subtask.target,)
        self.time_on_task = 0

    def _stopped(self) -> None:
        if self.mode is interface.Mode.MAIN:  # lines 15-16
            self.ended = "stop"
            return
        self.mode, self.instruction, self.subtask = interface.Mode.MAIN, self.task.request, None  # line 13
        self.targets = self.task.goal_nodes
        self.time_on_task = 0


RULES_OF_PLAY: Mapping[str, type[HelpEnv]] = {
    "indirect": VnlaEnv,
    "direct": DirectVnlaEnv,
    "direct-mute": MuteDirectVnlaEnv,
    "algorithm-6": Algorithm6Env,
}
"""Rules of play by the names that commands know them by; the first is the program's with help in words."""


def check_rules(rules: str) -> None:
    """Raises ValueError for a rule that is none."""
    if rules not in RULES_OF_PLAY:
        raise ValueError(f"unknown rules {rules!r} of VNLA; use one of {sorted(RULES_OF_PLAY)}")


def fitted(task: interface.Task, world: interface.Place, rules: str) -> interface.Task:
    """The task with time enough under a rule of play: Algorithm 6 takes a step for every request and one to come back
    from every sub-task (docs/sources.md, S111)."""
    check_rules(rules)
    more = 2 * math.ceil(task.budget or 0) if rules == "algorithm-6" else 0
    return dataclasses.replace(task, horizon=task.horizon + more)


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


def learned_limits(training: Sequence[interface.Task], place: Callable[[str], interface.Place]) -> Limits:
    """Time limits by `limit_key`, from the lengths of training tasks."""
    lengths = [
        (*limit_key(place(t.world), t.start.node, t.goal), t.horizon)
        for t in training
        if isinstance(t.goal, interface.FindObject)  # as all of VNLA's are
    ]
    return time_limits(lengths, MOST_ACTIONS)


def limited(task: interface.Task, world: interface.Place, limits: Limits) -> interface.Task:
    """A task with the time limit of its rooms, and the budget that goes with it."""
    assert isinstance(task.goal, interface.FindObject), "VNLA tasks look for objects"
    key = limit_key(world, task.start.node, task.goal)
    horizon = max(task.horizon, limits.get(key, MOST_ACTIONS))
    return dataclasses.replace(task, horizon=horizon, budget=help_budget(horizon))


def room_success(episode: interface.Episode, graph: NavGraph) -> float:
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

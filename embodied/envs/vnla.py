"""VNLA's rules of play: the program's, direct intervention, and Algorithm 6 as printed (dissertation 4.1)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from embodied.action_spaces import WORDS, Reach, directions
from embodied.envs.base import HelpEnv, required
from embodied.geometry import wrap
from embodied.interface import (
    STEP,
    Action,
    Ask,
    Intention,
    Mode,
    Move,
    Observation,
    Place,
    Pose,
    Reply,
    Situation,
    Stop,
    Task,
)
from embodied.navigation.graph import nearest
from embodied.teachers.vnla import AskRules, GoalAwareTeacher, VnlaTeacher


class VnlaEnv(HelpEnv):
    """VNLA as the authors' program plays it (docs/sources.md, S43): help costs no step.

    The sub-goal is put before the request and stays until the next one; stopping ends the
    episode even inside a sub-goal. After a request the same time step goes on with a move.
    """

    asking_takes_time = False

    def _begin(self) -> None:
        self._answered_at = -1

    def _askable(self, situation: Situation) -> tuple[Intention, ...]:
        return () if self._answered_at == self.time else super()._askable(situation)

    def _replied(self, reply: Reply) -> None:
        self._answered_at = self.time
        self.instruction = f"{reply.text} . {self.task.request}"
        self.subtask = reply.subtask
        self.time_on_task = 0


class GoalAwareVnlaEnv(VnlaEnv):
    """VNLA with the program's 'forward' (docs/sources.md, S44): it prefers the next node of the optimal path.

    That tells the agent something about the goal whenever it goes forward, at test time too; it
    is here for comparison with the published numbers. Its teacher is GoalAwareTeacher.
    """

    def _reachable(self) -> Reach:
        candidates, poses = super()._reachable()
        graph, pose = self.world.graph, self.pose
        goal = nearest(graph, pose.node, self.task.goal_nodes)
        nodes, yaw, _pitch = directions(graph, pose.node)
        wanted = np.flatnonzero(nodes == int(graph.next_hop[pose.node, goal]))
        if goal == pose.node or not len(wanted):
            return candidates, poses
        i = int(wanted[0])
        if abs(wrap(yaw[i] - pose.yaw)) > STEP + 1e-9:
            return candidates, poses
        allowed = candidates.allowed.copy()
        allowed[0] = True
        return dataclasses.replace(candidates, allowed=allowed), (Pose(int(nodes[i]), pose.turn, pose.tilt), *poses[1:])


class DirectVnlaEnv(VnlaEnv):
    """Direct intervention (dissertation 4.1.3): after a request the advisor acts in the agent's place."""

    def _begin(self) -> None:
        super()._begin()
        self._orders: tuple[str, ...] = ()

    def _replied(self, reply: Reply) -> None:
        super()._replied(reply)
        self._orders = required(reply.subtask, "sub-task in the reply").words

    def step(self, action: Action) -> Observation | None:
        """Like HelpEnv.step, but a move or stop is replaced while orders are pending; the Step says by what."""
        self._check(action)
        if self._orders and not isinstance(action, Ask):
            word, self._orders = self._orders[0], self._orders[1:]
            action = Stop(action.thought) if word == "stop" else Move(WORDS.index(word), action.thought)
        return super().step(action)


class MuteDirectVnlaEnv(DirectVnlaEnv):
    """Direct intervention that is not put into words: the agent reads its request throughout."""

    def _replied(self, reply: Reply) -> None:
        time_on_task = self.time_on_task
        super()._replied(reply)
        self.instruction, self.time_on_task = self.task.request, time_on_task  # the instruction has not changed


class Algorithm6Env(HelpEnv):
    """I3L as Algorithm 6 prints it: asking costs a step, the instruction replaces the request,
    and stopping in a sub-task goes back to the request (the operator (+) of 4.1.3 overwrites).

    A sub-task ends in the pose to which the described actions lead (`VnlaTeacher.reference`), which may be a turn
    on the spot: its node alone does not say that anything was done.
    """

    def _replied(self, reply: Reply) -> None:
        self.mode, self.subtask = Mode.SUB, required(reply.subtask, "sub-task in the reply")
        self.instruction = required(reply.text, "text in the reply")  # lines 6-8
        self.targets = (self.subtask.target,)
        self.time_on_task = 0

    def _stopped(self) -> None:
        if self.mode is Mode.MAIN:  # lines 15-16
            self.ended = "stop"
            return
        self.mode, self.instruction, self.subtask = Mode.MAIN, self.task.request, None  # line 13
        self.targets = self.task.goal_nodes
        self.time_on_task = 0


RULES: Mapping[str, type[HelpEnv]] = {
    "indirect": VnlaEnv,
    "direct": DirectVnlaEnv,
    "direct-mute": MuteDirectVnlaEnv,
    "goal-aware": GoalAwareVnlaEnv,
    "algorithm-6": Algorithm6Env,
}
"""Rules of play by the names that commands know them by; the first is the program's with help in words."""


ALL_RULES = AskRules()


def teacher_of(rules: str, asking: AskRules = ALL_RULES) -> VnlaTeacher:
    """The teacher of a rule of play.

    Args:
      asking: when it would ask.

    Raises:
      ValueError: an unknown rule.
    """
    check_rules(rules)
    return GoalAwareTeacher(rules=asking) if rules == "goal-aware" else VnlaTeacher(rules=asking)


def check_rules(rules: str) -> None:
    """Raises ValueError for a rule that is none."""
    if rules not in RULES:
        raise ValueError(f"unknown rules {rules!r} of VNLA; use one of {sorted(RULES)}")


def fitted(task: Task, world: Place, rules: str, teacher: VnlaTeacher) -> Task:
    """The task with time enough under a rule of play (docs/sources.md, S111).

    Algorithm 6 takes a step for every request and one to come back from every sub-task; the teacher of the goal-aware
    rule may need more actions than ours. The budget is left as it is.
    """
    horizon = task.horizon
    if rules == "algorithm-6":
        horizon += 2 * math.ceil(task.budget or 0)
    elif rules == "goal-aware":
        horizon = max(horizon, len(teacher.words(world, task.start, task.goal_nodes, LONGEST)[0]))
    return dataclasses.replace(task, horizon=horizon)


LONGEST = 200
"""Actions after which a teacher's walk is given up; no house is that large."""

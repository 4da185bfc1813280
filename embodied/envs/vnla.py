"""VNLA's rules of play: the program's, direct intervention, and Algorithm 6 as printed (dissertation 4.1)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

from embodied.action_spaces import WORDS
from embodied.envs.base import HelpEnv, required
from embodied.interface import Action, Ask, Intention, Mode, Move, Observation, Place, Reply, Situation, Stop, Task


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


def fitted(task: Task, world: Place, rules: str) -> Task:
    """The task with time enough under a rule of play: Algorithm 6 takes a step for every request and one to come back
    from every sub-task (docs/sources.md, S111)."""
    check_rules(rules)
    more = 2 * math.ceil(task.budget or 0) if rules == "algorithm-6" else 0
    return dataclasses.replace(task, horizon=task.horizon + more)

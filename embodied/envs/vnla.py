"""VNLA's rules of play: the program's, direct intervention, and Algorithm 6 as printed (dissertation 4.1)."""

from __future__ import annotations

import dataclasses

import numpy as np

from embodied.action_spaces import WORDS, Reach, directions
from embodied.envs.base import HelpEnv, required
from embodied.geometry import wrap
from embodied.interface import STEP, Action, Ask, Intention, Mode, Move, Observation, Pose, Reply, Situation, Stop
from embodied.navigation.graph import nearest


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
    is here for comparison with the published numbers. Its teacher is `stepwise_action`.
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


class Algorithm6Env(HelpEnv):
    """I3L as Algorithm 6 prints it: asking costs a step, the instruction replaces the request,
    and stopping in a sub-task goes back to the request (the operator (+) of 4.1.3 overwrites)."""

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

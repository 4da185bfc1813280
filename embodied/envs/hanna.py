"""HANNA's rule of play: two modes, people who know routes, images of where to go (dissertation 4.2.2)."""

from __future__ import annotations

from embodied.envs.base import HelpEnv, required
from embodied.interface import Mode, Reply, Viewpoint


class HannaEnv(HelpEnv):
    """Algorithm 7 of dissertation 4.2.2: two modes, people who know routes, images of where to go."""

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

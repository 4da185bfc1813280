"""VNLA's advisor: always there, knows everything, says the next k optimal actions (dissertation 4.1)."""

from __future__ import annotations

import numpy as np

from embodied.interface import Intention, Language, Reply, Situation, Subtask
from embodied.teachers.vnla import VnlaTeacher

HELP_STEPS = 4
"""k: how many actions an instruction describes (docs/sources.md, S48)."""


class Advisor:
    """Speaks the teacher's next k actions (4.1) towards the task's goals.

    It uses the teacher's plan because it has perfect knowledge (footnote 1 of 4.1.2); that does
    not make it the teacher: it never labels, it only answers.
    """

    def __init__(self, teacher: VnlaTeacher, language: Language, steps: int = HELP_STEPS) -> None:
        self._teacher, self._language, self._steps = teacher, language, steps

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        """Help, everywhere; the environment takes it away when the budget is spent."""
        return (Intention.HELP,)

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        s = situation
        words, end = self._teacher.words(s.world, s.pose, s.task.goal_nodes, self._steps)
        path = s.world.graph.path(s.pose.node, end.node)
        subtask = Subtask("subgoal", end.node, start=s.pose, path=path, words=words)
        return Reply(text=self._language.subgoal(words), subtask=subtask)

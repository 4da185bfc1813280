"""Judges of asking: what Ask-F1 counts in an episode, and environments in which nobody can be asked at first."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from embodied.envs.base import HelpEnv
from embodied.interface import Ask, Assistant, Episode, FindDescribed, Intention, Reply, Situation
from embodied.kinds.metrics import success

if TYPE_CHECKING:
    from embodied.navigation.graph import NavGraph


@dataclass(frozen=True)
class AskCounts:
    """Numbers of one episode, whose sums over episodes make the measures below."""

    questions: int
    needed: int
    """Questions that were needed; each clears one blocker."""
    left: int
    """1 if a blocker is left at the end."""


def ask_counts(episode: Episode, graph: NavGraph) -> AskCounts:
    """Questions and blockers of an episode, for question precision (needed / questions), the share of blockers cleared
    (needed / (needed + left)) and their harmonic mean, Ask-F1 (2 needed / (questions + needed + left)).

    After HiL-Bench (Elfeki et al. 2026, arXiv 2604.09408), where a blocker is information that a task lacks and that no
    exploring brings, and precise questions are those about blockers. Theirs were written by people; ours follow from
    the truth:

      Ask-v0: one is blocked while the request and the answers fit several things. A question was needed if its answer
        rules out one of them, or tells a route to its end.
      HANNA, VNLA, HARI: one is blocked where one does not get on by oneself. A question on a way that the last answer
        tells in words, short of its end, was not needed. Another was needed if the agent, before it asks the next such
        question, comes nearer to a goal than it ever was, or succeeds. Who fails is blocked at the end.

    What would have happened without the answer is not known: compare with the agent that never asks.
    """
    if isinstance(episode.task.goal, FindDescribed):
        return _among_rivals(episode, episode.task.goal)
    metres = np.asarray(graph.distance)[:, list(episode.task.goal_nodes)].min(axis=1)
    steps, good = episode.steps, bool(success(episode, graph))
    new, told_way = list[int](), tuple[int, ...]()
    for t, step in enumerate(steps):
        if isinstance(step.action, Ask):
            new += [t] if step.pose.node not in told_way else []
            told_way = step.reply.subtask.path[:-1] if step.reply and step.reply.text and step.reply.subtask else ()
    needed = 0
    for t, after in itertools.pairwise([*new, len(steps)]):
        before = metres[[s.pose.node for s in steps[: t + 1]]].min()
        nearer = metres[[s.next_pose.node for s in steps[t:after]]].min() < before - 1e-6
        needed += int(nearer or (good and after == len(steps)))
    return AskCounts(episode.requests, needed, int(not good))


def _among_rivals(episode: Episode, goal: FindDescribed) -> AskCounts:
    """Of Ask-v0: rivals are the things that fit and are not meant."""
    rivals, needed = {*goal.fitting} - {goal.placement}, 0
    for reply in (s.reply for s in episode.steps if s.reply is not None):
        led = reply.subtask is not None and reply.subtask.target in episode.task.goal_nodes
        left = set() if led else rivals - {*reply.ruled_out}
        needed, rivals = needed + (left != rivals), left
    return AskCounts(episode.requests, needed, int(bool(rivals)))


def late_env(make_env: Callable[[], HelpEnv], share: float) -> HelpEnv:
    """An environment in which nobody can be asked before a share of the task's steps has passed."""
    env = make_env()
    env.assistant = env.assistant and LateAssistant(env.assistant, share)
    return env


@dataclass(frozen=True)
class LateAssistant:
    assistant: Assistant
    share: float

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        early = situation.time < self.share * situation.task.horizon
        return () if early else self.assistant.intentions(situation)

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        return self.assistant.answer(situation, question, rng=rng)

"""Routes in words: a scripted listener follows what a language model said of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from embodied.interface import Episode, SeenPlace
from embodied.language import follow
from embodied.language.people_language import ARRIVED
from embodied.language.plain_language import heard_subgoal


def listener_arrives(world: SeenPlace, text: str, path: Sequence[int], yaw: float) -> bool:
    """True where somebody who only reads `text` comes within ARRIVED metres of the end of `path`.

    Args:
      yaw: direction at the beginning, radians.
    """
    try:
        walked = follow(world, text, path[0], yaw).path
    except ValueError:  # nothing in it is an instruction
        return False
    return float(world.graph.distance[walked[-1], path[-1]]) <= ARRIVED


def followed_replies(episodes: Iterable[Episode], worlds: Mapping[str, SeenPlace]) -> tuple[int, int]:
    """Of the replies that told a way: those that a listener carries out, and all."""
    right = total = 0
    for episode in episodes:
        for step in episode.steps:
            subtask = step.reply.subtask if step.reply else None
            if subtask is None or not step.reply or not step.reply.text or len(subtask.path) < 2:
                continue
            total += 1
            if subtask.words:  # VNLA: primitive actions
                right += _subgoal_in(step.reply.text) == subtask.words
            else:
                start = subtask.start or step.pose
                right += listener_arrives(worlds[episode.task.world], step.reply.text, subtask.path, start.yaw)
    return right, total


def _subgoal_in(text: str) -> tuple[str, ...]:
    try:
        return heard_subgoal(text)
    except (ValueError, IndexError):  # words that are no steps
        return ()

"""Routes in words: a language model paraphrases them; a scripted listener follows them.

`embodied llm paraphrase` paraphrases a split: of its routes only
those are kept whose words lead to the same place.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from embodied.agents.language_models.client import Client
from embodied.agents.language_models.completions import object_schema
from embodied.agents.language_models.prompts import read_prompt
from embodied.interface import STEP, Episode, Route, SeenPlace, Usage
from embodied.language import follow
from embodied.language.people_language import ARRIVED
from embodied.language.plain_language import heard_subgoal

PARAPHRASE = object_schema(instruction={"type": "string", "maxLength": 800})
STYLES = (
    "a friend on the phone, chatty",
    "very short, a few words",
    "a polite guide",
    "somebody who names furniture and colours",
    "a child",
    "a non-native speaker with simple words",
)


@dataclass(frozen=True)
class Paraphrases:
    """A model's paraphrases, and how many of them were dropped."""

    routes: tuple[Route, ...]
    """Those that a listener follows to their end, one or none per route that was given."""
    asked: int
    invalid: int
    """Answers that were none."""
    unchanged: int
    """The same words again."""
    lost: int
    """Words with which the listener does not arrive."""
    usage: Usage

    @property
    def failing(self) -> float:
        """The share that was dropped."""
        return 1.0 - len(self.routes) / self.asked if self.asked else 0.0


def paraphrased(
    routes: Sequence[tuple[str, Route]], worlds: Mapping[str, SeenPlace], client: Client, prompts: Path | None = None
) -> Paraphrases:
    """Every route in other words.

    Args:
      routes: each with the name of its house.
      prompts: folder with a paraphrase.md of one's own.
    """
    prompt = read_prompt("paraphrase", ("text", "style"), prompts)
    styles = itertools.cycle(STYLES)
    asked = [(prompt.messages(text=r.instruction, style=s), PARAPHRASE) for (_, r), s in zip(routes, styles)]
    kept, invalid, unchanged, lost, usage = [], 0, 0, 0, Usage()
    for (house, route), answer in zip(routes, client.ask_all(asked), strict=True):
        usage += client.usage(answer)
        text = "" if answer.value is None else str(answer.value["instruction"]).strip()
        if not text:
            invalid += 1
        elif text.lower() == route.instruction.lower():
            unchanged += 1
        elif not listener_arrives(worlds[house], text, route.path, route.turn * STEP):
            lost += 1
        else:
            kept.append(dataclasses.replace(route, id=f"{route.id}_said_again", instruction=text))
    return Paraphrases(tuple(kept), len(routes), invalid, unchanged, lost, usage)


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

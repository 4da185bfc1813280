"""The plainest voice: requests, turns and room names, without landmarks or style."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from embodied.geometry import wrap
from embodied.interface import FindObject

if TYPE_CHECKING:
    from embodied.world import World


class PlainLanguage:
    """A `Language` that says the same thing in the same words; draws nothing."""

    def request(self, goal: FindObject, *, rng: np.random.Generator) -> str:
        """'find a mug', 'find a towel in one of the bathrooms'."""
        where = f" in a {goal.room_kind.replace('_', ' ')}" if goal.room_kind else ""
        return f"find {with_article(goal.object_class)}{where}"

    def route(self, world: World, path: Sequence[int], yaw: float, *, rng: np.random.Generator) -> str:
        """'turn left and go to the hall . go straight . stop .'; `yaw` is the walker's first direction, radians."""
        positions = np.asarray(world.graph.positions)
        parts = []
        for a, b in itertools.pairwise(path):
            offset = positions[b] - positions[a]
            direction = math.atan2(offset[1], offset[0])
            room = world.graph.room_of_node[b]
            words = turn_words(float(wrap(direction - yaw)))
            if room != world.graph.room_of_node[a]:
                kind = world.house.room_by_id[room].kind
                words += f" into the {kind.replace('_', ' ')}"
            parts.append(words)
            yaw = direction
        return " . ".join([*parts, "stop"]) + " ."

    def subgoal(self, words: Sequence[str]) -> str:
        """VNLA's 'hard' sub-goal language (originals 4.4): 'turn 60 degrees left , go forward 2 steps'.

        Differs from the authors' program in one thing: repeated 'look up' or 'look down' is said
        once instead of being dropped in silence.
        """
        merged: list[tuple[str, int]] = []
        for word in words:
            if merged and merged[-1][0] == word:
                merged[-1] = (word, merged[-1][1] + 1)
            else:
                merged.append((word, 1))
        return " , ".join(_say(word, n) for word, n in merged)


def _say(word: str, times: int) -> str:
    if word in ("left", "right"):
        return f"turn {word}" if times == 1 else f"turn {30 * times} degrees {word}"
    if word in ("up", "down"):
        return f"look {word}"
    if word == "forward":
        return "go forward" if times == 1 else f"go forward {times} steps"
    return word


def turn_words(angle: float) -> str:
    """A turn by `angle` radians (left positive) in words."""
    degrees = math.degrees(angle)
    side = "left" if degrees > 0 else "right"
    if abs(degrees) <= 20:
        return "go straight"
    if abs(degrees) <= 60:
        return f"turn slightly {side} and go"
    if abs(degrees) <= 120:
        return f"turn {side} and go"
    return f"turn around to your {side} and go"


def with_article(noun: str) -> str:
    """'a mug', 'an armchair'; nouns that are plural in form keep 'some'."""
    if noun.endswith("s") and not noun.endswith(("ss", "us", "is")):
        return f"some {noun}"
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"

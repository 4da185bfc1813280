"""HARI's descriptions as arrays of numbers, for observations of Gymnasium environments."""

from __future__ import annotations

import bisect
import functools

import numpy as np

from embodied.assets.catalogue import load_catalogue
from embodied.assets.records import ROOM_KINDS
from embodied.assistants.descriptions import MOST_OBJECTS
from embodied.interface import Description

FEATURE_KINDS = ("object", "room", "action")
ACTION_WORDS = ("go", "stop")
"""Names of features of kind 'action'."""
OWN_WORDS = 4096
"""Numbers for object classes of people's own."""
DESCRIPTION_ROWS = MOST_OBJECTS + 1
"""Most feature sets of a description: a room and its objects."""


def description_rows(description: Description) -> np.ndarray:
    """(ROWS, 5) float32: kind + 1 (0 is padding), name by `word_number`, horizontal, vertical + 1, distance."""
    rows = np.zeros((DESCRIPTION_ROWS, 5), dtype=np.float32)
    for i, f in enumerate(description[:DESCRIPTION_ROWS]):
        rows[i] = FEATURE_KINDS.index(f.kind) + 1, word_number(f.name), f.horizontal, f.vertical + 1, f.distance
    return rows


@functools.cache
def words() -> tuple[str, ...]:
    """The words of descriptions, sorted: actions, room kinds and the catalogue's object classes."""
    return tuple(sorted({*ACTION_WORDS, *ROOM_KINDS, *load_catalogue().classes}))


@functools.cache
def word_number(word: str) -> int:
    """The number of a word, from 1, the same in every process.

    Object classes of people's own models are not in the catalogue; they get a number above all
    others, which two of them may share.
    """
    known = words()
    place = bisect.bisect_left(known, word)
    if place < len(known) and known[place] == word:
        return place + 1
    return len(known) + 1 + _stable(word) % OWN_WORDS


def _stable(word: str) -> int:
    total = 0
    for c in word:
        total = (total * 131 + ord(c)) % 2_147_483_647
    return total

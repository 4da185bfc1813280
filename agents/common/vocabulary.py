"""Words to numbers: the vocabulary of a data set and the one tokenizer every learner uses."""

from __future__ import annotations

import collections
import functools
import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

PAD, UNKNOWN, END = "<PAD>", "<UNK>", "<EOS>"
"""The first three words of every vocabulary; padding is number 0."""

_TOKEN = re.compile(r"[a-z]+(?:'[a-z]+)?|[0-9]+|[^\sa-z0-9]")


def tokenize(text: str) -> list[str]:
    """Lower-case words, numbers and single punctuation marks, in order."""
    return _TOKEN.findall(text.lower())


@dataclass(frozen=True)
class Vocabulary:
    words: tuple[str, ...]
    """Word of each number; starts with PAD, UNKNOWN, END."""

    def __post_init__(self) -> None:
        if self.words[:3] != (PAD, UNKNOWN, END):
            raise ValueError(f"a vocabulary starts with {PAD}, {UNKNOWN}, {END}; this one with {self.words[:3]}")
        if len(set(self.words)) < len(self.words):
            raise ValueError("a vocabulary holds a word twice; build it with build_vocabulary")

    def __len__(self) -> int:
        return len(self.words)

    @functools.cached_property
    def number_of(self) -> dict[str, int]:
        return {word: i for i, word in enumerate(self.words)}

    def number(self, word: str) -> int:
        """The number of a word, that of UNKNOWN where there is none."""
        return self.number_of.get(word, 1)

    def encode(self, text: str, length: int) -> np.ndarray:
        """(length,) int64 numbers of the words, then END if it fits, then padding."""
        numbers = [self.number(word) for word in tokenize(text)[:length]]
        if len(numbers) < length:
            numbers.append(2)
        return np.array(numbers + [0] * (length - len(numbers)), dtype=np.int64)


def build_vocabulary(texts: Iterable[str], least: int = 1) -> Vocabulary:
    """The vocabulary of `texts`: words seen at least `least` times, most frequent first, ties by alphabet."""
    count = collections.Counter(word for text in texts for word in tokenize(text))
    frequent = sorted((w for w, n in count.items() if n >= least), key=lambda w: (-count[w], w))
    return Vocabulary((PAD, UNKNOWN, END, *frequent))

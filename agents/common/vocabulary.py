"""Words to numbers: the vocabulary of a data set and the one tokenizer every learner uses."""

import collections
import functools
import itertools
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

PAD, UNKNOWN, END = "<PAD>", "<UNK>", "<EOS>"
"""The first three words of every vocabulary."""
PAD_NUMBER, UNKNOWN_NUMBER, END_NUMBER = 0, 1, 2
REMEMBERED = 200_000
"""Texts whose numbers a vocabulary remembers: the same ones come again and again."""

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
        return self.number_of.get(word, UNKNOWN_NUMBER)

    def encode(self, text: str, length: int, *, backwards: bool = False) -> np.ndarray:
        """(length,) int64 numbers of the words, then END if it fits, then padding; not to be changed.

        Args:
          backwards: the last word first; of a text that is too long, its end is left out and END is kept.
        """
        key = text, length, backwards
        encoded = self._encoded.get(key)
        if encoded is None:
            if len(self._encoded) >= REMEMBERED:
                self._encoded.clear()
            words = tokenize(text)
            numbers = self.sentence(words[: length - 1][::-1] if backwards else words)[:length]
            padding = [PAD_NUMBER] * (length - len(numbers))
            encoded = self._encoded[key] = np.array(numbers + padding, dtype=np.int64)
        return encoded

    def sentence(self, words: Iterable[str]) -> list[int]:
        """Numbers of words, END last."""
        return [*map(self.number, words), END_NUMBER]

    def batch(self, texts: Sequence[str], length: int) -> np.ndarray:
        """(B, L) int64 of several texts as `encode` gives them, no longer than the longest of them."""
        rows = np.stack([self.encode(text, length) for text in texts])
        return rows[:, : int((rows != PAD_NUMBER).sum(1).max())]

    def decode(self, numbers: Iterable[int]) -> tuple[str, ...]:
        """Words of the numbers before the first END, without padding."""
        before = itertools.takewhile(lambda n: n != END_NUMBER, numbers)
        return tuple(self.words[n] for n in before if n != PAD_NUMBER)

    def texts(self, rows: Iterable[Iterable[int]]) -> list[str]:
        """Texts of rows of numbers, each up to its END."""
        return [" ".join(self.decode(row)) for row in rows]

    @functools.cached_property
    def _encoded(self) -> dict[tuple[str, int, bool], np.ndarray]:
        return {}


def build_vocabulary(texts: Iterable[str], least: int = 1) -> Vocabulary:
    """The vocabulary of `texts`: words seen at least `least` times, most frequent first, ties by alphabet."""
    return most_frequent((word for text in texts for word in tokenize(text)), least=least)


def most_frequent(words: Iterable[str], least: int = 1, most: int | None = None) -> Vocabulary:
    """The vocabulary of words seen at least `least` times, at most `most` numbers; most frequent first, ties by
    alphabet."""
    count = collections.Counter(words)
    frequent = sorted((w for w, n in count.items() if n >= least), key=lambda w: (-count[w], w))
    return Vocabulary((PAD, UNKNOWN, END, *frequent)[:most])

"""Words to numbers and back, for one language."""

from __future__ import annotations

import collections
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from agents.common.vocabulary import END, PAD, UNKNOWN, Vocabulary

PAD_NUMBER, UNKNOWN_NUMBER, END_NUMBER = 0, 1, 2
"""Numbers of PAD, UNKNOWN and END; END also stands before the first word of a translation."""


@dataclass(frozen=True)
class Words:
    """Turns the words of a sentence into numbers, and numbers into words; those that are too rare are UNKNOWN."""

    vocabulary: Vocabulary

    def __len__(self) -> int:
        return len(self.vocabulary)

    def encode(self, words: Sequence[str]) -> list[int]:
        """Numbers of the words, END last."""
        number = self.vocabulary.number_of
        return [number.get(w, UNKNOWN_NUMBER) for w in words] + [END_NUMBER]

    def decode(self, numbers: Sequence[int]) -> tuple[str, ...]:
        """Words of the numbers before the first END, all if there is none."""
        found = [int(n) for n in numbers]
        kept = found[: found.index(END_NUMBER)] if END_NUMBER in found else found
        return tuple(self.vocabulary.words[n] for n in kept)


def build_words(sentences: Iterable[Sequence[str]], most: int) -> Words:
    """The `most` numbers of a language: PAD, UNKNOWN, END, then words by frequency, ties by alphabet."""
    count = collections.Counter(w for s in sentences for w in s)
    frequent = sorted(count, key=lambda w: (-count[w], w))
    return Words(Vocabulary((PAD, UNKNOWN, END, *frequent[: most - 3])))

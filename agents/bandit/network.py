"""Attention encoder-decoders (dissertation 3.1.3.1, appendix A): the translator, and the critic alike; and translating:
batches of sentences, sampled and greedy decoding.

B sentences, S source and T target words, h hidden size, V target vocabulary. Each line carries the
number of the equation it computes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from embodied.agents.common.tensors import Choice, Remembered, Rows, greedy_choice, padded
from embodied.agents.common.vocabulary import END_NUMBER, PAD_NUMBER, Vocabulary
from embodied.agents.common.weights import load_into, load_weights, save_weights
from embodied.agents.learners.bandit import BanditConfig
from embodied.records import Identity

Network = TypeVar("Network", bound=nn.Module)
SPAN = 0.1
"""Weights begin uniform in [-SPAN, SPAN], as in the authors' program."""


@dataclass(frozen=True, eq=False)
class Decoding(Rows):
    """The decoder's state from word to word."""

    hidden: Tensor
    cell: Tensor
    """(B, h) of its LSTM; hidden is tilde h^dec."""
    output: Tensor
    """(B, h) h^dec, fed into the next step."""


class EncoderDecoder(nn.Module):
    """Reads a source sentence, remembers the hidden vectors of the encoder with W_a times them as keys, and says one
    number-to-be per target word: h^dec."""

    def __init__(self, source_words: int, target_words: int, size: int) -> None:
        super().__init__()
        self.source = nn.Embedding(source_words, size)
        self.target = nn.Embedding(target_words, size)
        self.encoder = nn.LSTM(size, size, batch_first=True)
        self.word_gates = nn.Linear(size, 4 * size)
        self.gates = nn.Linear(2 * size, 4 * size, bias=False)
        self.attend = nn.Linear(size, size, bias=False)
        self.combine = nn.Linear(2 * size, size, bias=False)

    def encode(self, source: Tensor) -> tuple[Remembered, Decoding]:
        """Read (B, S) int64 numbers; the decoder starts where the encoder ended, Phi(x)."""
        lengths = (source != PAD_NUMBER).sum(1)
        packed = nn.utils.rnn.pack_padded_sequence(self.source(source), lengths, batch_first=True, enforce_sorted=False)
        states, (hidden, cell) = self.encoder(packed)
        states, _ = nn.utils.rnn.pad_packed_sequence(states, batch_first=True, total_length=source.shape[1])
        encoded = Remembered(states, self.attend(states), source != PAD_NUMBER)
        return encoded, Decoding(hidden[0], cell[0], torch.zeros_like(hidden[0]))

    def step(self, encoded: Remembered, now: Decoding, word_gates: Tensor) -> Decoding:
        """One step of Eq A.5; `word_gates` (B, 4h) is what the word before adds to the LSTM's gates."""
        gates = word_gates + self.gates(torch.cat([now.output, now.hidden], -1))  # A.5, with input feeding
        enter, forget, leave, content = gates.chunk(4, -1)
        cell = forget.sigmoid() * now.cell + enter.sigmoid() * content.tanh()
        hidden = leave.sigmoid() * cell.tanh()
        scores = torch.bmm(encoded.keys, hidden[:, :, None])[..., 0]  # (B, S) "general": h_t^T W_a h_s
        weights = scores.masked_fill(~encoded.mask, -torch.inf).softmax(-1)
        context = torch.bmm(weights[:, None], encoded.values)[:, 0]  # (B, h) A.4
        return Decoding(hidden, cell, torch.tanh(self.combine(torch.cat([hidden, context], -1))))  # A.3

    def word_before(self, words: Tensor) -> Tensor:
        """The part that known words (...) int64 add to the gates, (..., 4h); END stands before the first one."""
        return self.word_gates(self.target(words))

    def read(self, source: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
        """h^dec before each word of `target` (B, T), whose words are given (teacher forcing).

        Returns:
          (N, h) of the N words, and (N,) their places in the flat (B, T).
        """
        known = target != PAD_NUMBER
        order = known.sum(1).argsort(descending=True, stable=True)
        step, rank = known[order].t().nonzero(as_tuple=True)
        # all first words, then all second ones, the longest sentence first
        places = order[rank] * target.shape[1] + step
        encoded, now = self.encode(source)
        encoded, now = encoded.select(order), now.select(order)
        begin = torch.full_like(target[:, :1], END_NUMBER)
        before = torch.cat([begin, target[:, :-1]], 1).flatten()[places]
        outputs = []
        for gates in self.word_before(before).split(known.sum(0).tolist()):
            going = slice(len(gates))  # nothing is computed behind a sentence's end: samples differ much in length
            encoded, now = encoded.select(going), now.select(going)
            now = self.step(encoded, now, gates)
            outputs.append(now.output)
        return torch.cat(outputs), places


class Translator(nn.Module):
    """P_theta(y | x), Eq 3.1."""

    def __init__(self, source_words: int, target_words: int, size: int) -> None:
        super().__init__()
        self.body = EncoderDecoder(source_words, target_words, size)
        self.out = nn.Linear(size, target_words, bias=False)

    def forward(self, source: Tensor, target: Tensor) -> Tensor:
        """log P(y_t | y_<t, x), (B, T), zero on padding."""
        outputs, places = self.body.read(source, target)
        loss = nn.functional.cross_entropy(self.out(outputs), target.flatten()[places], reduction="none")  # A.2
        return spread(-loss, places, target)


class Critic(nn.Module):
    """V_omega(y_<t, x) = w^T h_t^crt (3.1.3.4)."""

    def __init__(self, source_words: int, target_words: int, size: int) -> None:
        super().__init__()
        self.body = EncoderDecoder(source_words, target_words, size)
        self.out = nn.Linear(size, 1, bias=False)

    def forward(self, source: Tensor, target: Tensor) -> Tensor:
        """The rating to be expected before each word, (B, T), zero on padding."""
        outputs, places = self.body.read(source, target)
        return spread(self.out(outputs)[:, 0], places, target)


def spread(numbers: Tensor, places: Tensor, target: Tensor) -> Tensor:
    """(N,) numbers at their places in a (B, T) of zeros."""
    return numbers.new_zeros(target.numel()).index_copy(0, places, numbers).view(target.shape)


def begin(network: Network, generator: torch.Generator) -> Network:
    """Draw all weights anew, uniform in [-SPAN, SPAN]."""
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.uniform_(-SPAN, SPAN, generator=generator)
    return network


TRANSLATOR_REMEDY = "delete it and train it again with `embodied study bandit`"


@dataclass(frozen=True)
class BanditAbout:
    """Metadata beside the weights in a file."""

    config: BanditConfig
    source: tuple[str, ...]
    target: tuple[str, ...]
    """The words of the two languages."""


def save_network(
    network: nn.Module, config: BanditConfig, lexicons: tuple[Vocabulary, Vocabulary], path: Path, identity: Identity
) -> None:
    """Write weights, settings, words and what they were trained with, atomically."""
    source, target = (x.words for x in lexicons)
    save_weights(path, "bandit", network.state_dict(), BanditAbout(config, source, target), identity)


def load_network(network: nn.Module, path: Path) -> None:
    """Put what `save_network` wrote into `network`.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    load_into(network, load_weights(path, "bandit", BanditAbout, TRANSLATOR_REMEDY)[0], path)


POOL = 20
"""Batches that are sorted by length together."""


@dataclass(frozen=True, eq=False)
class TokenizedCorpus:
    """Sentence pairs as numbers."""

    source: Sequence[Sequence[int]]
    target: Sequence[Sequence[int]]
    """Both end with END."""
    references: Sequence[tuple[str, ...]]
    """The target's words as they are, unknown ones included: what ratings compare with."""

    def __len__(self) -> int:
        return len(self.source)


def tokenized(
    pairs: Sequence[tuple[Sequence[str], Sequence[str]]], source: Vocabulary, target: Vocabulary
) -> TokenizedCorpus:
    """`pairs` in the numbers of two lexicons."""
    return TokenizedCorpus(
        [source.sentence(a) for a, _ in pairs], [target.sentence(b) for _, b in pairs], [tuple(b) for _, b in pairs]
    )


def batches(lengths: Sequence[int], size: int, rng: np.random.Generator) -> list[np.ndarray]:
    """A random order of all sentences, in batches of similar length, the shorter last batch included."""
    order, measured = rng.permutation(len(lengths)), np.asarray(lengths)
    pools = [order[i : i + POOL * size] for i in range(0, len(order), POOL * size)]
    pools = [pool[np.argsort(measured[pool], kind="stable")] for pool in pools]
    batches = [pool[i : i + size] for pool in pools for i in range(0, len(pool), size)]
    return [batches[i] for i in rng.permutation(len(batches))]


def in_order(lengths: Sequence[int], size: int) -> Iterator[np.ndarray]:
    """All sentences by length, in batches, for judging."""
    order = np.argsort(np.asarray(lengths), kind="stable")
    return (order[i : i + size] for i in range(0, len(order), size))


@torch.no_grad()
def decode(translator: Translator, source: Tensor, choose: Choice, longest: int) -> list[list[int]]:
    """Translations of (B, S) sentences, each with its END unless it was cut at `longest` words.

    Padding is never said: it stands for no word.
    """
    encoded, now = translator.body.encode(source)
    rows = torch.arange(len(source))
    written = torch.full((len(source), longest), PAD_NUMBER)
    word = torch.full((len(source),), END_NUMBER)
    for t in range(longest):
        now = translator.body.step(encoded, now, translator.body.word_before(word))
        logits = translator.out(now.output)
        logits[:, PAD_NUMBER] = -torch.inf
        word = choose(logits, rows, t)
        written[rows, t] = word
        going = (word != END_NUMBER).nonzero()[:, 0]
        if len(going) == 0:
            break
        if len(going) < len(rows):
            rows, word, now, encoded = rows[going], word[going], now.select(going), encoded.select(going)
    return [[n for n in row if n != PAD_NUMBER] for row in written.tolist()]


def greedy(translator: Translator, data: TokenizedCorpus, lexicon: Vocabulary, longest: int) -> list[tuple[str, ...]]:
    """The words of all sentences' likeliest translations (A.6), in their order."""
    translations: list[tuple[str, ...]] = [()] * len(data)
    for chosen in in_order([len(s) for s in data.source], 128):
        for i, numbers in zip(
            chosen, decode(translator, padded([data.source[i] for i in chosen]), greedy_choice, longest), strict=True
        ):
            translations[i] = lexicon.decode(numbers)
    return translations


@torch.no_grad()
def perplexity(translator: Translator, data: TokenizedCorpus) -> float:
    """exp of the mean negative log-likelihood of the reference words, END included."""
    total, words = 0.0, 0
    for chosen in in_order([len(s) for s in data.source], 128):
        target = padded([data.target[i] for i in chosen])
        total -= float(translator(padded([data.source[i] for i in chosen]), target).sum())
        words += int((target != PAD_NUMBER).sum())
    return float(np.exp(total / words))

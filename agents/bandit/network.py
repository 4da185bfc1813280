"""Attention encoder-decoders (dissertation 3.1.3.1, appendix A): the translator, and the critic alike.

B sentences, S source and T target words, h hidden size, V target vocabulary. Each line carries the
number of the equation it computes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import torch
from torch import Tensor, nn

from embodied.agents.bandit.config import BanditConfig
from embodied.agents.common.rows import Rows
from embodied.agents.common.tensor_file import load_into
from embodied.agents.common.vocabulary import END_NUMBER, PAD_NUMBER, Vocabulary
from embodied.agents.common.weights import load_weights, save_weights
from embodied.records import Identity

Network = TypeVar("Network", bound=nn.Module)
SPAN = 0.1
"""Weights begin uniform in [-SPAN, SPAN], as in the authors' program."""


@dataclass(frozen=True, eq=False)
class EncodedSentences(Rows):
    """B source sentences, read."""

    states: Tensor
    """(B, S, h) hidden vectors of the encoder."""
    keys: Tensor
    """(B, S, h) W_a times states, for attention."""
    mask: Tensor
    """(B, S) bool, False on padding."""


@dataclass(frozen=True, eq=False)
class Decoding(Rows):
    """The decoder's state from word to word."""

    hidden: Tensor
    cell: Tensor
    """(B, h) of its LSTM; hidden is tilde h^dec."""
    output: Tensor
    """(B, h) h^dec, fed into the next step."""


class EncoderDecoder(nn.Module):
    """Reads a source sentence and says one number-to-be per target word: h^dec."""

    def __init__(self, source_words: int, target_words: int, size: int) -> None:
        super().__init__()
        self.source = nn.Embedding(source_words, size)
        self.target = nn.Embedding(target_words, size)
        self.encoder = nn.LSTM(size, size, batch_first=True)
        self.word_gates = nn.Linear(size, 4 * size)
        self.gates = nn.Linear(2 * size, 4 * size, bias=False)
        self.attend = nn.Linear(size, size, bias=False)
        self.combine = nn.Linear(2 * size, size, bias=False)

    def encode(self, source: Tensor) -> tuple[EncodedSentences, Decoding]:
        """Read (B, S) int64 numbers; the decoder starts where the encoder ended, Phi(x)."""
        lengths = (source != PAD_NUMBER).sum(1)
        packed = nn.utils.rnn.pack_padded_sequence(self.source(source), lengths, batch_first=True, enforce_sorted=False)
        states, (hidden, cell) = self.encoder(packed)
        states, _ = nn.utils.rnn.pad_packed_sequence(states, batch_first=True, total_length=source.shape[1])
        encoded = EncodedSentences(states, self.attend(states), source != PAD_NUMBER)
        return encoded, Decoding(hidden[0], cell[0], torch.zeros_like(hidden[0]))

    def step(self, encoded: EncodedSentences, now: Decoding, word_gates: Tensor) -> Decoding:
        """One step of Eq A.5; `word_gates` (B, 4h) is what the word before adds to the LSTM's gates."""
        gates = word_gates + self.gates(torch.cat([now.output, now.hidden], -1))  # A.5, with input feeding
        enter, forget, leave, content = gates.chunk(4, -1)
        cell = forget.sigmoid() * now.cell + enter.sigmoid() * content.tanh()
        hidden = leave.sigmoid() * cell.tanh()
        scores = torch.bmm(encoded.keys, hidden[:, :, None])[..., 0]  # (B, S) "general": h_t^T W_a h_s
        weights = scores.masked_fill(~encoded.mask, -torch.inf).softmax(-1)
        context = torch.bmm(weights[:, None], encoded.states)[:, 0]  # (B, h) A.4
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

"""Translating: batches of sentences, sampled and greedy decoding."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from embodied.agents.bandit.network import Translator
from embodied.agents.common.choosing import Choice, greedy_choice
from embodied.agents.common.vocabulary import END_NUMBER, PAD_NUMBER, Vocabulary

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


def padded(sentences: Sequence[Sequence[int]]) -> Tensor:
    """(B, longest) int64, PAD behind each sentence's end."""
    rows = [torch.tensor(s, dtype=torch.long) for s in sentences]
    return torch.nn.utils.rnn.pad_sequence(rows, batch_first=True, padding_value=PAD_NUMBER)


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

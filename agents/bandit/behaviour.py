"""Behaviour of a translator on a split: the shares of length, sureness and words in a change of BLEU."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch

from embodied.agents.bandit.bleu import corpus_parts, sentence_bleu
from embodied.agents.bandit.network import Translator
from embodied.agents.bandit.training import TokenizedCorpora, sampled
from embodied.agents.bandit.translate import greedy, in_order, padded, perplexity
from embodied.agents.common.checkpoint import read_checkpoint

BEHAVIOUR_MEASURES = (
    "BLEU",
    "brevity penalty",
    "1-gram precision",
    "4-gram precision",
    "length",
    "greedy per-sentence BLEU",
    "sampled per-sentence BLEU",
    "without the last third",
    "sampled length",
    "entropy",
    "perplexity",
)
"""Lengths in words per word of the reference; entropy of the next word in nats, along sampled translations;
perplexity of the references. The first six are of greedy translations. 'without the last third' is the per-sentence
BLEU of sampled translations whose last third of words is cut off: where that is no less, ratings teach to be short."""


@torch.no_grad()
def behaviour(translator: Translator, m: TokenizedCorpora, split: str) -> Mapping[str, float]:
    """All BEHAVIOUR_MEASURES on a split; learners draw alike."""
    data = m.splits[split]
    translations = greedy(translator, data, m.lexicons[1], m.config.longest)
    parts = corpus_parts(translations, data.references)
    words = sum(map(len, data.references))
    scores, shortened, lengths, surprise, drawn = [], [], 0, 0.0, 0
    for chosen in in_order([len(s) for s in data.source], 128):
        numbers = sampled(translator, m, data, chosen, f"behaviour {split}", 0)
        target = padded(numbers)
        surprise -= float(translator(padded([data.source[i] for i in chosen]), target).sum())
        drawn += sum(map(len, numbers))
        for i, row in zip(chosen, numbers, strict=True):
            translation = m.lexicons[1].decode(row)
            lengths += len(translation)
            scores.append(sentence_bleu(translation, data.references[i]))
            shortened.append(sentence_bleu(translation[: math.ceil(2 / 3 * len(translation))], data.references[i]))
    return {
        "BLEU": parts.score,
        "brevity penalty": parts.brevity,
        "1-gram precision": parts.precisions[0],
        "4-gram precision": parts.precisions[3],
        "length": sum(map(len, translations)) / words,
        "greedy per-sentence BLEU": 100 * float(np.mean(list(map(sentence_bleu, translations, data.references)))),
        "sampled per-sentence BLEU": 100 * float(np.mean(scores)),
        "without the last third": 100 * float(np.mean(shortened)),
        "sampled length": lengths / words,
        "entropy": surprise / drawn,
        "perplexity": perplexity(translator, data),
    }


def translator_of_run(m: TokenizedCorpora, folder: Path) -> Translator:
    """The translator as a run in `folder` left it.

    Raises:
      CheckpointError: missing or damaged.
    """
    translator = m.translator()
    translator.load_state_dict(read_checkpoint(Path(folder) / "checkpoint.pt")["parts"]["translator"])
    return translator

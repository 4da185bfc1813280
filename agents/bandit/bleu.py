"""BLEU twice: of one sentence, smoothed, as a rating (3.1.4); of a corpus, by sacrebleu, as a judgement."""

from __future__ import annotations

import collections
import math
from collections.abc import Sequence

import sacrebleu

ORDERS = (1, 2, 3, 4)


def sentence_bleu(words: Sequence[str], reference: Sequence[str]) -> float:
    """Add-one-smoothed BLEU of one sentence, in [0, 1]; 1 for the reference itself.

    Numerators and denominators of all four orders and both lengths of the brevity penalty get one
    more (3.1.4, footnote 3). The text's source, Chen and Cherry (2014), leaves unigrams as they
    are; the authors' program smooths them as well, which is done here: a translation that shares no
    word with its reference is still better short than long. Unlike in the program the end mark is
    no word (docs/sources.md, S66).
    """
    logs = 0.0
    for n in ORDERS:
        counts, theirs = _ngrams(words, n), _ngrams(reference, n)
        logs += math.log((sum((counts & theirs).values()) + 1) / (sum(counts.values()) + 1))
    shortfall = 1 - (len(reference) + 1) / (len(words) + 1)
    return math.exp(logs / len(ORDERS) + min(0.0, shortfall))


def corpus_bleu(translations: Sequence[Sequence[str]], references: Sequence[Sequence[str]]) -> float:
    """BLEU of a test set, 0 to 100, by sacrebleu on the words as they were split."""
    lines = [" ".join(t) for t in translations], [[" ".join(r) for r in references]]
    return sacrebleu.corpus_bleu(*lines, tokenize="none", force=True).score


def _ngrams(words: Sequence[str], n: int) -> collections.Counter:
    return collections.Counter(zip(*(words[i:] for i in range(n)), strict=False))

"""BLEU of one sentence, smoothed, as a rating, and ratings of imperfect people (3.1.4): true scores made coarse, noisy
and skewed; BLEU of a corpus, by sacrebleu, as a judgement."""

import collections
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sacrebleu


@dataclass(frozen=True)
class Rater:
    """How a simulated person's rating differs from the true score in [0, 1]; as it is: not at all."""

    granularity: int = 0
    """Steps g of the scale, so that there are g + 1 ratings (4 for one to five stars); 0: any number (Eq 3.8)."""
    variance: float = 0.0
    """Scale lambda of the variance of people around their mean; 1 is as was measured (Eq 3.9)."""
    skew: float = 1.0
    """Exponent rho: above 1 the rater is harsh, below it motivating (Eq 3.10)."""

    def __post_init__(self) -> None:
        if self.granularity < 0 or self.variance < 0 or self.skew < 0:
            raise ValueError(f"a rater's granularity, variance and skew must not be negative, got {self}")

    def rate(self, score: float, *, rng: np.random.Generator) -> float:
        """One rating of a true score in [0, 1].

        Several perturbations are applied in the order skew, variance, granularity. One draw is made
        whatever the settings are, so that raters can be compared on the same noise.
        """
        noise = float(rng.standard_normal())
        rating = score**self.skew  # Eq 3.10
        if self.variance:
            rating += math.sqrt(self.variance) * deviation(rating) * noise
        return granular(rating, self.granularity) if self.granularity else rating


CLEAN = Rater()


def fitted(scores: Sequence[float], ratings: Sequence[float], granularity: int) -> Rater:
    """The rater that people resemble: the skew by least squares, then the variance that is left.

    Args:
      scores: true scores in [0, 1].
      ratings: what people gave, in [0, 1].

    Raises:
      ValueError: fewer than two ratings.
    """
    if len(scores) < 2:
        raise ValueError(f"a rater is fitted to at least two ratings, got {len(scores)}")
    s, r = np.asarray(scores, float), np.asarray(ratings, float)
    exponents = np.geomspace(0.1, 10.0, 201)
    skew = float(min(exponents, key=lambda e: float(((s**e - r) ** 2).sum())))
    spread = sum(deviation(m) ** 2 for m in s**skew)
    variance = float(((s**skew - r) ** 2).sum() / spread) if spread else 0.0
    return Rater(granularity, variance, skew)


def granular(score: float, steps: int) -> float:
    """Eq 3.8: the nearest of 0, 1/g, ..., 1; halves go up, as in the text's bins (Python's `round` would not)."""
    return min(1.0, max(0.0, math.floor(steps * score + 0.5) / steps))


def deviation(score: float) -> float:
    """sigma(s) of Eq 3.9, here on the scale 0 to 1: how far people are from their mean.

    The authors' program multiplies it by lambda and clips the rating to [0, 1]; the text has
    Nor(s, lambda sigma^2), which is done here: the mean stays the true score (docs/sources.md, S67).
    """
    percent = 100 * score
    return max(0.0, 0.64 * percent - 0.02 if percent < 50 else 67.0 - 0.67 * percent) / 100


ORDERS = (1, 2, 3, 4)


def sentence_bleu(words: Sequence[str], reference: Sequence[str]) -> float:
    """Add-one-smoothed BLEU of one sentence, in [0, 1]; 1 for the reference itself.

    Numerators and denominators of all four orders and both lengths of the brevity penalty get one more (3.1.4, footnote
    3). The text's source, Chen and Cherry (2014), leaves unigrams as they are; the authors' program smooths them as
    well, which is done here: a translation that shares no word with its reference is still better short than long.
    Unlike in the program the end mark is no word (docs/sources.md, S66).
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

"""Questions, how answers are scored, and blind models, which read questions and see nothing.

Questions that a model answers without sight, having learned from others, are dropped until it is near chance:
adversarial filtering (Le Bras et al. 2020, "Adversarial Filters of Dataset Biases", algorithm 1).
"""

from __future__ import annotations

import re
import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import lsqr

from embodied.seeds import stream

LETTERS = "ABCDE"
NEAR_CHANCE, MOST_ALIKE, FEWEST_LEFT = 0.03, 1 / 2, 12
"""How far above chance a blind model may be; most questions of a type with one number; fewest of a type."""
BLIND = ("majority", "prior", "classifier")
"""The letter, the option (the median number), or words, that are right most often; the last is a linear model."""
HASHED, DAMPING, ROUNDS, DROPPED, HALVINGS = 2**13, 3.0, 30, 0.05, 3
"""Words told apart and how they are learned; share of questions dropped at a time; ways to halve them, half by half."""


@dataclass(frozen=True)
class VqaQuestion:
    """A line of questions_<split>.jsonl. `answer` is one of the options, or a number; `about` are ids of placements,
    rooms and doors that it rests on; `fact` is for who reads along."""

    id: str
    walk: str
    type: str
    text: str
    answer: str
    options: tuple[str, ...] = ()
    about: tuple[str, ...] = ()
    fact: str = ""

    @property
    def letter(self) -> str:
        """The letter of the right option, or the number."""
        return LETTERS[self.options.index(self.answer)] if self.options else self.answer

    @property
    def prompt(self) -> str:
        """The question with its options, and how to answer, as VSI-Bench has them."""
        if not self.options:
            return f"{self.text}\nPlease answer the question using a single word or phrase."
        how = "Answer with the option's letter from the given choices directly."
        return "\n".join([self.text, "Options:", *map(". ".join, zip(LETTERS, self.options)), how])


Questions = Sequence[VqaQuestion]


def score(question: VqaQuestion, answer: str) -> float:
    """0 to 1: exact match of the letter, or mean relative accuracy of the number (Yang et al. 2025, sec. 3.3)."""
    if question.options:
        return float(answer.strip().split(" ")[0].rstrip(".,:)").lower() == question.letter.lower())
    number = re.search(r"-?\d+(\.\d+)?", answer)
    return float(accuracy(float(number[0]), np.array([float(question.answer)]))[0]) if number else 0.0


def accuracy(answers: float | np.ndarray, true: np.ndarray) -> np.ndarray:
    """(n,) share of the thresholds .5, .55 ... .95 that the relative error of each number is within."""
    return np.mean((np.abs(answers - true) / true)[:, None] <= 1 - np.linspace(0.5, 0.95, 10), axis=1)


def chance(questions: Questions) -> float:
    """Mean score of who picks any option, or says the one number that is best for all of them."""
    if questions[0].options:
        return float(np.mean([1 / len(q.options) for q in questions]))
    true = np.array([float(q.answer) for q in questions])
    return max(float(accuracy(guess, true).mean()) for guess in np.unique(true))


def blind(model: str, known: Questions, asked: Questions) -> np.ndarray:
    """(2, n): scores of a model that learned from `known`, and how sure it is of each right answer, for one type."""
    numbers, ends = not known[0].options, np.cumsum([len(q.options) for q in asked])[:-1]
    to_learn = [float(np.log(float(q.answer))) for q in known] if numbers else []
    to_learn += [(o == q.answer) - 1 / len(q.options) for q in known for o in q.options]
    values = _words(asked) @ lsqr(_words(known), np.subtract(to_learn, np.mean(to_learn)), DAMPING, iter_lim=ROUNDS)[0]
    if numbers:
        answers = np.exp(np.mean(to_learn) + values) if model == "classifier" else np.exp(np.median(to_learn))
        return np.stack([accuracy(answers, np.array([float(q.answer) for q in asked]))] * 2)
    if model != "classifier":
        key = (lambda q, o: q.options.index(o)) if model == "majority" else (lambda q, o: o)
        offered, right = Counter(key(q, o) for q in known for o in q.options), Counter(key(q, q.answer) for q in known)
        share = lambda q, o: (right[key(q, o)] + 1) / (offered[key(q, o)] + len(q.options))
        values = np.array([share(q, o) for q in asked for o in q.options])
    judged = []
    for q, of_options in zip(asked, np.split(values, ends)):
        own, others = of_options[q.options.index(q.answer)], np.delete(of_options, q.options.index(q.answer))
        level = int((np.abs(others - own) < 1e-9).sum())
        judged.append(((own >= others.max() - 1e-9) / (1 + level), own - others.max()))
    return np.array(judged).T


def _words(questions: Questions) -> csr_array:
    """(options, HASHED) words of each option with those of its question; (questions, HASHED) where there are none."""
    rows = []
    for q in questions:
        of_question = re.findall(r"[a-z]+", q.text.lower())
        for k, option in enumerate(q.options or ("",)):
            of_option = [*re.findall(r"[a-z]+", option.lower()), f"={option}", f"{k}."] if option else []
            words = [*of_option, *(f"{a}|{b}" for a in of_question for b in of_option)] or of_question
            rows.append(sorted({zlib.crc32(w.encode()) % HASHED for w in words}))
    ends = np.cumsum([0, *map(len, rows)])
    return csr_array((np.ones(ends[-1]), np.concatenate(rows), ends), shape=(len(rows), HASHED))


def cross_judged(model: str, questions: Questions, seed: int) -> np.ndarray:
    """(2, n): `blind` for every question, by models that learned from another half of them, HALVINGS times."""
    judged = np.zeros((HALVINGS, 2, len(questions)))
    for i in range(HALVINGS):
        half = stream(seed, "halves", i).permutation(len(questions)) % 2 == 0
        for part in (half, ~half):
            known, asked = ([q for q, is_in in zip(questions, where) if is_in] for where in (~part, part))
            judged[i][:, part] = blind(model, known, asked)
    return judged.mean(0)


def balanced(questions: Questions, seed: int) -> list[VqaQuestion]:
    """As many questions of every answer, where all offer the same ones; at most MOST_ALIKE of one number."""
    sizes = Counter(q.answer for q in questions)
    if len({frozenset(q.options) for q in questions}) > 1 or not questions:
        return [*questions]
    fits = [n for n in range(1, len(questions)) if n <= MOST_ALIKE * sum(min(n, size) for size in sizes.values())]
    most = min(sizes[o] for o in questions[0].options) if questions[0].options else max(fits, default=1)
    drawn = [questions[i] for i in stream(seed, "balanced", questions[0].type).permutation(len(questions))]
    kept = {q.id for answer in sizes for q in [q for q in drawn if q.answer == answer][:most]}
    return [q for q in questions if q.id in kept]


def thinned(questions: Questions, seed: int) -> list[VqaQuestion]:
    """The questions of one type without those that blind models are surest of, until all are near chance."""
    left = balanced(questions, seed)
    while len(left) >= FEWEST_LEFT:
        scores, sure = max((cross_judged(m, left, seed + len(left)) for m in BLIND), key=lambda j: j[0].mean())
        if scores.mean() <= chance(left) + NEAR_CHANCE:
            return left
        likely = np.flatnonzero(scores >= scores.mean())
        drop = {*likely[np.argsort(-sure[likely], kind="stable")[: max(1, round(DROPPED * len(left)))]].tolist()}
        left = [q for k, q in enumerate(left) if k not in drop]
    return []

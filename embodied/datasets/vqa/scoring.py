"""Questions, how answers are scored, and blind models, which read questions and see nothing.

Questions that a model answers without sight, having learned from others, are dropped until it is near chance:
adversarial filtering (Le Bras et al. 2020, "Adversarial Filters of Dataset Biases", algorithm 1).
"""

import itertools
import math
import re
import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import lsqr

from embodied.seeds import stream

LETTERS, OPTIONS, ALONE = "ABCDE", 4, (0.7, 2.0)
"""Most options of a question; how many times more often than chance has it one may be right, of all, or of a cell."""
NEAR_CHANCE, MOST_ALIKE, FEWEST_LEFT = 0.03, 1 / 2, 12
"""How far above chance a blind model may be; most questions of a type with one number; fewest of a type."""
BLIND = ("majority", "prior", "classifier")
"""The letter, the option, or the words that are right most often; to numbers, the first two say the usual one."""
HASHED, DAMPING, ROUNDS, HOUSE_FOLDS = 2**13, 3.0, 30, 5
"""Words told apart and how they are learned; parts of the houses."""


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


def cross_judged(model: str, questions: Questions, seed: int) -> np.ndarray:
    """(2, n): scores of a blind model for questions of one type, having learned from those about other houses, and how
    sure it is of each right answer."""
    numbers, of, words = not questions[0].options, folds(questions, seed), _words(model, questions)
    options = [max(len(q.options), 1) for q in questions]
    goal = lambda q, o: (o == q.answer) - 1 / len(q.options) if o else math.log(float(q.answer))
    true = np.array([goal(q, o) for q in questions for o in q.options or ("",)])
    of_option, values = np.repeat(of, options), np.zeros(len(true))
    for k in sorted({*of.tolist()}) if len({*of.tolist()}) > 1 else ():
        known = of_option != k
        weights = lsqr(words[known], true[known] - true[known].mean(), DAMPING, iter_lim=ROUNDS)[0]
        values[~known] = true[known].mean() + words[~known] @ weights
    if numbers:
        return np.stack([accuracy(np.exp(values), np.exp(true))] * 2)
    judged = []
    for q, of_options in zip(questions, np.split(values, np.cumsum(options)[:-1])):
        own, others = of_options[q.options.index(q.answer)], np.delete(of_options, q.options.index(q.answer))
        level = int((np.abs(others - own) < 1e-9).sum())
        judged.append(((own >= others.max() - 1e-9) / (1 + level), own - others.max()))
    return np.array(judged).T


def folds(questions: Questions, seed: int) -> np.ndarray:
    """(n,) int: questions about one house are in one part of HOUSE_FOLDS; those about a single house are dealt out."""
    houses = [q.walk.rpartition("_")[0] for q in questions]
    names = {name: k for k, name in enumerate(sorted({*houses}))}
    fold = stream(seed, "folds").permutation(max(len(names), HOUSE_FOLDS)) % HOUSE_FOLDS
    return np.array([fold[names[h] if len(names) > 1 else k % HOUSE_FOLDS] for k, h in enumerate(houses)])


def _words(model: str, questions: Questions) -> csr_array:
    """(options, HASHED) what a model knows of each option; (questions, HASHED) where there are none."""
    rows = []
    for q in questions:
        of_question = re.findall(r"[a-z]+", q.text.lower()) if model == "classifier" else []
        for k, option in enumerate(q.options or ("",)):
            of_option = [*re.findall(r"[a-z]+", option.lower()), f"={option}", f"{k}."]
            of_option = {"majority": of_option[-1:], "prior": of_option[-2:-1]}.get(model, of_option)
            words = [*of_option, *(f"{a}|{b}" for a in of_question for b in of_option)] if option else of_question
            rows.append(sorted({zlib.crc32(w.encode()) % HASHED for w in words}))
    ends = np.cumsum([0, *map(len, rows)])
    return csr_array((np.ones(ends[-1]), np.array([*itertools.chain(*rows)], int), ends), shape=(len(rows), HASHED))


def narrowed(questions: Questions, seed: int) -> list[VqaQuestion]:
    """Questions of one type, whose first option is right, with OPTIONS each, and each letter right equally often. Where
    there are more, some are chosen, and questions left out, until each cell is wrong three times as often as right."""
    left = [questions[i] for i in stream(seed, "narrowed").permutation(len(questions))]
    cells, chosen, before = {q.id: _cells(q) for q in questions}, dict[str, list[int]](), 0
    while len(left) != before:
        before, rights, wrongs = len(left), Counter(cells[q.id][0] for q in left), Counter[tuple[str, str]]()
        for q in left:
            wanted = [(3 * rights[c] - wrongs[c]) / (rights[c] + 1) for c in cells[q.id]]
            chosen[q.id] = sorted(range(1, len(q.options)), key=lambda i: -wanted[i])[: OPTIONS - 1]
            wrongs.update(cells[q.id][i] for i in chosen[q.id])
        if max(map(len, cells.values())) > OPTIONS:
            over = Counter({c: math.ceil((n - wrongs[c] / 3 - ALONE[c[0] > ""]) / 2) for c, n in rights.items()})
            left = [q for q in left if over[c := cells[q.id][0]] <= 0 or over.subtract([c])]
    out = []
    for k, q in enumerate(left):
        options = [q.options[i] for i in stream(seed, "options", q.id).permutation(chosen[q.id]).tolist()]
        options[(place := k % (len(options) + 1)) : place] = q.options[:1]
        fixed = len(q.about) - len(q.options) + 1
        about = [n for i, n in enumerate(q.about) if fixed < 1 or i < fixed or i - fixed + 1 in chosen[q.id]]
        out.append(replace(q, options=tuple(options), about=tuple(about)))
    return sorted(out, key=lambda q: q.id)


def _cells(q: VqaQuestion) -> list[tuple[str, str]]:
    """The kind of thing that a question is about, with that of each option, by its id or words."""
    fixed, kind = len(q.about) - len(q.options) + 1, lambda i: i.rpartition(".")[2].rpartition("_")[0]
    kinds = [kind(i) for i in q.about[fixed - 1 :]] if fixed > 0 else q.options
    return [(kind(q.about[0]) if len(q.about) > 1 else "", k) for k in kinds] or [("", "")]


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


def less_guessed(questions: Questions, scores: np.ndarray, sure: np.ndarray) -> list[VqaQuestion]:
    """Questions of one type without those that a model is surest of: as many as bring it near chance in the split where
    it is farthest above."""
    splits = np.array([q.walk.partition("_")[0] for q in questions])
    parts = [np.flatnonzero(splits == name) for name in sorted({*splits.tolist()})]
    levels = [chance([questions[k] for k in part.tolist()]) + NEAR_CHANCE for part in parts]
    above, k = max((float(scores[part].mean()) - level, k) for k, (part, level) in enumerate(zip(parts, levels)))
    likely = parts[k][scores[parts[k]] >= scores[parts[k]].mean()]
    likely = likely[np.argsort(-sure[likely], kind="stable")]
    if questions[0].options and len({frozenset(q.options) for q in questions}) == 1:  # as many of every answer
        nth = Counter[str]()
        ranks = [nth.update([questions[i].answer]) or nth[questions[i].answer] for i in likely.tolist()]
        likely = likely[np.argsort(ranks, kind="stable")]
    most = max(0, math.ceil(above * len(parts[k]) / max(1 - levels[k], NEAR_CHANCE)))
    drop = {*likely[:most].tolist()}
    return [q for i, q in enumerate(questions) if i not in drop]


def thinned(questions: Questions, seed: int) -> list[VqaQuestion]:
    """The questions of one type, of all splits, without those that blind models are surest of, until all are near
    chance in every split."""
    splits = sorted({q.walk.partition("_")[0] for q in questions})
    parts = [balanced([q for q in questions if q.walk.startswith(f"{name}_")], seed) for name in splits]
    before, left = 0, [q for part in parts for q in part]
    while FEWEST_LEFT <= len(left) != before:
        before = len(left)
        judged = [cross_judged(m, left, seed + len(left)) for m in BLIND]
        left = min((less_guessed(left, *of_model) for of_model in judged), key=len)
    return left if len(left) >= FEWEST_LEFT else []

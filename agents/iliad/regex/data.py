"""The data of REGEX: words, made up by the seed, rules that change them, and requests for the rules, split by template
(C.1.2)."""

from __future__ import annotations

import dataclasses
import functools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from embodied.agents.iliad.regex.language import PARTS, PHRASES, RequestTemplate, templates
from embodied.agents.iliad.regex.rules import RuleShape, compiled, outputs, random_rule, random_shape
from embodied.agents.learners.iliad import RegexConfig
from embodied.assets.cache import digest
from embodied.seeds import stream

WORD_PARTS = {name: text.split() for name, text in PHRASES["words"].items()}
"""Of made-up words; '-' is none."""
SHORTEST, LONGEST_MADE_UP = 3, 10
"""Letters of a word."""


def made_up(count: int, *, seed: int) -> tuple[str, ...]:
    """So many different words that could be English ones; the same on every machine.

    The dissertation's words are the dictionary of an operating system, which differs from one to the
    next and is often missing (docs/sources.md, S90).
    """
    rng = stream(seed, "regex", "words")
    words: dict[str, None] = {}
    while len(words) < count:
        word = _word(rng=rng)
        if SHORTEST <= len(word) <= LONGEST_MADE_UP:
            words[word] = None
    return tuple(words)


def _word(*, rng: np.random.Generator) -> str:
    pick = lambda name: WORD_PARTS[name][int(rng.integers(len(WORD_PARTS[name])))]
    middle = "".join(pick("onset") + pick("nucleus") + pick("coda") for _ in range(int(rng.integers(1, 3))))
    return (pick("start") + middle + pick("ending")).replace("-", "")


REQUESTS = 3
"""Requests of a data point of the simulation split."""
LEAST_CHANGED = 3
"""Of a data point's words, so many are changed by its rule, the first one among them."""
VAGUE_SHARE = 0.2
"""Of the requests for rules that can be put vaguely; 12 % of all (docs/sources.md, S91)."""
RARE = 20
"""A rule that fits fewer of the words is not asked for."""


@dataclass(frozen=True)
class WordTask:
    """A data point: D*, and what e* does to J words."""

    requests: tuple[str, ...]
    rule: str
    """The rule that is meant; only imitation and the reward know it."""
    words: tuple[str, ...]
    """w_1 .. w_J; the first is the episode's."""
    outputs: tuple[str, ...]
    """The words that the rule makes of them."""


@dataclass(frozen=True, eq=False)
class RegexData:
    """All that worlds and teachers are made of."""

    words: tuple[str, ...]
    templates: Mapping[str, Sequence[RequestTemplate]]
    splits: Mapping[str, Sequence[WordTask]]
    """Of 'train', 'validation' and 'test'."""

    @property
    def digest(self) -> str:
        """Names the content."""
        return digest({part: [dataclasses.astuple(q) for q in items] for part, items in self.splits.items()})


@functools.lru_cache(maxsize=2)
def make_data(config: RegexConfig) -> RegexData:
    """Data of the seed, made in seconds."""
    seed = config.data_seed
    words = made_up(config.vocabulary, seed=seed)
    grammar, places = Grammar(seed), _Places(words)
    splits: dict[str, list[WordTask]] = {}
    for part in PARTS:
        count, requests = (config.items, REQUESTS) if part == "train" else (config.held_out_items, 1)
        rng = stream(seed, "regex", "items", part)
        splits[part] = [_item(grammar, part, places, requests, config.examples, rng=rng) for _ in range(count)]
    return RegexData(words, grammar.by_part, splits)


class Grammar:
    """Requests of our own language."""

    def __init__(self, seed: int) -> None:
        self.by_part: Mapping[str, Sequence[RequestTemplate]] = templates(seed=seed)
        self._of: dict[tuple[str, RuleShape, bool], list[RequestTemplate]] = {}
        for part, all_of_them in self.by_part.items():
            for template in all_of_them:
                self._of.setdefault((part, template.shape, template.vague), []).append(template)

    def request(self, part: str, shape: RuleShape, before: str, after: str, *, rng: np.random.Generator) -> str:
        vague = self._of.get((part, shape, True), [])
        several = vague if vague and rng.random() < VAGUE_SHARE else self._of[part, shape, False]
        return several[int(rng.integers(len(several)))].fill(before, after)


class _Places:
    """Which words a rule changes."""

    def __init__(self, words: Sequence[str]) -> None:
        self.words = tuple(words)
        self.text = "\n".join(words)
        self.starts = np.cumsum([0, *(len(w) + 1 for w in words)])
        self.fits = functools.lru_cache(maxsize=20_000)(self._fits)

    def _fits(self, pattern: str) -> np.ndarray:
        """Numbers of the words in which the pattern is found, ascending."""
        made = compiled(f"{pattern}@")
        assert made is not None, "a rule of our own shapes"
        source = made[0].pattern.replace(".", "[^\n]")
        starts = [m.start() for m in re.finditer(source, self.text, re.MULTILINE)]
        return np.unique(np.searchsorted(self.starts, starts, side="right") - 1)


def _item(
    grammar: Grammar, part: str, places: _Places, requests: int, examples: int, *, rng: np.random.Generator
) -> WordTask:
    """A rule that some words allow, requests for it, and words of which it changes the first and two others."""
    while True:
        shape = random_shape(rng=rng)
        made = random_rule(shape, places.words, rng=rng)
        if made is None:
            continue
        rule, before, after = made
        texts = tuple(grammar.request(part, shape, before, after, rng=rng) for _ in range(requests))
        fitting = places.fits(rule.split("@")[0])
        words = _words_for(rule, places, fitting, examples, rng=rng) if len(fitting) >= RARE else None
        changed = outputs(rule, words) if words is not None else None
        if words is not None and changed is not None:
            return WordTask(texts, rule, words, changed)


def _words_for(
    rule: str, places: _Places, fitting: np.ndarray, count: int, *, rng: np.random.Generator
) -> tuple[str, ...] | None:
    """`count` different words, of which the first and at least LEAST_CHANGED in all are changed by the rule."""
    least = min(LEAST_CHANGED, count)
    chosen = [places.words[int(i)] for i in rng.choice(fitting, size=min(2 * least, len(fitting)), replace=False)]
    changed = [w for w in chosen if outputs(rule, [w]) not in (None, (w,))][:least]
    if len(changed) < least:
        return None
    distinct = dict.fromkeys(changed)
    while len(distinct) < count:
        distinct[places.words[int(rng.integers(len(places.words)))]] = None
    return tuple(distinct)


def rules_without_requests(words: Sequence[str], count: int, *, rng: np.random.Generator) -> Iterator[str]:
    """`count` random rules: the unlabeled executions of the marginal (C.1.2)."""
    while count:
        rule = random_rule(random_shape(rng=rng), words, rng=rng)
        if rule is not None:
            count -= 1
            yield rule[0]

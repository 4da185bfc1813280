"""The data of REGEX: words, rules that change them, and requests for the rules, split by template (C.1.2)."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from embodied.agents.iliad.regex.config import RegexConfig
from embodied.agents.iliad.regex.language import PARTS, RequestTemplate, templates
from embodied.agents.iliad.regex.rules import LETTERS, RuleShape, compiled, outputs, random_rule, random_shape
from embodied.agents.iliad.regex.words import made_up
from embodied.records import parse_file
from embodied.seeds import stream

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
    templates: Mapping[str, Sequence[Any]]
    """RequestTemplate of each part; their texts where they were read again."""
    splits: Mapping[str, Sequence[WordTask]]
    """Of 'train', 'validation' and 'test'."""


def make_data(
    config: RegexConfig, words: Sequence[str] = (), own: Mapping[str, Sequence[str]] | None = None
) -> RegexData:
    """Data of the seed.

    Args:
      words: a list of one's own; none for made-up words.
      own: templates of one's own, see `read_templates`; None for those of the grammar.

    Raises:
      ValueError: templates that ask for nothing that these words allow.
    """
    seed = config.data_seed
    known = tuple(words) or made_up(config.vocabulary, seed=seed)
    source = _OwnTemplates(own, seed) if own else Grammar(seed)
    places = _Places(known)
    splits: dict[str, list[WordTask]] = {}
    for part in PARTS:
        count, requests = (config.items, REQUESTS) if part == "train" else (config.held_out_items, 1)
        rng = stream(seed, "regex", "items", part)
        splits[part] = [_item(source, part, places, requests, config.examples, rng=rng) for _ in range(count)]
    return RegexData(known, source.by_part, splits)


def read_templates(path: Path) -> dict[str, list[str]]:
    """Templates in the authors' manner, of a file that you own: a JSON object from a rule to texts.

    BEFORE stands for one or two letters that are looked for and AFTER for those that are written, in
    rule and text: {"(^)(BEFORE)()@AFTER": ["change a leading BEFORE to AFTER"]}.

    Raises:
      ValueError: not such a file, or a rule that cannot be carried out (with its name).
    """
    body = parse_file(path)
    if not isinstance(body, dict) or not body:
        raise ValueError(f"{path}: expected an object from rules to lists of texts, got {type(body).__name__}")
    for rule, texts in body.items():
        if not isinstance(texts, list) or not texts or not all(isinstance(t, str) and t.strip() for t in texts):
            raise ValueError(f"{path}: rule {rule!r} needs a list of texts, at least one")
        if compiled(rule.replace("BEFORE", "a").replace("AFTER", "b")) is None:
            raise ValueError(f"{path}: {rule!r} is no rule 'pattern@replacement' of letters and ^$.()\\2CV")
    return {str(rule): [str(t) for t in texts] for rule, texts in body.items()}


class Grammar:
    """Requests of our own language."""

    def __init__(self, seed: int) -> None:
        self.by_part: Mapping[str, Sequence[RequestTemplate]] = templates(seed=seed)
        self._of: dict[tuple[str, RuleShape, bool], list[RequestTemplate]] = {}
        for part, all_of_them in self.by_part.items():
            for template in all_of_them:
                self._of.setdefault((part, template.shape, template.vague), []).append(template)

    def draw(self, part: str, places: _Places, count: int, *, rng: np.random.Generator) -> tuple[str, list[str]] | None:
        shape = random_shape(rng=rng)
        made = random_rule(shape, places.words, rng=rng)
        if made is None:
            return None
        return made[0], [self.request(part, shape, made[1], made[2], rng=rng) for _ in range(count)]

    def request(self, part: str, shape: RuleShape, before: str, after: str, *, rng: np.random.Generator) -> str:
        vague = self._of.get((part, shape, True), [])
        several = vague if vague and rng.random() < VAGUE_SHARE else self._of[part, shape, False]
        return several[int(rng.integers(len(several)))].fill(before, after)


class _OwnTemplates:
    """Requests of a file; each rule with several texts gives one to validation and one to test."""

    def __init__(self, own: Mapping[str, Sequence[str]], seed: int) -> None:
        self._own: dict[str, dict[str, list[str]]] = {part: {} for part in PARTS}
        for rule, texts in own.items():
            distinct = list(dict.fromkeys(texts))
            order = [distinct[int(k)] for k in stream(seed, "regex", "own", rule).permutation(len(distinct))]
            held = 2 if len(order) > 2 else 0
            for part, texts in zip(PARTS, (order[held:], order[:1] if held else [], order[1:2] if held else [])):
                if texts:
                    self._own[part][rule] = texts
        if not self._own["test"]:
            raise ValueError("no rule of these templates has three different texts, so none can be held out")
        self.by_part: Mapping[str, Sequence[RequestTemplate]] = dict.fromkeys(PARTS, ())

    def draw(self, part: str, places: _Places, count: int, *, rng: np.random.Generator) -> tuple[str, list[str]] | None:
        rules = sorted(self._own[part])
        rule = rules[int(rng.integers(len(rules)))]
        some = lambda: "".join(LETTERS[int(k)] for k in rng.integers(26, size=int(rng.integers(1, 3))))
        letters = {name: some() for name in ("BEFORE", "AFTER")}
        fill = lambda text: re.sub("BEFORE|AFTER", lambda m: letters[m.group()], text)
        spaced = {name: " ".join(value) for name, value in letters.items()}
        reworded = lambda text: re.sub("BEFORE|AFTER", lambda m: f"[{spaced[m.group()]}]", text)
        texts = self._own[part][rule]
        return fill(rule), [reworded(texts[int(rng.integers(len(texts)))]) for _ in range(count)]


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
        if made is None:
            return np.zeros(0, dtype=np.int64)
        source = made[0].pattern.replace(".", "[^\n]")
        starts = [m.start() for m in re.finditer(source, self.text, re.MULTILINE)]
        return np.unique(np.searchsorted(self.starts, starts, side="right") - 1)


def _item(
    source: Grammar | _OwnTemplates,
    part: str,
    places: _Places,
    requests: int,
    examples: int,
    *,
    rng: np.random.Generator,
) -> WordTask:
    """A rule that some words allow, requests for it, and words of which it changes the first and two others."""
    for _ in range(10_000):
        drawn = source.draw(part, places, requests, rng=rng)
        if drawn is None:
            continue
        rule, texts = drawn
        fitting = places.fits(rule.split("@")[0])
        if len(fitting) < RARE:
            continue
        words = _words_for(rule, places, fitting, examples, rng=rng)
        if words is None:
            continue
        made = outputs(rule, words)
        if made is not None:
            return WordTask(tuple(texts), rule, words, made)
    raise ValueError(f"no rule of the {part} templates changes {RARE} of the {len(places.words)} words; use other ones")


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


def rules_without_requests(
    data: RegexData, config: RegexConfig, count: int, *, rng: np.random.Generator
) -> Iterator[str]:
    """`count` random rules: the unlabeled executions of the marginal (C.1.2), of its kind in the settings."""
    while count:
        shape = random_shape(rng=rng)
        made = None if config.marginal == "narrow" and not known(shape, config.data_seed) else shape
        rule = None if made is None else random_rule(made, data.words, rng=rng)
        if rule is not None:
            count -= 1
            yield rule[0]


def known(shape: RuleShape, seed: int) -> bool:
    """True where a shape belongs to the half that a 'narrow' marginal has."""
    return bool(stream(seed, "regex", "narrow", shape.name).random() < 0.5)

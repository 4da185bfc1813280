"""The data of REGEX: words, made up by the seed, rules that change them, and requests for the rules, split by template
(C.1.2). How people put a rule into words: templates for every shape, made from a grammar of (condition, object,
operation), whose phrases are in phrases.toml.

A template is a request with slots for letters: '{b1}' is the first letter that is looked for,
'{a2}' the second that is written. 'every [{b1}] becomes [{a1}]' stands for '()(n)()@c' and others.
"""

import dataclasses
import functools
import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from embodied.agents.iliad.regex.rules import (
    ANY,
    ANYWHERE,
    LETTER,
    SHAPES,
    START,
    RuleShape,
    compiled,
    outputs,
    random_rule,
    random_shape,
)
from embodied.agents.learners.iliad import RegexConfig
from embodied.assets.cache import digest
from embodied.assets.json_file import read_toml
from embodied.seeds import stream

SPECIFIC = 12
"""Templates of a shape that say all of it."""
HELD_OUT = 0.1
"""Share of the vague texts that are held out for validation and test each."""
SLIP = 0.05
"""Share of templates that are written with a slip."""
PHRASES = read_toml(Path(__file__).with_name("phrases.toml"))
PARTS = ("train", "validation", "test")


@dataclass(frozen=True)
class RequestTemplate:
    """One way of asking for rules of one shape."""

    text: str
    shape: RuleShape
    vague: bool = False
    """True where other shapes would be asked for in the same words."""

    def fill(self, before: str, after: str) -> str:
        """The request with these letters."""
        slots = {f"b{k}": c for k, c in enumerate(before, 1)} | {f"a{k}": c for k, c in enumerate(after, 1)}
        return self.text.format(**slots)


def templates(*, seed: int) -> dict[str, list[RequestTemplate]]:
    """Part to its templates; no two parts share a text, every shape has specific templates in each of them."""
    templates: dict[str, list[RequestTemplate]] = {part: [] for part in PARTS}
    taken: set[str] = set()
    for shape in SHAPES:
        own_templates = [t for t in _specific(shape, seed=seed) if t.text not in taken]
        taken |= {t.text for t in own_templates}
        shared = [t for t in own_templates if _extreme(shape) in t.text]  # others are in the same words
        own_templates = [t for t in own_templates if t not in shared]
        held = [int(i) for i in stream(seed, "regex", "part", shape.name).permutation(len(own_templates))[:2]]
        for number, template in enumerate(own_templates):
            part = "validation" if number == held[0] else "test" if number == held[1] else "train"
            templates[part].append(template)
        for template in shared:
            templates[_part_of(template.text, seed=seed)].append(template)
        for text in sorted(set(_vague_sayings(shape))):
            templates[_part_of(text, seed=seed)].append(RequestTemplate(text, shape, vague=True))
    return templates


def _specific(shape: RuleShape, *, seed: int) -> list[RequestTemplate]:
    """A shape's templates: a draw from all that the grammar can say, some with a slip."""
    rng, by_text = stream(seed, "regex", "templates", shape.name), {}
    sayings = sorted(set(_sayings(shape)))
    for k in rng.permutation(len(sayings))[:SPECIFIC]:
        text = sayings[int(k)]
        slips = [(right, wrong) for right, wrong in PHRASES["slips"].items() if right in text]
        if slips and rng.random() < SLIP:
            right, wrong = slips[int(rng.integers(len(slips)))]
            text = text.replace(right, wrong, 1)
        by_text[text] = RequestTemplate(text, shape)
    return list(by_text.values())


def _part_of(text: str, *, seed: int) -> str:
    """The part that a vague text belongs to, whichever shape is meant by it."""
    at = stream(seed, "regex", "vague", text).random()
    return "validation" if at < HELD_OUT else "test" if at < 2 * HELD_OUT else "train"


def _said(part: str, key: str, **slots: str) -> list[str]:
    """The phrases of a part of phrases.toml for a key, or else those for all others, with their slots filled."""
    forms = PHRASES[part]
    return [form.format(**slots) for form in forms[key if key in forms else "else"]]


def _noun(symbol: str, number: int, one: bool) -> list[str]:
    """A symbol as a noun phrase with (`one`) or without an article; `number` is that of its letter."""
    return _said("one" if one else "bare", symbol, b=f"{{b{number}}}")


def _pair(block: str, one: bool) -> list[str]:
    """Two symbols, as a noun phrase with (`one`) or without an article."""
    a, b = block[0], block[1]
    second = 1 + (a == LETTER)
    phrases = [
        f"{x} {link.format(y)}"
        for x, y in itertools.product(_noun(a, 1, one), _noun(b, second, True))
        for link in ("followed by {}", "and {} right after it", "with {} behind it")
    ]
    if block == LETTER + LETTER:
        phrases = ["[{b1} {b2}]", "sequence [{b1} {b2}]" if not one else "the letters [{b1} {b2}]", *phrases[:3]]
    if block == ANY + ANY:
        return ["two letters", "any two letters"] if one else ["pair of letters", "two letters"]
    if a == ANY:
        phrases += [f"{y} and the letter before it" for y in _noun(b, second, one)]
    if b == ANY:
        phrases += [f"{x} and the letter {w} it" for x in _noun(a, 1, one) for w in ("after", "that follows")]
    return phrases


def _phrases(block: str, one: bool) -> list[str]:
    return _pair(block, one) if len(block) == 2 else _noun(block, 1, one)


def _done(replacement: str, what: str, *forms: str) -> list[str]:
    """Sayings that `what` becomes a replacement: as imperatives ('operations'), as phrases ('passives')."""
    return [text for form in forms for text in _said(form, replacement, what=what, new=_new(replacement))]


def _new(replacement: str) -> str:
    return "[{a1} {a2}]" if replacement.count(LETTER) == 2 else "[{a1}]"


def _sayings(shape: RuleShape) -> Iterator[str]:
    """Everything that the grammar can say for a shape."""
    ones, bares = _phrases(shape.block, True), _phrases(shape.block, False)
    for condition in (c for x in ones for c in _said("conditions", shape.anchor, x=x)):
        for operation in _done(shape.replacement, "it" if len(shape.block) == 1 else "them", "operations"):
            yield f"{condition} , {operation}"
    for place in _places(shape, ones, bares):
        yield from _done(shape.replacement, place, "operations", "passives")
    (result,) = _said("result", shape.replacement, new=_new(shape.replacement))
    where = {ANYWHERE: "", START: "start : "}.get(shape.anchor, "end : ")
    yield from (f"{where}{x} -> {result}" for x in ones)


def _vague_sayings(shape: RuleShape) -> Iterator[str]:
    """As if any letter were meant that stands at the shape's end of the word; nothing for other shapes."""
    if shape.anchor and set(shape.block) != {ANY}:
        yield from _done(shape.replacement, _extreme(shape), "operations", "passives")


def _places(shape: RuleShape, ones: Sequence[str], bares: Sequence[str]) -> list[str]:
    """The object of an operation, with where it stands."""
    if shape.anchor == ANYWHERE:
        every = [f"{word} {x}" for word in ("every", "each") for x in bares]
        return every + [f"all instances of {x}" for x in ones]
    words = ("start", "beginning", "leading") if shape.anchor == START else ("end", "back", "final")
    phrases = [f"{x} at the {word} of the word" for x in ones for word in words[:2]]
    phrases += [f"the {words[2]} {x}" for x in bares]
    return [_extreme(shape)] if set(shape.block) == {ANY} else phrases


def _extreme(shape: RuleShape) -> str:
    """'the first letter', 'the last two letters'."""
    side = "first" if shape.anchor == START else "last"
    return f"the {side} letter" if len(shape.block) == 1 else f"the {side} two letters"


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

"""How people put a rule into words: templates for every shape, made from a grammar of (condition, object, operation),
whose phrases are in phrases.toml.

A template is a request with slots for letters: '{b1}' is the first letter that is looked for,
'{a2}' the second that is written. 'every [{b1}] becomes [{a1}]' stands for '()(n)()@c' and others.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from embodied.agents.iliad.regex.rules import ANY, ANYWHERE, LETTER, SHAPES, START, RuleShape
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


# What is looked for -------------------------------------------------------------------------------


def _said(part: str, key: str, **slots: str) -> list[str]:
    """The phrases of a part of phrases.toml for a key, or else those for all others, with their slots filled."""
    forms = PHRASES[part]
    return [form.format(**slots) for form in forms[key if key in forms else "else"]]


def _one(symbol: str, number: int) -> list[str]:
    """A symbol as a noun phrase; `number` is that of its letter."""
    return _said("one", symbol, b=f"{{b{number}}}")


def _bare(symbol: str, number: int) -> list[str]:
    """The same without an article."""
    return _said("bare", symbol, b=f"{{b{number}}}")


def _pair(block: str, one: bool) -> list[str]:
    """Two symbols, as a noun phrase with (`one`) or without an article."""
    a, b = block[0], block[1]
    nouns = _one if one else _bare
    second = 1 + (a == LETTER)
    phrases = [
        f"{x} {link.format(y)}"
        for x, y in itertools.product(nouns(a, 1), _one(b, second))
        for link in ("followed by {}", "and {} right after it", "with {} behind it")
    ]
    if block == LETTER + LETTER:
        phrases = ["[{b1} {b2}]", "sequence [{b1} {b2}]" if not one else "the letters [{b1} {b2}]", *phrases[:3]]
    if block == ANY + ANY:
        return ["two letters", "any two letters"] if one else ["pair of letters", "two letters"]
    if a == ANY:
        phrases += [f"{y} and the letter before it" for y in nouns(b, second)]
    if b == ANY:
        phrases += [f"{x} and the letter {w} it" for x in nouns(a, 1) for w in ("after", "that follows")]
    return phrases


def _phrases(block: str, one: bool) -> list[str]:
    if len(block) == 2:
        return _pair(block, one)
    return (_one if one else _bare)(block, 1)


# What is done to it -------------------------------------------------------------------------------


def _operations(replacement: str, what: str) -> list[str]:
    """Imperatives: what to do to `what`."""
    return _said("operations", replacement, what=what, new=_new(replacement))


def _passives(replacement: str, what: str) -> list[str]:
    """Phrases of the operation on `what`."""
    return _said("passives", replacement, what=what, new=_new(replacement))


def _new(replacement: str) -> str:
    return "[{a1} {a2}]" if replacement.count(LETTER) == 2 else "[{a1}]"


# Whole requests -----------------------------------------------------------------------------------


def _sayings(shape: RuleShape) -> Iterator[str]:
    """Everything that the grammar can say for a shape."""
    ones, bares = _phrases(shape.block, True), _phrases(shape.block, False)
    for condition in (c for x in ones for c in _said("conditions", shape.anchor, x=x)):
        for operation in _operations(shape.replacement, "it" if len(shape.block) == 1 else "them"):
            yield f"{condition} , {operation}"
    for place in _places(shape, ones, bares):
        yield from _operations(shape.replacement, place)
        yield from _passives(shape.replacement, place)
    (result,) = _said("result", shape.replacement, new=_new(shape.replacement))
    where = {ANYWHERE: "", START: "start : "}.get(shape.anchor, "end : ")
    yield from (f"{where}{x} -> {result}" for x in ones)


def _vague_sayings(shape: RuleShape) -> Iterator[str]:
    """As if any letter were meant that stands at the shape's end of the word; nothing for other shapes."""
    if shape.anchor and set(shape.block) != {ANY}:
        place = _extreme(shape)
        yield from _operations(shape.replacement, place)
        yield from _passives(shape.replacement, place)


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

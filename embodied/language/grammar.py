"""Saying a route instruction and reading it back: one list of templates serves both directions."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast, get_args

import numpy as np

from embodied.language import clauses as meaning
from embodied.language.lexicon import PASSAGES, ROOM_NOUNS, ROOM_OF_NOUN, Lexicon, Word
from embodied.language.templates import NOVEL_HABIT, SPOKEN, TEMPLATES, Template
from embodied.seeds import novel_among, of_novelty

if TYPE_CHECKING:
    from embodied.language.templates import Speaker


@dataclass(frozen=True)
class Phrase:
    """A clause with the noun its speaker chose for the thing in it."""

    clause: meaning.Clause
    word: Word | None = None


def kind_of(clause: meaning.Clause) -> str:
    """The name by which templates know a clause."""
    if isinstance(clause, meaning.Turn):
        return {45: "slight", 90: "turn", 180: "around"}[clause.angle]
    if isinstance(clause, meaning.Past):
        return "past" if clause.side is None else "past_side"
    if isinstance(clause, meaning.Enter):
        return "door" if clause.nth else "enter"
    if isinstance(clause, meaning.OpenDoor) and clause.side:
        return "open_door_side"
    if isinstance(clause, meaning.Climb):
        return "climb_half" if clause.half else "climb"
    return _NAMES[type(clause)]


_NAMES = {c: re.sub(r"\B(?=[A-Z])", "_", c.__name__).lower() for c in get_args(meaning.Clause)}
"""'stop_by' for StopBy."""
_BY_KINDS: dict[tuple[str, ...], tuple[Template, ...]] = {
    kinds: tuple(t for t in TEMPLATES if t.kinds == kinds) for kinds in {t.kinds: None for t in TEMPLATES}
}


NOVEL_TEMPLATES = frozenset(
    t
    for same in _BY_KINDS.values()
    for texts in [novel_among(t.text for t in same[1:] if not t.habit)]
    for t in same
    if t.text in texts or t.habit == NOVEL_HABIT
)
"""Templates of people who are kept from learning; the first template of a clause is everybody's."""
NOVEL_WORDS = novel_among(
    {*SPOKEN.verbs[1:], *SPOKEN.soon[1:], *(noun for nouns in ROOM_NOUNS.values() for noun in nouns[1:])}
)
"""Verbs, adverbs and nouns for rooms that only they use."""
PLAIN_WEIGHT = 3.0
"""How much likelier than its other templates the first few of a clause are: what most people say."""


def say(phrases: Sequence[Phrase], speaker: Speaker, *, rng: np.random.Generator) -> str:
    """Sentences in the speaker's habits, e.g. 'Leave the bedroom and turn left at once. Stop by the sofa.'"""
    pieces: list[tuple[str, tuple[str, ...]]] = []
    i, again = 0, _again(phrases)
    while i < len(phrases):
        kinds = tuple(kind_of(p.clause) for p in phrases[i : i + 2])
        known = len(kinds) == 2 and kinds in _BY_KINDS
        if not (known and rng.random() < speaker.joining and not _misleads(kinds, phrases[i + 2 :])):
            kinds = kinds[:1]
        to = i + len(kinds)
        template = _pick(_BY_KINDS[kinds], speaker, rng)
        pieces.append((_fill(template, phrases[i:to], again[i:to], speaker, rng), kinds))
        i = to
    words = _sentences(pieces, speaker, rng).split(" ")  # now and then a misspelt one
    return " ".join(SPOKEN.slips.get(w, w) if rng.random() < speaker.slips else w for w in words)


def _misleads(pair: tuple[str, ...], after: Sequence[Phrase]) -> bool:
    """Tells whether the pair sounds as if nobody walked: 'turn right toward the sofa, then turn around'."""
    return pair[-1] == "to" and bool(after) and kind_of(after[0].clause) == "around"


def _again(phrases: Sequence[Phrase]) -> list[str]:
    """The word before the room noun of each clause: 'next' or 'other' for a room entered from one of its own kind."""
    befores: list[str] = []
    here: str | None = None
    for p in phrases:
        kind = meaning.room_of(p.clause)
        same = kind == here and isinstance(p.clause, meaning.Enter)
        befores.append(("next " if kind in PASSAGES else "other ") if same else "")
        here = kind if isinstance(p.clause, meaning.Enter | meaning.OpenDoor | meaning.Exit | meaning.Cross) else here
    return befores


def _pick(templates: Sequence[Template], speaker: Speaker, rng: np.random.Generator) -> Template:
    spoken = [t for t in templates if t.habit in ("", speaker.habit)]
    fitting = of_novelty(spoken, NOVEL_TEMPLATES, speaker.novelty)
    weights = np.array([3.0 if t.habit else PLAIN_WEIGHT if i < 4 else 1.0 for i, t in enumerate(fitting)])
    return fitting[int(rng.choice(len(fitting), p=weights / weights.sum()))]


def _fill(
    template: Template, phrases: Sequence[Phrase], again: Sequence[str], speaker: Speaker, rng: np.random.Generator
) -> str:
    own = functools.partial(of_novelty, novel=NOVEL_WORDS, novelty=speaker.novelty)
    verbs, soon = (own(SPOKEN.verbs + SPOKEN.playful if speaker.habit == "chatty" else SPOKEN.verbs), own(SPOKEN.soon))
    slots = {
        "walk": SPOKEN.verbs[0] if rng.random() < speaker.plainness else verbs[int(rng.integers(len(verbs)))],
        "soon": soon[int(rng.integers(len(soon)))],
    }
    rooms = [(kind, before) for p, before in zip(phrases, again) if (kind := meaning.room_of(p.clause)) is not None]
    for name, (kind, before) in zip(("room", "other"), rooms):
        plain, nouns = ROOM_NOUNS[kind][0], own(ROOM_NOUNS[kind])
        slots[name] = before + (plain if rng.random() < speaker.plainness else nouns[int(rng.integers(len(nouns)))])
    for p in phrases:
        if isinstance(p.clause, meaning.Metres):
            n, many = p.clause.count, "s" * (p.clause.count != 1)
            spelt = SPOKEN.numbers[n] if n < len(SPOKEN.numbers) and (n == 1 or rng.random() < 0.7) else str(n)
            slots |= {"metres": f"{spelt} meter{many}", "steps": f"{spelt} big step{many}"}
        if isinstance(p.clause, meaning.Enter) and p.clause.nth:
            slots["nth"] = SPOKEN.ordinals[p.clause.nth]
        if isinstance(p.clause, meaning.Climb):
            slots |= {"way": p.clause.way, "upstairs": f"{p.clause.way}stairs"}
        if (side := meaning.side_of(p.clause)) is not None:
            slots["side"] = side
        if p.word is not None:
            slots["thing"] = f"the {p.word}"
    return template.text.format(**slots)


def _sentences(pieces: Sequence[tuple[str, tuple[str, ...]]], speaker: Speaker, rng: np.random.Generator) -> str:
    """Pieces joined by links and full stops; a stop and a warning begin sentences of their own more often."""
    sentences: list[str] = []
    links: set[str] = set()
    current, length, hedged = "", 0, False
    for n, (text, kinds) in enumerate(pieces):
        last, before = pieces[n - 1] if n else ("", ())
        joined = n and length < speaker.clauses_per_sentence and rng.random() < 0.85
        if joined and not _stands_alone(text, kinds, last, before):
            link = _link(speaker, not {*before} <= STANDING, rng)
            link = "then" if link in links else link  # nobody says 'next' twice
            links |= {link} - {"and", "then", ""}
            if text.startswith("and ") or not link:
                current += f", {text}"
            elif link in ("and", "then", "and then"):
                current += f"{',' if hedged or rng.random() > 0.6 else ''} {link} {text}"
            elif " " not in link or rng.random() < 0.4:
                # 'next', 'after that', 'once there': no comma alone can join with these
                sentences.append(current)
                current, length = f"{link}, {text}", 0
            else:
                current += f", and {link} {text}"
            length, hedged = length + 1, False
            continue
        if current:
            sentences.append(current)
        current, length, hedged = text, 1, False
        fillers = (*SPOKEN.fillers[speaker.habit], *SPOKEN.fillers[""])
        if n == 0 and rng.random() < speaker.openings and fillers:
            current = f"{fillers[int(rng.integers(len(fillers)))]}, {text}"
        elif rng.random() < speaker.hedges:
            current, hedged = f"{text}, {SPOKEN.hedges[int(rng.integers(len(SPOKEN.hedges)))]}", True
    sentences.append(current)
    return " ".join(s[0].upper() + s[1:] + "." for s in sentences)


STANDING = {"turn", "slight", "around", "avoid", "notice", "stop_by", "stop_in", "stop_here"}
"""Clauses that lead nowhere; after others 'once there' may follow."""
_SUBJECTS = re.compile(r"(you|you'll|your|that|that's|this|if|I|the|not|bingo|done|end)\b")


def _stands_alone(text: str, kinds: tuple[str, ...], last: str, before: tuple[str, ...]) -> bool:
    """Tells whether a piece is a sentence of its own: warnings, and what is no command or follows none."""
    return "avoid" in (*kinds, *before) or any(_SUBJECTS.match(t) for t in (text, last))


def _link(speaker: Speaker, arrived: bool, rng: np.random.Generator) -> str:
    """A word that joins a clause to the one before it."""
    own = speaker.habit == "terse" or rng.random() < 0.6
    links = SPOKEN.links[speaker.habit if own else ""]
    if arrived and rng.random() < 0.25 and (more := SPOKEN.arrived_links[speaker.habit if own else ""]):
        links = more
    return links[int(rng.integers(len(links)))]


def parse(text: str, lexicon: Lexicon) -> meaning.RouteInstruction:
    """The clauses that a text means; what no template accounts for is passed over.

    Raises:
      ValueError: not one clause was understood.
    """
    rest, clauses = normalised(text), []
    while rest:
        heard = _longest(rest, lexicon)
        if heard is None:
            rest = rest.partition(" ")[2]
            continue
        rooms = iter([ROOM_OF_NOUN[noun] for slot in ("room", "other") if (noun := heard.slots.get(slot))])
        clauses += [_made(kind, heard.slots, rooms, heard.thing) for kind in heard.template.kinds]
        rest = rest[heard.length :].lstrip()
    if not clauses:
        raise ValueError(
            f"no part of {text!r} is a route instruction; expected words such as 'turn left and go to the sofa'"
        )
    return meaning.RouteInstruction(tuple(clauses))


def normalised(text: str) -> str:
    """Lower case without punctuation, slips mended, hedges and openings removed."""
    plain = re.sub(r"[.,;!?]+", " ", text)
    plain = " " + re.sub(r"\s+", " ", plain).strip().lower() + " "
    for right, wrong in SPOKEN.slips.items():
        plain = plain.replace(f" {wrong} ", f" {right} ")
    for empty in _EMPTY:
        plain = plain.replace(f" {empty} ", " ")
    return plain.strip()


_JOINING = (*SPOKEN.fillers.values(), *SPOKEN.links.values(), *SPOKEN.arrived_links.values())
_EMPTY = sorted(
    {h.lower() for h in SPOKEN.hedges} | {f for fs in _JOINING for f in fs if " " in f}, key=lambda s: (-len(s), s)
)


@dataclass(frozen=True)
class _Pattern:
    """A template to be read: what stands before its thing, and after it."""

    template: Template
    first: str
    """Its first word, or '' where a slot comes first."""
    before: re.Pattern
    after: re.Pattern | None
    """None where the template names no thing."""


@dataclass(frozen=True)
class _ParsedTemplate:
    """A template found at the beginning of a text."""

    template: Template
    length: int
    """Characters it accounts for."""
    slots: dict[str, str]
    thing: meaning.Referent | None


def _longest(text: str, lexicon: Lexicon) -> _ParsedTemplate | None:
    """The template that accounts for most of the beginning of `text`."""
    first = text.split(" ", 1)[0]
    heard = [h for p in _patterns() if p.first in ("", first) and (h := _read(p, text, lexicon)) is not None]
    return max(heard, key=lambda h: h.length, default=None)


def _read(pattern: _Pattern, text: str, lexicon: Lexicon) -> _ParsedTemplate | None:
    start = pattern.before.match(text)
    if start is None:
        return None
    if pattern.after is None:
        return _ParsedTemplate(pattern.template, start.end(), start.groupdict(), None)
    for words, thing in lexicon.things_at(text[start.end() :]):
        end = pattern.after.match(text, start.end() + len(words))
        if end is not None:
            return _ParsedTemplate(pattern.template, end.end(), start.groupdict() | end.groupdict(), thing)
    return None


@functools.cache
def _patterns() -> tuple[_Pattern, ...]:
    """Every template as patterns."""
    rooms, again = _any(ROOM_OF_NOUN), "(?:next |other )?"
    slots = {
        "side": "(?P<side>left|right)",
        "room": f"{again}(?P<room>{rooms})",
        "other": f"{again}(?P<other>{rooms})",
        "metres": rf"(?P<n>\d+|{_any(SPOKEN.numbers)}) meters?",
        "steps": rf"(?P<n>\d+|{_any(SPOKEN.numbers)}) big steps?",
        "nth": f"(?P<nth>{_any(SPOKEN.ordinals)})",
        "way": f"(?P<way>{meaning.UP}|{meaning.DOWN})",
        "upstairs": f"(?P<way>{meaning.UP}|{meaning.DOWN})stairs",
        "walk": f"(?:{_any(SPOKEN.verbs + SPOKEN.playful)})",
        "soon": f"(?:{_any(SPOKEN.soon)})",
    }
    patterns = []
    for t in TEMPLATES:
        text = re.escape(t.text.lower()).replace(r"\ ", " ").replace(r"\{", "{").replace(r"\}", "}")
        for name, slot in slots.items():
            text = text.replace(f"{{{name}}}", slot)
        before, thing, after = text.partition("{thing}")
        first = t.text.split(" ", 1)[0].lower()
        whole = r"(?![\w-])"
        start, end = re.compile(before + ("the " if thing else whole)), re.compile(after + whole) if thing else None
        patterns.append(_Pattern(t, "" if first.startswith("{") else first, start, end))
    return tuple(patterns)


def _any(words: Iterable[str]) -> str:
    """A pattern that matches any of the words, the longest that fits."""
    return "|".join(re.escape(w) for w in sorted(words, key=lambda w: (-len(w), w)))


def _made(name: str, slots: Mapping[str, str], rooms: Iterator[str], thing: meaning.Referent | None) -> meaning.Clause:
    """The clause that a name of the templates means, of what its slots held: words, kinds of rooms in turn, a thing."""
    if name in ("turn", "slight"):
        return meaning.Turn(slots["side"], 90 if name == "turn" else 45)
    if name == "around":
        return meaning.Turn(meaning.LEFT, 180)
    if name == "door":
        return meaning.Enter(next(rooms), slots["side"], SPOKEN.ordinals.index(slots["nth"]))
    if name == "open_door_side":
        return meaning.OpenDoor(next(rooms), slots["side"])
    if name == "metres":
        n = slots["n"]
        return meaning.Metres(SPOKEN.numbers.index(n) if n in SPOKEN.numbers else int(n))
    if name in ("climb", "climb_half"):
        return meaning.Climb(slots["way"], name == "climb_half")
    if name == "past_side":
        return meaning.Past(cast(meaning.Referent, thing), slots["side"])
    made: Any = next(c for c, known in _NAMES.items() if known == name)
    if issubclass(made, meaning.OfRoom):
        return made(next(rooms))
    return made(thing) if issubclass(made, meaning.OfThing) else made()

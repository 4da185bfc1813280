"""How clauses sound, the words and habits of people, and their questions: templates.toml, words.toml, speakers.toml and
questions.toml beside this module.

A template speaks for one or two clauses at once and is read back by the parser. Slots: {side} left or right, {room} a
room noun, {thing} 'the red sofa', {metres} 'three meters', {steps} 'three big steps', {nth} 'second', {walk} a verb,
{soon} an adverb. A slot is filled by the first clause of the template that has such a field.
"""

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from embodied.assets.json_file import from_plain, read_toml
from embodied.interface import Intention
from embodied.seeds import FAMILIAR


@dataclass(frozen=True)
class Template:
    kinds: tuple[str, ...]
    """Clause kinds in order: 'turn', 'slight', 'around', 'exit', 'enter', 'door', 'open_door', 'open_door_side',
    'cross', 'forward', 'metres', 'to', 'past', 'past_side', 'avoid', 'notice', 'stop_by', 'stop_in', 'stop_here'."""
    text: str
    habit: str = ""
    """'terse', 'chatty', 'formal', or '' for everybody."""


@dataclass(frozen=True)
class Words:
    """The content of words.toml; where it goes by habit, '' is everybody's."""

    verbs: tuple[str, ...]
    """Fill {walk}, the plainest first."""
    playful: tuple[str, ...]
    """Fill it besides with chatty people."""
    soon: tuple[str, ...]
    """Fill {soon}."""
    hedges: tuple[str, ...]
    """Signs of doubt; they mean nothing."""
    praise: tuple[str, ...]
    """Adjectives that say nothing which could be checked; chatty people like them."""
    seat_praise: tuple[str, ...]
    """More of them for what one sits or lies on."""
    body_praise: tuple[str, ...]
    """More of them for what stands on its own and has some depth."""
    sizes: tuple[str, ...]
    """Adjectives of size; they are true when said, and nobody relies on them."""
    ordinals: tuple[str, ...]
    numbers: tuple[str, ...]
    seats: tuple[str, ...]
    """Words in the names of classes that one sits or lies on."""
    unfit: tuple[str, ...]
    """Classes that nobody would steer by."""
    fillers: Mapping[str, tuple[str, ...]]
    """Openings by habit; they mean nothing."""
    links: Mapping[str, tuple[str, ...]]
    """Join two clauses, by habit."""
    arrived_links: Mapping[str, tuple[str, ...]]
    """Join them besides, where the first has led somewhere."""
    slips: Mapping[str, str]
    """Harmless slips of the keyboard."""
    rooms: Mapping[str, tuple[str, ...]]
    """Room kind to the nouns for it, the plainest first."""
    things: Mapping[str, tuple[str, ...]]
    """Object class to further nouns for it, beside the catalogue's own names and synonyms. None of them is another
    class's plain name."""


def _templates(lines: Mapping[str, tuple[str, ...]]) -> tuple[Template, ...]:
    """By clause sequence; a line may begin with '<habit>: '."""
    templates = []
    for kinds, texts in lines.items():
        for habit, _, text in (line.rpartition(": ") for line in texts):
            templates.append(Template(tuple(kinds.split()), text, habit))
    return tuple(templates)


_HERE = Path(__file__)
TEMPLATES = _templates(read_toml(_HERE.with_name("templates.toml")))
"""Every way of speaking."""
SPOKEN = from_plain(Words, read_toml(_HERE.with_name("words.toml")))


@dataclass(frozen=True)
class Speaker:
    """Habits of speech as probabilities: who names landmarks, who counts metres, who chats, who hedges. Some people are
    kept from learning: who speaks formally, and templates and words that embodied.seeds.novel_among chooses."""

    share: float
    """Of all people."""
    habit: str
    """'terse', 'chatty', 'formal' or '': which templates, links and openings it likes."""
    landmarks: float = 0.8
    """Naming a thing to walk to or past where one can be seen."""
    metres: float = 0.2
    """Giving a distance where no thing is named."""
    colours: float = 0.3
    """Adding a colour or material that is not needed."""
    ornament: float = 0.08
    """Adding an adjective of size or praise."""
    remarks: float = 0.08
    """Mentioning something that one sees on the way."""
    avoids: float = 0.05
    """Saying where not to go."""
    counts: float = 0.3
    """Counting doors where there are several on one side."""
    joining: float = 0.4
    """Saying two clauses in one breath."""
    clauses: int = 4
    """About how many clauses it takes for a route; the next try of a misunderstood route takes one more."""
    clauses_per_sentence: int = 2
    openings: float = 0.1
    hedges: float = 0.03
    slips: float = 0.01
    """Per word that can be misspelt."""
    plainness: float = 0.7
    """Using the plainest noun for a room."""
    novelty: str | None = None
    """'familiar' or 'novel': which templates and words it knows; None: all."""


SPEAKERS = from_plain(tuple[Speaker, ...], read_toml(Path(__file__).with_name("speakers.toml"))["speakers"])
"""Everyday, terse, chatty, formal, landmark-minded, direction-minded."""
NOVEL_HABIT = "formal"
"""Who is never heard in learning where some people are kept from it; novel people are formal or without a habit."""


def draw_speaker(rng: np.random.Generator, novelty: str | None = None) -> Speaker:
    """One of the speakers of a novelty by their shares."""
    kept = lambda s: s.habit != NOVEL_HABIT if novelty == FAMILIAR else s.habit in ("", NOVEL_HABIT)
    known = [s for s in SPEAKERS if novelty is None or kept(s)]
    shares = np.array([s.share for s in known])
    speaker = known[int(rng.choice(len(known), p=shares / shares.sum()))]
    return dataclasses.replace(speaker, novelty=novelty)


@dataclass(frozen=True)
class QuestionPattern:
    intention: Intention
    words: tuple[str, ...]
    """Regular expressions, any of which tells it."""


@dataclass(frozen=True)
class QuestionWords:
    """The content of questions.toml."""

    long_words: tuple[str, ...]
    short_words: Mapping[str, str]
    names: Mapping[str, str]
    """Expressions for {ROOM} and the like in patterns."""
    patterns: tuple[QuestionPattern, ...]


ASKED = from_plain(QuestionWords, read_toml(Path(__file__).with_name("questions.toml")))
_PATTERNS = [
    (p.intention, re.compile(rf"\b(?:{'|'.join(w.format(**ASKED.names) for w in p.words)})(?!\w)"))
    for p in ASKED.patterns
]


def intention_of(question: str) -> Intention | None:
    """The typed question that one in free words amounts to; None where it is understood as none."""
    words = (_spelt(w) for w in re.findall(r"[a-z]+", re.sub("['’]", "", question.lower())))
    text = re.sub(r"\bwere (?=(?:is|are|can|do|should)\b)", "where ", " ".join(words))
    return next((intention for intention, pattern in _PATTERNS if pattern.search(text)), None)


def _spelt(word: str) -> str:
    """The word that somebody meant who typed `word`."""
    if word in ASKED.short_words:
        return ASKED.short_words[word]
    near = (w for w in ASKED.long_words if w[0] == word[0] and _is_near(word, w))
    return word if word == "were" else next(near, word)


def _is_near(a: str, b: str) -> bool:
    """Tells whether one letter added, dropped, replaced or swapped with the next makes `b` of `a`."""
    if abs(len(a) - len(b)) > 1:
        return False
    k = next((i for i, (x, y) in enumerate(zip(a, b)) if x != y), min(len(a), len(b)))
    swapped = a[k : k + 2] == b[k : k + 2][::-1] and a[k + 2 :] == b[k + 2 :]
    return swapped or b[k + 1 :] in (a[k:], a[k + 1 :]) or b[k:] == a[k + 1 :]

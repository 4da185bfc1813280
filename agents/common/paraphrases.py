"""Words and whole sentences that no speaker of the corpus says: how well an agent reads what it never heard. An
instruction is said in synonyms, or read by its grammar and said in other frames.

Nouns, colours and numbers stay as they were said; word order, verbs and what joins clauses are others: in training
those of varied.toml, in tests those of unheard.toml.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.assets.json_file import from_plain, read_toml
from embodied.interface import Actions, Agent, Observations, Rngs, Situations, act
from embodied.language.clauses import Clause, Enter, Metres, Referent, room_of, side_of
from embodied.language.grammar import kind_of, normalised, parse
from embodied.language.lexicon import ROOM_NOUNS, Lexicon, lexicon_of
from embodied.language.plain_language import PlainLanguage, heard_subgoal
from embodied.language.templates import SPOKEN
from embodied.seeds import stream

BACKWARD_SHARE = 0.15
PARAPHRASED_SHARE, RENAMED_SHARE = 0.4, 0.3
"""Of the texts of training, in other frames and in synonyms (docs/sources.md, S184)."""
FIND = "find "


@dataclass(frozen=True)
class Wordings:
    """Contents of unheard.toml and in varied.toml."""

    joints: tuple[str, ...]
    backwards: str
    requests: tuple[str, ...]
    where: tuple[str, ...]
    synonyms: Mapping[str, tuple[str, ...]]
    frames: Mapping[str, tuple[str, ...]]
    actions: Mapping[str, tuple[str, ...]]


VARIED = from_plain(Wordings, read_toml(Path(__file__).with_name("varied.toml")))


def paraphraser(catalogue: Catalogue, wordings: Wordings) -> Callable[[str], str]:
    """A function that rewords instructions, requests and sub-goals about things of a catalogue; the same text always
    alike."""
    return functools.cache(functools.partial(paraphrase, lexicon=lexicon_of(catalogue), wordings=wordings))


def varied(catalogue: Catalogue) -> Callable[[str], str]:
    """A function that rewords a share of the texts of training in the wordings of varied.toml; the same text always
    alike."""
    return functools.partial(_varied, lexicon=lexicon_of(catalogue))


def _varied(text: str, lexicon: Lexicon) -> str:
    rng = stream(0, "varied", text)
    drawn = rng.random()
    if drawn < PARAPHRASED_SHARE:
        return paraphrase(text, lexicon, VARIED)
    if drawn < PARAPHRASED_SHARE + RENAMED_SHARE:
        return some_in_synonyms(text, rng.random(), rng)
    return text


def some_in_synonyms(text: str, share: float, rng: np.random.Generator) -> str:
    """The text with that share of its words in words of about the same meaning, those of training."""

    def other(word: re.Match[str]) -> str:
        like = VARIED.synonyms.get(word[0], ())
        return like[int(rng.integers(len(like)))] if like and rng.random() < share else word[0]

    return re.sub("[a-z]+", other, text.lower())


def paraphrase(text: str, lexicon: Lexicon, wordings: Wordings) -> str:
    """The text in other sentences; what its grammar does not read is left out. A text of which it reads none stays."""
    rng = stream(0, "paraphrase", text)
    *subgoals, last = text.split(" . ")
    if last.startswith(FIND):
        return " . ".join([*(_subgoal(s, wordings, rng) for s in subgoals), _request(last, wordings, rng)])
    try:
        clauses = parse(text, lexicon).clauses
    except ValueError:  # no instruction
        return text
    return _joined(list(_said(clauses, normalised(text), lexicon, wordings, rng)), wordings, rng)


def _said(
    clauses: Sequence[Clause], text: str, lexicon: Lexicon, wordings: Wordings, rng: np.random.Generator
) -> list[str]:
    """Each clause, or two at once, in a frame."""
    sentence, i = [], 0
    while i < len(clauses):
        kinds = " ".join(kind_of(c) for c in clauses[i : i + 2])
        many = 2 if i + 1 < len(clauses) and kinds in wordings.frames and rng.random() < 0.5 else 1
        now = clauses[i : i + many]
        frames = wordings.frames[" ".join(kind_of(c) for c in now)]
        sentence.append(frames[int(rng.integers(len(frames)))].format(**_slots(now, text, lexicon)))
        i += many
    return sentence


def _slots(clauses: Sequence[Clause], text: str, lexicon: Lexicon) -> dict[str, str]:
    """The things that are told of, in the nouns of the text."""
    slots: dict[str, str] = {}
    kinds = [kind for c in clauses if (kind := room_of(c)) is not None]
    for name, kind in zip(("room", "other"), kinds):
        slots[name] = _longest_in(text, map(str.lower, ROOM_NOUNS[kind])) or ROOM_NOUNS[kind][0]
    for c in clauses:
        if (side := side_of(c)) is not None:
            slots["side"] = side
        if isinstance(c, Metres):
            number = SPOKEN.numbers[c.count] if c.count < len(SPOKEN.numbers) else str(c.count)
            slots["metres"] = f"{number} meter{'s' * (c.count != 1)}"
        if isinstance(c, Enter) and c.nth:
            slots["nth"] = SPOKEN.ordinals[c.nth]
        if (thing := getattr(c, "thing", None)) is not None:
            slots["thing"] = f"the {' '.join([*thing.words, _noun(thing, text, lexicon)])}"
    return slots


def _noun(thing: Referent, text: str, lexicon: Lexicon) -> str:
    nouns = (noun for noun, classes in lexicon.classes_of.items() if classes == thing.classes)
    return _longest_in(text, nouns) or thing.classes[0]


def _longest_in(text: str, nouns: Iterable[str]) -> str:
    """The longest of the nouns that the text has; '' if it has none."""
    return max((n for n in nouns if f" {n} " in f" {text} "), key=len, default="")


def _joined(rewording: list[str], wordings: Wordings, rng: np.random.Generator) -> str:
    text = rewording[0]
    for before, more in itertools.pairwise(rewording):
        if text == before and len(rewording) > 2 and rng.random() < BACKWARD_SHARE:
            text = wordings.backwards.format(first=before, second=more)
        else:
            text += wordings.joints[int(rng.integers(len(wordings.joints)))] + more
    return ". ".join(s[:1].upper() + s[1:] for s in text.split(". ")) + "."


def _request(text: str, wordings: Wordings, rng: np.random.Generator) -> str:
    """'find a mug in a kitchen' otherwise."""
    thing, _, room = text.removeprefix(FIND).partition(" in ")
    where = wordings.where[int(rng.integers(len(wordings.where)))].format(room=room) if room else ""
    return wordings.requests[int(rng.integers(len(wordings.requests)))].format(thing=thing, where=where)


def _subgoal(text: str, wordings: Wordings, rng: np.random.Generator) -> str:
    """VNLA's sub-goal otherwise; as it is where it is not in the advisor's words, but a person's."""
    try:
        words = heard_subgoal(text)
    except (ValueError, IndexError):
        return text
    if not set(words) <= set(wordings.actions) or PlainLanguage().subgoal(words) != text:
        return text
    rewording = []
    for word, group in itertools.groupby(words):
        n, frames = len(list(group)), wordings.actions[word]
        rewording.append(frames[int(rng.integers(len(frames)))].format(n=n if word == "forward" else 30 * n))
    return " ; ".join(rewording)


UNHEARD = from_plain(Wordings, read_toml(Path(__file__).with_name("unheard.toml")))


def in_synonyms(known: Collection[str]) -> Callable[[str], str]:
    """A function that replaces each common word of a text by the first of its like that is not in `known`."""
    new = {word: next((w for w in many if w not in known), word) for word, many in UNHEARD.synonyms.items()}
    return functools.cache(lambda text: re.sub("[a-z]+", lambda m: new.get(m[0], m[0]), text.lower()))


@dataclass(frozen=True)
class Reworded:
    """An agent to which everything is said in other words; tasks in situations stay as they are."""

    agent: Agent
    say: Callable[[str], str]

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Rngs
    ) -> tuple[Actions, Any]:
        heard = [o if o is None else dataclasses.replace(o, instruction=self.say(o.instruction)) for o in observations]
        return act(self.agent, heard, situations, memory, rngs=rngs)

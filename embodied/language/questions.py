"""Questions in people's own words to the assistant of Ask-v0: the typed question that each amounts to."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from embodied.assets.json_file import from_plain, read_toml
from embodied.interface import Intention


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

"""Nouns and adjectives: which words people use for rooms and things, and what those words may mean."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from embodied.language.clauses import Referent
from embodied.language.templates import SPOKEN
from embodied.seeds import novel_among, of_novelty

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.assets.records import Asset

ROOM_NOUNS = SPOKEN.rooms
ROOM_OF_NOUN = {noun.lower(): kind for kind, nouns in ROOM_NOUNS.items() for noun in nouns}
PASSAGES = frozenset({"corridor", "hall", "stairwell"})
"""Kinds of room that one is in only to go elsewhere."""
MOST_WORDS = 8
"""Longest wording of a thing: three adjectives of up to two words, then a noun."""
UNFIT = frozenset(SPOKEN.unfit)
EMPTY = frozenset({*SPOKEN.praise, *SPOKEN.seat_praise, *SPOKEN.body_praise, *SPOKEN.sizes})
"""Adjectives that a listener passes over."""


def sizes_of(asset: Asset) -> list[str]:
    """The words of SPOKEN.sizes that are true of an asset."""
    w, d, h = asset.size
    sizes = []
    if w * d > 1.4:
        sizes += ["large", "big"] + ["huge", "massive"] * (w * d > 3)
    if max(w, d, h) < 0.45:
        sizes += ["small", "little", "compact"] + ["tiny"] * (max(w, d, h) < 0.2)
    if h > 1.6:
        sizes += ["tall", "high"]
    if max(w, d) > 1.8:
        sizes += ["long", "wide"]
    return sizes + ["low"] * (0.1 < h < 0.5 < w) + ["narrow"] * (min(w, d) < 0.35 < h) + ["thin"] * (min(w, d) < 0.06)


def praise_of(asset: Asset) -> tuple[str, ...]:
    """Words of praise that somebody might use for an asset; comfort comes to mind three times as readily for a seat."""
    w, d, h = asset.size
    seat = bool({*SPOKEN.seats} & {*asset.object_class.split()})
    body = asset.support not in ("surface", "ceiling") and min(w, d) > 0.25 and h > 0.3
    return (*SPOKEN.praise, *(SPOKEN.seat_praise * 3 if seat else ()), *(SPOKEN.body_praise if body else ()))


@dataclass(frozen=True)
class Word:
    """One way to name a thing."""

    noun: str
    adjectives: tuple[str, ...]

    def __str__(self) -> str:
        return " ".join([*self.adjectives, self.noun])


class Lexicon:
    """The words of a catalogue; made once per catalogue, changes never."""

    def __init__(self, catalogue: Catalogue) -> None:
        classes_of: dict[str, set[str]] = {}
        nouns_of: dict[str, list[str]] = {}
        adjectives: set[str] = set()
        for asset in catalogue.assets.values():
            adjectives |= {w.lower() for w in (*asset.colours, *asset.materials)}
            for noun in self._nouns(asset):
                noun = noun.lower()
                if noun in ROOM_OF_NOUN or not re.fullmatch(r"[a-z][a-z' -]*", noun):
                    continue
                classes_of.setdefault(noun, set()).add(asset.object_class)
                if noun not in nouns_of.setdefault(asset.object_class, []):
                    nouns_of[asset.object_class].append(noun)
        self.classes_of = {noun: tuple(sorted(names)) for noun, names in sorted(classes_of.items())}
        self.nouns_of = {name: tuple(nouns) for name, nouns in sorted(nouns_of.items())}
        self.adjectives = frozenset(adjectives - EMPTY)
        self.novel_nouns = novel_among(set(self.classes_of) - set(self.nouns_of))
        """Which only people who are kept from learning use; the names of classes are everybody's."""

    @staticmethod
    def _nouns(asset: Asset) -> tuple[str, ...]:
        """The class's name first, then the asset's synonyms, then what else people say."""
        return (asset.object_class, *asset.synonyms, *SPOKEN.things.get(asset.object_class, ()))

    def thing(self, word: Word) -> Referent:
        """The things that a word may stand for.

        Raises:
          KeyError: no such noun.
        """
        return Referent(self.classes_of[word.noun], tuple(sorted(w for w in word.adjectives if w not in EMPTY)))

    def words_for(
        self,
        asset: Asset,
        rng: np.random.Generator,
        *,
        adjectives: int,
        ornament: float = 0.0,
        novelty: str | None = None,
    ) -> Word:
        """A noun for an asset, with up to `adjectives` of its colour and material words.

        Args:
          novelty: of who speaks.
          ornament: probability of one more adjective, of size or of praise, that tells nothing apart.
        """
        nouns = self.nouns_of[asset.object_class]
        own = [n for n in nouns if n in {s.lower() for s in self._nouns(asset)}] or list(nouns)
        own = list(of_novelty(own, self.novel_nouns, novelty))
        noun = own[0] if len(own) == 1 or rng.random() < 0.5 else own[int(rng.integers(1, len(own)))]
        spare = [w.lower() for w in (*asset.colours[:1], *asset.materials[:1]) if w.lower() not in noun.split()]
        praise = praise_of(asset)
        extra = [*sizes_of(asset), *(praise[int(rng.integers(len(praise)))] for _ in range(3))]
        more = [extra[int(rng.integers(len(extra)))]] if rng.random() < ornament else []
        return Word(noun, (*more, *spare[:adjectives]))

    def things_at(self, text: str) -> Iterator[tuple[str, Referent]]:
        """Things that the beginning of `text` may name, the longest wording first: (words, thing)."""
        tokens = text.split(" ", MOST_WORDS)[:MOST_WORDS]
        for n in range(len(tokens), 0, -1):
            thing = self.heard(tokens[:n])
            if thing is not None:
                yield " ".join(tokens[:n]), thing

    def heard(self, tokens: list[str]) -> Referent | None:
        """The thing that adjectives and a noun mean, the longest noun at their end; None if they name nothing."""
        for i in range(len(tokens)):
            classes = self.classes_of.get(" ".join(tokens[i:]))
            if classes is not None and (words := self._adjectives_of(tokens[:i])) is not None:
                return Referent(classes, tuple(sorted(w for w in words if w not in EMPTY)))
        return None

    def _adjectives_of(self, tokens: list[str]) -> list[str] | None:
        """Tokens as adjectives, the longest first ('dark brown', 'wood'); None if they are none."""
        words = []
        while tokens:
            starts = (" ".join(tokens[:n]) for n in range(len(tokens), 0, -1))
            word = next((w for w in starts if w in self.adjectives or w in EMPTY), None)
            if word is None:
                return None
            words.append(word)
            tokens = tokens[len(word.split(" ")) :]
        return words


@functools.lru_cache(maxsize=4)
def lexicon_of(catalogue: Catalogue) -> Lexicon:
    """The lexicon of a catalogue, made once per process and catalogue."""
    return Lexicon(catalogue)


def says(asset: Asset, thing: Referent) -> bool:
    """Tells whether `thing` may mean this asset."""
    own = {w.lower() for w in (*asset.colours, *asset.materials)}
    return asset.object_class in thing.classes and all(w in own for w in thing.words)

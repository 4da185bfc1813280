"""How clauses sound, and the words that people use: templates.toml and words.toml beside this module.

A template speaks for one or two clauses at once and is read back by the parser. Slots: {side} left or right, {room} a
room noun, {thing} 'the red sofa', {metres} 'three meters', {steps} 'three big steps', {nth} 'second', {walk} a verb,
{soon} an adverb. A slot is filled by the first clause of the template that has such a field.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from embodied.assets.json_file import from_plain, read_toml


@dataclass(frozen=True)
class Template:
    kinds: tuple[str, ...]
    """Clause kinds in order: 'turn', 'slight', 'around', 'exit', 'enter', 'door', 'open_door',
    'open_door_side', 'cross', 'forward', 'metres', 'to',
    'past', 'past_side', 'avoid', 'notice', 'stop_by', 'stop_in', 'stop_here'."""
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

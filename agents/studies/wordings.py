"""The tables of every learner that reads instructions: as they were said, in synonyms, paraphrased, and of people never
heard. Each judges three readers: words learned from instructions, pre-trained vectors, and these with varied words in
training."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from embodied.agents.common.paraphrases import UNHEARD, in_synonyms, paraphraser, reworded
from embodied.agents.common.settings import EVERYBODY
from embodied.agents.studies.tables import StudyRow, StudyTable
from embodied.assets.catalogue import load_catalogue
from embodied.assets.closure import code_digest
from embodied.interface import Agent
from embodied.novelty import FAMILIAR, NOVEL

WORDING, SYNONYMS, PARAPHRASED = "wording", "synonyms", "paraphrased"
"""In a row's `judge`: how instructions are said; as they are without."""
SPEAKERS = "speakers"
"""In a row's `judge`: the novelty of who describes routes; those of the data set without."""


def words_table(row: Callable[..., StudyRow], columns: Sequence[str], splits: Sequence[str]) -> StudyTable:
    """The table of a learner.

    Args:
      row: makes a row of its label and of what differs in training.
    """
    readers = [[_said(r, how) for how in ("", SYNONYMS, PARAPHRASED)] for r in _readers(row)]
    lost = [(rewording, other) for rewording, *unheard in readers for other in unheard]
    won = [pair for alike in [*zip(*readers, strict=True)][1:] for pair in _changes(alike)]
    title = "Instructions in unheard words and sentences"
    rows = tuple(itertools.chain(*readers))
    return StudyTable(title, rows, tuple(columns), tuple(splits), (*lost, *won))


def speakers_table(row: Callable[..., StudyRow], columns: Sequence[str], splits: Sequence[str]) -> StudyTable:
    """Learned from familiar people alone, judged by them and by the others, beside one that learned from everybody:
    the others may be harder to follow, heard or not. `row` as in words_table."""

    def heard(reader: StudyRow, novelty: str, who: str) -> StudyRow:
        return dataclasses.replace(reader, label=f"{reader.label}, {who}", judge={**reader.judge, SPEAKERS: novelty})

    def both(reader: StudyRow, former: str, latter: str) -> tuple[StudyRow, StudyRow]:
        return heard(reader, FAMILIAR, former), heard(reader, NOVEL, latter)

    readers = _readers(lambda label, **train: row(label, speakers=FAMILIAR, **train))
    pairs = [both(r, "people heard in training", "people never heard") for r in readers]
    everybody = both(row("learned words of everybody", speakers=EVERYBODY), "the former people", "the latter people")
    rows, never = tuple(itertools.chain(*pairs, everybody)), [novel for _, novel in pairs]
    compared = (*pairs, everybody, (everybody[1], never[0]), *_changes(never))
    title = "Instructions of people who were never heard in training"
    return StudyTable(title, rows, tuple(columns), tuple(splits), compared)


def _readers(row: Callable[..., StudyRow]) -> tuple[StudyRow, ...]:
    """Agents that learn words from instructions alone, with pre-trained vectors, and from varied words, too."""
    vectors = row("pre-trained vectors", word_vectors="minilm")
    return row("learned words"), vectors, row("varied words", word_vectors="minilm", varied_words=True)


def _changes(readers: Sequence[StudyRow]) -> list[tuple[StudyRow, StudyRow]]:
    """Each reader beside the one before it, from which it differs in one setting."""
    return [(after, before) for before, after in itertools.pairwise(readers)]


def _said(row: StudyRow, how: str) -> StudyRow:
    return dataclasses.replace(row, label=f"{row.label}, {how}", judge={**row.judge, WORDING: how}) if how else row


def code_of(judge: Mapping[str, Any]) -> dict[str, str]:
    """The code and texts that word what is said in a row, as a part of what was judged."""
    return {"wording": code_digest(__name__)} if {WORDING, SPEAKERS} & set(judge) else {}


def saying(how: str, known: Sequence[str], cache: Path) -> Callable[[str], str]:
    """A function that says a text as a row has it to an agent that knows the words `known`."""
    return in_synonyms(known) if how == SYNONYMS else paraphraser(load_catalogue(cache), UNHEARD)


def hearing(agent: Agent, judge: Mapping[str, Any], known: Sequence[str], cache: Path) -> Agent:
    """An agent that knows the words `known`, to which everything is said as a row has it."""
    how = judge.get(WORDING)
    return reworded(agent, saying(how, known, cache)) if how else agent

"""The table of every learner that reads instructions: as they were said, in synonyms, and paraphrased. It judges three
readers: words learned from instructions, pre-trained vectors, and these with varied words in training."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from embodied.agents.common.paraphrases import UNHEARD, Reworded, in_synonyms, paraphraser
from embodied.agents.studies.tables import StudyRow, StudyTable
from embodied.assets.catalogue import load_catalogue
from embodied.assets.closure import code_digest
from embodied.interface import Agent

WORDING, SYNONYMS, PARAPHRASED = "wording", "synonyms", "paraphrased"
"""In a row's `judge`: how instructions are said; as they are without."""


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
    return {"wording": code_digest(__name__)} if WORDING in judge else {}


def saying(how: str, known: Sequence[str], cache: Path) -> Callable[[str], str]:
    """A function that says a text as a row has it to an agent that knows the words `known`."""
    return in_synonyms(known) if how == SYNONYMS else paraphraser(load_catalogue(cache), UNHEARD)


def hearing(agent: Agent, judge: Mapping[str, Any], known: Sequence[str], cache: Path) -> Agent:
    """An agent that knows the words `known`, to which everything is said as a row has it."""
    how = judge.get(WORDING)
    return Reworded(agent, saying(how, known, cache)) if how else agent

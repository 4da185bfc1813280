"""The table of every learner that reads: instructions as they were said, in synonyms and paraphrased, with and without
pre-trained word vectors."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from agents.common.paraphrases import paraphraser
from agents.common.unheard import Reworded, in_synonyms
from agents.studies.tables import StudyRow, StudyTable
from assets.catalogue import load_catalogue
from embodied.interface import Policy
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
    learned, read = row("learned words"), row("pre-trained vectors", word_vectors="minilm")
    rows = {(r.label, how): _said(r, how) for r in (learned, read) for how in ("", SYNONYMS, PARAPHRASED)}
    hows = (SYNONYMS, PARAPHRASED)
    lost = [(rows[r.label, ""], rows[r.label, how]) for how in hows for r in (learned, read)]
    won = [(rows[read.label, how], rows[learned.label, how]) for how in hows]
    title = "Instructions in unheard words and sentences"
    return StudyTable(title, tuple(rows.values()), tuple(columns), tuple(splits), (*lost, *won))


def speakers_table(row: Callable[..., StudyRow], columns: Sequence[str], splits: Sequence[str]) -> StudyTable:
    """Learned from familiar people alone, judged by them and by the others; `row` as in words_table."""

    def heard(novelty: str, label: str, **train: Any) -> StudyRow:
        who = "people never heard" if novelty == NOVEL else "people heard in training"
        made = row(f"{label}, {who}", speakers=FAMILIAR, **train)
        return dataclasses.replace(made, judge={**made.judge, SPEAKERS: novelty})

    def pair(label: str, **train: Any) -> tuple[StudyRow, StudyRow]:
        return heard(FAMILIAR, label, **train), heard(NOVEL, label, **train)

    learned, read = pair("learned words"), pair("pre-trained vectors", word_vectors="minilm")
    title = "Instructions of people who were never heard in training"
    return StudyTable(title, (*learned, *read), tuple(columns), tuple(splits), (learned, read, (read[1], learned[1])))


def _said(row: StudyRow, how: str) -> StudyRow:
    return dataclasses.replace(row, label=f"{row.label}, {how}", judge={**row.judge, WORDING: how}) if how else row


def saying(how: str, known: Sequence[str], cache: Path) -> Callable[[str], str]:
    """What says a text as a row has it to an agent that knows the words `known`."""
    return in_synonyms(known) if how == SYNONYMS else paraphraser(load_catalogue(cache))


def hearing(policy: Any, how: str, known: Sequence[str], cache: Path) -> Policy:
    """A policy to which everything is said so."""
    return Reworded(policy, saying(how, known, cache))

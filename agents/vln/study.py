"""Tables of VLN as data, and VLN as a learner of the engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from embodied.agents.common.session import Note
from embodied.agents.studies.engine import Measured
from embodied.agents.studies.episodes import JUDGES
from embodied.agents.studies.tables import StudyRow, StudyTable
from embodied.agents.studies.wordings import words_table
from embodied.agents.vision.sighted_study import TEST_SPLITS, SightedStudy
from embodied.agents.vln.agent import VlnAgent
from embodied.agents.vln.config import MEASURES, FollowerSettings, SpeakerSettings
from embodied.agents.vln.run import train_follower
from embodied.agents.vln.speaker import load_speaker, reranked, speaker_identity, train_speaker
from embodied.evaluation.evaluate import spread
from embodied.records import save_lines

LEARNED, RERANKED = "learned", "reranked"
CANDIDATES = 10
"""K of Eq 2.19."""


def _row(label: str, played: str = LEARNED, **train: Any) -> StudyRow:
    return StudyRow(label, train, {"played": played})


def _without(name: str) -> StudyRow:
    return StudyRow(name, None, {"played": name})


FOLLOWER, BLIND_FOLLOWER = _row("DAgger"), _row("DAgger, blind", blind=True)
CHOSEN = _row("DAgger, reranked", RERANKED)
VLN_TABLES: Mapping[str, StudyTable] = {
    "followers": StudyTable(
        "Followers of route instructions",
        (
            FOLLOWER,
            _row("student forcing", forcing="student"),
            _row("teacher forcing", forcing="teacher"),
            BLIND_FOLLOWER,
            _row("DAgger, no instruction", wordless=True),
            _without("random walk"),
            _without("shortest"),
        ),
        MEASURES,
        TEST_SPLITS,
        ((FOLLOWER, BLIND_FOLLOWER),),
    ),
    "speaker": StudyTable(
        "A speaker that chooses between walks (Eq 2.19)",
        (FOLLOWER, CHOSEN),
        MEASURES,
        TEST_SPLITS,
        ((CHOSEN, FOLLOWER),),
    ),
    "words": words_table(_row, MEASURES, TEST_SPLITS[1:]),
}


@dataclass(frozen=True, kw_only=True)
class VlnStudy(SightedStudy):
    """Followers and the speaker."""

    config: FollowerSettings
    speaker: SpeakerSettings

    name, agent_kind, all_tables = "vln", VlnAgent, VLN_TABLES
    makers = ("embodied.agents.vln.run",)
    judges = (*JUDGES, "embodied.agents.vln.speaker")

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """The speaker, if a row wants it."""
        if any(r.judge["played"] == RERANKED for r in rows):
            train_speaker(
                self.training_data(), self.speaker, folder / "speaker", note=lambda line: note(f"speaker: {line}")
            )

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        train_follower(self.training_data(), self.settings(train, seed), self.evaluation, home, note=note)
        return home / "best.safetensors"

    @torch.inference_mode()
    def judge(self, weights: Path | None, row: StudyRow, split: str, seed: int, folder: Path, keep: Path) -> Measured:
        if weights is None or row.judge["played"] != RERANKED:
            return super().judge(weights, row, split, seed, folder, keep)
        source, speaker, agent = (
            self.training_data(),
            load_speaker(folder / "speaker" / "speaker.safetensors"),
            self.load(weights),
        )
        whole, bank = source.data.split(split), source.split(split).bank
        tasks, played = spread(whole.tasks, self.tasks), []
        for k in self.eval_seeds:
            episodes = reranked(whole, tasks, agent, speaker, bank, candidates=CANDIDATES, seed=k)
            save_lines(keep.with_name(f"{keep.name}_{k}.jsonl"), episodes)
            played += episodes
        return self.count(played, whole, row.judge)

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        about = super().judged(row, split)
        speaker = {"speaker": speaker_identity(self.training_data(), self.speaker)}
        return {**about, **speaker} if row.judge["played"] == RERANKED else about

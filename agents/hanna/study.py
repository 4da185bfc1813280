"""The tables of 4.2 as data, and HANNA as a learner of embodied.agents.studies.engine."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.common.session import Note
from embodied.agents.hanna.agent import HannaAgent, by_the_text, hanna_policies, train_agent
from embodied.agents.hanna.training_config import HannaEvaluation, TrainingConfig
from embodied.agents.studies.episodes import JUDGES
from embodied.agents.studies.tables import StudyRow, StudyTable
from embodied.agents.vision.sighted_study import TEST_SPLITS as TEST
from embodied.agents.vision.sighted_study import SightedStudy, TrainingData
from embodied.datasets.store import Dataset, SplitData
from embodied.interface import Agent

VALIDATION_SPLITS = ("val_seen", "val_unseen")
FULL = ("success", "spl", "navigation error", "requests")


def learned(label: str, played: str = "learned", **train: Any) -> StudyRow:
    """A row of an agent that differs from the settings of the study in `train`."""
    return StudyRow(label, train, {"played": played})


def without(label: str, played: str) -> StudyRow:
    """A row of an agent that does not learn."""
    return StudyRow(label, None, {"played": played})


NO_ASK = learned("No ask", ask_rule="never", alpha=0.5)
RANDOM_ASK = learned("Random ask", ask_rule="random", alpha=0.5)
EVERY_5 = learned("Ask every 5", ask_rule="every5", alpha=0.5)
LEARNED = learned("Learned")
HALF = learned("half curiosity", alpha=0.5)
IMAGE_ONLY = learned("Target image only", read_assistance=False)
LANGUAGE = learned("+ language instruction")
LSTM = learned("LSTM encoder-decoder", model="lstm", alpha=0.0, predict_reasons=False)
NO_CURIOSITY = learned("Our model, alpha = 0", alpha=0.0)
OURS = learned("Our model, alpha = 1")
PLAIN_OURS = learned("our model, alpha = 0, no conditions", alpha=0.0, predict_reasons=False)
ABLATIONS: Mapping[str, Mapping[str, Any]] = {
    "No inter-task reset": {"reset_inter_task": False},
    "No condition prediction": {"predict_reasons": False},
    "No cosine-similarity attention": {"similarity_attention": False},
    "No curiosity loss": {"alpha": 0.0},
}
HANNA_TABLES: Mapping[str, StudyTable] = {
    "4.3": StudyTable(
        "Results on the test splits",
        (
            without("Random walk", "random walk"),
            without("Forward 10", "forward 10"),
            learned("No assistance", ask_rule="never", alpha=0.5),
            learned("Learn to interpret assistance"),
            without("Shortest", "shortest"),
            learned("Perfect assistance interpretation", "learned, perfect interpretation"),
            learned("Blind", "blind"),
            learned("Rules only", "rules only"),
        ),
        FULL,
        TEST,
    ),
    "4.4": StudyTable("Types of assistance", (IMAGE_ONLY, LANGUAGE), ("success",), TEST, ((LANGUAGE, IMAGE_ONLY),)),
    "4.5": StudyTable(
        "Help-request policies",
        (NO_ASK, RANDOM_ASK, EVERY_5, LEARNED),
        ("success", "requests"),
        TEST,
        tuple((one, other) for one in (LEARNED, HALF) for other in (NO_ASK, RANDOM_ASK, EVERY_5)),
    ),
    "4.6": StudyTable(
        "Model and curiosity",
        (LSTM, NO_CURIOSITY, OURS),
        ("success", "mistake repeat", "request repeat"),
        ("test_unseen",),
        ((PLAIN_OURS, LSTM), (OURS, NO_CURIOSITY)),
    ),
    "D.2": StudyTable(
        "Ablations",
        (learned("Final agent"), *(learned(name, **off) for name, off in ABLATIONS.items())),
        FULL,
        VALIDATION_SPLITS,
        tuple((learned("Final agent"), learned(name, **off)) for name, off in ABLATIONS.items()),
    ),
}
"""The studies by name. D.2 is on the validation splits, as in the dissertation. Pairs that are compared differ in one
thing, but for learned asking and other rules, which have the authors' alpha; half curiosity is learned asking with the
alpha of these rules (Table D.1, note)."""


PRINTED = ("4.3", "4.4", "4.5", "4.6", "D.2")
"""Tables whose numbers the dissertation prints: judged as the text has it, and in columns of their own as we do."""
BY_TEXT, SHIPPED = "by the text", " as shipped"
"""In a row's `judge`, and at the end of a split's name."""


def in_both_ways(table: StudyTable) -> StudyTable:
    """The table with columns of the text's way of judging, then of ours; comparisons are of both."""
    text = lambda row: dataclasses.replace(row, judge={**row.judge, BY_TEXT: True})
    return dataclasses.replace(
        table,
        rows=tuple(text(row) for row in table.rows),
        splits=(*table.splits, *(s + SHIPPED for s in table.splits)),
        compared=tuple((text(a), text(b)) for a, b in table.compared),
    )


@dataclass(frozen=True, kw_only=True)
class HannaStudy(SightedStudy):
    """Tables 4.3 to 4.6 and D.2."""

    config: TrainingConfig
    evaluation: HannaEvaluation
    device: str = "cpu"

    name, agent_kind = "hanna", HannaAgent
    makers = ("embodied.agents.hanna.agent",)
    judges = (*JUDGES, "embodied.agents.hanna.agent")

    def tables(self) -> Mapping[str, StudyTable]:
        """Splits out of distribution come beside the test splits."""
        ood, tables = Dataset(self.data).ood, {}
        for name, table in HANNA_TABLES.items():
            wider = dataclasses.replace(table, splits=(*table.splits, *ood)) if table.splits == TEST else table
            tables[name] = in_both_ways(wider) if name in PRINTED else wider
        return tables

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Features that are missing are told before anything is trained."""
        for split in dict.fromkeys(s.removesuffix(SHIPPED) for s in splits):
            self.training_data().split(split)

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        train_agent(self.training_data(), self.settings(train, seed), self.evaluation, home, note=note)
        return home / "best.safetensors"

    def policies(self, agent: HannaAgent | None, judge: Mapping[str, Any], split: str) -> Agent:
        if agent is None:
            return super().policies(agent, judge, split)
        bank = self.training_data().split(split.removesuffix(SHIPPED)).bank
        by_text = judge.get(BY_TEXT) and not split.endswith(SHIPPED)
        return hanna_policies(agent, bank, by_the_text if by_text else HannaAgent.policy)[judge["played"]]

    def where(self, agent: HannaAgent | None, judge: Mapping[str, Any], split: str) -> SplitData:
        return super().where(agent, judge, split.removesuffix(SHIPPED))

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return super().judged(row, split.removesuffix(SHIPPED))

    def about(self) -> str:
        return (
            f"{super().about()} Judged at temperature {self.evaluation.evaluation_temperature:g} and by "
            f"docs/sources.md, S36, S161, S162; in {', '.join(PRINTED)} so in the columns 'as shipped' alone, in the "
            "others, beside the printed numbers, the likeliest action is taken."
        )

    def training_data(self) -> TrainingData:
        return dataclasses.replace(super().training_data(), device=self.device)

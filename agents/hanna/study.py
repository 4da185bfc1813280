"""HANNA as a learner of embodied.agents.studies.engine."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.common.session import Note
from embodied.agents.hanna.agent import HannaAgent, HannaLearner, by_the_text, hanna_policies
from embodied.agents.learners.hanna import HannaEvaluation, TrainingConfig
from embodied.agents.studies.tables import StudyRow, StudyTable, study_tables
from embodied.agents.vision.sighted_study import TEST_SPLITS as TEST
from embodied.agents.vision.sighted_study import SightedStudy
from embodied.datasets.store import Dataset, SplitData
from embodied.interface import Agent

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

    name, agent_kind, learner = "hanna", HannaAgent, HannaLearner

    def tables(self) -> Mapping[str, StudyTable]:
        """Splits out of distribution come beside the test splits."""
        ood, tables = Dataset(self.data).ood, {}
        for name, table in study_tables("hanna").items():
            wider = dataclasses.replace(table, splits=(*table.splits, *ood)) if table.splits == TEST else table
            tables[name] = in_both_ways(wider) if name in PRINTED else wider
        return tables

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Features that are missing are told before anything is trained."""
        for split in dict.fromkeys(s.removesuffix(SHIPPED) for s in splits):
            self.training_data().split(split)

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

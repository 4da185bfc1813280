"""REGEX as its commands run it: settings become data, teacher and student, and these a problem of ILIAD."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.common.session import Note
from embodied.agents.common.tensor_file import load_into
from embodied.agents.common.vocabulary import Vocabulary
from embodied.agents.common.weights import load_weights, save_weights
from embodied.agents.iliad.protocol import DescribingTeacher
from embodied.agents.iliad.regex.coding import Requests, request_words
from embodied.agents.iliad.regex.config import RegexConfig
from embodied.agents.iliad.regex.data import RegexData, make_data, rules_without_requests
from embodied.agents.iliad.regex.networks import Speller
from embodied.agents.iliad.regex.stages import (
    REGEX_REMEDY,
    RegexAbout,
    new_network,
    pretrain_student,
    teach_describer,
    teach_executor,
)
from embodied.agents.iliad.regex.teacher import GrammarTeacher, LearnedTeacher
from embodied.agents.iliad.regex.world import RegexMarginal, RegexStudent, RegexWorld
from embodied.agents.iliad.training import IliadProblem, successes
from embodied.evaluation.tables import Samples
from embodied.records import identity_of
from embodied.seeds import stream

VALIDATION_REQUESTS = 500
"""Data points of each validation; the last one of a run and tests have all."""


@dataclass(frozen=True)
class RegexSetup:
    """REGEX before anything is made; as NavSetup of embodied.agents.iliad.nav.run."""

    config: RegexConfig

    name = "regex"
    updates = 30_000

    def source(self) -> Mapping[str, object]:
        return {"teacher": self.config}

    def prepare(self, folder: Path, note: Note) -> RegexGrounds:
        """Data and teacher, trained into `folder` unless it is there."""
        config, data = self.config, make_data(self.config)
        requests = request_words(r for q in data.splits["train"] for r in q.requests)
        count = sum(map(len, data.templates.values()))
        note(f"{len(data.words)} words, {count} templates, {len(requests.vocabulary)} words of requests")
        if config.teacher == "grammar":
            teacher: DescribingTeacher = GrammarTeacher(config)
        else:
            executor = teach_executor(data, config, requests, folder, note=note)
            describer = teach_describer(data, config, requests, folder, note=note)
            teacher = LearnedTeacher(describer, executor, requests, config.candidates)
        return RegexGrounds(config, data, requests, teacher)

    def about(self) -> str:
        c = self.config
        return (
            f"{c.items:,} data points with three requests each, {c.held_out_items:,} for validation and for test, in "
            f"wordings that nobody learned from. Hidden size {c.hidden_size}, {c.pretraining_iterations:,} updates of "
            f"pre-training on rules alone; teacher: {c.teacher}; marginal: {c.unlabeled:,} rules."
        )


@dataclass(frozen=True, eq=False)
class RegexGrounds:
    """Data and networks that all students of a study share."""

    config: RegexConfig
    data: RegexData
    requests: Requests
    teacher: DescribingTeacher

    def problem(self, seed: int, folder: Path, note: Note) -> IliadProblem:
        """A student of this seed with everything around it; it is pretrained in `folder` where the settings say so."""
        c, requests, splits = self.config, self.requests, self.data.splits

        def new_student() -> RegexStudent:
            if not c.pretraining_iterations:
                return RegexStudent(new_network(Speller, c, requests, seed, "student"), requests)
            return RegexStudent(pretrain_student(self.data, c, requests, folder, seed, note=note).train(), requests)

        rng, student = stream(c.data_seed, "regex", "unlabeled"), new_student()
        marginal = RegexMarginal(tuple(rules_without_requests(self.data.words, c.unlabeled, rng=rng)))
        identity = identity_of("embodied.agents.iliad.regex.run", world="regex", data=self.data.digest, teacher=c)
        save = lambda path, identity: save_weights(
            path, "regex", student.network.state_dict(), RegexAbout(c, requests.vocabulary.words), identity
        )
        return IliadProblem(
            RegexWorld(), self.teacher, marginal, student, new_student(),
            splits["train"], splits["validation"][:VALIDATION_REQUESTS], identity, save,
        )  # fmt: skip

    def judge(self, best: Path, split: str, how: Mapping[str, Any]) -> Samples:
        """Which requests of a split a trained student fulfils."""
        good = successes(RegexWorld(), load_student(best)[0], self.data.splits[split])
        return Samples(tuple(map(float, good)), share=True)


def load_student(path: Path) -> tuple[RegexStudent, RegexConfig]:
    """A student as training saved it.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    tensors, about = load_weights(path, "regex", RegexAbout, REGEX_REMEDY)
    requests = Requests(Vocabulary(about.words))
    speller = new_network(Speller, about.config, requests, 0, "loaded")
    load_into(speller, tensors, path)
    return RegexStudent(speller.eval(), requests), about.config

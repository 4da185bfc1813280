"""The steps of REGEX's commands: settings become data, teacher and student, and these a problem of ILIAD."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from embodied.agents.common.session import Note
from embodied.agents.iliad.config import LearnerConfig
from embodied.agents.iliad.protocol import DescribingTeacher
from embodied.agents.iliad.regex.coding import Requests, request_words
from embodied.agents.iliad.regex.config import RegexConfig, data_of
from embodied.agents.iliad.regex.data import RegexData, WordTask, make_data, read_templates, rules_without_requests
from embodied.agents.iliad.regex.networks import Speller
from embodied.agents.iliad.regex.stages import (
    load_network,
    new_network,
    pretrain_student,
    save_network,
    teach_describer,
    teach_executor,
)
from embodied.agents.iliad.regex.teacher import GrammarTeacher, LearnedTeacher
from embodied.agents.iliad.regex.words import read_words
from embodied.agents.iliad.regex.world import RegexMarginal, RegexStudent, RegexWorld
from embodied.agents.iliad.training import IliadProblem, train
from embodied.assets.cache import digest
from embodied.assets.json_file import read_text
from embodied.identity import differences, identity_of, read_finished, write_finished
from embodied.records import from_plain, to_json
from embodied.seeds import stream

VALIDATION_REQUESTS = 500
"""Data points of each validation; the last one of a run and tests have all."""


@dataclass(frozen=True, eq=False)
class RegexGrounds:
    """Data and networks that all students of a study share."""

    config: RegexConfig
    data: RegexData
    requests: Requests
    teacher: DescribingTeacher
    digest: str
    """Of the data."""


def prepare(
    config: RegexConfig, folder: Path, *, words: Path | None = None, templates: Path | None = None, note: Note = print
) -> RegexGrounds:
    """Data and teacher, made or trained into `folder` unless they are there.

    Raises:
      ValueError: files that cannot be used; data of other settings in the folder.
    """
    folder = Path(folder)
    data = _data(config, folder / "data.json", words, templates)
    requests = request_words(r for q in data.splits["train"] for r in q.requests)
    count = sum(len(v) for v in data.templates.values())
    note(f"{len(data.words)} words, {count} templates, {len(requests.vocabulary)} words of requests")
    if config.teacher == "grammar":
        if templates:
            raise ValueError("the grammar knows no templates but its own; use --teacher learned with --templates")
        teacher: DescribingTeacher = GrammarTeacher(config)
    else:
        executor = teach_executor(data, config, requests, folder, note=note)
        describer = teach_describer(data, config, requests, folder, note=note)
        teacher = LearnedTeacher(describer, executor, requests, config.candidates, config.pragmatics)
    return RegexGrounds(config, data, requests, teacher, _digest(data))


def problem_of(grounds: RegexGrounds, seed: int, folder: Path, *, note: Note = print) -> IliadProblem:
    """A student of this seed with everything around it; it is pretrained in `folder` where the settings say so."""
    c = grounds.config

    def student() -> RegexStudent:
        if not c.pretraining_iterations:
            return RegexStudent(new_network(Speller, c, grounds.requests, seed, "student"), grounds.requests)
        made = pretrain_student(grounds.data, c, grounds.requests, folder, seed, note=note)
        return RegexStudent(made.train(), grounds.requests)

    rng = stream(c.data_seed, "regex", "unlabeled")
    rules = tuple(rules_without_requests(grounds.data, c, c.unlabeled, rng=rng))
    splits = grounds.data.splits
    identity = identity_of("embodied.agents.iliad.regex.run", world="regex", data=grounds.digest, teacher=c)
    return IliadProblem(
        RegexWorld(), grounds.teacher, RegexMarginal(rules), student(), student(),
        splits["train"], splits["validation"][:VALIDATION_REQUESTS], identity,
    )  # fmt: skip


def learn(
    grounds: RegexGrounds,
    learner: LearnerConfig,
    folder: Path,
    pretraining: Path,
    *,
    minutes: float | None = None,
    note: Note = print,
) -> list[dict[str, float]]:
    """Train, or go on training, the student of a run folder; keeps the best one as best.safetensors.

    Args:
      pretraining: where the student is that all learners of a seed begin with; made there if it is missing.
    """
    problem = problem_of(grounds, learner.seed, pretraining, note=note)
    student = problem.student
    assert isinstance(student, RegexStudent)
    keep = lambda path, identity: save_network(path, student.network, grounds.config, grounds.requests, identity)
    return train(problem, learner, folder, keep, minutes=minutes, note=note)


def load_student(path: Path) -> tuple[RegexStudent, RegexConfig]:
    """A student that `learn` kept.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    speller, requests, config = load_network(path, Speller)
    return RegexStudent(speller, requests), config


def _data(config: RegexConfig, path: Path, words: Path | None, templates: Path | None) -> RegexData:
    """The data of a folder, made if it is not there."""
    own = {name: read_text(p) for name, p in (("words", words), ("templates", templates)) if p}
    identity = {**data_of(config), **{k: digest(v) for k, v in own.items()}}
    if path.exists():
        made_of, body = read_finished(path)
        stored = from_plain(_Kept, body, str(path))
        if changed := differences(made_of, identity):
            raise ValueError(f"{path} was made with other settings ({', '.join(changed)}); use another folder")
        return RegexData(stored.words, stored.templates, stored.splits)
    data = make_data(config, read_words(words) if words else (), read_templates(templates) if templates else None)
    templates_of = {part: tuple(t.text for t in many) for part, many in data.templates.items()}
    splits = {part: tuple(items) for part, items in data.splits.items()}
    write_finished(path, identity, json.loads(to_json(_Kept(tuple(data.words), templates_of, splits))))
    return data


@dataclass(frozen=True)
class _Kept:
    """data.json of a study, beside its identity."""

    words: tuple[str, ...]
    templates: Mapping[str, tuple[str, ...]]
    splits: Mapping[str, tuple[WordTask, ...]]


def _digest(data: RegexData) -> str:
    splits: Mapping[str, Sequence[WordTask]] = data.splits
    return digest({part: [dataclasses.astuple(q) for q in items] for part, items in splits.items()})

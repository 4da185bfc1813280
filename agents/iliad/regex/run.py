"""REGEX as its commands run it: settings become data, teacher and student, and these a problem of ILIAD. Before a
student learns, the teacher's executor and describer are trained, and a student on rules alone: by maximum likelihood
on batches drawn by (seed, update)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from embodied.agents.common.session import Note
from embodied.agents.common.tensors import greedy_choice
from embodied.agents.common.vocabulary import Vocabulary
from embodied.agents.common.weights import load_into, load_weights, save_weights
from embodied.agents.iliad.protocol import NOTHING, DescribingTeacher
from embodied.agents.iliad.regex.data import RegexData, WordTask, make_data, rules_without_requests
from embodied.agents.iliad.regex.rules import (
    ChangeDescriber,
    Requests,
    Speller,
    changes,
    characters,
    outputs,
    request_words,
    texts,
)
from embodied.agents.iliad.regex.teacher import GrammarTeacher, LearnedTeacher, RegexMarginal, RegexStudent, RegexWorld
from embodied.agents.iliad.training import IliadProblem, Network, asked, begun, drawn, successes, teach
from embodied.agents.iliad.writing import likelihood_loss
from embodied.agents.learners.iliad import RegexConfig
from embodied.assets.cache import digest
from embodied.evaluation.tables import Samples
from embodied.records import identity_of
from embodied.seeds import stream

REGEX_REMEDY = "delete it and train it again with `embodied train iliad regex`"


@dataclass(frozen=True)
class RegexAbout:
    """Metadata beside the weights in a file."""

    config: RegexConfig
    words: tuple[str, ...]
    """Of requests."""


def new_network(kind: Callable[..., Network], config: RegexConfig, requests: Requests, seed: int, name: str) -> Network:
    """An untrained speller or describer; its weights follow from seed and name."""
    with begun("regex", seed, name):
        return kind(len(requests.vocabulary), config.hidden_size, config.word_size, config.character_size)


def teach_executor(data: RegexData, config: RegexConfig, requests: Requests, folder: Path, *, note: Note) -> Speller:
    """pi_T (3.2.4.3): words and a request to the word that comes out; on the simulation split."""
    network = new_network(Speller, config, requests, config.data_seed, "executor")
    items = data.splits["train"]

    def loss_of(rng: np.random.Generator) -> Tensor:
        chosen = drawn(items, config.teacher_batch, rng)
        places = rng.integers(config.examples, size=len(chosen))
        words = characters([q.words[j] for q, j in zip(chosen, places)])
        wanted = characters([q.outputs[j] for q, j in zip(chosen, places)])
        return likelihood_loss(network(words, requests(asked(chosen, rng)), wanted), wanted)

    judge = lambda: executor_success(network, requests, data.splits["validation"][:256])
    how = _settings(folder, config.executor_iterations, config, requests, config.data_seed)
    return teach(network, "executor", loss_of, judge, note=note, **how)


def teach_describer(
    data: RegexData, config: RegexConfig, requests: Requests, folder: Path, *, note: Note
) -> ChangeDescriber:
    """P~_T(d | e) (3.2.4.1): J words before and after to a request; on the simulation split."""
    network = new_network(ChangeDescriber, config, requests, config.data_seed, "describer")
    items = data.splits["train"]

    def loss_of(rng: np.random.Generator) -> Tensor:
        chosen = drawn(items, config.teacher_batch, rng)
        changed = changes([list(zip(q.words, q.outputs, strict=True)) for q in chosen])
        wanted = requests(asked(chosen, rng))
        return likelihood_loss(network(changed, wanted), wanted)

    how = _settings(folder, config.describer_iterations, config, requests, config.data_seed)
    return teach(network, "describer", loss_of, dict, note=note, **how)


def pretrain_student(
    data: RegexData, config: RegexConfig, requests: Requests, folder: Path, seed: int, *, note: Note
) -> Speller:
    """A student that writes rules, knowing no requests: random ones that change the word (docs/sources.md, S95)."""
    network = new_network(Speller, config, requests, seed, "student")

    def loss_of(rng: np.random.Generator) -> Tensor:
        words, rules = changing_rules(data.words, config.teacher_batch, rng=rng)
        wanted = characters(rules)
        return likelihood_loss(network(characters(words), requests([NOTHING] * len(words)), wanted), wanted)

    how = _settings(folder, config.pretraining_iterations, config, requests, seed)
    return teach(network, "student", loss_of, dict, note=note, **how)


def changing_rules(known: Sequence[str], count: int, *, rng: np.random.Generator) -> tuple[list[str], list[str]]:
    """Random words, and for each a random rule that changes it; both are drawn again until it does."""
    words: list[str] = []
    rules: list[str] = []
    while len(rules) < count:
        for rule in rules_without_requests(known, count - len(rules), rng=rng):
            word = known[int(rng.integers(len(known)))]
            if outputs(rule, [word]) not in (None, (word,)):
                words.append(word)
                rules.append(rule)
    return words, rules


def executor_success(executor: Speller, requests: Requests, items: Sequence[WordTask]) -> dict[str, float]:
    """Share of words that the executor changes as their request says."""
    words = characters([q.words[0] for q in items])
    longest = max(len(q.outputs[0]) for q in items) + 2
    written = texts(executor.write(words, requests([q.requests[0] for q in items]), greedy_choice, longest))
    return {"success": float(np.mean([w == q.outputs[0] for w, q in zip(written, items, strict=True)]))}


def _settings(folder: Path, updates: int, config: RegexConfig, requests: Requests, seed: int) -> dict[str, Any]:
    """How a network is taught, and what it depends on."""
    words = requests.vocabulary.words
    how = {"world": "regex", "folder": folder, "updates": updates, "seed": seed, "config": config}
    return {**how, "about": RegexAbout(config, words), "words": digest(words)}


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

    def judge(self, best: Path, split: str) -> Samples:
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

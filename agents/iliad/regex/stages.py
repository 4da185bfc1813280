"""Training before a student learns: of the teacher's executor and describer, and a student on rules alone.

All three are maximum likelihood on batches drawn by (seed, update).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from embodied.agents.common.choosing import greedy_choice
from embodied.agents.common.session import Note
from embodied.agents.common.weights import seeded
from embodied.agents.iliad.protocol import NOTHING
from embodied.agents.iliad.regex.coding import Requests, changes, characters, texts
from embodied.agents.iliad.regex.config import RegexConfig
from embodied.agents.iliad.regex.data import RegexData, WordTask, rules_without_requests
from embodied.agents.iliad.regex.networks import ChangeDescriber, Speller
from embodied.agents.iliad.regex.rules import outputs
from embodied.agents.iliad.stages import Network, asked, drawn, teach
from embodied.agents.iliad.writing import likelihood_loss
from embodied.assets.cache import digest
from embodied.seeds import stream

REGEX_REMEDY = "delete it and train it again with `embodied train iliad regex`"
_OF_OTHERS = (
    *("teacher", "candidates", "unlabeled"),
    *("executor_iterations", "describer_iterations", "pretraining_iterations"),
)
"""Settings on which what a stage gives does not depend, or that are its own number of updates."""


@dataclass(frozen=True)
class RegexAbout:
    """Metadata beside the weights in a file."""

    config: RegexConfig
    words: tuple[str, ...]
    """Of requests."""


def new_network(kind: Callable[..., Network], config: RegexConfig, requests: Requests, seed: int, name: str) -> Network:
    """An untrained speller or describer; its weights follow from seed and name."""
    with seeded(int(stream(seed, "regex", "begin", name).integers(2**31))):
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
    settings = {k: v for k, v in vars(config).items() if k not in _OF_OTHERS}
    how = {"world": "regex", "folder": folder, "updates": updates, "rate": config.teacher_rate, "seed": seed}
    words = requests.vocabulary.words
    return {**how, "about": RegexAbout(config, words), "settings": settings, "words": digest(words)}

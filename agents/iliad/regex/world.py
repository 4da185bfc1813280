"""REGEX as a problem of ILIAD: what an execution is, what fulfils a request, and a student that writes rules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from embodied.agents.common.choosing import Choice, greedy_choice, sampled_choice
from embodied.agents.iliad.protocol import ExecutionScores, one_request
from embodied.agents.iliad.regex.data import WordTask
from embodied.agents.iliad.regex.networks import PAD, Requests, Speller, characters, texts
from embodied.agents.iliad.regex.rules import LONGEST_BLOCK, edit_distance, outputs


@dataclass(frozen=True)
class Written:
    """An execution: the rule that was written, and what it makes of the task's words."""

    rule: str
    outputs: tuple[str, ...] | None
    """None for a rule that cannot be carried out on one of them, or that nobody has tried."""


class RegexWorld:
    """Requests to change words."""

    request = staticmethod(one_request)

    def success(self, task: WordTask, execution: Written) -> bool:
        """True where the episode's word, the first one, became what it should."""
        return execution.outputs is not None and execution.outputs[0] == task.outputs[0]

    def reward(self, task: WordTask, execution: Written) -> float:
        """(|w| - editdistance(found, w)) / |w| of the episode's word (C.1); 0 where there is no output."""
        if execution.outputs is None:
            return 0.0
        return nearness(execution.outputs[0], task.outputs[0])

    def demonstrate(self, task: WordTask, execution: Written) -> Written:
        """The rule that was meant: its character t is shown in the state after t characters of one's own
        (docs/sources.md, S102)."""
        return Written(task.rule, task.outputs)


def nearness(written: str, wanted: str) -> float:
    """Eq C.1; may be below 0. A wanted word without letters counts as one of one letter."""
    length = max(1, len(wanted))
    return (length - edit_distance(written, wanted)) / length


def carried_out(rule: str, task: WordTask) -> Written:
    """A rule with what it makes of the task's words."""
    return Written(rule, outputs(rule, task.words))


class RegexMarginal:
    """Uniform over a list of rules without requests (C.1.2)."""

    def __init__(self, rules: Sequence[str]) -> None:
        self.rules = tuple(rules)

    def draw(self, tasks: Sequence[WordTask], *, rng: np.random.Generator) -> list[Written]:
        chosen = rng.integers(len(self.rules), size=len(tasks))
        return [carried_out(self.rules[int(i)], task) for i, task in zip(chosen, tasks, strict=True)]


class RegexStudent:
    """A policy over the characters of rules; it learns them with the episode's word alone (docs/sources.md, S97)."""

    def __init__(self, speller: Speller, requests: Requests) -> None:
        self.network, self.requests = speller, requests

    def sample(self, tasks: Sequence[WordTask], requests: Sequence[str], *, rng: np.random.Generator) -> list[Written]:
        return self._write(tasks, requests, sampled_choice(rng.random((len(tasks), LONGEST_BLOCK))))

    def greedy(self, tasks: Sequence[WordTask], requests: Sequence[str]) -> list[Written]:
        return self._write(tasks, requests, greedy_choice)

    def rollout_for_dagger(
        self, tasks: Sequence[WordTask], requests: Sequence[str], *, rng: np.random.Generator
    ) -> list[Written]:
        return self.greedy(tasks, requests)

    def scores(
        self,
        tasks: Sequence[WordTask],
        requests: Sequence[str],
        executions: Sequence[Written],
        actions: Sequence[Written] | None = None,
    ) -> ExecutionScores:
        """Of the characters of rules, at most H, END included; of other rules' characters where `actions` are given."""
        states = characters([e.rule for e in executions])[:, :LONGEST_BLOCK]
        wanted = states if actions is None else characters([e.rule for e in actions])[:, :LONGEST_BLOCK]
        length = min(states.shape[1], wanted.shape[1])
        states, wanted = states[:, :length], wanted[:, :length]
        logits = self.network(*self._inputs(tasks, requests), states)
        return scores_of(logits, wanted, (states != PAD) & (wanted != PAD))

    def _write(self, tasks: Sequence[WordTask], requests: Sequence[str], choose: Choice) -> list[Written]:
        numbers = self.network.write(*self._inputs(tasks, requests), choose, LONGEST_BLOCK)
        return [carried_out(rule, task) for rule, task in zip(texts(numbers), tasks, strict=True)]

    def _inputs(self, tasks: Sequence[WordTask], requests: Sequence[str]) -> tuple[Tensor, Tensor]:
        return characters([t.words[0] for t in tasks]), self.requests(requests)


def scores_of(logits: Tensor, actions: Tensor, mask: Tensor) -> ExecutionScores:
    """Scores of the actions (B, T) under logits (B, T, V)."""
    logs = logits.log_softmax(-1)
    taken = logs.gather(-1, actions[..., None])[..., 0]
    entropies = -(logs.exp() * logs).sum(-1)
    zero = torch.zeros(())
    return ExecutionScores(torch.where(mask, taken, zero), torch.where(mask, entropies, zero), mask)

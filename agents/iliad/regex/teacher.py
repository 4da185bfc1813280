"""REGEX as a problem of ILIAD: what an execution is, what fulfils a request, and a student that writes rules; and who
describes what a rule did: a describer with an executor (3.2.4.1), or the grammar that asks for rules."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from embodied.agents.common.tensors import Choice, greedy_choice, sampled_choice
from embodied.agents.iliad.protocol import NOTHING, DescribingNetworks, ExecutionScores, one_request
from embodied.agents.iliad.regex.data import Grammar, WordTask
from embodied.agents.iliad.regex.rules import (
    LETTERS,
    LONGEST_BLOCK,
    LONGEST_REQUEST,
    PAD,
    REPLACEMENTS,
    SAME,
    ChangeDescriber,
    Requests,
    RuleShape,
    Speller,
    changes,
    characters,
    edit_distance,
    outputs,
    texts,
)
from embodied.agents.learners.iliad import RegexConfig


@dataclass(frozen=True)
class Written:
    """An execution: the rule that was written, and what it makes of the task's words."""

    rule: str
    outputs: tuple[str, ...] | None
    """None for a rule that cannot be carried out on one of them, or that nobody has tried."""


class RegexWorld:
    """Requests to change words."""

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


_OWN_RULE = re.compile(r"\((\^?)\)\(([a-zCV.]{1,2})\)\((\$?)\)@((?:[a-z]|\\2){0,2})")
Case = tuple[WordTask, Written, str]
"""Task, execution, and a description of it."""


def describable(task: WordTask, execution: Written) -> bool:
    """True where the rule can be carried out on all words and changes one: others are not asked about."""
    return execution.outputs is not None and execution.outputs != task.words


def near_optimal(task: WordTask, execution: Written) -> bool:
    """perf >= tau of Eq 3.15: all J words became what they should (C.1.2)."""
    return execution.outputs == task.outputs


class LearnedTeacher(DescribingNetworks):
    """Eq 3.15 and 3.16 with two networks; it sees words before and after, never a rule."""

    longest = LONGEST_REQUEST

    def __init__(self, describer: ChangeDescriber, executor: Speller, requests: Requests, candidates: int) -> None:
        super().__init__(candidates)
        self.describer, self.executor, self.requests = describer.eval(), executor.eval(), requests

    spoken_of = staticmethod(describable)
    near_optimal = staticmethod(near_optimal)

    def candidates_of(
        self, tasks: Sequence[WordTask], executions: Sequence[Written], uniforms: np.ndarray | None = None
    ) -> list[list[str]]:
        changed = changes([list(zip(q.words, e.outputs or (), strict=True)) for q, e in zip(tasks, executions)])
        copies = 1 if uniforms is None else uniforms.shape[1]
        choose = greedy_choice if uniforms is None else sampled_choice(uniforms.reshape(-1, uniforms.shape[2]))
        numbers = self.describer.write(changed, choose, LONGEST_REQUEST, copies)
        texts = self.requests.vocabulary.texts(numbers.tolist())
        several = [texts[k * copies : (k + 1) * copies] for k in range(len(tasks))]
        return [[d for d in dict.fromkeys(many) if d != NOTHING] or [NOTHING] for many in several]

    def fits(self, cases: Sequence[Case]) -> list[bool]:
        """True where the executor, told d, makes all J words what they became.

        The first word that was changed is tried first and the others only where that one fits.
        """
        first = [next((j for j, w in enumerate(q.words) if (e.outputs or ())[j] != w), 0) for q, e, _ in cases]
        changed = lambda i, j: (cases[i][0].words[j], (cases[i][1].outputs or ())[j], cases[i][2])
        fits = self._reproduces([changed(i, j) for i, j in enumerate(first)])
        left = [i for i, fit in enumerate(fits) if fit]
        others = [(i, j) for i in left for j in range(len(cases[i][0].words)) if j != first[i]]
        passed = dict.fromkeys(left, True)
        for (i, _), fit in zip(others, self._reproduces([changed(i, j) for i, j in others])):
            passed[i] &= fit
        return [passed.get(i, False) for i in range(len(cases))]

    def _reproduces(self, cases: Sequence[tuple[str, str, str]]) -> list[bool]:
        """True where the executor, given a word and a description, writes the expected word."""
        if not cases:
            return []
        longest = max(len(expected) for _, expected, _ in cases) + 2
        words, requests = characters([w for w, _, _ in cases]), self.requests([d for _, _, d in cases])
        written = texts(self.executor.write(words, requests, greedy_choice, longest))
        return [a == expected for a, (_, expected, _) in zip(written, cases)]


class GrammarTeacher:
    """Whoever made the requests of the data: it can read rules of our shapes and says what they do.

    A second, consistent teacher (docs/sources.md, S101): P_T(d | e) is P*(d | e).
    """

    def __init__(self, config: RegexConfig) -> None:
        self.grammar = Grammar(config.data_seed)

    def describe(
        self, tasks: Sequence[WordTask], executions: Sequence[Written], *, rng: np.random.Generator
    ) -> list[str | None]:
        return [self._one(q, e, rng=rng) for q, e in zip(tasks, executions, strict=True)]

    def _one(self, task: WordTask, execution: Written, *, rng: np.random.Generator) -> str | None:
        if not describable(task, execution):
            return None
        if near_optimal(task, execution):
            return one_request(task, rng=rng)
        parsed = parse(execution.rule)
        return None if parsed is None else self.grammar.request("train", *parsed, rng=rng)


def parse(rule: str) -> tuple[RuleShape, str, str] | None:
    """Shape and letters of a rule of our own shapes, None for others."""
    match = _OWN_RULE.fullmatch(rule)
    if match is None or (match[1] and match[3]):
        return None
    block, new = match[2], match[4].replace("\\2", SAME)
    kinds = lambda text, keep: "".join("L" if c in LETTERS else c for c in text if c in keep)
    replacement = kinds(new, LETTERS + SAME)
    if replacement not in REPLACEMENTS:
        return None
    shape = RuleShape(match[1] or match[3], kinds(block, LETTERS + "CV."), replacement)
    letters = lambda text: "".join(c for c in text if c in LETTERS)
    return shape, letters(block), letters(new)

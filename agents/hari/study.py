"""Tables 4.7 and 4.8, Figures 4.5 and 4.6 as data; HARI as a learner of the engine; and rules that choose intentions
where nothing has learned to, the upper half of Table 4.7, with all rows of the table for one trained agent."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from embodied.agents.common.session import Note
from embodied.agents.common.weights import weights_digest
from embodied.agents.hari import run
from embodied.agents.hari.networks import INTENTIONS, Executor, HariAgent, load_agent, load_executor
from embodied.agents.hari.policy import ASKS, DO, DONE, Belief, Reader, action_of, available, carry, consider, policy_of
from embodied.agents.learners.hari import ExecutionConfig, IntentionConfig
from embodied.agents.studies.engine import Measured
from embodied.agents.studies.episodes import EpisodeStudy
from embodied.agents.studies.tables import StudyRow, StudyTable, study_tables
from embodied.datasets.store import Dataset, SplitData, dataset_of
from embodied.evaluation.tables import Samples
from embodied.interface import Actions, Agent, Episode, Observations, Rngs
from embodied.records import identity_of, key_of

CUR, GOAL, SUB = ASKS["cur"], ASKS["goal"], ASKS["sub"]
RANDOM, GREEDY = "random + rules", "learned, greedy"


@dataclass(frozen=True, eq=False)
class RuleMoment:
    """The facts that a rule may use."""

    taken: np.ndarray
    """(5,) int64: how often each intention was chosen in this episode."""
    described: bool
    """True if CUR was answered since the last move."""
    would_stop: bool
    """True if stopping is the execution policy's likeliest action."""
    possible: np.ndarray
    """(5,) bool: what the environment allows."""
    budget: np.ndarray
    """(5,) what this episode may take of each, drawn at its beginning."""


class Rule:
    """Chooses intentions; without a budget of its own an episode may take as many as it likes."""

    def budget(self, rng: np.random.Generator) -> np.ndarray:
        """(5,) the most that an episode may take of each intention."""
        return np.full(len(INTENTIONS), np.inf)

    def choose(self, moment: RuleMoment, rng: np.random.Generator) -> int:
        """The next intention, an index into INTENTIONS."""
        raise NotImplementedError


@dataclass(frozen=True)
class AskFirst(Rule):
    """Asks what it always asks, then does, and is done when the execution policy is."""

    goal: bool = False
    """Ask GOAL once, at the beginning."""
    state: bool = False
    """Ask CUR before every move."""
    sub: bool = False
    """Ask SUB whenever possible; not in the dissertation."""

    def choose(self, moment: RuleMoment, rng: np.random.Generator) -> int:
        if self.goal and not moment.taken[GOAL]:
            return GOAL
        if self.state and not moment.described:
            return CUR
        if moment.would_stop:
            return DONE
        return SUB if self.sub and moment.possible[SUB] else DO


@dataclass(frozen=True)
class RandomWithBudgets(Rule):
    """ "Random + rules" of Table 4.7: GOAL first, then at random among what its budgets leave.

    An episode may take at most floor(X_a) + Bernoulli(X_a - floor(X_a)) intentions of kind a, where
    X_a is the learned policy's mean on validation tasks. The execution policy decides when it is done (the heading
    of the table's upper half): where it would stop, DONE is all there is, but no more often than SUB until SUB's
    budget is spent. Where nothing else is left, it is done.
    """

    means: Mapping[str, float]
    """X_a of 'cur', 'goal', 'sub' and 'do'."""

    def budget(self, rng: np.random.Generator) -> np.ndarray:
        budget = super().budget(rng)
        for k, name in enumerate(INTENTIONS[:DONE]):
            whole = np.floor(self.means[name])
            budget[k] = whole + (rng.random() < self.means[name] - whole)
        return budget

    def choose(self, moment: RuleMoment, rng: np.random.Generator) -> int:
        if not moment.taken.any() and moment.possible[GOAL] and moment.budget[GOAL] >= 1:
            return GOAL
        free = moment.possible & (moment.taken < moment.budget)
        subs_spent = moment.taken[SUB] >= moment.budget[SUB]
        if moment.would_stop and (subs_spent or moment.taken[DONE] < moment.taken[SUB]):
            return DONE
        free[DONE] = False
        return int(rng.choice(np.flatnonzero(free))) if free.any() else DONE


RULES: Mapping[str, Rule] = {
    "no assistance": AskFirst(),
    "dense goal": AskFirst(goal=True),
    "dense state": AskFirst(state=True),
    "dense goal and state": AskFirst(goal=True, state=True),
    "SUB whenever possible": AskFirst(sub=True),
}
"""Rows 1 to 4 of Table 4.7, and the strongest rule that we know of."""


@dataclass
class RuleMemory:
    """Memory of a rule's agent in B episodes."""

    belief: Belief
    taken: np.ndarray
    """(B, 5) int64."""
    described: np.ndarray
    """(B,) bool."""
    budgets: np.ndarray
    """(B, 5)."""


@dataclass(eq=False)
class RuleAgent:
    """An execution policy whose intentions follow a rule."""

    executor: Executor
    rule: Rule

    def __post_init__(self) -> None:
        self._reader = Reader(self.executor)

    def act(self, observations: Observations, memory: RuleMemory | None, *, rngs: Rngs) -> tuple[Actions, RuleMemory]:
        """See embodied.interface.Policy."""
        considered, belief = consider(self._reader, observations, memory.belief if memory else None)
        mind = memory or self._begin(belief, rngs)
        actions: Actions = [None] * len(observations)
        taken, described = mind.taken.copy(), mind.described.copy()
        for k, i in enumerate(considered.rows):
            seen = observations[i]
            assert seen is not None  # rows are those that have not ended
            stop = bool(considered.would_stop[k])
            moment = RuleMoment(taken[i].copy(), bool(described[i]), stop, available(seen), mind.budgets[i])
            chosen = self.rule.choose(moment, rngs[i])
            move = considered.move(k) if chosen == DO else None
            actions[i] = action_of(chosen, move)
            taken[i, chosen] += 1
            described[i] = chosen == CUR or (described[i] and chosen != DO)
        return actions, RuleMemory(carry(considered, belief), taken, described, mind.budgets)

    def _begin(self, belief: Belief, rngs: Rngs) -> RuleMemory:
        shape = (len(rngs), len(INTENTIONS))
        budgets = np.stack([self.rule.budget(rng) for rng in rngs])
        return RuleMemory(belief, np.zeros(shape, dtype=np.int64), np.zeros(len(rngs), dtype=bool), budgets)


def policies(agent: HariAgent, means: Mapping[str, float]) -> dict[str, Agent]:
    """The rows of Table 4.7 that one agent gives.

    Args:
      means: X_a of "random + rules": the agent's mean number of each intention on validation tasks.
    """
    return {
        **{name: RuleAgent(agent.executor, rule) for name, rule in RULES.items()},
        RANDOM: RuleAgent(agent.executor, RandomWithBudgets(means)),
        "learned": policy_of(agent),
        GREEDY: policy_of(agent, sample=False),
    }


TIMES = "times"
"""In a row: whether intentions are counted by time."""


@dataclass(frozen=True, kw_only=True)
class HariStudy(EpisodeStudy):
    """Tables 4.7 and 4.8, Figures 4.5 and 4.6."""

    execution: ExecutionConfig
    config: IntentionConfig
    """The policy that all rows begin with."""
    executor: Path | None = None
    """A trained execution policy; None trains one in the study's folder."""
    eval_data: Path | None = None
    """Another data set to judge in: in its unseen houses, and in all its splits if `data` has the same houses and tasks
    to learn from; None: in `data`."""

    name = "hari"

    def tables(self) -> Mapping[str, StudyTable]:
        """The splits out of distribution come beside those of the tests; elsewhere, houses may all be unknown."""
        known = self.judged_in({}).lessons == dataset_of(self.data, "hari").lessons
        ood, tables = self.judged_in({}).ood, {}
        for name, table in study_tables("hari").items():
            splits = [s for s in table.splits if known or s.endswith("_env")]
            splits += ood if table.splits == run.TEST else ()
            tables[name] = dataclasses.replace(table, splits=tuple(splits))
        return tables

    def settings(self, train: Mapping[str, Any], seed: int) -> IntentionConfig:
        return dataclasses.replace(self.config, seed=seed, **train)

    def trained(self, train: Mapping[str, Any], seed: int, folder: Path) -> Mapping[str, Any]:
        walking = self._walking(folder)
        begin = weights_digest(walking) if walking.exists() else None
        data = dataset_of(self.data, "hari").digest
        return identity_of(*self.makers, settings=self.settings(train, seed), data=data, begin=begin)

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Train the execution policy that intention policies use."""
        if self.executor is None:
            run.train_execution(dataset_of(self.data, "hari"), self.execution, self._walking(folder).parent, note=note)

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        executor = load_executor(self._walking(folder))
        run.train_intention(dataset_of(self.data, "hari"), executor, self.settings(train, seed), home, note=note)
        return home / "best.safetensors"

    def load(self, weights: Path) -> HariAgent:
        return load_agent(weights)

    def policies(self, agent: HariAgent, judge: Mapping[str, Any], split: str) -> Agent:
        played, data = judge["played"], dataset_of(self.data, "hari")
        none = dict.fromkeys(INTENTIONS, 0.0)
        means = run.validation_means(data, agent, seed=self.eval_seeds[0]) if played == RANDOM else none
        return policies(agent, means)[played]

    def where(self, agent: HariAgent, judge: Mapping[str, Any], split: str) -> SplitData:
        return self.judged_in(judge).split(split, rules=run.rules_of(agent.config))

    def judged_in(self, judge: Mapping[str, Any]) -> Dataset:
        return dataset_of(self.eval_data or self.data, "hari")

    def about(self) -> str:
        other = self.judged_in({}).digest[:16]
        return super().about() + (f" Judged in the data set {other}." if self.eval_data else "")

    def count(self, episodes: Sequence[Episode], split: SplitData, judge: Mapping[str, Any]) -> Measured:
        if judge.get(TIMES):
            return intentions_by_time(episodes, self.config.horizon)
        return super().count(episodes, split, judge)

    def _walking(self, folder: Path) -> Path:
        """The execution policy that intention policies use."""
        if self.executor is not None:
            return self.executor
        identity = identity_of(settings=self.execution, data=dataset_of(self.data, "hari").digest)
        return folder / f"execution_{key_of(identity)}" / "best.safetensors"


def intentions_by_time(episodes: Sequence[Episode], horizon: int) -> dict[str, Samples]:
    """'cur at 3': the share of the episodes that run at time step 3 that choose CUR; of each intention and step."""
    totals: dict[str, tuple[list[float], list[float]]] = {}
    for episode in episodes:
        chosen = [run.intention_of(s.action) for s in episode.steps[:horizon]]
        for t in range(horizon):
            for name in INTENTIONS:
                some, all_ = totals.setdefault(f"{name} at {t + 1}", ([], []))
                some.append(float(t < len(chosen) and chosen[t] == name))
                all_.append(float(t < len(chosen)))
    houses = tuple(e.task.world for e in episodes)
    return {name: Samples(tuple(some), houses, tuple(all_)) for name, (some, all_) in totals.items()}

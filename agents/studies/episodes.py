"""Studies of agents that play episodes on a data set: what is common to them, so that a learner is a few functions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from embodied.agents.studies.engine import Measured, StudyLearner
from embodied.agents.studies.tables import StudyRow
from embodied.datasets.store import Dataset, SplitData
from embodied.evaluation.evaluate import evaluate, play, spread
from embodied.evaluation.tables import measured
from embodied.interface import Agent, Episode
from embodied.records import Identity, identity_of, save_lines

JUDGES = ("embodied.evaluation.evaluate", "embodied.datasets.store")
"""Modules that decide how every agent is judged."""
evaluate_frozen = torch.inference_mode()(evaluate)
"""As embodied.evaluation.evaluate.evaluate, without gradients."""


@dataclass(frozen=True)
class EpisodeStudy(StudyLearner):
    """A study whose agents play episodes. A learner says `settings`, `train`, `load`, `policies` and its tables."""

    data: Path
    """Data set."""
    repeats: tuple[int, ...]
    tasks: int | None = None
    """Judge on at most so many tasks of a split, from all houses alike."""
    eval_seeds: tuple[int, ...] = (0,)
    """Seeds of what is drawn in judging; the same tasks are judged with each."""
    threads: int = 1

    batch = 32
    """Episodes judged side by side; has no influence on results."""

    @property
    def judges(self) -> tuple[str, ...]:
        return (*JUDGES, *self.makers)

    def settings(self, train: Mapping[str, Any], seed: int) -> object:
        """The settings, a record, with what differs in a row."""
        raise NotImplementedError

    def load(self, weights: Path) -> Any:
        """A trained agent."""
        raise NotImplementedError

    def policies(self, agent: Any, judge: Mapping[str, Any], split: str) -> Agent:
        """Who plays; `agent` is None in rows that do not learn."""
        raise NotImplementedError

    def depends(self, train: Mapping[str, Any]) -> Mapping[str, object]:
        """All that a run depends on besides its settings."""
        return {"data": Dataset(self.data).digest}

    def judged_in(self, judge: Mapping[str, Any]) -> Dataset:
        """The data set in whose houses a row is judged."""
        return Dataset(self.data)

    def where(self, agent: Any, judge: Mapping[str, Any], split: str) -> SplitData:
        """Tasks and environments that a row is judged in."""
        return self.judged_in(judge).split(split)

    def count(self, episodes: Sequence[Episode], split: SplitData, judge: Mapping[str, Any]) -> Measured:
        """Counts of some episodes."""
        return measured(episodes, {name: place.graph for name, place in split.worlds.items()})

    def trained(self, train: Mapping[str, Any], seed: int, folder: Path) -> Identity:
        return identity_of(*self.makers, settings=self.settings(train, seed), **self.depends(train))

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {"data": self.judged_in(row.judge).digest, "tasks": self.tasks, "judging": self.eval_seeds}

    @torch.inference_mode()
    def judge(self, weights: Path | None, row: StudyRow, split: str, seed: int, folder: Path, keep: Path) -> Measured:
        agent = None if weights is None else self.load(weights)
        whole = self.where(agent, row.judge, split)
        tasks, player = spread(whole.tasks, self.tasks), self.policies(agent, row.judge, split)
        all_episodes: list[Episode] = []
        for k in self.eval_seeds:
            episodes = play(whole.make_env, player, tasks, seed=k, batch=self.batch, agent=keep.name)
            save_lines(keep.with_name(f"{keep.name}_{k}.jsonl"), episodes)
            all_episodes += episodes
        return self.count(all_episodes, whole, row.judge)

    def about(self) -> str:
        seeds, data = ", ".join(map(str, self.repeats)), Dataset(self.data)
        tasks = "all" if self.tasks is None else f"at most {self.tasks}"
        return (
            f"Data set {data.digest[:16]}, {len(data.names('train'))} training houses; training seeds {seeds}; {tasks} "
            f"tasks of a split, judged with seeds {', '.join(map(str, self.eval_seeds))}."
        )

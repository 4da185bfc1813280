"""Judging a HARI agent beside rules: the rows of Table 4.7 for one trained agent."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import torch

from agents.hari.agent import HariAgent
from agents.hari.intention import counts_of
from agents.hari.policy import policy_of
from agents.hari.rules import RULES, RandomWithBudgets, RuleAgent
from agents.hari.run import CONDITIONS, rules_of, task_split_of
from embodied.datasets.store import Dataset, SplitData
from embodied.evaluation.evaluate import spread
from embodied.evaluation.rollout import play
from embodied.evaluation.tables import Row, row
from embodied.interface import Agent, Episode

TEST = tuple(f"test_{c}" for c in CONDITIONS)
COLUMNS = ("success", "CUR", "GOAL", "SUB", "DO", "requests", "navigation error")
RANDOM = "random + rules"


@torch.inference_mode()
def policies(agent: HariAgent, means: Mapping[str, float]) -> dict[str, Agent]:
    """The rows of Table 4.7 that one agent gives.

    Args:
      means: X_a of "random + rules": the agent's mean number of each intention on validation tasks.
    """
    return {
        **{name: RuleAgent(agent.executor, rule) for name, rule in RULES.items()},
        RANDOM: RuleAgent(agent.executor, RandomWithBudgets(means)),
        "learned": policy_of(agent),
        "learned, likeliest": policy_of(agent, sample=False),
    }


def validation_means(data: Dataset, agent: HariAgent, *, seed: int, tasks: int) -> dict[str, float]:
    """The agent's mean number of each intention on validation tasks of all three conditions."""
    ground = task_split_of(data, [f"val_{c}" for c in CONDITIONS], agent.config, tasks)
    with torch.inference_mode():
        return counts_of(play(ground.make_env, policy_of(agent), ground.tasks, seed=seed, batch=agent.config.batch))


def judge(
    data: Dataset,
    agent: HariAgent,
    splits: Sequence[str] = TEST,
    *,
    seed: int = 0,
    limit: int | None = None,
    batch: int = 32,
    only: Sequence[str] = (),
    keep: Callable[[str, str, Sequence[Episode]], None] | None = None,
    watch: Callable[[Iterable[str]], Iterable[str]] = iter,
    instead: Callable[[SplitData], SplitData] = lambda split: split,
) -> list[Row]:
    """One row per policy and split, over the same tasks, in the environment that the agent was trained for.

    Args:
      limit: at most so many tasks per split, from all houses alike.
      only: names of rows; none for all.
      keep: is given split, name and episodes (to save them).
      instead: gives a split another assistant.

    Raises:
      ValueError: an unknown row.
    """
    judged = policies(agent, validation_means(data, agent, seed=seed, tasks=agent.config.validation_tasks))
    if unknown := sorted(set(only) - set(judged)):
        raise ValueError(f"unknown rows {unknown}; there are {list(judged)}")
    rows = []
    for split in splits:
        whole = instead(data.split(split, hari=rules_of(agent.config)))
        tasks = spread(whole.tasks, limit)
        graphs = {n: p.graph for n, p in whole.worlds.items()}
        for name in watch(only or list(judged)):
            with torch.inference_mode():
                episodes = play(whole.make_env, judged[name], tasks, seed=seed, batch=batch, agent=name)
            rows.append(row(name, split, episodes, graphs, seed=seed))
            if keep:
                keep(split, name, episodes)
    return rows

"""Judging a HARI agent beside rules: the rows of Table 4.7 for one trained agent."""

from __future__ import annotations

from collections.abc import Mapping

import torch

from embodied.agents.hari.agent import HariAgent
from embodied.agents.hari.intention import counts_of
from embodied.agents.hari.policy import policy_of
from embodied.agents.hari.rules import RULES, RandomWithBudgets, RuleAgent
from embodied.agents.hari.run import CONDITIONS, task_split_of
from embodied.datasets.store import Dataset
from embodied.evaluation.rollout import play
from embodied.interface import Agent

TEST = tuple(f"test_{c}" for c in CONDITIONS)
RANDOM = "random + rules"
GREEDY = "learned, greedy"


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
        GREEDY: policy_of(agent, sample=False),
    }


def validation_means(data: Dataset, agent: HariAgent, *, seed: int, tasks: int) -> dict[str, float]:
    """The agent's mean number of each intention on validation tasks of all three conditions."""
    ground = task_split_of(data, [f"val_{c}" for c in CONDITIONS], agent.config, tasks)
    with torch.inference_mode():
        return counts_of(play(ground.make_env, policy_of(agent), ground.tasks, seed=seed, batch=agent.config.batch))

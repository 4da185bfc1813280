"""Training of the intention policy: advantage actor-critic on shaped costs (4.3.4, E.1, E.2).

for update in ...:
    play a batch of training tasks with draws from psi
    costs -> shaped costs (4.20) -> what was still to come at each step, C_t
    critic: descend on (V - C)^2 / 2            (E.2)
    actor:  ascend on (V - C) log psi           (E.1), once the critic has had its own updates
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack

import torch
from torch import Tensor

from embodied.agents.common.checkpoint import Stateful
from embodied.agents.common.losses import Decisions, actor_loss, costs_to_go, critic_loss
from embodied.agents.common.playing import TaskSet
from embodied.agents.common.session import Options, Progress, Session, descend, episode_seed, run, tasks_of_update
from embodied.agents.hari.agent import HariAgent, save
from embodied.agents.hari.networks import INTENTIONS, RecurrentHead
from embodied.agents.hari.policy import Choice, policy_of
from embodied.envs.hari import shaped_costs
from embodied.evaluation.evaluate import play
from embodied.interface import Action, Ask, Episode, Move, Place
from embodied.kinds import metrics
from embodied.records import Identity

MAY_CHANGE = ("iterations", "checkpoint_minutes", "validate_every", "validation_tasks")


def train(
    agent: HariAgent,
    critic: RecurrentHead,
    training: TaskSet,
    validation: TaskSet,
    folder: Path,
    identity: Identity,
    **options: Unpack[Options],
) -> Progress:
    """Train `agent.actor` and `critic` in place (see embodied.agents.common.session.run).

    Writes best.safetensors (least validation cost) and what embodied.agents.common.session writes.
    """
    config = agent.config
    agent.executor.network.eval()
    learning = IntentionRun(agent, critic)

    def validate(session: Session) -> Sequence[Episode]:
        tasks = validation.tasks[: config.validation_tasks]
        with torch.inference_mode():
            episodes = play(validation.make_env, policy_of(agent), tasks, seed=config.seed, batch=config.batch)
        cost = math.fsum(s.cost for e in episodes for s in e.steps) / len(episodes)
        session.record({"episodes": len(episodes), "cost": cost, **numbers_of(episodes, validation.worlds)})
        if session.improved(-cost):  # what is optimised: the mean cost, task errors included
            save(agent, session.folder / "best.safetensors", identity)
        return episodes

    step = lambda update: train_step(learning, training, update)
    how: dict[str, Any] = {"total": config.updates, "may_change": MAY_CHANGE}
    return run(folder, identity, learning.parts, config, step, validate, **how, **options)


class IntentionRun:
    """Owns what changes in a run: the two heads and their optimizers."""

    def __init__(self, agent: HariAgent, critic: RecurrentHead) -> None:
        self.agent, self.critic = agent, critic
        self.policy = policy_of(agent)
        rate = agent.config.learning_rate
        self.actor_optimizer = torch.optim.Adam(agent.actor.parameters(), rate)
        self.critic_optimizer = torch.optim.Adam(critic.parameters(), rate)

    @property
    def parts(self) -> dict[str, Stateful]:
        """The content of its checkpoints."""
        heads = {"actor": self.agent.actor, "critic": self.critic}
        return {**heads, "actor optimizer": self.actor_optimizer, "critic optimizer": self.critic_optimizer}


def train_step(run: IntentionRun, ground: TaskSet, update: int) -> dict[str, float]:
    """One update: of the critic alone among the first `critic_iterations`, else of both; returns numbers to report."""
    config = run.agent.config
    tasks = tasks_of_update(ground.tasks, update, config.batch, config.seed)
    tasks = [dataclasses.replace(t, id=f"{t.id}#{k}") for k, t in enumerate(tasks)]
    choices: list[Choice] = []
    run.policy.choices = choices
    episodes = play(ground.make_env, run.policy, tasks, seed=episode_seed(config.seed, update), batch=len(tasks))
    costs, mask = padded([shaped_costs(e, ground.worlds[e.task.world].graph.hops) for e in episodes])
    log_p, entropy = chosen(choices, len(tasks))
    decisions = Decisions(log_p, -values(run.critic, choices, len(tasks)), -costs_to_go(costs, mask), mask)
    descend(critic_loss(decisions), run.critic_optimizer, f"update {update}, critic", config.clip)
    if update >= config.critic_iterations:
        bonus = config.entropy * (entropy * mask).sum() / len(tasks)
        descend(actor_loss(decisions) - bonus, run.actor_optimizer, f"update {update}, actor", config.clip)
    return numbers_of(episodes, ground.worlds) | {
        "cost": float((costs * mask).sum() / len(tasks)),
        "critic": float(critic_loss(decisions).detach()),
        "entropy": float((entropy.detach() * mask).sum() / mask.sum()),
    }


def padded(rows: Sequence[Sequence[float]]) -> tuple[Tensor, Tensor]:
    """(B, T) float32 of rows of unequal length, zero behind their ends, and (B, T) bool: where there is something."""
    out = torch.zeros(len(rows), max(map(len, rows)))
    mask = torch.zeros(out.shape, dtype=torch.bool)
    for i, r in enumerate(rows):
        out[i, : len(r)], mask[i, : len(r)] = torch.tensor(r), True
    return out, mask


def chosen(choices: Sequence[Choice], batch: int) -> tuple[Tensor, Tensor]:
    """(B, T) log psi of the intentions that were chosen, and (B, T) entropies; zero behind the ends."""
    log_p, entropy = [], []
    for c in choices:
        log = c.logits.log_softmax(-1)
        log_p.append(_spread(log.gather(1, c.intentions[:, None])[:, 0], c.rows, batch))
        finite = log.masked_fill(torch.isinf(log), 0.0)
        entropy.append(_spread(-(finite * log.exp()).sum(-1), c.rows, batch))
    return torch.stack(log_p, 1), torch.stack(entropy, 1)


def values(critic: RecurrentHead, choices: Sequence[Choice], batch: int) -> Tensor:
    """(B, T) V of the costs to come at each step, by the critic's own memory; zero behind the ends."""
    memory, out = critic.begin(batch), []
    for c in choices:
        before = (memory[0][c.rows], memory[1][c.rows])
        value, after = critic(c.belief, c.shown, c.last, c.depth, before)
        index = torch.tensor(c.rows)
        memory = (memory[0].index_put((index,), after[0]), memory[1].index_put((index,), after[1]))
        out.append(_spread(value[:, 0], c.rows, batch))
    return torch.stack(out, 1)


def _spread(numbers: Tensor, rows: list[int], batch: int) -> Tensor:
    """(b,) numbers of some rows as (B,), zero elsewhere."""
    return numbers.new_zeros(batch).index_put((torch.tensor(rows),), numbers)


def counts_of(episodes: Sequence[Episode]) -> dict[str, float]:
    """Mean number of each intention per episode; DONE on sub-goals counts as 'done'."""
    chosen = Counter(intention_of(s.action) for e in episodes for s in e.steps)
    return {name: chosen[name] / len(episodes) for name in INTENTIONS}


def intention_of(action: Action) -> str:
    """One of INTENTIONS."""
    if isinstance(action, Ask):
        return action.intention.value
    return "do" if isinstance(action, Move) else "done"


def numbers_of(episodes: Sequence[Episode], places: Mapping[str, Place]) -> dict[str, float]:
    """Success and the mean number of each intention."""
    success = sum(metrics.success(e, places[e.task.world].graph) for e in episodes) / len(episodes)
    return {"success": success, **counts_of(episodes)}

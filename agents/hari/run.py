"""The steps of HARI's commands: a data set becomes training data and task sets, and these agents.

The intention policy is trained by advantage actor-critic on shaped costs (4.3.4, E.1, E.2):

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
from typing import Unpack

import torch
from torch import Tensor

from embodied.agents.common.session import Options, Progress, Session, descend, episode_seed, run, tasks_of_update
from embodied.agents.common.tensors import Decisions, actor_loss, costs_to_go, critic_loss, side_by_side
from embodied.agents.common.weights import Stateful, checksum_of, load_into, weights_digest
from embodied.agents.hari import networks
from embodied.agents.hari.policy import Choice, policy_of
from embodied.agents.hari.pretraining import PretrainingData, pretrain
from embodied.agents.hari.words import feature_words
from embodied.agents.learners.hari import ExecutionConfig, IntentionConfig
from embodied.assistants.descriptions import Describer, frequent_classes
from embodied.datasets.store import Dataset, TaskSet
from embodied.envs.base import HelpEnv
from embodied.envs.hari import Costs, HariRules, shaped_costs
from embodied.evaluation.evaluate import play, spread
from embodied.interface import Action, Ask, Episode, Move, Place
from embodied.kinds import metrics
from embodied.records import Identity, identity_of


def train(
    agent: networks.HariAgent,
    critic: networks.RecurrentHead,
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
            networks.save(agent, session.folder / "best.safetensors", identity)
        return episodes

    step = lambda update: train_step(learning, training, update)
    whole = dataclasses.replace(config, iterations=config.updates)
    return run(folder, identity, learning.parts, whole, step, validate, **options)


class IntentionRun:
    """Owns what changes in a run: the two heads and their optimizers."""

    def __init__(self, agent: networks.HariAgent, critic: networks.RecurrentHead) -> None:
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
    shaped = [torch.tensor(shaped_costs(e, ground.worlds[e.task.world].graph.hops)) for e in episodes]
    costs, mask = side_by_side(shaped)  # (B, T)
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


def chosen(choices: Sequence[Choice], batch: int) -> tuple[Tensor, Tensor]:
    """(B, T) log psi of the intentions that were chosen, and (B, T) entropies; zero behind the ends."""
    log_p, entropy = [], []
    for c in choices:
        log = c.logits.log_softmax(-1)
        log_p.append(_spread(log.gather(1, c.intentions[:, None])[:, 0], c.rows, batch))
        finite = log.masked_fill(torch.isinf(log), 0.0)
        entropy.append(_spread(-(finite * log.exp()).sum(-1), c.rows, batch))
    return torch.stack(log_p, 1), torch.stack(entropy, 1)


def values(critic: networks.RecurrentHead, choices: Sequence[Choice], batch: int) -> Tensor:
    """(B, T) V of the costs to come at each step, by the critic's own memory; zero behind the ends."""
    memory, out = critic.begin(batch), []
    for c in choices:
        value, after = critic(c.belief, c.shown, c.last, c.depth, memory[:, c.rows])
        memory = memory.index_copy(1, torch.tensor(c.rows), after)
        out.append(_spread(value[:, 0], c.rows, batch))
    return torch.stack(out, 1)


def _spread(numbers: Tensor, rows: list[int], batch: int) -> Tensor:
    """(b,) numbers of some rows as (B,), zero elsewhere."""
    return numbers.new_zeros(batch).index_put((torch.tensor(rows),), numbers)


def counts_of(episodes: Sequence[Episode]) -> dict[str, float]:
    """Mean number of each intention per episode; DONE on sub-goals counts as 'done'."""
    chosen = Counter(intention_of(s.action) for e in episodes for s in e.steps)
    return {name: chosen[name] / len(episodes) for name in networks.INTENTIONS}


def intention_of(action: Action) -> str:
    """One of INTENTIONS."""
    if isinstance(action, Ask):
        return action.intention.value
    return "do" if isinstance(action, Move) else "done"


def numbers_of(episodes: Sequence[Episode], places: Mapping[str, Place]) -> dict[str, float]:
    """Success and the mean number of each intention."""
    success = sum(metrics.success(e, places[e.task.world].graph) for e in episodes) / len(episodes)
    return {"success": success, **counts_of(episodes)}


CONDITIONS = ("unseen_start", "unseen_object", "unseen_env")
"""Names of validation and test splits, after 'val_' and 'test_' (4.3.5)."""
VALIDATION_CONDITIONS, TEST = (tuple(f"{part}_{c}" for c in CONDITIONS) for part in ("val", "test"))


def rules_of(config: IntentionConfig) -> HariRules:
    """The environment that an intention policy is trained for."""
    costs = Costs.alike(config.cost)
    return HariRules(
        costs, config.stack, config.longest, config.cooperative, horizon=config.horizon, kept=config.keep_fraction
    )


def task_split_of(data: Dataset, splits: Sequence[str], config: IntentionConfig, limit: int | None = None) -> TaskSet:
    """Some splits as one place to learn or to be validated in; at most `limit` tasks, from all splits alike."""
    parts = [data.split(s, rules=rules_of(config)) for s in splits]
    each = None if limit is None else -(-limit // len(splits))
    tasks = [t for part in parts for t in spread(part.tasks, each)]
    places: Mapping[str, Place] = {name: place for part in parts for name, place in part.worlds.items()}

    def make_env() -> HelpEnv:
        env = parts[0].make_env()
        env.worlds = places
        return env

    return TaskSet(places, tasks, make_env)


def validation_means(data: Dataset, agent: networks.HariAgent, *, seed: int) -> dict[str, float]:
    """The agent's mean number of each intention on validation tasks of all three conditions."""
    ground = task_split_of(data, VALIDATION_CONDITIONS, agent.config, agent.config.validation_tasks)
    with torch.inference_mode():
        return counts_of(play(ground.make_env, policy_of(agent), ground.tasks, seed=seed, batch=agent.config.batch))


def train_execution(
    data: Dataset, config: ExecutionConfig, folder: Path, *, init_from: Path | None = None, **options: Unpack[Options]
) -> Progress:
    """Train, or go on training, the execution policy of a run folder.

    Args:
      init_from: with the words and weights of this execution policy, not with random ones.
    """
    where: dict[str, Place] = {**data.places("pretrain"), **data.places("pretrain_val")}
    validation = spread(data.tasks("pretrain_val"), None)
    describer = Describer(frequent_classes(data.places("train").values(), config.keep_fraction))
    source = PretrainingData(where, describer, data.tasks("pretrain"), validation)
    houses = {t.world for t in source.training}
    places = [source.places[name] for name in sorted(houses)]
    words = feature_words(describer.dense(place, v) for place in places for v in range(len(place.graph.ids)))
    other = None if init_from is None else networks.load_executor(init_from)
    executor = networks.new_executor(config, other.words if other else words)
    if other is not None and init_from is not None:
        load_into(executor.network, other.network.state_dict(), init_from)
    size = sum(p.numel() for p in executor.network.parameters())
    note = options.get("note", print)
    note(f"{len(source.training)} tasks in {len(houses)} houses, {len(executor.words)} names, {size:,} parameters")
    more = {} if init_from is None else {"begin": weights_digest(init_from)}
    identity = identity_of("embodied.agents.hari.run", settings=config, data=data.digest, **more)
    return pretrain(executor, source, folder, identity, **options)


def train_intention(
    data: Dataset, executor: networks.Executor, config: IntentionConfig, folder: Path, **options: Unpack[Options]
) -> Progress:
    """Train, or go on training, the intention policy of a run folder over a trained execution policy."""
    actor, critic = networks.new_heads(config, executor.config.hidden_size)
    training = task_split_of(data, ["train"], config)
    validation = task_split_of(data, VALIDATION_CONDITIONS, config, config.validation_tasks)
    size = sum(p.numel() for p in actor.parameters())
    note = options.get("note", print)
    note(f"{len(training.tasks)} tasks in {len(training.worlds)} houses, {size:,} parameters of each head")
    begin = checksum_of(executor.network.state_dict(), {})
    identity = identity_of("embodied.agents.hari.run", settings=config, data=data.digest, begin=begin)
    return train(networks.HariAgent(executor, actor, config), critic, training, validation, folder, identity, **options)

"""The steps of HARI's commands: a data set becomes training data and task sets, and these agents."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Unpack

import torch

from embodied.agents.common.playing import TaskSet
from embodied.agents.common.session import Options, Progress
from embodied.agents.common.tensor_file import checksum_of, load_into
from embodied.agents.common.weights import weights_digest
from embodied.agents.hari.agent import Executor, HariAgent, load_executor, new_executor, new_heads
from embodied.agents.hari.config import ExecutionConfig, IntentionConfig
from embodied.agents.hari.intention import counts_of, train
from embodied.agents.hari.policy import policy_of
from embodied.agents.hari.pretraining import PretrainingData, pretrain
from embodied.agents.hari.words import feature_words
from embodied.assistants.descriptions import Describer, frequent_classes
from embodied.datasets.store import Dataset
from embodied.envs.base import HelpEnv
from embodied.envs.hari import Costs, HariRules
from embodied.evaluation.evaluate import play, spread
from embodied.interface import Place
from embodied.records import identity_of

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


def validation_means(data: Dataset, agent: HariAgent, *, seed: int) -> dict[str, float]:
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
    other = None if init_from is None else load_executor(init_from)
    executor = new_executor(config, other.words if other else words)
    if other is not None and init_from is not None:
        load_into(executor.network, other.network.state_dict(), init_from)
    size = sum(p.numel() for p in executor.network.parameters())
    note = options.get("note", print)
    note(f"{len(source.training)} tasks in {len(houses)} houses, {len(executor.words)} names, {size:,} parameters")
    more = {} if init_from is None else {"begin": weights_digest(init_from)}
    identity = identity_of("embodied.agents.hari.run", settings=config, data=data.digest, **more)
    return pretrain(executor, source, folder, identity, **options)


def train_intention(
    data: Dataset, executor: Executor, config: IntentionConfig, folder: Path, **options: Unpack[Options]
) -> Progress:
    """Train, or go on training, the intention policy of a run folder over a trained execution policy."""
    actor, critic = new_heads(config, executor.config.hidden_size)
    training = task_split_of(data, ["train"], config)
    validation = task_split_of(data, VALIDATION_CONDITIONS, config, config.validation_tasks)
    size = sum(p.numel() for p in actor.parameters())
    note = options.get("note", print)
    note(f"{len(training.tasks)} tasks in {len(training.worlds)} houses, {size:,} parameters of each head")
    begin = checksum_of(executor.network.state_dict(), {})
    identity = identity_of("embodied.agents.hari.run", settings=config, data=data.digest, begin=begin)
    return train(HariAgent(executor, actor, config), critic, training, validation, folder, identity, **options)

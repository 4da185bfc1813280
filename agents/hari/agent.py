"""HARI's agents on disk: the execution policy alone, or with the intention policy that learned to use it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import nn

from agents.common.tensor_file import put
from agents.common.weights import load_weights, save_weights
from agents.hari.config import ExecutionConfig, IntentionConfig
from agents.hari.networks import INTENTIONS, ExecutionNetwork, RecurrentHead
from agents.hari.sight import FeatureSpec
from agents.hari.words import FeatureWords
from embodied.identity import Identity
from embodied.interface import FeatureSource, Sight

REMEDY = "train it again with `embodied train hari`"


@dataclass(frozen=True)
class HariAbout:
    """What stands beside the weights in a file."""

    names: tuple[str, ...]
    """The words that the policies know."""

    execution: ExecutionConfig
    intention: IntentionConfig | None = None
    """None for an execution policy alone."""
    sight: FeatureSpec | None = None
    """None for an execution policy that reads words alone."""


@dataclass(frozen=True, eq=False)
class Executor:
    """A trained execution policy with the words it knows."""

    network: ExecutionNetwork
    words: FeatureWords
    config: ExecutionConfig
    seeing: FeatureSpec | None = None
    """Whose features it learned from; None: it reads words alone."""
    eyes: FeatureSource | None = None
    """Where the features come from; not part of its file."""

    def look(self, sights: Sequence[Sight]) -> list[np.ndarray] | list[None]:
        """(36, D) float32 of each sight; None of each where it does not see.

        Raises:
          ValueError: it sees, and nobody gave it eyes.
        """
        if self.seeing is None:
            return [None] * len(sights)
        if self.eyes is None:
            raise ValueError("this execution policy sees; give it its houses' features (agents.hari.run.with_eyes)")
        return [self.eyes.features(s) for s in sights]


@dataclass(frozen=True, eq=False)
class HariAgent:
    """An execution policy and the intention policy that was trained on it."""

    executor: Executor
    actor: RecurrentHead
    config: IntentionConfig


def new_executor(
    config: ExecutionConfig, words: FeatureWords, seeing: FeatureSpec | None = None, eyes: FeatureSource | None = None
) -> Executor:
    """Random weights that follow from the seed; of a policy that sees where `seeing` says whose features."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        network = ExecutionNetwork(config, len(words), seeing.size if seeing else 0)
        return Executor(network, words, config, seeing, eyes)


def new_heads(config: IntentionConfig, belief: int) -> tuple[RecurrentHead, RecurrentHead]:
    """Actor psi and critic V with random weights that follow from the seed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        actor = RecurrentHead(belief, config.hidden_size, len(INTENTIONS), knows_stack=config.knows_stack)
        return actor, RecurrentHead(belief, config.hidden_size, 1, knows_stack=config.knows_stack)


def begun_with(executor: Executor, other: Executor) -> Executor:
    """`executor` with the words and weights of another; one that reads alone may so be taught to see.

    Raises:
      ValueError: the other has other sizes, or sees what this one does not.
    """
    new = new_executor(executor.config, other.words, executor.seeing, executor.eyes)
    try:
        lost = new.network.load_state_dict(other.network.state_dict(), strict=False)
    except RuntimeError as e:
        raise ValueError(f"an execution policy of other sizes cannot be begun with ({e})") from e
    if lost.unexpected_keys or any(not k.startswith("sight.") for k in lost.missing_keys):
        raise ValueError(f"cannot begin with a policy that has {lost.unexpected_keys} and lacks {lost.missing_keys}")
    return new


def save_executor(executor: Executor, path: Path, identity: Identity | None = None) -> None:
    """Write an execution policy and what it was trained with, atomically."""
    about = HariAbout(executor.words.names, executor.config, sight=executor.seeing)
    save_weights(path, "hari", _named("execution", executor.network), about, identity)


def save_agent(agent: HariAgent, path: Path, identity: Identity | None = None) -> None:
    """Write an agent with its execution policy and what it was trained with, atomically."""
    executor = agent.executor
    about = HariAbout(executor.words.names, executor.config, agent.config, executor.seeing)
    tensors = _named("execution", executor.network) | _named("actor", agent.actor)
    save_weights(path, "hari", tensors, about, identity)


def load_executor(path: Path) -> Executor:
    """The execution policy of a file of `save_executor` or `save_agent`.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    tensors, told = load_weights(path, "hari", HariAbout, REMEDY)
    executor = new_executor(told.execution, FeatureWords(told.names), told.sight)
    put(executor.network, _of("execution", tensors), path)
    executor.network.eval()
    return executor


def load_agent(path: Path) -> HariAgent:
    """What `save_agent` wrote.

    Raises:
      FileNotFoundError, ValueError: missing, damaged, of another format, or an execution policy alone.
    """
    tensors, told = load_weights(path, "hari", HariAbout, REMEDY)
    config = told.intention
    if config is None:
        raise ValueError(
            f"{path} holds an execution policy alone; teach it to ask: "
            f"`embodied train hari intention --execution {path}`"
        )
    executor = load_executor(path)
    actor, _ = new_heads(config, executor.config.hidden_size)
    put(actor, _of("actor", tensors), path)
    actor.eval()
    return HariAgent(executor, actor, config)


def _named(name: str, module: nn.Module) -> dict[str, torch.Tensor]:
    return {f"{name}.{k}": v for k, v in module.state_dict().items()}


def _of(name: str, tensors: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    return {k.removeprefix(f"{name}."): v for k, v in tensors.items() if k.startswith(f"{name}.")}

"""HARI's agents on disk: the execution policy alone, or with the intention policy that learned to use it."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import nn

from agents.common.tensor_file import load_tensors, save_tensors
from agents.hari.config import ExecutionConfig, IntentionConfig, as_dict
from agents.hari.networks import INTENTIONS, ExecutionNetwork, RecurrentHead
from agents.hari.sight import Seeing
from agents.hari.words import FeatureWords
from embodied.interface import FeatureSource, Sight
from embodied.records import from_plain, parse

FORMAT, OLD_FORMAT = "embodied-hari-2", "embodied-hari-1"
"""The older one has no checksum."""


@dataclass(frozen=True)
class Configs:
    """Settings of the policies in a file."""

    execution: ExecutionConfig
    intention: IntentionConfig | None = None
    """None for an execution policy alone."""
    sight: Seeing | None = None
    """None for an execution policy that reads words alone."""


@dataclass(frozen=True)
class HariSettings:
    """What stands beside the weights in a file."""

    settings: Configs
    names: tuple[str, ...]
    """The words that the policies know."""


@dataclass(frozen=True)
class _About:
    """The same as the file holds it: JSON as text."""

    format: str
    settings: str
    names: str


@dataclass(frozen=True, eq=False)
class Executor:
    """A trained execution policy with the words it knows."""

    network: ExecutionNetwork
    words: FeatureWords
    config: ExecutionConfig
    seeing: Seeing | None = None
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
    config: ExecutionConfig, words: FeatureWords, seeing: Seeing | None = None, eyes: FeatureSource | None = None
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


def save_executor(executor: Executor, path: Path) -> None:
    """Write an execution policy, atomically."""
    _save({"execution": executor.network}, _settings_of(executor), executor.words, path)


def save_agent(agent: HariAgent, path: Path) -> None:
    """Write an agent with its execution policy, atomically."""
    settings = _settings_of(agent.executor) | {"intention": as_dict(agent.config)}
    _save({"execution": agent.executor.network, "actor": agent.actor}, settings, agent.executor.words, path)


def load_executor(path: Path) -> Executor:
    """The execution policy of a file of `save_executor` or `save_agent`.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    tensors, told = _load(Path(path))
    executor = new_executor(told.settings.execution, FeatureWords(told.names), told.settings.sight)
    _fill(executor.network, tensors, "execution", path)
    executor.network.eval()
    return executor


def load_agent(path: Path) -> HariAgent:
    """What `save_agent` wrote.

    Raises:
      FileNotFoundError, ValueError: missing, damaged, of another format, or an execution policy alone.
    """
    tensors, told = _load(Path(path))
    config = told.settings.intention
    if config is None:
        raise ValueError(
            f"{path} holds an execution policy alone; teach it to ask: "
            f"`embodied train hari intention --execution {path}`"
        )
    executor = load_executor(path)
    actor, _ = new_heads(config, executor.config.hidden_size)
    _fill(actor, tensors, "actor", path)
    actor.eval()
    return HariAgent(executor, actor, config)


def _settings_of(executor: Executor) -> dict[str, dict[str, object]]:
    seeing = executor.seeing
    return {"execution": as_dict(executor.config)} | ({"sight": dataclasses.asdict(seeing)} if seeing else {})


def _save(
    modules: dict[str, nn.Module], settings: dict[str, dict[str, object]], words: FeatureWords, path: Path
) -> None:
    about = {"format": FORMAT, "settings": json.dumps(settings), "names": json.dumps(words.names)}
    tensors = {f"{n}.{k}": v for n, m in modules.items() for k, v in m.state_dict().items()}
    save_tensors(Path(path), tensors, about)


def _load(path: Path) -> tuple[dict[str, torch.Tensor], HariSettings]:
    tensors, about = load_tensors(path, (FORMAT, OLD_FORMAT), "train it again with `embodied train hari`")
    told = from_plain(_About, about, str(path))
    body = {"names": parse(told.names, "a list of names"), "settings": parse(told.settings, "settings")}
    return tensors, from_plain(HariSettings, body, str(path))


def _fill(module: nn.Module, tensors: dict[str, torch.Tensor], name: str, path: Path) -> None:
    mine = {k.removeprefix(f"{name}."): v for k, v in tensors.items() if k.startswith(f"{name}.")}
    try:
        module.load_state_dict(mine)
    except RuntimeError as e:
        raise ValueError(f"{path}: its weights are not those of its settings ({e}); train it again") from e

"""HARI's agents on disk: the execution policy alone, or with the intention policy that learned to use it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import nn

from embodied.agents.common.weights import load_into, load_weights, save_weights, seeded
from embodied.agents.hari.config import ExecutionConfig, IntentionConfig
from embodied.agents.hari.networks import INTENTIONS, ExecutionNetwork, RecurrentHead
from embodied.agents.hari.words import FeatureWords
from embodied.records import Identity

HARI_REMEDY = "train it again with `embodied train hari`"
OLDER_NAMES = {".before.": ".norm1.", ".between.": ".norm2.", ".widen.": ".linear1.", ".narrow.": ".linear2."}
OLDER_NAMES |= {".query.": ".self_attn.in_proj_", ".merge.": ".self_attn.out_proj."}
"""Of a Transformer's modules, and those of torch.nn.TransformerEncoderLayer."""


@dataclass(frozen=True)
class HariAbout:
    """Metadata beside the weights in a file."""

    names: tuple[str, ...]
    """The words that the policies know."""

    execution: ExecutionConfig
    intention: IntentionConfig | None = None
    """None for an execution policy alone."""


@dataclass(frozen=True, eq=False)
class Executor:
    """A trained execution policy with the words it knows."""

    network: ExecutionNetwork
    words: FeatureWords
    config: ExecutionConfig


@dataclass(frozen=True, eq=False)
class HariAgent:
    """An execution policy and the intention policy that was trained on it."""

    executor: Executor
    actor: RecurrentHead
    config: IntentionConfig


def new_executor(config: ExecutionConfig, words: FeatureWords) -> Executor:
    """Random weights that follow from the seed."""
    with seeded(config.seed):
        return Executor(ExecutionNetwork(config, len(words)), words, config)


def new_heads(config: IntentionConfig, belief: int) -> tuple[RecurrentHead, RecurrentHead]:
    """Actor psi and critic V with random weights that follow from the seed."""
    with seeded(config.seed):
        actor = RecurrentHead(belief, config.hidden_size, len(INTENTIONS), knows_stack=config.knows_stack)
        return actor, RecurrentHead(belief, config.hidden_size, 1, knows_stack=config.knows_stack)


def save(made: Executor | HariAgent, path: Path, identity: Identity | None = None) -> None:
    """Write an execution policy, or an agent with its own, and what it was trained with, atomically."""
    agent = made if isinstance(made, HariAgent) else None
    executor = made.executor if isinstance(made, HariAgent) else made
    parts = nn.ModuleDict({"execution": executor.network} | ({"actor": agent.actor} if agent else {}))
    about = HariAbout(executor.words.names, executor.config, agent.config if agent else None)
    save_weights(path, "hari", parts.state_dict(), about, identity)


def load_executor(path: Path) -> Executor:
    """The execution policy of a file of `save`.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    tensors, about = load_weights(path, "hari", HariAbout, HARI_REMEDY)
    executor = new_executor(about.execution, FeatureWords(about.names))
    load_into(executor.network, _of("execution", tensors), path)
    executor.network.eval()
    return executor


def load_agent(path: Path) -> HariAgent:
    """Load an agent that `save` wrote.

    Raises:
      FileNotFoundError, ValueError: missing, damaged, of another format, or an execution policy alone.
    """
    tensors, about = load_weights(path, "hari", HariAbout, HARI_REMEDY)
    config = about.intention
    if config is None:
        raise ValueError(
            f"{path} holds an execution policy alone; teach it to ask: "
            f"`embodied train hari intention --execution {path}`"
        )
    executor = load_executor(path)
    actor, _ = new_heads(config, executor.config.hidden_size)
    load_into(actor, _of("actor", tensors), path)
    actor.eval()
    return HariAgent(executor, actor, config)


def _of(part: str, tensors: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """The tensors of a part, those of Transformers by torch's names, which older files lack."""
    named = {}
    for name, tensor in tensors.items():
        if ".layers." in name:
            if ".query." in name:
                tensor = torch.cat([tensor, tensors[name.replace("query", "looked_at")]])
            for older, new in OLDER_NAMES.items():
                name = name.replace(older, new)
        if name.startswith(f"{part}.") and ".looked_at." not in name:
            named[name.removeprefix(f"{part}.")] = tensor
    return named

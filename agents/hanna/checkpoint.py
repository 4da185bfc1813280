"""Checkpoints of a run that trains a HANNA agent."""

from __future__ import annotations

from pathlib import Path

import torch

from agents.hanna.agent import HannaAgent
from agents.hanna.training_config import TrainingConfig
from agents.imitation.checkpoint import CheckpointError, read_checkpoint, refuse_changes, write_checkpoint
from agents.imitation.loop import Progress
from agents.tensor_file import put
from embodied.records import from_plain

FORMAT = "embodied-checkpoint-1"


def save_checkpoint(path: Path, agent: HannaAgent, optimizer: torch.optim.Optimizer, progress: Progress) -> None:
    """Write `path` atomically; an interruption leaves the checkpoint before it."""
    body = {
        "config": agent.config.to_json(),
        "encoder": agent.encoder_digest,
        "vocabulary": list(agent.vocabulary.words),
        "network": agent.network.state_dict(),
        "optimizer": optimizer.state_dict(),
        "progress": vars(progress),
    }
    write_checkpoint(path, FORMAT, body)


def load_checkpoint(path: Path, agent: HannaAgent, optimizer: torch.optim.Optimizer) -> Progress:
    """Put a run back into `agent` and `optimizer` and say where it was.

    Raises:
      CheckpointError: truncated, of another version, or of a run with other settings, another
        vocabulary or another encoder.
    """
    fields = ("encoder", "vocabulary", "config", "network", "optimizer", "progress")
    body = read_checkpoint(Path(path), FORMAT, fields)
    if body["encoder"] != agent.encoder_digest:
        raise CheckpointError(
            f"{path}: this run learned from encoder {body['encoder'][:12]}, the data set has features of "
            f"{agent.encoder_digest[:12]}; use the same data set and encoder, or another run folder"
        )
    if tuple(body["vocabulary"]) != agent.vocabulary.words:
        raise CheckpointError(f"{path}: the data set has other words than this run began with; use another run folder")
    before, now = TrainingConfig.from_json(body["config"]), agent.config
    refuse_changes(path, vars(before), vars(now), MAY_CHANGE)
    put(agent.network, body["network"], path)
    optimizer.load_state_dict(body["optimizer"])
    return from_plain(Progress, body["progress"], f"{path}: progress")


MAY_CHANGE = (
    "iterations",
    "cooldown",
    "checkpoint_minutes",
    "evaluation_batch",
    "evaluation_temperature",
    "ask_threshold",
)
"""Settings that may differ on resuming without changing what was learned so far."""

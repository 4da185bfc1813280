"""Checkpoints: everything that decides what comes next in a run, written atomically, refused if another run's."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import torch

from agents.common.agent_file import TrainedAgent
from agents.common.checkpoint_file import CheckpointError, read_checkpoint, refuse_changes, write_checkpoint
from agents.common.session import Progress
from agents.common.tensor_file import put
from embodied.records import from_json, from_plain


def save_run(
    path: Path, kind: str, agent: TrainedAgent, optimizer: torch.optim.Optimizer, progress: Progress, pictures: str = ""
) -> None:
    """Write the state of a run that trains `agent`, atomically; an interruption leaves the checkpoint before it.

    Args:
      pictures: how the pictures were drawn that it learns from; '' leaves that out.
    """
    body = {
        "config": agent.config.to_json(),
        "encoder": agent.encoder_digest,
        "vocabulary": list(agent.vocabulary.words),
        "network": agent.network.state_dict(),
        "optimizer": optimizer.state_dict(),
        "progress": vars(progress),
        **({"pictures": pictures} if pictures else {}),
    }
    write_checkpoint(path, kind, body)


def load_run(
    path: Path,
    kind: str,
    agent: TrainedAgent,
    optimizer: torch.optim.Optimizer,
    may_change: Collection[str],
    pictures: str = "",
) -> Progress:
    """Put a run back into `agent` and `optimizer` and say where it was.

    Args:
      may_change: settings that may differ without changing what was learned so far.
      pictures: as in `save_run`.

    Raises:
      CheckpointError: truncated, of another version, or of a run with other settings, another
        vocabulary, another encoder or other pictures.
    """
    fields = ("encoder", "vocabulary", "config", "network", "optimizer", "progress")
    body = read_checkpoint(Path(path), kind, fields)
    if body["encoder"] != agent.encoder_digest:
        raise CheckpointError(
            f"{path}: this run learned from encoder {body['encoder'][:12]}, the data set has features of "
            f"{agent.encoder_digest[:12]}; use the same data set and encoder, or another run folder"
        )
    if body.get("pictures", pictures) != pictures:
        raise CheckpointError(
            f"{path}: this run learned from pictures {body['pictures']}, the data set has {pictures}; "
            "say --quality, or use another run folder"
        )
    if tuple(body["vocabulary"]) != agent.vocabulary.words:
        raise CheckpointError(f"{path}: the data set has other words than this run began with; use another run folder")
    before, now = from_json(type(agent.config), body["config"]), agent.config
    refuse_changes(path, vars(before), vars(now), may_change)
    put(agent.network, body["network"], path)
    optimizer.load_state_dict(body["optimizer"])
    return from_plain(Progress, body["progress"], f"{path}: progress")

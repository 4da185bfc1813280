"""Checkpoints of a training run: everything that decides what comes next, written atomically."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from agents.hanna.agent import HannaAgent
from agents.imitation.config import TrainingConfig
from assets.cache import atomic_path

FORMAT = "embodied-checkpoint-1"


class CheckpointError(ValueError):
    """A checkpoint that cannot be continued: says what was expected, what came and what to do."""


@dataclass(frozen=True)
class Progress:
    """Where a run is. Randomness needs no state: every draw is named by seed and update."""

    update: int = 0
    """Updates done."""
    seconds: float = 0.0
    """Spent so far, over all sessions."""
    best: float = -1.0
    """Best validation success so far."""
    best_update: int = 0
    """After which best.safetensors was kept."""


def save_checkpoint(path: Path, agent: HannaAgent, optimizer: torch.optim.Optimizer, progress: Progress) -> None:
    """Write `path` atomically; an interruption leaves the checkpoint before it."""
    body = {
        "format": FORMAT,
        "config": agent.config.to_json(),
        "encoder": agent.encoder_digest,
        "vocabulary": list(agent.vocabulary.words),
        "network": agent.network.state_dict(),
        "optimizer": optimizer.state_dict(),
        "progress": vars(progress),
    }
    with atomic_path(Path(path)) as temporary:
        torch.save(body, temporary)


def load_checkpoint(path: Path, agent: HannaAgent, optimizer: torch.optim.Optimizer) -> Progress:
    """Put a run back into `agent` and `optimizer` and say where it was.

    Raises:
      CheckpointError: truncated, of another version, or of a run with other settings, another
        vocabulary or another encoder.
    """
    body = _read(Path(path))
    if body["encoder"] != agent.encoder_digest:
        raise CheckpointError(
            f"{path}: this run learned from encoder {body['encoder'][:12]}, the data set has features of "
            f"{agent.encoder_digest[:12]}; use the same data set and encoder, or another run folder"
        )
    if tuple(body["vocabulary"]) != agent.vocabulary.words:
        raise CheckpointError(f"{path}: the data set has other words than this run began with; use another run folder")
    before, now = TrainingConfig.from_json(body["config"]), agent.config
    changed = sorted(k for k, v in vars(before).items() if vars(now)[k] != v and k not in MAY_CHANGE)
    if changed:
        pairs = ", ".join(f"{k} {vars(before)[k]!r} -> {vars(now)[k]!r}" for k in changed)
        raise CheckpointError(
            f"{path}: settings changed since this run began ({pairs}); restore them or use another run folder"
        )
    agent.network.load_state_dict(body["network"])
    optimizer.load_state_dict(body["optimizer"])
    return Progress(**body["progress"])


MAY_CHANGE = (
    "iterations",
    "cooldown",
    "checkpoint_minutes",
    "evaluation_batch",
    "evaluation_temperature",
    "ask_threshold",
)
"""Settings that may differ on resuming without changing what was learned so far."""


def _read(path: Path) -> dict[str, Any]:
    try:
        body = torch.load(path, map_location="cpu", weights_only=True)
    except OSError:
        raise
    except Exception as e:  # a truncated file raises one of half a dozen kinds
        raise CheckpointError(f"{path}: cannot be read ({e}); it was cut short, delete it to begin again") from e
    if not isinstance(body, dict) or body.get("format") != FORMAT:
        found = body.get("format") if isinstance(body, dict) else type(body).__name__
        raise CheckpointError(f"{path}: format {found!r}, this version reads {FORMAT!r}; begin a new run")
    return body

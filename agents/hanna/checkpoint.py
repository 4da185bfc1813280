"""Checkpoints of a run that trains a HANNA agent."""

from __future__ import annotations

from pathlib import Path

import torch

from agents.common.checkpoint import load_run, save_run
from agents.common.session import Progress
from agents.common.settings import MAY_CHANGE
from agents.hanna.agent import HannaAgent
from agents.hanna.training_config import JUDGED

FORMAT = "embodied-checkpoint-1"


def save_checkpoint(path: Path, agent: HannaAgent, optimizer: torch.optim.Optimizer, progress: Progress) -> None:
    """Write `path` atomically; an interruption leaves the checkpoint before it."""
    save_run(path, FORMAT, agent, optimizer, progress)


def load_checkpoint(path: Path, agent: HannaAgent, optimizer: torch.optim.Optimizer) -> Progress:
    """Put a run back into `agent` and `optimizer` and say where it was; raises CheckpointError."""
    return load_run(path, FORMAT, agent, optimizer, (*MAY_CHANGE, *JUDGED))

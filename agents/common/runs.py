"""Resumable runs: weights, optimizers and numbers of a training stage in one checkpoint."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import torch
from torch import nn

from agents.common.checkpoint_file import read_checkpoint, refuse_changes, write_checkpoint
from agents.common.session import Note, Progress, Session
from assets.cache import write_json


class Run:
    """Owns what changes in a stage: modules, optimizers, and where it is.

    Randomness needs no state: every draw is named by seed and update.
    """

    def __init__(
        self,
        folder: Path,
        identity: Mapping[str, object],
        modules: Mapping[str, nn.Module],
        optimizers: Mapping[str, torch.optim.Optimizer],
        kind: str,
    ) -> None:
        """Begin, or go on from the checkpoint in `folder`.

        Args:
          kind: name and version of such checkpoints.

        Raises:
          CheckpointError: damaged, or of a run with other settings or another corpus.
        """
        self.folder, self.identity, self.modules, self.optimizers = Path(folder), dict(identity), modules, optimizers
        self.kind = kind
        self.progress = Progress()
        self.sums: dict[str, float] = {}
        """Of what is being counted, a pass or the updates since a validation."""
        self.history: list[dict[str, float]] = []
        """What was found so far, such as one entry per finished pass."""
        if self.path.exists():
            self._load()

    @property
    def path(self) -> Path:
        return self.folder / "checkpoint.pt"

    def add(self, numbers: Mapping[str, float]) -> None:
        for name, value in numbers.items():
            self.sums[name] = self.sums.get(name, 0.0) + value

    def save(self, progress: Progress) -> None:
        """Write the checkpoint atomically; an interruption leaves the one before it."""
        self.progress = progress
        body = {
            "identity": self.identity,
            "update": progress.update,
            "seconds": progress.seconds,
            "sums": self.sums,
            "history": self.history,
            "modules": {k: m.state_dict() for k, m in self.modules.items()},
            "optimizers": {k: o.state_dict() for k, o in self.optimizers.items()},
        }
        write_checkpoint(self.path, self.kind, body)
        write_json(self.folder / "result.json", {"identity": self.identity, "history": self.history}, indent=1)

    def _load(self) -> None:
        body = read_checkpoint(self.path, self.kind)
        refuse_changes(self.path, body["identity"], self.identity)
        for name, module in self.modules.items():
            module.load_state_dict(body["modules"][name])
        for name, optimizer in self.optimizers.items():
            optimizer.load_state_dict(body["optimizers"][name])
        self.progress, self.sums, self.history = (
            Progress(body["update"], body["seconds"]),
            body["sums"],
            body["history"],
        )

    def session(self, total: int, minutes: float, note: Note, stop_after: float | None = None) -> Session:
        """Go on until `total` updates are done, or for `stop_after` minutes, saving every so many `minutes`."""
        say = lambda line: note(f"{self.folder}: {line}")
        return Session(self.progress, total, self.save, minutes=stop_after, checkpoint_minutes=minutes, note=say)

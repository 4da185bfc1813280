"""Resumable runs: weights, optimizers and numbers of a training stage in one checkpoint, pass after pass."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from agents.bandit.translate import batches
from agents.imitation.checkpoint import CheckpointError
from agents.imitation.loop import stop_signal
from assets.cache import atomic_path, write_json
from embodied.locks import locked
from embodied.seeds import stream

FORMAT = "embodied-bandit-run-1"
Note = Callable[[str], None]


class Run:
    """Owns what changes in a stage: modules, optimizers, and where it is.

    Randomness needs no state: every draw is named by seed, pass and sentence.
    """

    def __init__(
        self,
        folder: Path,
        identity: Mapping[str, object],
        modules: Mapping[str, nn.Module],
        optimizers: Mapping[str, torch.optim.Optimizer],
    ) -> None:
        """Begin, or go on from the checkpoint in `folder`.

        Raises:
          CheckpointError: damaged, or of a run with other settings or another corpus.
        """
        self.folder, self.identity, self.modules, self.optimizers = Path(folder), dict(identity), modules, optimizers
        self.update, self.seconds = 0, 0.0
        self.sums: dict[str, float] = {}
        """Of the pass at hand."""
        self.history: list[dict[str, float]] = []
        """One entry per finished pass."""
        if self.path.exists():
            self._load()

    @property
    def path(self) -> Path:
        return self.folder / "checkpoint.pt"

    def add(self, numbers: Mapping[str, float]) -> None:
        for name, value in numbers.items():
            self.sums[name] = self.sums.get(name, 0.0) + value

    def save(self) -> None:
        """Write the checkpoint atomically; an interruption leaves the one before it."""
        body = {
            "format": FORMAT,
            "identity": self.identity,
            "update": self.update,
            "seconds": self.seconds,
            "sums": self.sums,
            "history": self.history,
            "modules": {k: m.state_dict() for k, m in self.modules.items()},
            "optimizers": {k: o.state_dict() for k, o in self.optimizers.items()},
        }
        with atomic_path(self.path) as temporary:
            torch.save(body, temporary)
        write_json(self.folder / "result.json", {"identity": self.identity, "history": self.history}, indent=1)

    def _load(self) -> None:
        body = read_checkpoint(self.path)
        changed = sorted(
            k for k in {*body["identity"], *self.identity} if body["identity"].get(k) != self.identity.get(k)
        )
        if changed:
            pairs = ", ".join(f"{k} {body['identity'].get(k)!r} -> {self.identity.get(k)!r}" for k in changed)
            raise CheckpointError(
                f"{self.path}: settings changed since this run began ({pairs}); restore them or use another folder"
            )
        for name, module in self.modules.items():
            module.load_state_dict(body["modules"][name])
        for name, optimizer in self.optimizers.items():
            optimizer.load_state_dict(body["optimizers"][name])
        self.update, self.seconds, self.sums, self.history = (body[k] for k in ("update", "seconds", "sums", "history"))


def read_checkpoint(path: Path) -> dict[str, Any]:
    """What `Run.save` wrote.

    Raises:
      CheckpointError: damaged, or of another format.
    """
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


def run_passes(
    run: Run,
    passes: int,
    lengths: Sequence[int],
    batch: int,
    *,
    seed: int,
    purpose: str,
    minutes: float,
    note: Note,
    step: Callable[[np.ndarray, int], Mapping[str, float]],
    finish: Callable[[int, Mapping[str, float]], Mapping[str, float]],
) -> list[dict[str, float]]:
    """Go on with `run` until it has had so many passes; returns what `finish` said of each.

    Args:
      lengths: of the sentences, which are put into batches of similar length, anew in every pass.
      minutes: between checkpoints.
      step: does one update with the sentences it is given, in this pass; returns numbers to add up.
      finish: is given a pass and the sums of its numbers; returns what is kept of it.

    Raises:
      KeyboardInterrupt: after Ctrl-C, once the update at hand is done and saved.
    """
    each, order, saved, began = -(-len(lengths) // batch), None, time.monotonic(), time.monotonic() - run.seconds
    with locked(run.folder), stop_signal() as stop:
        while run.update < passes * each:
            turn, place = divmod(run.update, each)
            if order is None or place == 0:
                order = batches(lengths, batch, stream(seed, purpose, "order", turn))
            run.add(step(order[place], turn))
            run.update += 1
            run.seconds = time.monotonic() - began
            if place + 1 == each:
                run.history.append({"pass": turn + 1, **finish(turn, run.sums), "seconds": round(run.seconds, 1)})
                run.sums = {}
                note(f"{run.folder}: " + ", ".join(f"{k} {v:.4g}" for k, v in run.history[-1].items()))
            if place + 1 == each or stop.is_set() or time.monotonic() - saved > 60 * minutes:
                run.save()
                saved = time.monotonic()
            if stop.is_set():
                note(f"{run.folder}: stopped after {run.update} updates; the same command goes on from there")
                raise KeyboardInterrupt
    return run.history[:passes]

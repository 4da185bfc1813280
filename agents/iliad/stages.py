"""What is trained before a student learns, whatever the world: one network, by maximum likelihood or imitation.

Batches are drawn by (seed, update), so a stage is resumable and exact after a kill.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from agents.common.actor_critic import descend
from agents.common.runs import Run
from agents.common.session import Note, falling_rate
from embodied.locks import locked
from embodied.seeds import stream

FORMAT = "embodied-iliad-stage-1"
COOLDOWN = 0.4
"""Share of the updates, the last ones, over which the rate of these stages falls (docs/sources.md, S92)."""
CLIP = 5.0
REPORT = 250
"""Updates between notes."""
Network = TypeVar("Network", bound=nn.Module)


@dataclass(frozen=True, eq=False)
class TeachingStage:
    """How long a network is trained, and where it is kept."""

    world: str
    """'regex' or 'nav'; draws are named by it."""
    name: str
    folder: Path
    updates: int
    rate: float
    """Adam's learning rate."""
    seed: int
    identity: Mapping[str, object]
    """What the run depends on besides."""

    def train(
        self,
        network: Network,
        loss_of: Callable[[np.random.Generator], Tensor],
        judge: Callable[[], Mapping[str, float]],
        keep: Callable[[Path], None],
        note: Note,
    ) -> Network:
        """Train `network` or go on, unless that is done; `keep` writes it as NAME.safetensors into the folder."""
        optimizer = torch.optim.Adam(network.parameters(), self.rate, fused=True)
        identity = {"stage": self.name, "updates": self.updates, "seed": self.seed, **self.identity}
        run = Run(self.folder / self.name, identity, {"network": network}, {"adam": optimizer}, FORMAT)
        if run.progress.update >= self.updates:
            return network.eval()
        network.train()
        with locked(run.folder), run.session(self.updates, 2.0, note) as session:
            for update in session:
                for group in optimizer.param_groups:
                    group["lr"] = falling_rate(self.rate, update, self.updates, COOLDOWN)
                loss = loss_of(stream(self.seed, self.world, self.name, update))
                descend(loss, optimizer, CLIP, f"{self.name}, update {update}")
                run.add({"loss": float(loss.detach()), "updates": 1.0})
                if (update + 1) % REPORT == 0 or update + 1 == self.updates:
                    found = {"update": update + 1.0, "loss": run.sums["loss"] / run.sums["updates"], **judge()}
                    run.history.append(found)
                    run.sums = {}
                    note(f"{run.folder}: " + ", ".join(f"{k} {v:.4g}" for k, v in found.items()))
        keep(self.folder / f"{self.name}.safetensors")
        return network.eval()

"""Training before a student learns, whatever the world: of one network, by maximum likelihood or imitation.

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

from embodied.agents.common.checkpoint import Stateful
from embodied.agents.common.session import Note, Session, descend, seeded_dropout, set_learning_rate
from embodied.agents.common.tensor_file import load_into, read_weights
from embodied.agents.common.weights import origin_of, save_weights
from embodied.identity import Identity, differences
from embodied.seeds import stream

COOLDOWN = 0.4
"""Share of the updates, the last ones, over which the rate of these stages falls (docs/sources.md, S92)."""
CLIP = 5.0
REPORT = 250
"""Updates between judgings."""
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
    identity: Identity
    """All that the network depends on."""
    about: object
    """Stands beside its weights (embodied.agents.common.weights)."""

    def train(
        self,
        network: Network,
        loss_of: Callable[[np.random.Generator], Tensor],
        judge: Callable[[], Mapping[str, float]],
        note: Note,
    ) -> Network:
        """Train `network` or go on, unless NAME.safetensors in the folder is what would come of it."""
        path = self.folder / f"{self.name}.safetensors"
        if path.exists() and not differences(origin_of(path) or {}, self.identity):
            load_into(network, read_weights(path), path)
            return network.eval()
        optimizer = torch.optim.Adam(network.parameters(), self.rate, fused=True)
        network.train()
        parts: dict[str, Stateful] = {"network": network, "adam": optimizer}
        with Session(
            self.folder / self.name, self.identity, parts, self.updates, checkpoint_minutes=2.0, every=REPORT, note=note
        ) as session:
            for update in session:
                set_learning_rate(optimizer, self.rate, update, self.updates, COOLDOWN)
                with seeded_dropout(self.seed, update):
                    loss = loss_of(stream(self.seed, self.world, self.name, update))
                descend(loss, optimizer, f"{self.name}, update {update}", CLIP)
                session.add({"loss": float(loss.detach()), "updates": 1.0})
                if session.due(REPORT):
                    session.record({"loss": session.sums["loss"] / session.sums["updates"], **judge()})
                    session.sums = {}
            if session.progress.update >= self.updates:
                save_weights(path, self.world, network.state_dict(), self.about, self.identity)
        return network.eval()

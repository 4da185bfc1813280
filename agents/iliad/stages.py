"""Training before a student learns, whatever the world: of one network, by maximum likelihood or imitation.

Batches are drawn by (seed, update), so a stage is resumable and exact after a kill.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from embodied.agents.common.checkpoint import Stateful
from embodied.agents.common.session import Note, Session, descend, seeded_dropout, set_learning_rate
from embodied.agents.common.tensor_file import load_into, read_weights
from embodied.agents.common.weights import origin_of, save_weights
from embodied.agents.iliad.protocol import Tasks, one_request
from embodied.records import differences, identity_of
from embodied.seeds import stream

COOLDOWN = 0.4
"""Share of the updates, the last ones, over which the rate of these stages falls (docs/sources.md, S92)."""
CLIP = 5.0
REPORT = 250
"""Updates between judgings."""
Network = TypeVar("Network", bound=nn.Module)


def teach(
    network: Network,
    name: str,
    loss_of: Callable[[np.random.Generator], Tensor],
    judge: Callable[[], Mapping[str, float]],
    *,
    world: str,
    folder: Path,
    updates: int,
    rate: float,
    seed: int,
    about: object,
    note: Note,
    **depends: object,
) -> Network:
    """Train `network` or go on, unless NAME.safetensors in the folder is what would come of it.

    Args:
      world: 'regex' or 'nav'; draws are named by it.
      rate: Adam's learning rate.
      about: stands beside the weights (embodied.agents.common.weights).
      depends: all that the network depends on besides name, updates and seed.
    """
    identity = identity_of(f"embodied.agents.iliad.{world}.stages", stage=name, updates=updates, seed=seed, **depends)
    path = folder / f"{name}.safetensors"
    if path.exists() and not differences(origin_of(path) or {}, identity):
        load_into(network, read_weights(path), path)
        return network.eval()
    optimizer = torch.optim.Adam(network.parameters(), rate, fused=True)
    network.train()
    parts: dict[str, Stateful] = {"network": network, "adam": optimizer}
    with Session(folder / name, identity, parts, updates, checkpoint_minutes=2.0, every=REPORT, note=note) as session:
        for update in session:
            set_learning_rate(optimizer, rate, update, updates, COOLDOWN)
            with seeded_dropout(seed, update):
                loss = loss_of(stream(seed, world, name, update))
            descend(loss, optimizer, f"{name}, update {update}", CLIP)
            session.add({"loss": float(loss.detach()), "updates": 1.0})
            if session.due(REPORT):
                session.record({"loss": session.sums["loss"] / session.sums["updates"], **judge()})
                session.sums = {}
        if session.progress.update >= updates:
            save_weights(path, world, network.state_dict(), about, identity)
    return network.eval()


def drawn(tasks: Tasks, count: int, rng: np.random.Generator) -> list[Any]:
    """Random tasks."""
    return [tasks[int(i)] for i in rng.integers(len(tasks), size=count)]


def asked(tasks: Tasks, rng: np.random.Generator) -> list[str]:
    """One request of each task."""
    return [one_request(task, rng=rng) for task in tasks]

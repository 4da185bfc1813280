"""Work of learners on a device, to be timed by `embodied bench gpu`: features of panoramas and steps of training."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import torch

from embodied.agents.common.session import descend
from embodied.agents.vision.encoder import Network, load_encoder
from embodied.agents.vision.strip import STRIP_COLUMNS
from embodied.agents.vision.training import Heads, StripBatch, vision_loss

BATCH = {"cpu": 2, "cuda": 64}
"""Strips of one call."""
CLASSES = 64


def works(device: str) -> dict[str, tuple[Callable[[], object], int]]:
    """By name a call to time, and of how many panoramas it is. The strips are noise: time does not depend on them."""
    n, encoder = BATCH[device], load_encoder().to(device)
    strips = np.random.default_rng(0).integers(0, 256, (n, 192, 576, 3), np.uint8)
    network = load_encoder().network.to(device).train()
    size = encoder.encode_strips(strips[:1]).shape[-1]
    heads = Heads(size, CLASSES).to(device)
    optimiser = torch.optim.AdamW([*network.parameters(), *heads.parameters()])
    batch = StripBatch(
        torch.from_numpy(strips),
        torch.zeros(n, 12, STRIP_COLUMNS, CLASSES, dtype=torch.uint8),
        torch.zeros(n, 36, CLASSES, dtype=torch.bool),
        torch.zeros(n, 12, STRIP_COLUMNS, dtype=torch.int64),
        torch.zeros(n, 12, STRIP_COLUMNS),
        torch.zeros(n, dtype=torch.int64),
    ).to(device)
    return {
        "features of panoramas": (functools.partial(encoder.encode_strips, strips), n),
        "panoramas learned from": (functools.partial(_learn, network, heads, optimiser, batch), n),
    }


def _learn(network: Network, heads: Heads, optimiser: torch.optim.Optimizer, batch: StripBatch) -> None:
    descend(vision_loss(network, heads, batch)[0], optimiser, "the benchmark")
    torch.zeros(1, device=batch.rgb.device).item()  # waits for the device

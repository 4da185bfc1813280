"""How much features say: linear readers fitted on training houses, judged on houses never seen.

The same protocol serves trained, random and ImageNet features, so their numbers can be compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from embodied.agents.common.weights import seeded
from embodied.agents.vision.encoder import Encoder
from embodied.agents.vision.labels import HouseStrips, visible_in_views


@dataclass(frozen=True, eq=False)
class LabelledFeatures:
    """Features of n nodes and what is to be read from them."""

    features: np.ndarray
    """(n, 36, D) float32."""
    visible: np.ndarray
    """(n, 36, C) bool."""
    room: np.ndarray
    """(n,) int, room kind of each node."""


def average_precision(scores: np.ndarray, positive: np.ndarray) -> float:
    """Mean of the precision at each positive, best scores first; NaN without positives.

    Ties are broken by position, so constant scores give the precision of the given order.
    """
    order = np.argsort(-scores, kind="stable")
    hits = positive[order].astype(np.float64)
    if not hits.sum():
        return float("nan")
    precision = np.cumsum(hits) / np.arange(1, len(hits) + 1)
    return float((precision * hits).sum() / hits.sum())


def read(
    train: LabelledFeatures, test: LabelledFeatures, classes: Sequence[str], *, seed: int, steps: int = 400
) -> dict[str, Any]:
    """Scores of linear readers that were fitted on `train`, on `test`: 'AP', mean over classes of the average precision
    of 'is it visible in this view'; 'chance AP', that of a constant; 'room accuracy', share of nodes whose kind of room
    is read from the mean of their views; and 'AP by class', None for a class that no judged house shows."""
    d = train.features.shape[-1]
    x, y = (torch.from_numpy(s.features.reshape(-1, d)) for s in (train, test))
    mean, deviation = x.mean(0), x.std(0) + 1e-6
    x, y = (x - mean) / deviation, (y - mean) / deviation
    visible = torch.from_numpy(train.visible.reshape(len(x), -1)).float()
    objects = _fit(x, visible, lambda out, goal: F.binary_cross_entropy_with_logits(out, goal) * 20, seed, steps)
    scores, truth = objects(y).numpy(), test.visible.reshape(len(y), -1)
    known = [c for c in range(visible.shape[1]) if visible[:, c].any()]
    ap = [average_precision(scores[:, c], truth[:, c]) if c in known else float("nan") for c in range(truth.shape[1])]

    pooled = [t.view(-1, 36, d).mean(1) for t in (x, y)]  # (n, D): the node as a whole
    scale = pooled[0].std(0) + 1e-6
    rooms = torch.from_numpy(train.room.astype(np.int64))
    reader = _fit(
        pooled[0] / scale, rooms, F.cross_entropy, seed, steps, int(max(train.room.max(), test.room.max())) + 1
    )
    guessed = reader(pooled[1] / scale).argmax(1).numpy()

    return {
        "AP": float(np.nanmean(ap)),
        "chance AP": float(truth[:, [c for c in known if truth[:, c].any()]].mean()),
        "room accuracy": float((guessed == test.room).mean()),
        "AP by class": {name: None if math.isnan(x) else x for name, x in zip(classes, ap, strict=True)},
    }


def _fit(
    x: Tensor, goal: Tensor, loss: Callable[[Tensor, Tensor], Tensor], seed: int, steps: int, outputs: int | None = None
) -> Callable[[Tensor], Tensor]:
    """A linear reader trained with Adam on random batches of 4096 rows."""
    with seeded(seed):
        reader = torch.nn.Linear(x.shape[1], outputs or goal.shape[1])
        optimizer = torch.optim.AdamW(reader.parameters(), 1e-2, weight_decay=1e-2)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
        for _ in range(steps):
            rows = torch.randint(len(x), (min(4096, len(x)),))
            optimizer.zero_grad()
            loss(reader(x[rows]), goal[rows]).backward()
            optimizer.step()
            schedule.step()
    return lambda rows: reader(rows).detach()


def labelled(houses: Sequence[HouseStrips], encoder: Encoder, classes: Sequence[str]) -> LabelledFeatures:
    """Features of houses and what a linear reader should read from them."""
    columns = [houses[0].classes.index(c) for c in classes]
    features = [encoder.encode_strips(h.rgb[i : i + 8]) for h in houses for i in range(0, len(h.rgb), 8)]
    return LabelledFeatures(
        np.concatenate(features),
        np.concatenate([visible_in_views(h.share[..., columns]) for h in houses]),
        np.concatenate([h.room for h in houses]).astype(np.int64),
    )

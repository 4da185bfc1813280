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
from embodied.agents.vision.strip import windows
from embodied.datasets.store import Dataset


@dataclass(frozen=True, eq=False)
class LabelledFeatures:
    """Features of n nodes and what is to be read from them."""

    features: np.ndarray
    """(n, 36, D) float32."""
    visible: np.ndarray
    """(n, 36, C) bool."""
    room: np.ndarray
    """(n,) int, room kind of each node."""
    log_depth: np.ndarray
    """(n, 36) float32, mean log distance in each view."""
    house: np.ndarray
    """(n,) int, which house."""
    position: np.ndarray
    """(n, 3) metres."""


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
    is read from the mean of their views; 'depth R²', explained variance of the mean log distance of a view; 'place
    AUC' (see `place_auc`); and 'AP by class', None for a class that no judged house shows."""
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

    goal = torch.from_numpy(train.log_depth.reshape(-1, 1)).float()
    depth = _fit(x, goal, F.mse_loss, seed, steps)(y).numpy()[:, 0]
    true_depth = test.log_depth.reshape(-1)
    return {
        "AP": float(np.nanmean(ap)),
        "chance AP": float(truth[:, [c for c in known if truth[:, c].any()]].mean()),
        "room accuracy": float((guessed == test.room).mean()),
        "depth R²": float(1 - ((depth - true_depth) ** 2).mean() / true_depth.var()),
        "place AUC": place_auc(test),
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


def place_auc(nodes: LabelledFeatures, near: float = 2.5) -> float:
    """Probability that the target similarity (D.1, summed) of two nodes at most `near` metres apart is higher than that
    of two nodes of the same house farther apart."""
    close, far = [], []
    for house in sorted(set(nodes.house.tolist())):
        rows = np.flatnonzero(nodes.house == house)
        unit = nodes.features[rows] / (np.linalg.norm(nodes.features[rows], axis=-1, keepdims=True) + 1e-6)
        gap = np.linalg.norm(nodes.position[rows][:, None] - nodes.position[rows][None], axis=-1)
        for i in range(len(rows)):
            similar = np.einsum("vd,nwd->nvw", unit[i], unit).max(-1).mean(-1)  # delta of D.1, averaged
            others = np.arange(len(rows)) != i
            close.append(similar[others & (gap[i] <= near)])
            far.append(similar[others & (gap[i] > near)])
    ranks = np.searchsorted(np.sort(np.concatenate(far)), np.concatenate(close))
    return float(ranks.mean() / sum(map(len, far)))


def labelled(
    data: Dataset, houses: Sequence[HouseStrips], encoder: Encoder, classes: Sequence[str]
) -> LabelledFeatures:
    """Features of houses and what a linear reader should read from them."""
    columns = [houses[0].classes.index(c) for c in classes]
    features = [encoder.encode_strips(h.rgb[i : i + 8]) for h in houses for i in range(0, len(h.rgb), 8)]
    return LabelledFeatures(
        np.concatenate(features),
        np.concatenate([visible_in_views(h.share[..., columns]) for h in houses]),
        np.concatenate([h.room for h in houses]).astype(np.int64),
        np.concatenate([np.einsum("vrc,nrc->nv", windows(), h.log_depth.astype(np.float32)) for h in houses]),
        np.concatenate([np.full(len(h.rgb), i) for i, h in enumerate(houses)]),
        np.concatenate([data.place(h.name).graph.positions for h in houses]),
    )

"""A detector on a frozen encoder: which classes each part of a panorama shows, and each of its 36 views; and how much
features say: linear readers fitted on training houses, judged on houses never seen.

It reads the encoder's maps in cells of 8 pixels (5 degrees), too, so that small things do not vanish in a mean. A view
shows a class as surely as its surest cell, corrected by what the whole view looks like. The same protocol of readers
serves trained, random and ImageNet features, so their numbers can be compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from embodied.agents.common.session import Note
from embodied.agents.common.settings import SHIPPED_DETECTOR
from embodied.agents.common.weights import half_precision, load_into, load_weights, save_weights, seeded
from embodied.agents.vision.config import StripTraining
from embodied.agents.vision.encoder import STRIP_COLUMNS, Encoder, cell_direction, inside_windows, pool_views
from embodied.agents.vision.features import SHELL, HouseStrips, strip_of, visible_in_views
from embodied.agents.vision.training import StripBatch, classes_of, learn
from embodied.records import Identity, identity_of
from embodied.render.panorama import Panorama, Recognised


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


WIDTH = 128
"""Channels of the detector's maps."""
BLOCKS = 3


class DetectorNetwork(nn.Module):
    """Maps of an encoder's network to logits of cells and views."""

    def __init__(self, channels: Sequence[int], classes: int) -> None:
        """Args:
        channels: of the maps in cells of 8, of 16, and of the last map.
        """
        super().__init__()
        fine, middle, last = channels
        self.fine = nn.Conv2d(fine, WIDTH, 1, bias=False)
        self.coarse = nn.Conv2d(middle + last, WIDTH, 1, bias=False)
        self.norm = nn.BatchNorm2d(WIDTH)
        self.blocks = nn.ModuleList(_Block() for _ in range(BLOCKS))
        self.cells = nn.Conv2d(WIDTH, classes, 1)
        self.view_norm = nn.BatchNorm1d(2 * last, affine=False)
        self.views = nn.Linear(2 * last, classes)

    def forward(self, maps: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        """(n, C, 12, 36) and (n, 36, C) logits from maps (n, channels, rows, columns) of `strip_pyramid`."""
        fine, middle, last = maps
        coarse = self.coarse(torch.cat([middle, last], 1))
        x = F.relu(self.norm(self.fine(fine) + F.interpolate(coarse, scale_factor=2.0)))
        for block in self.blocks:
            x = block(x)
        cells = F.max_pool2d(self.cells(x), 2)
        inside = torch.from_numpy(inside_windows()).to(cells.device)
        surest = cells.flatten(2)[:, :, inside].amax(-1).transpose(1, 2)
        whole = torch.cat([pool_views(last), pool_views(last, last.shape[1])], -1)
        return cells, surest + self.views(self.view_norm(whole.flatten(0, 1))).unflatten(0, whole.shape[:2])


class _Block(nn.Module):
    """A residual connection around a look at the neighbours of each cell, round the strip's ends."""

    def __init__(self) -> None:
        super().__init__()
        self.near = nn.Conv2d(WIDTH, WIDTH, 5, groups=WIDTH, bias=False)
        self.norm = nn.BatchNorm2d(WIDTH)
        self.mix = nn.Conv2d(WIDTH, WIDTH, 1)

    def forward(self, x: Tensor) -> Tensor:
        around = F.pad(F.pad(x, (2, 2, 0, 0), mode="circular"), (0, 0, 2, 2))
        return x + F.relu(self.mix(self.norm(self.near(around))))


@dataclass(frozen=True)
class DetectorAbout:
    """Metadata beside the weights of a detector."""

    encoder: str
    """Digest of its encoder."""
    channels: tuple[int, int, int]
    """Of the encoder's maps."""
    classes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Detector:
    """A trained detector and the encoder whose maps it reads."""

    encoder: Encoder
    network: DetectorNetwork
    classes: tuple[str, ...]

    @classmethod
    def load(cls, encoder: Encoder, path: Path = SHIPPED_DETECTOR) -> Detector:
        """The detector in a file, for its encoder.

        Raises:
          FileNotFoundError, OSError.
          ValueError: damaged, of another format, or of another encoder.
        """
        remedy = "train a detector with `embodied train detector`"
        tensors, about = load_weights(path, "detector", DetectorAbout, remedy)
        if about.encoder != encoder.digest:
            raise ValueError(
                f"{path}: a detector of encoder {about.encoder[:12]}, not of {encoder.digest[:12]}; name the one that "
                "was trained with this encoder"
            )
        network = DetectorNetwork(about.channels, len(about.classes))
        load_into(network, tensors, path)
        return cls(encoder, network.eval(), about.classes)

    def save(self, path: Path, identity: Identity | None = None) -> None:
        """Write half-precision weights, the names of the classes and what they were trained with, atomically."""
        about = DetectorAbout(self.encoder.digest, self.encoder.network.channels, self.classes)
        save_weights(path, "detector", half_precision(self.network), about, identity)

    @torch.no_grad()
    def __call__(self, strips: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, 192, 576, 3) uint8 -> probabilities of each class, (n, C, 12, 36) of cells and (n, 36, C) of views."""
        cells, views = self.network(self.encoder.pyramid(strips))
        return cells.sigmoid().cpu().numpy(), views.sigmoid().cpu().numpy()

    def recognise(self, panorama: Panorama, most: int = 8, least: float = 0.3) -> list[Recognised]:
        """The `most` surest things in a panorama, but for walls, floors and ceilings, the surest first, each where it
        is seen best, to a cell of 10 degrees.

        Args:
          least: probability from which on a cell shows a class.

        Examples:
          >>> Detector.load(load_encoder()).recognise(world.panorama(0))[0].name
          'sofa'
        """
        likely = self(strip_of(panorama)[None])[0][0].reshape(len(self.classes), -1)  # (C, 12 * 36)
        best, cells = likely.max(1), likely.argmax(1)
        recognised: list[Recognised] = []
        for k in (-best).argsort(kind="stable").tolist():
            if best[k] < least or len(recognised) == most:
                break
            if (name := self.classes[k]) not in SHELL:
                where = cell_direction(*divmod(int(cells[k]), STRIP_COLUMNS))
                recognised.append(Recognised(name, float(best[k]), *where))
        return recognised

    def precision(self, houses: Sequence[HouseStrips]) -> dict[str, float]:
        """Average precision of each class that some view of `houses` shows: is it visible in this view?"""
        columns = [houses[0].classes.index(c) for c in self.classes]
        scores = np.concatenate([self(h.rgb[i : i + 8])[1] for h in houses for i in range(0, len(h.rgb), 8)])
        shown = np.concatenate([visible_in_views(h.share[..., columns]) for h in houses])
        pairs = zip(self.classes, scores.reshape(-1, len(columns)).T, shown.reshape(-1, len(columns)).T, strict=True)
        return {name: average_precision(score, there) for name, score, there in pairs if there.any()}


def train_detector(
    houses: Sequence[HouseStrips],
    encoder: Encoder,
    config: StripTraining,
    folder: Path,
    *,
    device: str = "cpu",
    note: Note = print,
) -> Detector:
    """A detector on an encoder that stays as it is; args and errors: as embodied.agents.vision.training.learn."""
    classes = classes_of(houses, config)
    looking = encoder.to(device)
    with seeded(config.seed):
        network = DetectorNetwork(encoder.network.channels, len(classes))

    def loss_of(batch: StripBatch) -> tuple[Tensor, dict[str, float]]:
        cells, views = network(looking.pyramid(batch.rgb))
        shows = (batch.share.permute(0, 3, 1, 2) >= 8).float()  # covers 3 % of the cell
        in_cells = F.binary_cross_entropy_with_logits(cells, shows) * 20
        in_views = F.binary_cross_entropy_with_logits(views, batch.visible.float()) * 20
        return in_cells + in_views, {"cell objects": float(in_cells.detach()), "view objects": float(in_views.detach())}

    identity = identity_of("embodied.agents.vision.detector", encoder=encoder.digest)
    learn(houses, classes, config, {"detector": network}, loss_of, folder, identity, device=device, note=note)
    return Detector(encoder.to("cpu"), network.cpu().eval(), tuple(houses[0].classes[i] for i in classes))

"""Training of the encoder on our own renders: which objects, which room, how far.

Every cell of the feature map learns which classes it shows, which kind of room it looks into and
how far away things are; every one of the 36 views learns which classes are visible in it and in
what room the camera stands. Labels come from the simulator's own ids and depths and cost nothing.
"""

from __future__ import annotations

import dataclasses
import functools
import operator
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from embodied.agents.common.session import Note, Session, descend
from embodied.agents.common.weights import Stateful, seeded
from embodied.agents.vision import encoder as encoders
from embodied.agents.vision.config import StripTraining, VisionConfig
from embodied.agents.vision.features import HouseStrips, visible_in_views
from embodied.agents.vision.lite import Lite, load_imagenet
from embodied.assets.cache import digest
from embodied.assets.records import ROOM_KINDS
from embodied.records import Identity, identity_of
from embodied.seeds import stream


@dataclass(frozen=True, eq=False)
class StripBatch:
    """Strips and labels of n nodes as tensors."""

    rgb: Tensor
    """(n, 192, 576, 3) uint8."""
    share: Tensor
    """(n, 12, 36, C) uint8."""
    visible: Tensor
    """(n, 36, C) bool."""
    rooms: Tensor
    """(n, 12, 36) int64, -1 for none."""
    log_depth: Tensor
    """(n, 12, 36) float32."""
    room: Tensor
    """(n,) int64."""

    def to(self, device: str) -> StripBatch:
        return StripBatch(**{f.name: getattr(self, f.name).to(device) for f in dataclasses.fields(self)})


class Heads(nn.Module):
    """Linear readers of the feature map (cells) and of the pooled features (views), by which an encoder learns."""

    def __init__(self, size: int, classes: int) -> None:
        super().__init__()
        self.cell_objects = nn.Conv2d(size, classes, 1)
        self.cell_room = nn.Conv2d(size, len(ROOM_KINDS), 1)
        self.cell_depth = nn.Conv2d(size, 1, 1)
        self.view_objects = nn.Linear(size, classes)
        self.view_room = nn.Linear(size, len(ROOM_KINDS))


def vision_loss(network: encoders.Network, heads: Heads, batch: StripBatch) -> tuple[Tensor, dict[str, float]]:
    """Sum of the five losses, and each as a number."""
    half = isinstance(network, Lite)  # bfloat16 halves the time
    with torch.autocast(batch.rgb.device.type, torch.bfloat16, enabled=half):
        maps = encoders.strip_map(network, batch.rgb).float()  # (n, D, 12, 36)
    views = encoders.pool_views(maps, network.peaks)  # (n, 36, D)
    cells = (batch.share.permute(0, 3, 1, 2) >= 8).float()  # (n, C, 12, 36): covers 3 % of the cell
    parts = {
        "cell objects": F.binary_cross_entropy_with_logits(heads.cell_objects(maps), cells) * 10,
        "cell room": F.cross_entropy(heads.cell_room(maps), batch.rooms, ignore_index=-1) * 0.5,
        "cell depth": F.smooth_l1_loss(heads.cell_depth(maps)[:, 0], batch.log_depth),
        "view objects": F.binary_cross_entropy_with_logits(heads.view_objects(views), batch.visible.float()) * 5,
        "view room": F.cross_entropy(heads.view_room(views).flatten(0, 1), batch.room.repeat_interleave(views.shape[1]))
        * 0.5,
    }
    return functools.reduce(operator.add, parts.values()), {
        name: float(value.detach()) for name, value in parts.items()
    }


def batches(
    houses: Sequence[HouseStrips], classes: Sequence[int], size: int, shade: float = 0.0, *, rng: np.random.Generator
) -> Iterator[StripBatch]:
    """One pass over all nodes in random order, each rolled, perhaps mirrored, and recoloured."""
    where = [(house, i) for house in houses for i in range(len(house.rgb))]
    order = rng.permutation(len(where))
    columns = np.asarray(classes)
    for start in range(0, len(order) - len(order) % size, size):
        chosen = [where[k] for k in order[start : start + size]]
        rows = []
        for house, i in chosen:
            turn, mirror = int(rng.integers(encoders.STRIP_COLUMNS)), bool(rng.random() < 0.5)
            rgb = recolour(turn_strip(house.rgb[i], turn * encoders.CELL, mirror), shade, rng=rng)
            share, rooms, depth = (turn_strip(x[i], turn, mirror) for x in (house.share, house.rooms, house.log_depth))
            rows.append((rgb, share[..., columns], rooms.astype(np.int64), depth.astype(np.float32), house.room[i]))
        rgb, share, rooms, depth, room = map(np.stack, zip(*rows, strict=True))
        arrays = rgb, share, visible_in_views(share), rooms, depth, room.astype(np.int64)
        yield StripBatch(*map(torch.from_numpy, arrays))


def turn_strip(strip: np.ndarray, columns: int, mirror: bool) -> np.ndarray:
    """A strip or its labels (rows, columns, ...) as seen after turning, and in a mirror."""
    rolled = np.roll(strip, columns, 1)
    return rolled[:, ::-1] if mirror else rolled


def recolour(image: np.ndarray, uneven: float = 0.0, *, rng: np.random.Generator) -> np.ndarray:
    """(H, W, 3) uint8 with another exposure, white balance and gamma, and lit unevenly where `uneven` says how much:
    strips that are drawn without light lack lamps, windows and shadows."""
    gain = rng.uniform(0.7, 1.35) * rng.uniform(0.93, 1.07, 3)
    gamma = rng.uniform(0.8, 1.25)
    ramp = (np.arange(256)[:, None] / 255) ** gamma * gain
    table = np.clip(ramp * 255, 0, 255).astype(np.uint8)  # (256, 3)
    recoloured = np.stack([table[image[..., c], c] for c in range(3)], -1)
    if not uneven:
        return recoloured
    shade = np.exp(rng.normal(0.0, uneven, (4, 9))).astype(np.float32)
    shade = cv2.resize(np.concatenate([shade, shade[:, :1]], 1), image.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    return np.clip(recoloured * shade[..., None], 0, 255).astype(np.uint8)


def train_encoder(
    houses: Sequence[HouseStrips], config: VisionConfig, folder: Path, *, device: str = "cpu", note: Note = print
) -> tuple[encoders.Encoder, list[str]]:
    """The encoder, on the CPU in the end, and the names of the classes that it learned to tell.

    Args and errors: as `learn`.
    """
    classes = classes_of(houses, config)
    with seeded(config.seed):
        network = encoders.ENCODER_NETWORKS[config.network]()
        heads = Heads(network.size, len(classes))
    if isinstance(network, Lite):
        load_imagenet(network)
    modules = {"network": network, "heads": heads}
    loss_of = functools.partial(vision_loss, network, heads)
    identity = identity_of("embodied.agents.vision.training")
    learn(houses, classes, config, modules, loss_of, folder, identity, device=device, note=note)
    return encoders.Encoder(network.cpu().eval(), config.network), [houses[0].classes[i] for i in classes]


def classes_of(houses: Sequence[HouseStrips], config: StripTraining) -> list[int]:
    """Indices of the classes to learn: those that are visible in enough views.

    Raises:
      ValueError: no strips, or strips with different classes.
    """
    if not houses or len({h.classes for h in houses}) != 1:
        raise ValueError("training needs strips of at least one house, all with the same list of classes")
    count = sum(visible_in_views(h.share).sum((0, 1)) for h in houses)
    return np.flatnonzero(count >= config.least_views).tolist()


def learn(
    houses: Sequence[HouseStrips],
    classes: Sequence[int],
    config: StripTraining,
    modules: Mapping[str, nn.Module],
    loss_of: Callable[[StripBatch], tuple[Tensor, dict[str, float]]],
    folder: Path,
    identity: Identity,
    *,
    device: str = "cpu",
    note: Note = print,
) -> None:
    """Train modules on strips, epoch by epoch.

    Args:
      loss_of: a batch's loss, and its parts for the log.
      folder: of the run, whose state is kept after each epoch; training goes on from it.
      identity: what else decides the result.
      device: where PyTorch computes.

    Raises:
      DivergedError: the loss is no longer a number.
      CheckpointError: damaged, or of other settings.
    """
    count = sum(len(house.rgb) for house in houses)
    updates = count // config.batch
    note(f"{count} strips an epoch, of {len(houses)} houses, {len(classes)} classes")
    for module in modules.values():
        module.to(device)
    parameters = [p for module in modules.values() for p in module.parameters()]
    optimizer = torch.optim.AdamW(parameters, config.learning_rate, weight_decay=config.weight_decay)
    steps = max(config.epochs * updates, 1)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, config.learning_rate, total_steps=steps)

    def update(batch: StripBatch, where: str) -> dict[str, float]:
        loss, parts = loss_of(batch.to(device))
        descend(loss, optimizer, where)
        schedule.step()
        return parts

    def pass_over(epoch: int) -> dict[str, float]:
        """Learn once from every strip; returns the losses, smoothed."""
        # not in channels_last: its backward pass corrupts memory in PyTorch 2.13 on CPUs with few channels
        for module in modules.values():
            module.train()
        rng = stream(config.seed, "vision", "epoch", epoch)
        drawn = batches(houses, classes, config.batch, config.shade, rng=rng)
        losses = (update(batch, f"epoch {epoch + 1}, update {done}") for done, batch in enumerate(drawn, 1))
        return _watched(losses, f"epoch {epoch + 1}", updates, config.batch, note)

    learned = {**identity, **identity_of(settings=config, strips=_digest_of(houses))}
    parts: dict[str, Stateful] = {**modules, "optimizer": optimizer, "schedule": schedule}
    with Session(folder, learned, parts, config.epochs, checkpoint_minutes=0.0, note=note) as session:
        for epoch in session:
            session.add(pass_over(epoch))


def _watched(losses: Iterable[dict[str, float]], name: str, total: int, batch: int, note: Note) -> dict[str, float]:
    """The parts of a pass's losses, smoothed, and told from time to time."""
    began, smooth = time.monotonic(), dict[str, float]()
    for done, parts in enumerate(losses, 1):
        smooth = {k: 0.95 * smooth.get(k, v) + 0.05 * v for k, v in parts.items()}
        if done % 25 == 0 or done == total:
            rate = done * batch / (time.monotonic() - began)
            terms = ", ".join(f"{k} {v:.3f}" for k, v in smooth.items())
            note(f"{name}, update {done}/{total}, {rate:.1f} strips/s: {terms}")
    return smooth


def _digest_of(houses: Sequence[HouseStrips]) -> str:
    """Of the pictures and labels of some houses."""
    return digest(*(digest(h.name, h.classes, h.rgb.tobytes(), h.share.tobytes()) for h in houses))


def whitened(encoder: encoders.Encoder, houses: Sequence[HouseStrips]) -> encoders.Encoder:
    """The encoder with features decorrelated over the views of `houses`.

    Raw features are all positive, so any two views have a cosine near one and the target
    similarity of D.1 says little; after whitening it is near zero for different places.
    """
    features = [encoder.encode_strips(h.rgb[i : i + 8]) for h in houses for i in range(0, len(h.rgb), 8)]
    mean, mix = encoders.whitening(torch.from_numpy(np.concatenate(features)).flatten(0, 1))
    return encoders.Encoder(encoder.network, encoder.name, mean, mix)

"""Encoder: the network that turns a panorama into 36 x D features, with its file and its digest; and the strip that it
looks at: the part of an equirect that the 36 views see, and where in it each view looks.

The 36 views (12 turns of 30 degrees x 3 tilts, 60 degrees high, 75 wide) overlap about fourfold, so a network that
looks at each alone does most of its work four times. Here it looks once at a strip of 360 x 120 degrees, 576 x 192
pixels, and every view is a window of the feature map. The map's cells are 10 degrees wide, three to a turn, so turning
the agent by 30 degrees turns its features exactly.

Row 0 looks 60 degrees up. Column 0 begins at yaw +pi and yaw falls to the right: what is on the
left in the picture is on the left in the world.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from embodied.agents.common.settings import SHIPPED_ENCODER
from embodied.agents.common.weights import load_into, load_weights, save_weights
from embodied.agents.vision.lite import COMPACT, LITE, Compact, Lite, folded
from embodied.interface import VIEW_PITCHES, VIEW_YAWS, VIEWS
from embodied.records import Identity

HEIGHT, WIDTH = 192, 576
CELL = 16
"""Pixels of a cell of the feature map (the encoder's stride)."""
STRIP_ROWS, STRIP_COLUMNS = HEIGHT // CELL, WIDTH // CELL
HALF = math.radians(60)
"""The strip ends this far above and below the horizon."""
VFOV = math.radians(60)
ASPECT = 640 / 480
"""Of a view: what the VLN literature extracts features from."""


@functools.cache
def directions() -> np.ndarray:
    """(192, 576, 3) float64 unit rays of the strip's pixel centres, world frame."""
    pitch = HALF - (np.arange(HEIGHT) + 0.5) / HEIGHT * 2 * HALF
    yaw = np.pi - (np.arange(WIDTH) + 0.5) / WIDTH * 2 * np.pi
    pitch, yaw = np.meshgrid(pitch, yaw, indexing="ij")
    return np.stack([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)], -1)


def view_coverage(view: int) -> np.ndarray:
    """(192, 576) float64: how much picture area of view `view` each pixel of the strip covers; 0 outside.

    A pixel's solid angle is proportional to cos(pitch); a solid angle at angle theta from the optical axis covers 1 /
    cos(theta)^3 of the picture plane. Averages with these weights equal averages over the perspective picture.
    """
    yaw, pitch = VIEW_YAWS[view], VIEW_PITCHES[view]
    forward = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    left = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    up = np.cross(forward, left)
    rays = directions()
    depth = rays @ forward
    ahead = np.maximum(depth, 1e-6)
    tall = math.tan(VFOV / 2)
    inside = (depth > 0) & (np.abs(rays @ up) <= tall * ahead) & (np.abs(rays @ left) <= ASPECT * tall * ahead)
    return np.where(inside, np.hypot(rays[..., 0], rays[..., 1]) / ahead**3, 0.0)


def cell_direction(row: int, column: int) -> tuple[float, float]:
    """Yaw and pitch, in radians, of the middle of a cell of the feature map."""
    return math.pi - (column + 0.5) / STRIP_COLUMNS * math.tau, HALF - (row + 0.5) / STRIP_ROWS * 2 * HALF


@functools.cache
def windows() -> np.ndarray:
    """(36, 12, 36) float32: weight of each cell of the feature map in each view; each view sums to 1."""
    weights = np.stack(
        [view_coverage(k).reshape(STRIP_ROWS, CELL, STRIP_COLUMNS, CELL).sum((1, 3)) for k in range(VIEWS)]
    )
    return (weights / weights.sum((1, 2), keepdims=True)).astype(np.float32)


@functools.cache
def inside_windows() -> np.ndarray:
    """(36, K) int64 indices of cells: those that each view shows more than a tenth as much of as of its fullest cell.

    Views with fewer cells than others have some twice."""
    weights = windows().reshape(VIEWS, -1)
    inside = [np.flatnonzero(w > 0.1 * w.max()) for w in weights]
    longest = max(map(len, inside))
    return np.stack([np.resize(cells, longest) for cells in inside])


DIGESTED = "embodied-encoder-1"
"""The beginning of what digests of encoders are made of."""
Network = Compact | Lite
"""Makes a map of `size` channels, of which the last `peaks` are pooled as maxima, in cells of `stride` pixels."""
ENCODER_NETWORKS: Mapping[str, type[Network]] = {COMPACT: Compact, LITE: Lite}
SHARING = "strip"
"""Views share one look at the panorama, of whose feature map they are windows."""
MARGIN = 3 * CELL
"""Pixels of the strip's other end shown beyond each end, so that its ends are no borders."""


@dataclass(frozen=True)
class EncoderAbout:
    """Metadata beside the weights in an encoder's file."""

    name: str
    digest: str
    sharing: str = SHARING


@dataclass(frozen=True, eq=False)
class Encoder:
    """A frozen network and what is done with its output."""

    network: Network
    name: str
    """Key of ENCODER_NETWORKS."""
    mean: Tensor | None = None
    """(D,) subtracted from features; None leaves them as the network gives them."""
    mix: Tensor | None = None
    """(D, D) that whitens features after the mean is gone: x -> (x - mean) @ mix."""

    @property
    def size(self) -> int:
        """D."""
        return self.network.size

    @functools.cached_property
    def digest(self) -> str:
        """Hex SHA-256 over weights and settings: two encoders with one digest give the same features."""
        h = hashlib.sha256(json.dumps([DIGESTED, self.name, SHARING]).encode())
        for name, tensor in sorted(_tensors(self).items()):
            h.update(name.encode() + tensor.detach().cpu().half().contiguous().numpy().tobytes())
        return h.hexdigest()

    @functools.cached_property
    def _looking(self) -> Network:
        """The network, or one that gives the same in less time."""
        on_processor = next(self.network.parameters()).device.type == "cpu"
        return folded(self.network) if isinstance(self.network, Lite) and on_processor else self.network

    @torch.no_grad()
    def encode_strips(self, strips: np.ndarray) -> np.ndarray:
        """(n, 192, 576, 3) uint8 -> (n, 36, D) float32 by one look at each strip."""
        views = [pool_views(strip_map(self._looking, part), self.network.peaks) for part in self._parts(strips)]
        return self.finish(torch.cat(views)).cpu().numpy()

    @torch.no_grad()
    def pyramid(self, strips: np.ndarray | Tensor) -> list[Tensor]:
        """(n, 192, 576, 3) uint8 -> the maps of `strip_pyramid`."""
        pyramids = [strip_pyramid(self._looking, part) for part in self._parts(strips)]
        return [torch.cat(maps) for maps in zip(*pyramids, strict=True)]

    @torch.no_grad()
    def encode_views(self, views: np.ndarray) -> np.ndarray:
        """(n, 36, H, W, 3) uint8 -> (n, 36, D) float32, each view alone."""
        n = len(views)
        flat = self._send(views.reshape(-1, *views.shape[2:]))
        maps = [self.network.feature_map(self.network.normalise(part)) for part in flat.split(36)]
        means = self.size - self.network.peaks
        out = torch.cat([torch.cat([m[:, :means].mean((2, 3)), m[:, means:].amax((2, 3))], 1) for m in maps])
        return self.finish(out.view(n, views.shape[1], -1)).cpu().numpy()

    def to(self, device: torch.device | str) -> Encoder:
        """The encoder on another device (the network moves with it)."""
        move = lambda t: None if t is None else t.to(device)
        moved = self.network.to(device)
        return dataclasses.replace(self, network=moved, mean=move(self.mean), mix=move(self.mix))

    def finish(self, features: Tensor) -> Tensor:
        """Pooled features (..., D) of the network without the mean, mixed."""
        if self.mean is not None:
            features = features - self.mean
        return features if self.mix is None else features @ self.mix

    def _parts(self, strips: np.ndarray | Tensor) -> Sequence[Tensor]:
        """Strips as they are looked at together: a processor keeps one in its cache, not several."""
        sent = strips if isinstance(strips, Tensor) else self._send(strips)
        return sent.split(1) if sent.device.type == "cpu" else [sent]

    def _send(self, images: np.ndarray) -> Tensor:
        return torch.from_numpy(np.ascontiguousarray(images)).to(next(self.network.parameters()).device)


def strip_map(network: Network, strips: Tensor) -> Tensor:
    """(n, 192, 576, 3) uint8 -> (n, D, 12, 36) feature map of strips; left and right ends know each other."""
    return strip_pyramid(network, strips)[-1]


def strip_pyramid(network: Network, strips: Tensor) -> list[Tensor]:
    """As `strip_map`, after the maps that it is made from, in cells of 8 and of 16 pixels."""
    if strips.shape[1:] != (HEIGHT, WIDTH, 3):
        raise ValueError(f"expected strips (n, {HEIGHT}, {WIDTH}, 3), got {tuple(strips.shape)}")
    wide = network.normalise(torch.cat([strips[:, :, -MARGIN:], strips, strips[:, :, :MARGIN]], 2))
    # pixel by pixel is faster, but PyTorch 2.13 may corrupt memory on the way back (embodied.agents.vision.training)
    maps = network.pyramid(wide.contiguous() if torch.is_grad_enabled() else wide)
    ends = [MARGIN * m.shape[-1] // wide.shape[-1] for m in maps]
    return [m[..., end:-end] for m, end in zip(maps, ends, strict=True)]


def pool_views(maps: Tensor, peaks: int = 0) -> Tensor:
    """(n, D, 12, 36) feature maps -> (n, 36, D): each view is the average of its window, but for the last `peaks`
    channels, of which it is the largest value."""
    weights = torch.from_numpy(windows()).to(maps.device).view(36, STRIP_ROWS * STRIP_COLUMNS)
    cells, means = maps.flatten(2), maps.shape[1] - peaks
    mean = torch.einsum("vc,ndc->nvd", weights, cells[:, :means])
    if not peaks:
        return mean
    inside = torch.from_numpy(inside_windows()).to(maps.device)
    return torch.cat([mean, cells[:, means:, inside].amax(-1).transpose(1, 2)], -1)


def whitening(features: Tensor, floor: float = 1e-2) -> tuple[Tensor, Tensor]:
    """Mean (D,) and mix (D, D) after which `features` (n, D) have no mean and unit covariance.

    Directions with less than `floor` of the mean variance are damped, not blown up.
    """
    mean = features.mean(0)
    centred = (features - mean).double()
    values, vectors = torch.linalg.eigh(centred.T @ centred / len(features))
    scale = (values + floor * values.mean()).rsqrt()
    return mean, ((vectors * scale) @ vectors.T).float()


def save_encoder(encoder: Encoder, path: Path, identity: Identity | None = None) -> None:
    """Write half-precision weights, settings and what they were trained with, atomically."""
    about = EncoderAbout(encoder.name, encoder.digest)
    save_weights(path, "encoder", {k: v.detach().half() for k, v in _tensors(encoder).items()}, about, identity)


def load_encoder(path: Path = SHIPPED_ENCODER) -> Encoder:
    """Read what `save_encoder` wrote.

    Raises:
      ValueError: truncated, of another format, or not the weights its digest names.
    """
    remedy = "train the encoder again with `embodied train vision`"
    tensors, about = load_weights(path, "encoder", EncoderAbout, remedy)
    if about.name not in ENCODER_NETWORKS or about.sharing != SHARING:
        raise ValueError(f"{path}: unknown settings {about}; {remedy}")
    tensors = {k: v.float() for k, v in tensors.items()}
    mean, mix = tensors.pop("mean", None), tensors.pop("mix", None)
    network = ENCODER_NETWORKS[about.name]()
    counters = {k: v for k, v in network.state_dict().items() if k.endswith("num_batches_tracked")}
    load_into(network, {**counters, **tensors}, path)
    encoder = Encoder(network.eval(), about.name, mean, mix)
    if encoder.digest != about.digest:
        raise ValueError(f"{path}: contents do not fit the digest {about.digest[:12]}; it was changed")
    return encoder


def _tensors(encoder: Encoder) -> dict[str, Tensor]:
    """Everything that decides features; counters of batches do not."""
    body = {k: v for k, v in encoder.network.state_dict().items() if not k.endswith("num_batches_tracked")}
    extra = {k: v for k, v in (("mean", encoder.mean), ("mix", encoder.mix)) if v is not None}
    return {**body, **extra}

"""Encoder: the network that turns a panorama into 36 x D features, with its file and its digest."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from embodied.agents.common.shipped import SHIPPED_ENCODER
from embodied.agents.common.weights import load_into, load_weights, save_weights
from embodied.agents.vision.lite import COMPACT, LITE, Compact, Lite, folded
from embodied.agents.vision.strip import CELL, HEIGHT, STRIP_COLUMNS, STRIP_ROWS, WIDTH, inside_windows, windows
from embodied.records import Identity

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

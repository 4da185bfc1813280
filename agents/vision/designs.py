"""Every network that an encoder may be, by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import torch.nn.functional as F
from torch import Tensor, nn

from agents.vision.config import IMAGENET
from agents.vision.lite import LiteBody, imagenet_weights
from agents.vision.network import Network
from agents.vision.resnet import ARCHITECTURES, ResNet


@dataclass(frozen=True)
class Design:
    """A body, and what is done with its map."""

    body: str
    """'lite0' or a key of resnet.ARCHITECTURES."""
    neck: int = 0
    """Channels that a 1x1 convolution makes of the body's; 0: the map is the body's."""
    peaks: int = 0
    """This many of them are max-pooled over a view, the others mean-pooled: small things vanish in a mean."""


DESIGNS: Mapping[str, Design] = {
    "compact": Design("compact"),
    "compact_maxpool": Design("compact", 256, 128),
    "lite0": Design("lite0", 256, 128),
    "lite0_means": Design("lite0", 192),
    **{name: Design(name) for name in ARCHITECTURES if name.startswith("resnet")},
}


class NetworkWithNeck(Network):
    """A body whose map a 1x1 convolution mixes."""

    def __init__(self, body: Network, size: int, peaks: int) -> None:
        super().__init__()
        self.size, self.stride, self.peaks = size, body.stride, peaks
        self.mean, self.deviation = body.mean, body.deviation
        self.body = body
        self.neck = nn.Conv2d(body.size, size, 1, bias=False)
        self.norm = nn.BatchNorm2d(size)

    def feature_map(self, images: Tensor) -> Tensor:
        return F.relu(self.norm(self.neck(self.body.feature_map(images))))


def build(name: str) -> Network:
    """The network `name` with random weights."""
    design = DESIGNS[name]
    body = LiteBody() if design.body == "lite0" else ResNet(ARCHITECTURES[design.body])
    return NetworkWithNeck(body, design.neck, design.peaks) if design.neck else body


def body_of(network: Network) -> Network:
    """The network without its neck."""
    return network.body if isinstance(network, NetworkWithNeck) else network


def load_imagenet(network: Network) -> None:
    """Load ImageNet weights into the body of 'lite0' or 'lite0_means'.

    Raises:
      ValueError: no other network's weights come in a package.
      UnableError: the package is not installed.
    """
    body = body_of(network)
    if not isinstance(body, LiteBody):
        raise ValueError(f"ImageNet weights come in a package for {IMAGENET} only; use one of these networks")
    body.load_state_dict(imagenet_weights())

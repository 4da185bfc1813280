"""Residual networks (He et al. 2016) whose parameters carry torchvision's names.

ImageNet weights that somebody has on disk (`resnet18-....pth` to `resnet152-....pth`, version 1 or
2) therefore load unchanged. The compact network that ships with this repository is the same class
with narrower stages, one block each, and without the last halving of resolution.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

MEAN, DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Of ImageNet's RGB in [0, 1]; what torchvision's weights expect."""


@dataclass(frozen=True)
class Architecture:
    """Sizes that tell one residual network from another."""

    block: str
    """'basic' (two 3x3 convolutions) or 'bottleneck' (1x1, 3x3, 1x1, four times as wide at the end)."""
    counts: tuple[int, int, int, int]
    """Blocks in each stage."""
    widths: tuple[int, int, int, int] = (64, 128, 256, 512)
    stem: int = 64
    """Channels of the first convolution."""
    strides: tuple[int, int, int, int] = (1, 2, 2, 2)

    @property
    def size(self) -> int:
        """D, channels of the last feature map."""
        return self.widths[-1] * EXPANSION[self.block]

    @property
    def stride(self) -> int:
        """Pixels per cell of the last feature map."""
        return 4 * self.strides[0] * self.strides[1] * self.strides[2] * self.strides[3]


EXPANSION = {"basic": 1, "bottleneck": 4}
COMPACT = "compact"
"""The network that is trained here: its stride is a cell of the strip."""
ARCHITECTURES: dict[str, Architecture] = {
    COMPACT: Architecture("basic", (1, 1, 1, 1), (32, 64, 128, 192), 32, (1, 2, 2, 1)),
    "resnet18": Architecture("basic", (2, 2, 2, 2)),
    "resnet34": Architecture("basic", (3, 4, 6, 3)),
    "resnet50": Architecture("bottleneck", (3, 4, 6, 3)),
    "resnet101": Architecture("bottleneck", (3, 4, 23, 3)),
    "resnet152": Architecture("bottleneck", (3, 8, 36, 3)),
}


class BasicBlock(nn.Module):
    def __init__(self, inputs: int, width: int, stride: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, width, 3, stride, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        self.conv2 = nn.Conv2d(width, width, 3, 1, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(width)
        self.downsample = _downsample(inputs, width, stride)

    def forward(self, x: Tensor) -> Tensor:
        y = F.relu(self.bn1(self.conv1(x)))
        y = self.bn2(self.conv2(y))
        return F.relu(y + (x if self.downsample is None else self.downsample(x)))


class Bottleneck(nn.Module):
    """The stride sits in the 3x3 convolution, as in torchvision ("ResNet v1.5")."""

    def __init__(self, inputs: int, width: int, stride: int) -> None:
        super().__init__()
        outputs = width * EXPANSION["bottleneck"]
        self.conv1 = nn.Conv2d(inputs, width, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        self.conv2 = nn.Conv2d(width, width, 3, stride, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(width)
        self.conv3 = nn.Conv2d(width, outputs, 1, bias=False)
        self.bn3 = nn.BatchNorm2d(outputs)
        self.downsample = _downsample(inputs, outputs, stride)

    def forward(self, x: Tensor) -> Tensor:
        y = F.relu(self.bn1(self.conv1(x)))
        y = F.relu(self.bn2(self.conv2(y)))
        y = self.bn3(self.conv3(y))
        return F.relu(y + (x if self.downsample is None else self.downsample(x)))


def _downsample(inputs: int, outputs: int, stride: int) -> nn.Module | None:
    if stride == 1 and inputs == outputs:
        return None
    return nn.Sequential(nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs))


class ResNet(nn.Module):
    """Images to a feature map."""

    size: int
    """D, channels of the map."""
    stride: int
    """Pixels per cell of the map."""
    channels: tuple[int, int, int]
    """Of the last three stages."""
    peaks = 0
    """So many of the last channels are the largest values of a view; the others are means."""

    def __init__(self, architecture: Architecture) -> None:
        super().__init__()
        a = architecture
        self.size, self.stride = a.size, a.stride
        second, third, fourth = (width * EXPANSION[a.block] for width in a.widths[1:])
        self.channels = (second, third, fourth)
        block = {"basic": BasicBlock, "bottleneck": Bottleneck}[a.block]
        self.conv1 = nn.Conv2d(3, a.stem, 7, 2, 3, bias=False)
        self.bn1 = nn.BatchNorm2d(a.stem)
        inputs = a.stem
        for i, (count, width, stride) in enumerate(zip(a.counts, a.widths, a.strides, strict=True), 1):
            blocks = []
            for j in range(count):
                blocks.append(block(inputs, width, stride if j == 0 else 1))
                inputs = width * EXPANSION[a.block]
            setattr(self, f"layer{i}", nn.Sequential(*blocks))
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")

    def feature_map(self, images: Tensor) -> Tensor:
        """(n, 3, H, W) normalised images -> (n, D, H / stride, W / stride)."""
        return self.pyramid(images)[-1]

    def pyramid(self, images: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """(n, 3, H, W) normalised images -> the maps of the last three stages."""
        maps = [F.max_pool2d(F.relu(self.bn1(self.conv1(images))), 3, 2, 1)]
        for stage in (1, 2, 3, 4):
            maps.append(getattr(self, f"layer{stage}")(maps[-1]))
        _, _, second, third, last = maps
        return second, third, last

    def normalise(self, images: Tensor) -> Tensor:
        """(n, H, W, 3) uint8 RGB -> (n, 3, H, W) float32, as the weights expect, in memory pixel by pixel."""
        mean, deviation = (torch.tensor(x, device=images.device).view(1, 3, 1, 1) for x in (MEAN, DEVIATION))
        return (images.permute(0, 3, 1, 2).float() / 255 - mean) / deviation


def load_torchvision(name: str, weights: Mapping[str, Tensor]) -> ResNet:
    """The network `name` ('resnet18' to 'resnet152') with a state dict of torchvision's layout; `fc` is dropped.

    Raises:
      ValueError: unknown network, or weights of another one.
    """
    if name not in ARCHITECTURES:
        raise ValueError(f"unknown network {name!r}; known are {sorted(ARCHITECTURES)}")
    network = ResNet(ARCHITECTURES[name])
    body = {k: v for k, v in weights.items() if not k.startswith("fc.")}
    try:
        network.load_state_dict(body)
    except RuntimeError as e:
        what = " ".join(str(e).split())
        raise ValueError(f"these are not the weights of {name} ({what:.200}); name the network they belong to") from e
    return network.eval()

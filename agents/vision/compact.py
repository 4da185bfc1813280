"""The compact network: a residual network (He et al. 2016) of one block in each of four stages."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

COMPACT = "compact"
STAGE_WIDTHS, STAGE_STRIDES = (32, 64, 128, 192), (1, 2, 2, 1)
"""Of the stages: channels, and by how much they halve the resolution."""
MEAN, DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Of ImageNet's RGB in [0, 1]."""


class ResidualBlock(nn.Module):
    def __init__(self, inputs: int, width: int, stride: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, width, 3, stride, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        self.conv2 = nn.Conv2d(width, width, 3, 1, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(width)
        self.downsample = None
        if stride > 1 or inputs != width:
            self.downsample = nn.Sequential(nn.Conv2d(inputs, width, 1, stride, bias=False), nn.BatchNorm2d(width))

    def forward(self, x: Tensor) -> Tensor:
        y = F.relu(self.bn1(self.conv1(x)))
        y = self.bn2(self.conv2(y))
        return F.relu(y + (x if self.downsample is None else self.downsample(x)))


class Compact(nn.Module):
    """Images to a feature map."""

    stride, peaks = 16, 0
    """Pixels per cell of the map; how many of its last channels are the largest values of a view, not means."""

    def __init__(self) -> None:
        super().__init__()
        self.channels = STAGE_WIDTHS[1], STAGE_WIDTHS[2], STAGE_WIDTHS[3]
        self.size, inputs = STAGE_WIDTHS[-1], STAGE_WIDTHS[0]
        self.conv1 = nn.Conv2d(3, inputs, 7, 2, 3, bias=False)
        self.bn1 = nn.BatchNorm2d(inputs)
        for i, (width, stride) in enumerate(zip(STAGE_WIDTHS, STAGE_STRIDES, strict=True), 1):
            setattr(self, f"layer{i}", nn.Sequential(ResidualBlock(inputs, width, stride)))
            inputs = width
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")

    def feature_map(self, images: Tensor) -> Tensor:
        """(n, 3, H, W) normalised images -> (n, D, H / 16, W / 16)."""
        return self.pyramid(images)[-1]

    def pyramid(self, images: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """(n, 3, H, W) normalised images -> the maps of the last three stages, with `channels`."""
        maps = [F.max_pool2d(F.relu(self.bn1(self.conv1(images))), 3, 2, 1)]
        for stage in (1, 2, 3, 4):
            maps.append(getattr(self, f"layer{stage}")(maps[-1]))
        _, _, second, third, last = maps
        return second, third, last

    def normalise(self, images: Tensor) -> Tensor:
        """(n, H, W, 3) uint8 RGB -> (n, 3, H, W) float32, as the weights expect, in memory pixel by pixel."""
        mean, deviation = (torch.tensor(x, device=images.device).view(1, 3, 1, 1) for x in (MEAN, DEVIATION))
        return (images.permute(0, 3, 1, 2).float() / 255 - mean) / deviation

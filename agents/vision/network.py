"""Network: what an encoder needs of a network that turns pictures into a map of features."""

from __future__ import annotations

import torch
from torch import Tensor, nn

MEAN, DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Of ImageNet's RGB in [0, 1]; what torchvision's weights expect."""


class Network(nn.Module):
    """Pictures to a map of features."""

    size: int
    """D, channels of the map."""
    stride: int
    """Pixels per cell of the map."""
    peaks: int = 0
    """So many of the last channels are the largest of what a view shows; the others are means."""
    mean: tuple[float, float, float] = MEAN
    deviation: tuple[float, float, float] = DEVIATION
    """Of RGB in [0, 1], gone before the network looks."""

    def feature_map(self, images: Tensor) -> Tensor:
        """(n, 3, H, W) normalised images -> (n, D, H / stride, W / stride)."""
        raise NotImplementedError

    def features(self, images: Tensor) -> Tensor:
        """(n, 3, H, W) -> (n, D), of pictures looked at alone: what VLN calls ResNet features."""
        maps = self.feature_map(images)
        return torch.cat(
            [maps[:, : self.size - self.peaks].mean((2, 3)), maps[:, self.size - self.peaks :].amax((2, 3))], 1
        )

    def normalise(self, images: Tensor) -> Tensor:
        """(n, H, W, 3) uint8 RGB -> (n, 3, H, W) float32, as the weights expect, in memory pixel by pixel."""
        mean = torch.tensor(self.mean, device=images.device).view(1, 3, 1, 1)
        deviation = torch.tensor(self.deviation, device=images.device).view(1, 3, 1, 1)
        return (images.permute(0, 3, 1, 2).float() / 255 - mean) / deviation

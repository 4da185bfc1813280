"""Sight of the execution policy: features of the panorama where words of d^s are missing (docs/sources.md, S130)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from agents.vision.bank import FeatureBank
from agents.vision.config import drawing
from agents.vision.drawn import pictures_of
from agents.vision.features import feature_path, load_bank
from embodied.datasets.store import Dataset
from embodied.interface import TURNS, VIEWS, Place
from embodied.render.pictures import PictureSettings

TILTS = VIEWS // TURNS
"""Views of one heading: below, level, above."""


@dataclass(frozen=True)
class FeatureSpec:
    """Whose features a policy learned from."""

    size: int
    """D, of one view."""
    encoder: str
    """Digest of the encoder."""
    pictures: str = ""
    """How the pictures were drawn that it saw in training: 'fast_192'."""


class Headings(nn.Module):
    """A panorama as rows that stand beside those of words, and as what is seen along each move."""

    def __init__(self, size: int, hidden: int) -> None:
        """
        Args:
          size: D.
          hidden: h.
        """
        super().__init__()
        self.row = nn.Linear(TILTS * size, hidden)
        self.along = nn.Linear(size, hidden, bias=False)
        for layer in (self.row, self.along):  # as long as the embeddings of words; features are whitened
            nn.init.normal_(layer.weight, std=(hidden * layer.in_features) ** -0.5)
        nn.init.normal_(self.row.bias, std=hidden**-0.5)

    def rows(self, views: Tensor, horizontal: nn.Embedding) -> Tensor:
        """(B, 36, D) -> (B, 12, h): one row per heading, with the embedding that words have for its direction.

        Directions are absolute in both, so that "mug to the north" and what is seen in the north are near each other.
        """
        stacked = views.unflatten(1, (TILTS, TURNS)).transpose(1, 2).flatten(2)  # (B, 12, 3 D)
        headings = torch.arange(1, TURNS + 1, device=views.device)
        return self.row(stacked) + horizontal(headings)

    def moves(self, views: Tensor, which: Tensor) -> Tensor:
        """(B, C + 1, h) of the views that moves lead into.

        Args:
          views: (B, 36, D).
          which: (B, C + 1) int64, 1 + view, or 0 for stopping and padding, of which nothing is seen.
        """
        index = (which - 1).clamp(min=0)[..., None].expand(-1, -1, views.shape[-1])
        return self.along(views.gather(1, index) * (which > 0)[..., None])


def hidden_channels(size: int, share: float, rng: np.random.Generator) -> np.ndarray:
    """(D,) float32 that hides a share of the channels for a whole episode (Tan et al. 2019) and makes up for it."""
    return ((rng.random(size) >= share) / (1 - share)).astype(np.float32)


def eyes_of(
    data: Dataset, encoder: str, *, splits: Sequence[str] = (), picture_kind: str | None = None
) -> tuple[FeatureBank, FeatureSpec]:
    """The features of the houses of some splits (none: of all), and what to call them.

    Args:
      encoder: digest.
      picture_kind: of the pictures that they were made from, as in agents.vision.run.pictures_of.

    Raises:
      FileNotFoundError, ValueError: there are none, or not of these houses; says how to make them.
    """
    names = sorted({n for split in splits or data.splits for n in data.names(split)})
    pictures: Mapping[str, PictureSettings] = {n: pictures_of(data, n, picture_kind) for n in names}
    places: Mapping[str, Place] = {n: data.place(n) for n in names}
    paths = {n: feature_path(data.folder / "features", encoder, n, pictures[n]) for n in names}
    bank = load_bank(paths, encoder, places, pictures)
    return bank, FeatureSpec(bank.size, encoder, ", ".join(sorted({drawing(p) for p in pictures.values()})))

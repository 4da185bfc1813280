"""From panoramas to the 36 x D features per node of appendix D.1, and their files; and FeatureBank: features of many
worlds in one tensor, by Sight, and of pictures that were taken at another time.

A feature file belongs to one house, one encoder and one way of drawing, and says so: `<folder>/<encoder digest, 16
letters>/<drawing>/<house>.safetensors`. Row k of a node is view k of embodied.interface: turn
k % 12 (counter-clockwise from +x), tilt k // 12 - 1.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import torch

from embodied.agents.common.weights import load_tensors, save_tensors
from embodied.agents.vision.config import PLAIN, drawing
from embodied.agents.vision.encoder import HEIGHT, Encoder
from embodied.gym.semantic_features import SightRows
from embodied.interface import VIEWS, Sight, Viewpoint, is_picture, viewpoint
from embodied.render.panorama import Panorama
from embodied.render.pictures import PictureSettings

FEATURES_FORMAT = "embodied-features-2"
EQUIRECT = 288
"""Height of the equirect that the strip is cut from: 1.6 pixels per degree."""


def strip_of(panorama: Panorama) -> np.ndarray:
    """(192, 576, 3) uint8: what the 36 views see, in one picture (see vision.strip)."""
    return panorama.equirect(EQUIRECT)[margin()]


def margin() -> slice:
    """Rows of the equirect that belong to the strip."""
    above = (EQUIRECT - HEIGHT) // 2
    return slice(above, above + HEIGHT)


def encode_panoramas(encoder: Encoder, panoramas: Iterable[Panorama]) -> np.ndarray:
    """(n, 36, D) float16 features of panoramas, in order."""
    return encode_strips(encoder, map(strip_of, panoramas))


def encode_strips(encoder: Encoder, strips: Iterable[np.ndarray]) -> np.ndarray:
    """(n, 36, D) float16 features of strips, in order."""
    out, left = list[np.ndarray](), iter(strips)
    while group := list(itertools.islice(left, 8)):
        out.append(encoder.encode_strips(np.stack(group)))
    return np.concatenate(out).astype(np.float16)


def feature_path(folder: Path, digest: str, world: str, pictures: PictureSettings = PLAIN) -> Path:
    """The file in which the features of a world by an encoder, from pictures drawn so, are kept."""
    return Path(folder) / digest[:16] / drawing(pictures) / f"{world}.safetensors"


def save_features(
    path: Path, features: np.ndarray, encoder: Encoder, source: str, pictures: PictureSettings = PLAIN
) -> None:
    """Write (n, 36, D) features; `source` is the digest of what they were computed from (the house)."""
    about = {"format": FEATURES_FORMAT, "encoder": encoder.digest, "source": source, "drawing": drawing(pictures)}
    tensor = torch.from_numpy(np.ascontiguousarray(features, dtype=np.float16))
    save_tensors(Path(path), {"features": tensor}, about)


def load_features(path: Path, *, encoder: str, source: str, pictures: PictureSettings) -> np.ndarray:
    """(n, 36, D) float16 features by the encoder of a digest, of the house of a digest, from pictures drawn so.

    Raises:
      FileNotFoundError: there is no such file.
      ValueError: truncated, changed, of another format, encoder, house or way of drawing.
    """
    picture_kind = "" if pictures.word == PLAIN.word else f" --pictures {pictures.word}"
    remedy = f"make it with `embodied features{picture_kind}`"
    tensors, about = load_tensors(Path(path), FEATURES_FORMAT, remedy)
    for name, expected in {"encoder": encoder, "source": source, "drawing": drawing(pictures)}.items():
        if about[name] != expected:
            raise ValueError(f"{path}: made from {name} {about[name][:12]}, expected {expected[:12]}; {remedy}")
    return tensors["features"].numpy()


def has_features(path: Path, encoder: Encoder, source: str, pictures: PictureSettings) -> bool:
    """True if a file holds the features of the house with the digest `source`; False: missing or damaged."""
    try:
        load_features(path, encoder=encoder.digest, source=source, pictures=pictures)
        return True
    except (FileNotFoundError, ValueError):
        return False


class FeatureBank:
    """A FeatureSource over (36, D) feature sets that are already computed, as one tensor on a device."""

    def __init__(
        self, worlds: Mapping[str, np.ndarray], digest: str, live: Callable[[Sight], np.ndarray] | None = None
    ) -> None:
        """Args:
          worlds: world name -> (nodes, 36, D) features, float16 or float32.
          digest: of the encoder that agents must have learned from to be shown them.
          live: makes those (36, D) of a house with other doors closed, when they are first asked for.

        Raises:
          ValueError: another shape, or no world.
        """
        self._rows = SightRows(worlds)
        self._table = torch.from_numpy(self._rows.filled(worlds))
        self._shown: int | None = None
        self._live, self._other_doors = live, dict[Viewpoint, int]()
        self.size, self.digest = self._rows.size, digest

    def to(self, device: torch.device | str) -> FeatureBank:
        """The bank on another device; this one stays."""
        return self._with(_table=self._table.to(device))

    def with_goal_images(self, pictures: Mapping[str, np.ndarray]) -> FeatureBank:
        """The bank with other features for pictures (embodied.interface.is_picture): of the same worlds, taken at
        another time."""
        if SightRows(pictures).spans != self._rows.spans or SightRows(pictures).size != self._rows.size:
            raise ValueError("pictures must be of the same worlds, with as many nodes and features")
        table = torch.from_numpy(self._rows.filled(pictures)).to(self._table.device)
        return self._with(_table=torch.cat([self._table, table]), _shown=len(self._table))

    def blind(self) -> FeatureBank:
        """The bank in which everything is black: all features are zero."""
        nothing = np.zeros((VIEWS, self.size), np.float32)
        return self._with(_table=torch.zeros_like(self._table), _live=lambda sight: nothing, _other_doors={})

    def features(self, sight: Sight) -> np.ndarray:
        """(36, D) float32, in absolute order."""
        return self._table[self._row(sight)].cpu().numpy()

    def gather(self, sights: Sequence[Sight | None]) -> torch.Tensor:
        """(n, 36, D) features of several sights, zeros for None."""
        rows = torch.tensor([0 if s is None else self._row(s) for s in sights], device=self._table.device)
        known = torch.tensor([s is not None for s in sights], device=self._table.device)
        return self._table[rows] * known[:, None, None]

    def _with(self, **changed: object) -> FeatureBank:
        other = object.__new__(FeatureBank)
        other.__dict__.update(self.__dict__, **changed)
        return other

    def _row(self, sight: Sight) -> int:
        at = viewpoint(sight)
        if at.world not in self._rows.spans and self._live is not None:
            if at not in self._other_doors:
                self._other_doors[at] = len(self._table)
                made = torch.from_numpy(self._live(sight)).to(self._table)
                self._table = torch.cat([self._table, made[None]])
            return self._other_doors[at]
        row = self._rows.row(sight)
        if self._shown is not None and is_picture(sight):
            return row + self._shown
        return row

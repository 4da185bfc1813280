"""From panoramas to the 36 x D features per node of appendix D.1, and their files.

A feature file belongs to one house, one encoder and one way of drawing, and says so: `<folder>/<encoder digest, 16
letters>/<drawing>/<house>.safetensors`. Row k of a node is view k of embodied.interface: turn
k % 12 (counter-clockwise from +x), tilt k // 12 - 1.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import torch

from embodied.agents.common.weights import load_tensors, save_tensors
from embodied.agents.vision.config import PLAIN, drawing
from embodied.agents.vision.encoder import Encoder
from embodied.agents.vision.strip import HEIGHT
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

"""From panoramas to the 36 x D features per node of appendix D.1, and their files.

A feature file belongs to one house and one encoder, and says so: `<folder>/<encoder digest,
16 letters>/<house>.safetensors`. Row k of a node is view k of embodied.interface: turn k % 12
(counter-clockwise from +x), tilt k // 12 - 1.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np
import safetensors
import safetensors.torch
import torch

from agents.vision.bank import FeatureBank
from agents.vision.encoder import Encoder
from agents.vision.resnet import read_weights
from agents.vision.strip import HEIGHT, VFOV
from assets.cache import atomic_path
from embodied.interface import VIEW_PITCHES, VIEW_YAWS, VIEWS
from embodied.render.panorama import Panorama

FORMAT = "embodied-features-1"
EQUIRECT = 288
"""Height of the equirect that the strip is cut from: 1.6 pixels per degree."""
VIEW_SIZE = (240, 320)
"""Height and width of a view that is looked at alone; half of Matterport's 480 x 640."""


def strip_of(panorama: Panorama) -> np.ndarray:
    """(192, 576, 3) uint8: what the 36 views see, in one picture (see vision.strip)."""
    return panorama.equirect(EQUIRECT)[margin()]


def margin() -> slice:
    """Rows of the equirect that belong to the strip."""
    above = (EQUIRECT - HEIGHT) // 2
    return slice(above, above + HEIGHT)


def views_of(panorama: Panorama, size: tuple[int, int] = VIEW_SIZE) -> np.ndarray:
    """(36, h, w, 3) uint8: the perspective views, 60 degrees high, in the order of embodied.interface."""
    return np.stack(
        [panorama.view_rgb(yaw, pitch, VFOV, size) for yaw, pitch in zip(VIEW_YAWS, VIEW_PITCHES, strict=True)]
    )


def encode_panoramas(encoder: Encoder, panoramas: Iterable[Panorama], batch: int = 8) -> np.ndarray:
    """(n, 36, D) float16 features of panoramas, in order, as the encoder wants to look at them."""
    prepare, encode = (
        (strip_of, encoder.encode_strips) if encoder.sharing == "strip" else (views_of, encoder.encode_views)
    )
    out = [encode(np.stack(group)) for group in _groups((prepare(p) for p in panoramas), batch)]
    return np.concatenate(out).astype(np.float16)


def _groups(pictures: Iterator[np.ndarray], batch: int) -> Iterator[list[np.ndarray]]:
    group: list[np.ndarray] = []
    for picture in pictures:
        group.append(picture)
        if len(group) == batch:
            yield group
            group = []
    if group:
        yield group


def feature_path(folder: Path, digest: str, world: str) -> Path:
    """Where the features of a world by an encoder are kept."""
    return Path(folder) / digest[:16] / f"{world}.safetensors"


def save_features(path: Path, features: np.ndarray, encoder: Encoder, source: str) -> None:
    """Write (n, 36, D) features; `source` is the digest of what they were computed from (the house)."""
    about = {"format": FORMAT, "encoder": encoder.digest, "source": source}
    with atomic_path(Path(path)) as temporary:
        tensor = torch.from_numpy(np.ascontiguousarray(features, dtype=np.float16))
        safetensors.torch.save_file({"features": tensor}, temporary, metadata=about)


def load_features(path: Path, *, encoder: str | None = None, source: str | None = None) -> tuple[np.ndarray, str]:
    """(n, 36, D) float16 features and the digest of their encoder.

    Args:
      encoder, source: the digests that are expected, if any.

    Raises:
      FileNotFoundError: there is no such file.
      ValueError: truncated, of another format, another encoder or another house.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist; make it with `embodied features`")
    features = read_weights(path).get("features")
    with safetensors.safe_open(path, "pt") as f:
        about = f.metadata() or {}
    if about.get("format") != FORMAT or features is None or features.dim() != 3 or features.shape[1] != VIEWS:
        raise ValueError(f"{path}: not a feature file of format {FORMAT!r}; make it again with `embodied features`")
    for name, expected in (("encoder", encoder), ("source", source)):
        if expected is not None and about[name] != expected:
            raise ValueError(
                f"{path}: made from {name} {about[name][:12]}, expected {expected[:12]}; "
                "make features again with `embodied features`"
            )
    return features.numpy(), about["encoder"]


def load_bank(paths: Mapping[str, Path], encoder: str | None = None) -> FeatureBank:
    """The features of several worlds (name -> file); all must come from one encoder."""
    worlds, digests = {}, set()
    for name in sorted(paths):
        worlds[name], digest = load_features(paths[name], encoder=encoder)
        digests.add(digest)
    if len(digests) > 1:
        raise ValueError(
            f"features come from the encoders {sorted(d[:12] for d in digests)}; make them all with one encoder"
        )
    return FeatureBank(worlds, digests.pop())

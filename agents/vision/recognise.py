"""What the encoder recognises in a panorama, by the heads that it was trained with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn

from agents.common.shipped import SHIPPED_HEADS
from agents.common.tensor_file import load_into
from agents.common.weights import half_precision, load_weights, save_weights
from agents.vision.encoder import Encoder, strip_map
from agents.vision.features import strip_of
from agents.vision.labels import SHELL
from agents.vision.strip import COLUMNS, cell_direction
from assets.records import ROOM_KINDS
from embodied.identity import Identity
from embodied.render.panorama import Panorama, Recognised


class Heads(nn.Module):
    """Linear readers of the feature map (cells) and of the pooled features (views)."""

    def __init__(self, size: int, classes: int) -> None:
        super().__init__()
        self.cell_objects = nn.Conv2d(size, classes, 1)
        self.cell_room = nn.Conv2d(size, len(ROOM_KINDS), 1)
        self.cell_depth = nn.Conv2d(size, 1, 1)
        self.view_objects = nn.Linear(size, classes)
        self.view_room = nn.Linear(size, len(ROOM_KINDS))


@dataclass(frozen=True)
class HeadsAbout:
    """What stands beside the weights of heads."""

    encoder: str
    """Digest of their encoder."""
    size: int
    """D of its feature map."""
    classes: tuple[str, ...]


def save_heads(
    heads: Heads, encoder: Encoder, classes: Sequence[str], path: Path, identity: Identity | None = None
) -> None:
    """Write half-precision weights, the names of the classes and what they were trained with, atomically."""
    about = HeadsAbout(encoder.digest, encoder.size, tuple(classes))
    save_weights(path, "heads", half_precision(heads), about, identity)


@dataclass(frozen=True, eq=False)
class Recogniser:
    """Names things in panoramas, but not walls, floors and ceilings, and where they are, to a cell of 10 degrees.

    Examples:
      >>> recogniser = Recogniser.load(load_encoder())
      >>> recogniser(world.panorama(0))[0].name
      'sofa'
    """

    encoder: Encoder
    heads: Heads
    classes: tuple[str, ...]
    least: float = 0.3
    """Probability from which on a cell shows a class."""

    @classmethod
    def load(cls, encoder: Encoder, path: Path = SHIPPED_HEADS) -> Recogniser:
        """The heads in a file, for their encoder.

        Raises:
          FileNotFoundError, OSError.
          ValueError: damaged, of another format, or of another encoder.
        """
        tensors, about = load_weights(path, "heads", HeadsAbout, "train the encoder again with `embodied train vision`")
        if about.encoder != encoder.digest:
            raise ValueError(
                f"{path}: heads of encoder {about.encoder[:12]}, not of {encoder.digest[:12]}; name those that were "
                "trained with this encoder"
            )
        heads = Heads(about.size, len(about.classes))
        load_into(heads, {k: v.float() for k, v in tensors.items()}, path)
        return cls(encoder, heads.eval(), about.classes)

    @torch.no_grad()
    def __call__(self, panorama: Panorama, most: int = 8) -> list[Recognised]:
        """The `most` surest classes in a panorama, the surest first, each where it is seen best."""
        strip = torch.from_numpy(strip_of(panorama)[None])
        maps = strip_map(self.encoder.network, strip)
        likely: Tensor = self.heads.cell_objects(maps)[0].sigmoid().flatten(1)  # (C, 12 * 36)
        best, cells = likely.max(1)
        found: list[Recognised] = []
        for k in best.argsort(descending=True).tolist():
            if best[k] < self.least or len(found) == most:
                break
            if self.classes[k] not in SHELL:
                direction = cell_direction(*divmod(int(cells[k]), COLUMNS))
                found.append(Recognised(self.classes[k], float(best[k]), *direction))
        return found

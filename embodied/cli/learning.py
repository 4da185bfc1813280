"""Options that the commands of learners share: `embodied features | train | evaluate | study`. Free of torch."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

from embodied.agents.common.shipped import SHIPPED_ENCODER
from embodied.agents.vision.config import CAPTURE_CONDITIONS, RENDER_PRESETS, TORCHVISIONS
from embodied.options import (
    PICTURE_HELP,
    Cached,
    Count,
    InputFolder,
    InputPath,
    Option,
    OutputFolder,
    any_path,
    positive,
)

PRESET = Option(words=tuple(RENDER_PRESETS), helps=PICTURE_HELP)
PRESETS = Option(words=tuple(RENDER_PRESETS), metavar="KIND")
GOAL_IMAGES = tuple(CAPTURE_CONDITIONS)


@dataclass(frozen=True, kw_only=True)
class Drawn:
    pictures: Annotated[str | None, PRESET] = None
    """How the encoded pictures are drawn; traced and reference of few rays (default: as the panoramas of
    the data set, else unlit)."""


@dataclass(frozen=True, kw_only=True)
class EncoderFile(Drawn):
    encoder: InputPath = SHIPPED_ENCODER
    """An encoder of `embodied train vision` (default: shipped)."""


@dataclass(frozen=True, kw_only=True)
class Encoded(EncoderFile):
    encoder: InputPath = SHIPPED_ENCODER
    """An encoder of `embodied train vision`, or torchvision weights with --network (default: shipped)."""
    network: Annotated[str | None, Option(words=(*TORCHVISIONS, "random"))] = None
    """The torchvision network of --encoder; 'random' for an untrained compact one."""

    def encoder_digest(self) -> str:
        """The digest of the encoder, which names its features."""
        from embodied.agents.vision.run import encoder_of

        return encoder_of(self.encoder, self.network).digest


@dataclass(frozen=True, kw_only=True)
class WithGoalImage:
    goal_image: Annotated[str, Option(words=GOAL_IMAGES)] = "same"
    """How the goal images of training differ from what the agent sees, as in `embodied features --goal-image`."""


@dataclass(frozen=True, kw_only=True)
class Threaded:
    threads: Count = 1
    """CPU threads of PyTorch."""


@dataclass(frozen=True, kw_only=True)
class WithDevice:
    device: str = "cpu"
    """'cpu' or 'cuda'."""


@dataclass(frozen=True, kw_only=True)
class WithData(Cached, Threaded):
    data: InputFolder
    """The data set, a folder that `embodied dataset` built."""


@dataclass(frozen=True, kw_only=True)
class Timed:
    minutes: Annotated[float | None, Option(positive, "X")] = None
    """Stop after X minutes; rerun the command to resume."""


SCALE = Option(words=("mini", "paper"))
SMALL_SCALE = Option(words=("mini", "paper", "tiny"))


@dataclass(frozen=True, kw_only=True)
class Run(WithData, Timed):
    out: OutputFolder
    """Run folder; rerun the command to resume an interrupted run."""
    scale: Annotated[str, SCALE] = "mini"
    """The settings to start from."""


@dataclass(frozen=True, kw_only=True)
class Nav(Cached, Encoded):
    data: InputFolder | None = None
    """NAV: the data set, a folder that `embodied dataset vln` or `hanna` built."""


class NamedFile(NamedTuple):
    name: str
    path: Path


def named_file(text: str) -> NamedFile:
    """NAME=FILE."""
    name, _, path = text.partition("=")
    if not name or not path:
        raise argparse.ArgumentTypeError(f"{text!r} should be NAME=FILE, as in unlit=RUN/best.safetensors")
    return NamedFile(name, any_path(path))


NamedFiles = tuple[Annotated[NamedFile, Option(named_file, "NAME=FILE")], ...]


def by_name(files: Sequence[NamedFile]) -> dict[str, list[Path]]:
    """The files of each name, in the order in which they were given."""
    files_by_name: dict[str, list[Path]] = {}
    for name, path in files:
        files_by_name.setdefault(name, []).append(path)
    return files_by_name

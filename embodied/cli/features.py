"""Compute features of a data set's panoramas: 36 x D per viewpoint, which learners read.

Houses that have features of this encoder are skipped. The encoder is the shipped one, one of `embodied train vision`,
or a torchvision network whose weights are on your disk.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from embodied.cli.common import note
from embodied.cli.learning import SHOWN, Encoded, Lit, WithData, WithDevice
from embodied.options import Count, Option


@dataclass(frozen=True, kw_only=True)
class Options(WithData, Encoded, Lit, WithDevice):
    threads: Count = 2
    workers: Count = 1
    """Process N houses in parallel."""
    split: tuple[Annotated[str, Option(metavar="SPLIT")], ...] = ()
    """Use the houses of these splits (default: all)."""
    houses: Count | None = None
    """Use the first N houses of each split (default: all)."""
    shown: tuple[Annotated[str, Option(words=SHOWN)], ...] = ()
    """Also make features of goal images that differ from what the agent sees there: camera: taken by a robot's camera;
    hour: at another hour; day: on another day, with people elsewhere and small things moved; later: at another hour of
    another day; -camera: also by a robot's camera; -view: that, and only one view of 60 degrees; same: identical."""
    ray: Annotated[str | None, Option(metavar="ADDRESS")] = None
    """Use a Ray cluster instead: its address, or 'local'."""


def run(args: Options) -> None:
    from embodied.agents.common.parallel import check_device
    from embodied.agents.vision.occasions import OCCASIONS
    from embodied.agents.vision.run import encoder_of, make_features

    check_device(args.device)
    make_features(
        args.data,
        encoder_of(args.encoder, args.network).to(args.device),
        args.cache,
        picture_kind=args.pictures,
        splits=args.split,
        first=args.houses,
        lights=args.lights,
        threads=args.threads,
        workers=args.workers,
        ray=args.ray,
        shown=[OCCASIONS[word] for word in args.shown],
        note=note,
    )

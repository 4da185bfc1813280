"""Turn the panoramas of a data set into the 36 x D features per node that learners read.

Houses that have features of this encoder are skipped. The encoder is the one that ships with the
repository, one of `embodied train vision`, or a torchvision network whose weights are on your disk.
"""

from __future__ import annotations

import argparse

from embodied.cli.common import note


def add(parser: argparse.ArgumentParser) -> None:
    from embodied.cli import learning

    learning.add_features(parser)


def run(args: argparse.Namespace) -> int:
    from agents.common.device import check_device
    from agents.vision.occasions import OCCASIONS
    from agents.vision.run import encoder_of, make_features

    check_device(args.device)
    encoder = encoder_of(args.encoder, args.network).to(args.device)
    make_features(
        args.data,
        encoder,
        args.cache,
        picture_kind=args.pictures,
        splits=args.split or (),
        first=args.houses,
        lights=args.lights,
        threads=args.threads,
        workers=args.workers,
        ray=args.ray,
        shown=[OCCASIONS[word] for word in args.shown],
        note=note,
    )
    return 0

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
    from agents.vision import run as vision

    return vision.run_features(args, note)

"""Compute features of a data set's panoramas: 36 x D per viewpoint, which learners read.

Houses that have features of this encoder are skipped. The encoder is the shipped one or of
`embodied train vision`.
"""

from dataclasses import dataclass
from typing import Annotated

from embodied.agents.options import Encoded, WithData, WithDevice
from embodied.agents.vision.config import GOAL_IMAGES, SAME_TIME
from embodied.cli.common import note
from embodied.options import Count, Option


@dataclass(frozen=True, kw_only=True)
class FeatureOptions(WithData, Encoded, WithDevice):
    threads: Count = 2
    workers: Count = 1
    """Process N houses in parallel."""
    split: tuple[Annotated[str, Option(metavar="SPLIT")], ...] = ()
    """Use the houses of these splits (default: all)."""
    goal_image: tuple[Annotated[str, Option(words=GOAL_IMAGES)], ...] = ()
    """Also make features of goal images that differ from what the agent sees there; later-camera: taken at another hour
    of another day, with people elsewhere and small things moved, by a robot's camera; same: identical."""


def run(args: FeatureOptions) -> None:
    from embodied.agents.common.tensors import check_device
    from embodied.agents.vision.encoder import load_encoder
    from embodied.agents.vision.run import Extractor, make_features
    from embodied.datasets.store import Dataset

    check_device(args.device)
    data, encoder = Dataset(args.data), load_encoder(args.encoder).to(args.device)
    goal_images = (SAME_TIME, *args.goal_image)
    extract = Extractor(data.folder.resolve(), encoder, args.cache, args.pictures, goal_images, args.threads)
    names = list(dict.fromkeys(name for split in args.split or data.splits for name in data.names(split)))
    make_features(extract, names, workers=args.workers, note=note)

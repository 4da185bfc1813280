"""The detector of objects on an encoder: `embodied train detector`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from embodied.agents.learner import Learner, register_learner
from embodied.agents.learners.vision import StripOptions
from embodied.agents.options import TRAINING, EncoderFile
from embodied.agents.vision.config import StripTraining
from embodied.options import Count, InputFolder, Option, Settings, part, whole

if TYPE_CHECKING:
    from embodied.agents.common.session import Note

DETECTOR = StripTraining(epochs=3, shade=0.3, weight_decay=0.02)


@dataclass(frozen=True, kw_only=True)
class DetectorTraining(StripOptions, EncoderFile):
    """A detector of objects on a frozen encoder.

    Renders the houses of a data set, trains a detector on the encoder's maps, and measures its average precision on
    validation houses.
    """

    threads: Count = 2
    workers: Count = 1
    """Render N houses in parallel."""
    lit_houses: Annotated[int, Option(whole(0), "N")] = 0
    """Also train on lit pictures of N of the training houses."""
    also: InputFolder | None = None
    """Another data set: also train on its training houses that are not in --data."""
    share: Annotated[float, Option(part, "X")] = 1.0
    """Share of the viewpoints of --also to draw, at regular intervals."""
    config: Annotated[StripTraining, Settings(TRAINING, DETECTOR)]


def train(args: DetectorTraining, *, note: Note) -> None:
    from embodied.agents.vision.drawn import StripSource
    from embodied.agents.vision.encoder import load_encoder
    from embodied.agents.vision.run import detector_for
    from embodied.datasets.store import Dataset

    source, also = args.source(), None
    if args.also:
        folder = source.folder / Dataset(args.also).digest[:12]  # houses of both have the same names
        also = StripSource(args.also, folder, args.cache, args.pictures, share=args.share)
    detector_for(
        load_encoder(args.encoder),
        source,
        args.config,
        args.out,
        lit=args.lit_houses,
        also=also,
        device=args.device,
        workers=args.workers,
        note=note,
    )


register_learner(Learner(name="detector", train=(DetectorTraining, train)))

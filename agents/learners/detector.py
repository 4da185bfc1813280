"""The detector of objects on an encoder: `embodied train detector`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from embodied.agents.learner import Learner, register_learner
from embodied.agents.learners.vision import StripTrainingOptions
from embodied.agents.options import TRAINING, Encoded
from embodied.agents.vision.config import StripTraining
from embodied.options import Settings

if TYPE_CHECKING:
    from embodied.agents.common.session import Note

DETECTOR = StripTraining(epochs=3, shade=0.3, weight_decay=0.02)


@dataclass(frozen=True, kw_only=True)
class DetectorTraining(StripTrainingOptions, Encoded):
    """A detector of objects on a frozen encoder.

    Renders the houses of a data set, trains a detector on the encoder's maps, and measures its average precision on
    validation houses.
    """

    config: Annotated[StripTraining, Settings(TRAINING, DETECTOR)]


def train(args: DetectorTraining, *, note: Note) -> None:
    from embodied.agents.vision.encoder import load_encoder
    from embodied.agents.vision.run import detector_for

    detector_for(load_encoder(args.encoder), args.source(), args.config, args.out, device=args.device, note=note)


register_learner(Learner(name="detector", train=(DetectorTraining, train)))

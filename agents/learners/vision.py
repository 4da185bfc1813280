"""The encoder: `embodied train vision`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from embodied.agents.learner import Learner, register_learner
from embodied.agents.options import TRAINING, Drawn, WithData, WithDevice
from embodied.agents.vision.config import VisionConfig
from embodied.options import Count, Option, OutputFolder, Settings, whole

if TYPE_CHECKING:
    from embodied.agents.common.session import Note
    from embodied.agents.vision.run import StripSource


@dataclass(frozen=True, kw_only=True)
class StripTrainingOptions(Drawn, WithDevice, WithData):
    out: OutputFolder
    """Folder for strips of views, weights and metrics."""
    strips: OutputFolder | None = None
    """Folder for strips of views, to share them between runs (default: OUT/strips)."""
    threads: Count = 2
    workers: Count = 1
    """Render N houses in parallel."""
    lit_houses: Annotated[int, Option(whole(0), "N")] = 0
    """Show N of the training houses in light (pictures 'fast')."""

    def source(self) -> StripSource:
        """The strips of the data set."""
        from embodied.agents.vision.run import StripSource

        folder = self.strips or self.out / "strips"
        return StripSource(self.data, folder, self.cache, self.pictures, self.lit_houses, self.workers)


@dataclass(frozen=True, kw_only=True)
class VisionTraining(StripTrainingOptions):
    """An encoder of panoramas, on renders of a data set's training houses.

    Renders the houses of a data set, trains an encoder to name and locate the objects in them, and measures on unseen
    houses how much linear readers of its features tell.
    """

    config: Annotated[VisionConfig, Settings(TRAINING, VisionConfig())]


def train(args: VisionTraining, *, note: Note) -> None:
    from embodied.agents.vision.run import train_vision

    train_vision(args.source(), args.config, args.out, device=args.device, note=note)


register_learner(Learner(name="vision", train=(VisionTraining, train)))

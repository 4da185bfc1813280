"""The encoder: `embodied train vision`, `embodied study vision`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from embodied.agents.learner import Learner, register_learner
from embodied.agents.options import (
    PRESETS,
    TRAINING,
    Drawn,
    NamedFiles,
    Repeated,
    Seeds,
    StudyOptions,
    WithData,
    WithDevice,
    by_name,
    study_of,
)
from embodied.agents.vision.config import VisionConfig
from embodied.options import Count, Option, OutputFolder, Settings, whole

if TYPE_CHECKING:
    from embodied.agents.common.session import Note
    from embodied.agents.studies.engine import StudyLearner
    from embodied.agents.vision.drawn import StripSource


@dataclass(frozen=True, kw_only=True)
class StripOptions(Drawn, WithDevice, WithData):
    out: OutputFolder
    """Folder for strips of views, weights and metrics."""
    strips: OutputFolder | None = None
    """Folder for strips of views, to share them between runs (default: OUT/strips)."""

    def source(self) -> StripSource:
        """The strips of the data set."""
        from embodied.agents.vision.drawn import StripSource

        return StripSource(self.data, self.strips or self.out / "strips", self.cache, self.pictures)


@dataclass(frozen=True, kw_only=True)
class VisionTraining(StripOptions):
    """An encoder of panoramas, on renders of a data set's training houses.

    Renders the houses of a data set, trains an encoder to name and locate the objects in them, and measures on unseen
    houses how well it does.
    """

    threads: Count = 2
    workers: Count = 1
    """Render N houses in parallel."""
    config: Annotated[VisionConfig, Settings(TRAINING, VisionConfig())]


@dataclass(frozen=True, kw_only=True)
class VisionStudyOptions(StudyOptions, Repeated, StripOptions):
    """Encoders that turn pictures into features."""

    seeds: Seeds = 1
    houses: Annotated[tuple[int, ...], Option(whole(1), "N")] = ()
    """Numbers of training houses to compare."""
    budget: Count = 0
    """Train every encoder on as many pictures as N houses have in all epochs; of more houses than N times --epochs,
    only some viewpoints are drawn (default: the largest of --houses)."""
    lit_houses: Count = 12
    """Light N houses for one more encoder and for the linear probes."""
    encoders: NamedFiles = ()
    """Evaluate these encoders, or detectors of the shipped encoder, too; files with one name count as training seeds of
    one encoder."""
    test_pictures: tuple[Annotated[str, PRESETS], ...] = ("unlit", "fast")
    """Kinds of pictures to evaluate on (default: unlit and fast)."""
    split: str = "val_unseen"
    """Evaluate on the houses of this split."""
    config: Annotated[VisionConfig, Settings(TRAINING, VisionConfig())]


def train(args: VisionTraining, *, note: Note) -> None:
    from embodied.agents.vision.run import train_vision

    train_vision(args.source(), args.config, args.out, device=args.device, workers=args.workers, note=note)


def study(args: VisionStudyOptions) -> StudyLearner:
    from embodied.agents.common.parallel import check_device
    from embodied.agents.vision.study import EncoderStudy

    check_device(args.device)
    more: dict[str, Any] = {"pictures": args.test_pictures, "ready": by_name(args.encoders)}
    return study_of(EncoderStudy, args, source=args.source(), **more)


register_learner(Learner(name="vision", train=(VisionTraining, train), study=(VisionStudyOptions, study)))

"""Options that the commands of learners share: `embodied features | train | evaluate | study`. Free of torch."""

from __future__ import annotations

import dataclasses
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from embodied import options
from embodied.agents.common.settings import SHIPPED_ENCODER
from embodied.agents.vision.config import RENDER_PRESETS

if TYPE_CHECKING:
    from embodied.agents.vision.sighted_study import TrainingData

PRESET = options.Option(words=tuple(RENDER_PRESETS), helps=options.PICTURE_HELP)


@dataclass(frozen=True, kw_only=True)
class Drawn:
    pictures: Annotated[str | None, PRESET] = None
    """How the encoded pictures are drawn; traced and reference with few rays (default: as the panoramas of
    the data set, else unlit)."""


@dataclass(frozen=True, kw_only=True)
class Encoded(Drawn):
    encoder: options.InputPath = SHIPPED_ENCODER
    """An encoder of `embodied train vision` (default: shipped)."""


@dataclass(frozen=True, kw_only=True)
class Threaded:
    threads: options.Count = 1
    """CPU threads of PyTorch."""


@dataclass(frozen=True, kw_only=True)
class WithDevice:
    device: str = "cpu"
    """'cpu' or 'cuda'."""


@dataclass(frozen=True, kw_only=True)
class WithData(options.Cached, Threaded):
    data: options.InputFolder
    """The data set, a folder that `embodied dataset` built."""


@dataclass(frozen=True, kw_only=True)
class Timed:
    minutes: Annotated[float | None, options.Option(options.positive, "X")] = None
    """Stop after X minutes; rerun the command to resume."""


TRAINING, EVALUATION = "settings of training", "settings of evaluation"
"""Titles of groups of options."""
SCALE = options.Option(words=("mini", "paper"))


@dataclass(frozen=True, kw_only=True)
class Scaled:
    scale: Annotated[str, SCALE] = "mini"
    """The settings to start from."""


@dataclass(frozen=True, kw_only=True)
class ScaledDown(Scaled):
    scale: Annotated[str, options.Option(words=("mini", "paper", "tiny"))] = "mini"
    """The settings to start from."""


@dataclass(frozen=True, kw_only=True)
class Run(WithData, Timed, Scaled):
    out: options.OutputFolder
    """Run folder; rerun the command to resume an interrupted run."""


@dataclass(frozen=True, kw_only=True)
class Nav(options.Cached, Encoded):
    data: options.InputFolder
    """The data set, a folder that `embodied dataset vln` or `hanna` built."""


@dataclass(frozen=True, kw_only=True)
class Recorded:
    rrd: bool = False
    """Record two validation episodes at each validation, into the run folder."""


@dataclass(frozen=True, kw_only=True)
class SightedRun(Recorded, Run, Encoded, WithDevice):
    """Options of agents that see features and learn by imitation."""


def training_data(args: Any, kind: str, device: str = "cpu") -> TrainingData:
    """Training data by options of WithData and Encoded.

    Raises:
      DatasetError: a data set of another kind.
      UnableError: there is no such device.
    """
    from embodied.agents.common.tensors import check_device
    from embodied.agents.vision.encoder import load_encoder
    from embodied.agents.vision.sighted_study import TrainingData
    from embodied.datasets.store import dataset_of

    check_device(device)
    data, encoder = dataset_of(args.data, kind), load_encoder(args.encoder)
    return TrainingData(data, encoder, args.pictures, device, cache=args.cache)


def training(function: str, kind: str) -> Callable[..., None]:
    """`embodied train` of agents that see features: by `module:function`, on a data set of a kind of task."""

    def train(args: Any, **session: Any) -> None:
        source = training_data(args, kind, args.device)
        how = {"minutes": args.minutes, **session}
        pkgutil.resolve_name(function)(source, args.config, args.evaluation, args.out, **how)

    return train


Tables = Annotated[tuple[str, ...], options.Option(metavar="TABLE", name="TABLE")]
Seeds = Annotated[int, options.Option(options.whole(1, options.REPEATS), "N")]


@dataclass(frozen=True, kw_only=True)
class StudyOptions(Threaded):
    """Options of every study."""

    out: options.OutputFolder
    """Folder of the study: runs, episodes and tables; rerun the command to resume."""
    rows: tuple[Annotated[str, options.Option(metavar="LABEL")], ...] = ()
    """Run only the rows with these labels."""
    workers: options.Count = 1
    """Train N runs in parallel."""
    report: bool = False
    """Train and evaluate nothing; write tables of the stored results."""


@dataclass(frozen=True, kw_only=True)
class Repeated:
    seeds: Seeds = 3
    """Train every row with N random seeds, from --seed on."""


@dataclass(frozen=True, kw_only=True)
class EpisodeStudyOptions(StudyOptions, Repeated, WithData, Scaled):
    """Options of studies whose agents play episodes."""

    tasks: options.Count | None = None
    """Evaluate on at most N tasks of a split, spread over its houses (default: all)."""


def study_by(name: str) -> Callable[[Any], Any]:
    """`embodied study` by `module:Class`: see `study_of`."""
    return lambda args: study_of(pkgutil.resolve_name(name), args)


def study_of(kind: Any, args: Any, **more: Any) -> Any:
    """A study: its fields are the options of the same names, but for `more`."""
    named = {f.name: getattr(args, f.name) for f in dataclasses.fields(kind) if hasattr(args, f.name)}
    seed = named["config"].seed
    return kind(**{"repeats": tuple(range(seed, seed + args.seeds)), **named, **more})

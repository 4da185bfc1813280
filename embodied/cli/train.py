"""Train the encoder, its detector, an agent (hanna, vnla, vln, hari), or the ILIAD student.

Rerun an interrupted command to resume; the result is the same. `tensorboard --logdir DIR` shows the curves. On several
GPUs run `torchrun --nproc-per-node N --no-python embodied train hanna --device cuda ...`, and on several cores the same
without --device.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from embodied.agents.common.settings import EvaluationSettings
from embodied.agents.hanna.training_config import EVALUATIONS, SCALES, HannaEvaluation, TrainingConfig
from embodied.agents.hari.config import EXECUTION_SCALES, INTENTION_SCALES, ExecutionConfig, IntentionConfig
from embodied.agents.iliad.config import LearnerConfig
from embodied.agents.iliad.nav.config import NAV_LEARNER_SCALES, NAV_SCALES, NavConfig
from embodied.agents.iliad.regex.config import LEARNER_SCALES, REGEX_SCALES, RegexConfig
from embodied.agents.vision.config import StripTraining, VisionConfig
from embodied.agents.vln.config import FORCING, SPEAKER_SCALES, FollowerSettings, SpeakerSettings
from embodied.agents.vln.config import SCALES as VLN_SCALES
from embodied.agents.vnla.config import ASK_RULES, ASKERS, TRAINED_UNDER, VnlaSettings
from embodied.agents.vnla.config import SCALES as VNLA_SCALES
from embodied.cli.common import note
from embodied.cli.learning import (
    SCALE,
    SMALL_SCALE,
    Drawn,
    Encoded,
    EncoderFile,
    Nav,
    Run,
    Threaded,
    Timed,
    WithData,
    WithDevice,
    WithGoalImage,
)
from embodied.options import Count, InputFolder, InputPath, Option, OutputFolder, Settings, part, whole

if TYPE_CHECKING:
    from embodied.agents.vision.lessons import Lessons
    from embodied.interface import Episode

WATCHED = 2
"""Validation episodes that --rrd records each time."""
TRAINING, EVALUATION = "settings of training", "settings of evaluation"
DETECTOR = StripTraining(epochs=3, shade=0.3, weight_decay=0.02)
VNLA_WORDS = {"asker": ASKERS, "ask_rules": tuple(ASK_RULES), "rules": tuple(TRAINED_UNDER)}


@dataclass(frozen=True, kw_only=True)
class Strips(Drawn, WithDevice):
    strips: OutputFolder | None = None
    """Folder for strips of views, to share them between runs (default: OUT/strips)."""


@dataclass(frozen=True, kw_only=True)
class TrainVision(Strips, WithData):
    """The encoder, on renders of a data set's training houses.

    Renders the houses of a data set, trains an encoder to name and locate the objects in them, and measures on unseen
    houses how well it does.
    """

    out: OutputFolder
    """Folder for strips of views, weights and metrics."""
    threads: Count = 2
    workers: Count = 1
    """Render N houses in parallel."""
    config: Annotated[VisionConfig, Settings(TRAINING, VisionConfig())]


@dataclass(frozen=True, kw_only=True)
class TrainDetector(Strips, WithData, EncoderFile):
    """A detector of objects, on an encoder that stays as it is.

    Renders the houses of a data set, trains a detector on the encoder's maps, and measures its average precision on
    validation houses.
    """

    out: OutputFolder
    """Folder for strips of views, weights and metrics."""
    threads: Count = 2
    workers: Count = 1
    """Render N houses in parallel."""
    lit_houses: Annotated[int, Option(whole(0), "N")] = 0
    """N of the training houses are seen in light, too."""
    also: InputFolder | None = None
    """Another data set: its training houses that are not in --data are seen, too."""
    share: Annotated[float, Option(part, "X")] = 1.0
    """Share of the viewpoints of --also that is drawn, in regular steps."""
    config: Annotated[StripTraining, Settings(TRAINING, DETECTOR)]


@dataclass(frozen=True, kw_only=True)
class Recorded:
    rrd: bool = False
    """Record two validation episodes at each validation, into the run folder."""


@dataclass(frozen=True, kw_only=True)
class TrainHanna(Recorded, Run, Encoded, WithDevice, WithGoalImage):
    """The agent, on a HANNA data set with features.

    Trains an agent by imitation to navigate, to ask for help and to follow it, on data of `embodied features`.
    """

    threads: Count = 2
    begin: InputPath | None = None
    """Initialise with the weights of this agent."""
    config: Annotated[TrainingConfig, Settings(TRAINING, SCALES)]
    evaluation: Annotated[HannaEvaluation, Settings(EVALUATION, EVALUATIONS)]


@dataclass(frozen=True, kw_only=True)
class TrainVnla(Recorded, Run, Encoded, WithDevice):
    """The agent that asks an advisor, on a VNLA data set with features.

    Trains an agent by imitation to navigate by one view, to ask an advisor within a budget and to follow the advice.
    """

    threads: Count = 2
    config: Annotated[VnlaSettings, Settings(TRAINING, VNLA_SCALES, words=VNLA_WORDS)]
    evaluation: Annotated[EvaluationSettings, Settings(EVALUATION, EvaluationSettings())]


@dataclass(frozen=True, kw_only=True)
class TrainFollower(Recorded, Run, Encoded, WithDevice):
    """An agent that follows route instructions, on a VLN or HANNA data set with features (imitation)."""

    speaker: InputPath | None = None
    """For --spoken-share: a file of `embodied train vln speaker`."""
    config: Annotated[FollowerSettings, Settings(TRAINING, VLN_SCALES, words={"forcing": FORCING})]
    evaluation: Annotated[EvaluationSettings, Settings(EVALUATION, EvaluationSettings(), skip=("ask_threshold",))]


@dataclass(frozen=True, kw_only=True)
class TrainSpeaker(WithData, Encoded):
    """A network that describes walks, on a VLN or HANNA data set with features (maximum likelihood)."""

    out: OutputFolder
    """Run folder; rerun the command to resume an interrupted run."""
    scale: Annotated[str, SCALE] = "mini"
    """The settings to start from."""
    config: Annotated[SpeakerSettings, Settings(TRAINING, SPEAKER_SCALES)]


@dataclass(frozen=True, kw_only=True)
class TrainExecution(Run):
    """First phase: to understand descriptions and to navigate by them (DAgger)."""

    begin: InputPath | None = None
    """Initialise with the weights of this execution policy."""
    config: Annotated[ExecutionConfig, Settings(TRAINING, EXECUTION_SCALES)]


@dataclass(frozen=True, kw_only=True)
class TrainIntention(Recorded, Run, Drawn):
    """Second phase: which question to ask when (actor-critic)."""

    execution: InputPath
    """A trained execution policy (best.safetensors)."""
    config: Annotated[IntentionConfig, Settings(TRAINING, INTENTION_SCALES)]


@dataclass(frozen=True, kw_only=True)
class TrainIliad(Timed, Threaded):
    out: OutputFolder
    """Folder for data, teacher and students; rerun the command to resume."""
    scale: Annotated[str, SMALL_SCALE] = "mini"
    """The settings to start from."""


@dataclass(frozen=True, kw_only=True)
class RegexFiles:
    words: InputPath | None = None
    """REGEX: a file with one word per line (default: made-up words)."""
    templates: InputPath | None = None
    """REGEX: a JSON file with your own requests: rule -> texts with BEFORE and AFTER (default: the grammar's)."""


@dataclass(frozen=True, kw_only=True)
class TrainRegex(TrainIliad, RegexFiles):
    """Change words as a request says, by regular expressions."""

    learner: Annotated[LearnerConfig, Settings("settings of the student's training", LEARNER_SCALES)]
    world: Annotated[RegexConfig, Settings("settings of data and teacher", REGEX_SCALES)]


@dataclass(frozen=True, kw_only=True)
class TrainNav(TrainIliad, Nav):
    """Follow routes through houses, on a `vln` or `hanna` data set with features."""

    data: InputFolder
    learner: Annotated[LearnerConfig, Settings("settings of the student's training", NAV_LEARNER_SCALES)]
    world: Annotated[NavConfig, Settings("settings of data and teacher", NAV_SCALES)]


def train_vision(args: TrainVision) -> None:
    from embodied.agents.vision.drawn import StripSource
    from embodied.agents.vision.run import train_vision

    source = StripSource(args.data, args.strips or args.out / "strips", args.cache, args.pictures)
    train_vision(source, args.config, args.out, device=args.device, workers=args.workers, note=note)


def train_detector(args: TrainDetector) -> None:
    from embodied.agents.vision.drawn import StripSource
    from embodied.agents.vision.encoder import load_encoder
    from embodied.agents.vision.run import detector_for
    from embodied.datasets.store import Dataset

    strips = args.strips or args.out / "strips"
    source = StripSource(args.data, strips, args.cache, args.pictures)
    also = None
    if args.also:
        folder = strips / Dataset(args.also).digest[:12]  # houses of both have the same names
        also = StripSource(args.also, folder, args.cache, args.pictures, share=args.share)
    encoder = load_encoder(args.encoder)
    detector_for(
        encoder,
        source,
        args.config,
        args.out,
        lit=args.lit_houses,
        also=also,
        device=args.device,
        workers=args.workers,
        note=note,
    )


def train_hanna(args: TrainHanna) -> None:
    from embodied.agents.hanna.run import train_agent

    lessons = _lessons(args, "hanna")
    train_agent(lessons, args.config, args.evaluation, args.out, begin=args.begin, **_session(args))


def train_vnla(args: TrainVnla) -> None:
    from embodied.agents.vnla.run import train_agent

    train_agent(_lessons(args, "vnla"), args.config, args.evaluation, args.out, **_session(args))


def train_follower(args: TrainFollower) -> None:
    from embodied.agents.vln.run import train_follower

    lessons = _lessons(args, "vln")
    train_follower(lessons, args.config, args.evaluation, args.out, speaker=args.speaker, **_session(args))


def train_speaker(args: TrainSpeaker) -> None:
    from embodied.agents.vln.speaker import train_speaker

    train_speaker(_lessons(args, "vln"), args.config, args.out, note=note)


def _lessons(args: TrainHanna | TrainVnla | TrainFollower | TrainSpeaker, kind: str) -> Lessons:
    """What an agent by imitation learns from; under torchrun, PyTorch has its device."""
    from embodied.agents.common.parallel import join_launcher
    from embodied.agents.vision.lessons import Lessons
    from embodied.agents.vision.run import encoder_of
    from embodied.datasets.store import dataset_of

    encoder = encoder_of(args.encoder, args.network)
    data, shown = dataset_of(args.data, kind), args.goal_image if isinstance(args, TrainHanna) else "same"
    device = "cpu" if isinstance(args, TrainSpeaker) else join_launcher(args.device)
    return Lessons(data, encoder, args.pictures, device, shown, args.cache)


def train_execution(args: TrainExecution) -> None:
    from embodied.agents.hari.run import train_execution
    from embodied.datasets.store import dataset_of

    data = dataset_of(args.data, "hari")
    train_execution(data, args.config, args.out, begin=args.begin, minutes=args.minutes, note=note)


def train_intention(args: TrainIntention) -> None:
    from embodied.agents.hari.agent import load_executor
    from embodied.agents.hari.run import train_intention
    from embodied.datasets.store import dataset_of

    data = dataset_of(args.data, "hari")
    walking = load_executor(args.execution)
    train_intention(data, walking, args.config, args.out, **_session(args, sees=False))


def train_regex(args: TrainRegex) -> None:
    from embodied.agents.iliad.config import folder_name
    from embodied.agents.iliad.regex.config import students_of
    from embodied.agents.iliad.regex.run import learn, prepare

    regex, learner = args.world, args.learner
    grounds = prepare(regex, args.out / "shared", words=args.words, templates=args.templates, note=note)
    home = args.out / "students" / students_of(regex) / f"seed_{learner.seed}"
    learn(grounds, learner, home / folder_name(learner), home / "pretraining", minutes=args.minutes, note=note)


def train_nav(args: TrainNav) -> None:
    from embodied.agents.iliad.config import folder_name
    from embodied.agents.iliad.nav.run import NavSource, learn, prepare

    nav, learner = args.world, args.learner
    source = NavSource(args.data, args.encoder_digest(), args.pictures, args.cache)
    grounds = prepare(nav, source, args.out / "shared", note=note)
    home = args.out / "students" / nav.teacher / f"seed_{learner.seed}" / folder_name(learner)
    learn(grounds, learner, home, minutes=args.minutes, note=note)


def _session(args: TrainHanna | TrainVnla | TrainFollower | TrainIntention, *, sees: bool = True) -> dict[str, Any]:
    """How long it trains now, and who is told."""
    watch = _recorder(args, sees=sees) if args.rrd else None
    return {"minutes": args.minutes, "note": note, "on_validation": watch}


def _recorder(
    args: TrainHanna | TrainVnla | TrainFollower | TrainIntention, *, sees: bool
) -> Callable[[int, Sequence[Episode]], None]:
    """Writes the first validation episodes of each validation as Rerun recordings, with what it saw if it sees."""
    from embodied.agents.vision.drawn import drawn_world, pictures_of
    from embodied.datasets.store import Dataset
    from embodied.viz.recording import record_episode
    from embodied.viz.sinks import Sinks

    data = Dataset(args.data)

    def keep(update: int, episodes: Sequence[Episode]) -> None:
        for number, episode in enumerate(episodes[:WATCHED]):
            name = episode.task.world
            with drawn_world(data, name, args.cache, pictures_of(data, name, args.pictures)) as world:
                file = args.out / f"validation_{update:06d}_{number}.rrd"
                record_episode(world, episode, Sinks(file), eyes=world if sees else None)

    return keep


def _with_threads(train: Callable[[Any], None]) -> Callable[[Any], None]:
    """The command that trains once PyTorch has its threads."""

    def run(args: Any) -> None:
        from embodied.agents.common.parallel import use_threads

        use_threads(args.threads)
        train(args)

    return run


COMMANDS: Mapping[str, Any] = {
    "vision": (TrainVision, _with_threads(train_vision)),
    "detector": (TrainDetector, _with_threads(train_detector)),
    "hanna": (TrainHanna, _with_threads(train_hanna)),
    "vnla": (TrainVnla, _with_threads(train_vnla)),
    "vln": (
        "Agents that follow route instructions, and a speaker that describes walks.",
        {
            "follower": (TrainFollower, _with_threads(train_follower)),
            "speaker": (TrainSpeaker, _with_threads(train_speaker)),
        },
    ),
    "hari": (
        "The agent that learns which question to ask, in two phases.",
        {
            "execution": (TrainExecution, _with_threads(train_execution)),
            "intention": (TrainIntention, _with_threads(train_intention)),
        },
    ),
    "iliad": (
        "A student that learns to do what a request says from descriptions (ADEL), demonstrations or rewards.",
        {"regex": (TrainRegex, _with_threads(train_regex)), "nav": (TrainNav, _with_threads(train_nav))},
    ),
}

"""Train agents for each row of a table of a paper, evaluate them, and write the table beside the printed numbers.

    embodied study hanna 4.5 --data DATA --judged-in OTHER --out STUDY --seeds 3
    embodied study find --data DATA --out STUDY
    embodied study vision --data DATA --pictures unlit --houses 12 48 --out STUDY
    embodied study hari 4.7 4.8 --data DATA --out STUDY
    embodied study vnla askers interventions rules --data DATA --out STUDY
    embodied study vln followers speaker --data DATA --out STUDY
    embodied study ask houses classes curves --out STUDY
    embodied study bandit 3.2 3.4 3.5 --data CORPUS --out STUDY
    embodied study iliad regex 3.4 3.5 C.1 --out STUDY
    embodied study iliad nav 3.4 3.5 --data DATA --out STUDY
    embodied study check STUDY

HANNA's tables are 4.3, 4.4, 4.5, 4.6, D.1, D.2, `sight`, `words` and `places`. HARI's are 4.7, 4.8, 'figure 4.5',
'figure 4.5b' and 'figure 4.6'. VNLA's are the first paper's: `askers`, `interventions`, `rooms` (needs
--without-rooms), `rules` and `algorithm-6`, and `words`. VLN's are `followers`, `speaker` and `words`. Ask-v0's are
`houses`, `classes` and `curves`. `bandit` has Table 3.2, Figures 3.4 and 3.5, `rates`, `held-out` and, with --rater,
`people`; ILIAD has Tables 3.4, 3.5 and C.1, 'figure 3.7' and `algorithms`, NAV `words`, too. `check` says which stored
tables no longer belong to this code. Rows that tables share are trained once. Each table is written as JSON, Markdown
and, for some, as a figure. Rerun an interrupted command to resume.
"""

from __future__ import annotations

import dataclasses
import functools
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from embodied.agents.ask.config import AskerConfig, AskEvaluation
from embodied.agents.bandit.config import SCALES as BANDIT_SCALES
from embodied.agents.bandit.config import BanditConfig
from embodied.agents.common.settings import EvaluationSettings
from embodied.agents.find.config import FinderConfig
from embodied.agents.hanna.training_config import EVALUATIONS, SCALES, HannaEvaluation, TrainingConfig
from embodied.agents.hari.config import EXECUTION_SCALES, INTENTION_SCALES, IntentionConfig
from embodied.agents.iliad.config import LearnerConfig
from embodied.agents.iliad.nav.config import NAV_LEARNER_SCALES, NAV_SCALES, NavConfig
from embodied.agents.iliad.regex.config import LEARNER_SCALES, REGEX_SCALES, RegexConfig
from embodied.agents.vision.config import VisionConfig
from embodied.agents.vln.config import SCALES as VLN_SCALES
from embodied.agents.vln.config import SPEAKER_SCALES, FollowerSettings
from embodied.agents.vnla.config import SCALES as VNLA_SCALES
from embodied.agents.vnla.config import VnlaSettings
from embodied.cli.common import note
from embodied.cli.learning import (
    PRESETS,
    SCALE,
    SMALL_SCALE,
    Encoded,
    EncoderFile,
    NamedFiles,
    Nav,
    Threaded,
    WithData,
    WithDevice,
    WithGoalImage,
    by_name,
)
from embodied.cli.model import WithModel, client_of
from embodied.cli.train import EVALUATION, TRAINING, RegexFiles, Strips
from embodied.options import (
    REPEATS,
    Cached,
    Count,
    InputFolder,
    InputPath,
    Option,
    OutputFolder,
    Settings,
    any_folder,
    whole,
)
from embodied.records import load_json

if TYPE_CHECKING:
    from embodied.agents.studies.engine import StudyLearner
    from embodied.interface import Agent

Tables = Annotated[tuple[str, ...], Option(metavar="TABLE", name="TABLE")]
Seeds = Annotated[int, Option(whole(1, REPEATS), "N")]


@dataclass(frozen=True, kw_only=True)
class Study(Threaded):
    """Options of every study."""

    out: OutputFolder
    """Folder of the study: runs, episodes and tables; rerun the command to resume."""
    rows: tuple[Annotated[str, Option(metavar="LABEL")], ...] = ()
    """Run only the rows with these labels."""
    workers: Count = 1
    """Train N runs in parallel."""
    report: bool = False
    """Train and evaluate nothing; write tables of the stored results."""


@dataclass(frozen=True, kw_only=True)
class Trained:
    seeds: Seeds = 3
    """Train every row with N random seeds, from --seed on."""


@dataclass(frozen=True, kw_only=True)
class Judged:
    tasks: Count | None = None
    """Evaluate on at most N tasks of a split, spread over its houses (default: all)."""


@dataclass(frozen=True, kw_only=True)
class JudgeSeed:
    judge_seed: int = 0
    """Random seed of the evaluation."""


@dataclass(frozen=True, kw_only=True)
class HannaOptions(Study, Trained, Judged, JudgeSeed, WithData, EncoderFile, WithDevice, WithGoalImage):
    """Agents that ask people for help and follow their routes."""

    tables: Tables
    """Make these tables: 4.3, 4.4, 4.5, 4.6, D.1, D.2, sight, words, speakers or places."""
    seeds: Seeds = 1
    scale: Annotated[str, SCALE] = "mini"
    """The settings to start from."""
    judged_in: InputFolder | None = None
    """Evaluate in the unseen houses of another data set that has features (default: of --data)."""
    begin: InputPath | None = None
    """Initialise with the weights of this agent."""
    config: Annotated[TrainingConfig, Settings(TRAINING, SCALES, skip=("training_houses",))]
    evaluation: Annotated[HannaEvaluation, Settings(EVALUATION, EVALUATIONS)]


WORDLESS = ("instruction_length", "word_vectors", "varied_words")
"""Of the settings of agents, those that an agent that is told a class has no use for."""


@dataclass(frozen=True, kw_only=True)
class FindOptions(Study, Trained, WithData, EncoderFile):
    """Agents that find things without help, with sight and without."""

    judged_tasks: Count = 50
    """Evaluate on at most N tasks of each unseen house."""
    config: Annotated[FinderConfig, Settings(TRAINING, FinderConfig(), skip=WORDLESS)]


@dataclass(frozen=True, kw_only=True)
class VisionOptions(Study, Trained, Strips, WithData):
    """Encoders that turn pictures into features."""

    seeds: Seeds = 1
    houses: Annotated[tuple[int, ...], Option(whole(1), "N")] = ()
    """Numbers of training houses to compare."""
    budget: Count = 0
    """Train every encoder on as many pictures as N houses have in all epochs; of more houses than N times --epochs,
    only some viewpoints are drawn (default: the largest of --houses)."""
    lit_houses: Count = 12
    """N houses are lit for one more encoder, and for linear readers."""
    encoders: NamedFiles = ()
    """Evaluate these encoders, or detectors of the shipped encoder, too; those of one name are training seeds of one
    kind."""
    test_pictures: tuple[Annotated[str, PRESETS], ...] = ("unlit", "fast")
    """Kinds of pictures to evaluate on (default: unlit and fast)."""
    split: str = "val_unseen"
    """Evaluate on the houses of this split."""
    config: Annotated[VisionConfig, Settings(TRAINING, VisionConfig())]


@dataclass(frozen=True, kw_only=True)
class HariOptions(Study, Trained, Judged, WithData):
    """Agents that learn which question to ask."""

    tables: Tables
    """Make these tables: 4.7, 4.8, 'figure 4.5', 'figure 4.5b' or 'figure 4.6'."""
    scale: Annotated[str, SCALE] = "mini"
    """The settings to start from."""
    execution: InputPath | None = None
    """A trained execution policy (default: trained in --out first)."""
    judged_in: InputFolder | None = None
    """Evaluate in another data set: in all its splits if it differs from --data in --evaluation-tasks only, else in its
    unseen houses (default: in --data)."""
    judging_seeds: Seeds = 3
    """Evaluate with N random seeds, from --seed on."""
    config: Annotated[IntentionConfig, Settings(TRAINING, INTENTION_SCALES, skip=("cooperative", "perfect"))]


@dataclass(frozen=True, kw_only=True)
class VnlaOptions(Study, Trained, Judged, WithData, Encoded):
    """Agents that ask an advisor within a budget."""

    tables: Tables
    """Make these tables: askers, interventions, algorithm-6, rooms, rules or words."""
    scale: Annotated[str, SCALE] = "mini"
    """The settings to start from."""
    without_rooms: InputFolder | None = None
    """A data set of --no-rooms, for the table `rooms`."""
    others: Count | None = None
    """Training seeds of all rows but the learned asker's (default: --seeds)."""
    config: Annotated[VnlaSettings, Settings(TRAINING, VNLA_SCALES, skip=("asker", "ask_rules", "rules"))]
    evaluation: Annotated[EvaluationSettings, Settings(EVALUATION, EvaluationSettings())]


@dataclass(frozen=True, kw_only=True)
class VlnOptions(Study, Trained, Judged, WithData, Encoded):
    """Agents that follow route instructions, and a speaker."""

    tables: Tables
    """Make these tables: followers, speaker, words or speakers."""
    scale: Annotated[str, SCALE] = "mini"
    """The settings to start from."""
    others: Count = 1
    """Training seeds of all rows but the first."""
    config: Annotated[
        FollowerSettings, Settings(TRAINING, VLN_SCALES, skip=("forcing", "blind", "wordless", "spoken_share"))
    ]
    evaluation: Annotated[EvaluationSettings, Settings(EVALUATION, EvaluationSettings(), skip=("ask_threshold",))]


@dataclass(frozen=True, kw_only=True)
class BanditOptions(Study, Trained):
    """A translator that learns from ratings."""

    tables: Tables
    """Make these tables: 3.2, 3.4, 3.5, rates, held-out or, with --rater, people."""
    data: InputFolder
    """The corpus, a folder that `embodied corpus` made."""
    scale: Annotated[str, SMALL_SCALE] = "mini"
    """The settings to start from."""
    rater: InputPath | None = None
    """Learn from ratings like people's, too: rater.json of `embodied dataset from-people`."""
    config: Annotated[BanditConfig, Settings(TRAINING, BANDIT_SCALES)]


@dataclass(frozen=True, kw_only=True)
class IliadOptions(Study, Trained):
    tables: Tables
    """Make these tables: 3.4, 3.5, C.1, 'figure 3.7' or algorithms; in NAV also words and speakers."""
    scale: Annotated[str, SMALL_SCALE] = "mini"
    """The settings to start from."""


LEARNED = ("learner", "mixing", "anneal_every")
"""Settings that the rows of ILIAD's tables decide."""


@dataclass(frozen=True, kw_only=True)
class RegexOptions(IliadOptions, RegexFiles):
    """Students that learn to change words from descriptions."""

    config: Annotated[LearnerConfig, Settings("settings of the student's training", LEARNER_SCALES, skip=LEARNED)]
    world: Annotated[RegexConfig, Settings("settings of data and teacher", REGEX_SCALES)]


@dataclass(frozen=True, kw_only=True)
class NavOptions(IliadOptions, Nav):
    """Students that learn to follow routes from descriptions."""

    data: InputFolder
    config: Annotated[LearnerConfig, Settings("settings of the student's training", NAV_LEARNER_SCALES, skip=LEARNED)]
    world: Annotated[NavConfig, Settings("settings of data and teacher", NAV_SCALES, skip=("blind",))]


@dataclass(frozen=True, kw_only=True)
class AskOptions(Study, Trained, WithModel, Cached):
    """Ask-v0: agents that decide when to ask, against the price of their questions."""

    tables: Tables
    """Make these tables: houses, classes or curves."""
    config: Annotated[AskerConfig, Settings("the learned asker", AskerConfig())]
    evaluation: Annotated[AskEvaluation, Settings(EVALUATION, AskEvaluation())]


@dataclass(frozen=True, kw_only=True)
class CheckOptions:
    """Say which stored tables no longer belong to this code."""

    folder: Annotated[Path, Option(any_folder, "STUDY", name="folder")]
    """Folder of a study, or of stored tables such as docs/results/data."""


def run_table(args: Any, learner: StudyLearner, **names: Any) -> int:
    """Make the tables of a study and print them."""
    from embodied.agents.studies.engine import run_study

    made = run_study(
        learner,
        getattr(args, "tables", None) or list(learner.tables()),
        args.out,
        rows=names.get("rows") or args.rows or None,
        workers=args.workers,
        report=args.report,
        command=" ".join(["embodied", *sys.argv[1:]]),
        note=note,
    )
    for path in made.values():
        print(path.read_text(encoding="utf-8"))
    return 0


def study_of(kind: Any, args: Any, **more: Any) -> Any:
    """A study: its fields are the options of the same names, but for `more`."""
    named = {f.name: getattr(args, f.name) for f in dataclasses.fields(kind) if hasattr(args, f.name)}
    seed = named["config"].seed
    return kind(**{"repeats": tuple(range(seed, seed + args.seeds)), **named, **more})


def hanna(args: HannaOptions) -> int:
    from embodied.agents.hanna.study import HannaStudy

    return run_table(args, study_of(HannaStudy, args, judging=(args.judge_seed,), elsewhere=args.judged_in))


def find(args: FindOptions) -> int:
    from embodied.agents.find.study import FindStudy

    return run_table(args, study_of(FindStudy, args))


def vision(args: VisionOptions) -> int:
    from embodied.agents.common.parallel import check_device
    from embodied.agents.vision.drawn import StripSource
    from embodied.agents.vision.study import EncoderStudy

    check_device(args.device)
    source = StripSource(args.data, args.strips or args.out / "strips", args.cache, args.pictures)
    ready = by_name(args.encoders)
    return run_table(args, study_of(EncoderStudy, args, source=source, pictures=args.test_pictures, ready=ready))


def hari(args: HariOptions) -> int:
    from embodied.agents.hari.study import HariStudy

    config, execution = args.config, EXECUTION_SCALES[args.scale]
    judging = tuple(range(config.seed, config.seed + args.judging_seeds))
    more = {"execution": execution, "executor": args.execution, "elsewhere": args.judged_in}
    return run_table(args, study_of(HariStudy, args, judging=judging, **more))


def vnla(args: VnlaOptions) -> int:
    from embodied.agents.vnla.study import VnlaStudy

    return run_table(args, study_of(VnlaStudy, args))


def vln(args: VlnOptions) -> int:
    from embodied.agents.vln.study import VlnStudy

    return run_table(args, study_of(VlnStudy, args, speaker=SPEAKER_SCALES[args.scale]))


def bandit(args: BanditOptions) -> int:
    from embodied.agents.bandit.ratings import Rater
    from embodied.agents.bandit.study import BanditStudy

    rater = load_json(args.rater, Rater) if args.rater else None
    return run_table(args, study_of(BanditStudy, args, rater=rater))


def iliad(args: RegexOptions | NavOptions) -> int:
    from embodied.agents.iliad.nav.run import NavSource
    from embodied.agents.iliad.study import IliadStudy, NavStudyWorld, RegexStudyWorld, StudyWorld

    world: StudyWorld
    if isinstance(args, NavOptions):
        world = NavStudyWorld(args.world, NavSource(args.data, args.encoder_digest(), args.pictures, args.cache))
    else:
        world = RegexStudyWorld(args.world, args.words, args.templates)
    return run_table(args, study_of(IliadStudy, args, world=world))


def check(args: CheckOptions) -> int:
    from embodied.agents.studies.engine import check

    print("\n".join(check(args.folder)) or f"no stored tables in {args.folder}")
    return 0


def ask(args: AskOptions) -> int:
    from embodied.agents.ask.study import AskStudy

    learner = study_of(AskStudy, args)
    if args.server.model:
        about = {k: getattr(args.server, k) for k in ("model", "form", "temperature", "most_tokens")}
        learner = dataclasses.replace(learner, model=functools.partial(model_agent, args), model_about=about)
    return run_table(args, learner)


def model_agent(args: AskOptions, places: object) -> Agent:
    """The language model that the options name."""
    from embodied.agents.language_models.agent import LanguageModelAgent
    from embodied.agents.language_models.prompts import PromptBuilder, agent_prompt

    return LanguageModelAgent(client_of(args), PromptBuilder(prompt=agent_prompt(args.prompts)))


COMMANDS: Mapping[str, Any] = {
    "hanna": (HannaOptions, hanna),
    "find": (FindOptions, find),
    "vision": (VisionOptions, vision),
    "hari": (HariOptions, hari),
    "vnla": (VnlaOptions, vnla),
    "vln": (VlnOptions, vln),
    "bandit": (BanditOptions, bandit),
    "iliad": (
        "Students that learn from descriptions of what they did.",
        {"regex": (RegexOptions, iliad), "nav": (NavOptions, iliad)},
    ),
    "ask": (AskOptions, ask),
    "check": (CheckOptions, check),
}

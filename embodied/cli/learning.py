"""Options of the commands that learn: `embodied train vision | hanna | vnla | hari`, `features` and `study`.

Free of torch, so that `embodied --help` answers at once; what they do is in agents.vision.run,
agents.hanna.run, agents.hanna.judging and agents.hanna.study.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Mapping
from pathlib import Path

from agents.bandit.config import SCALES as BANDIT_SCALES
from agents.bandit.config import BanditConfig
from agents.bandit.rating_config import DECISIONS, RatingConfig
from agents.common.settings import EvaluationSettings
from agents.common.shipped import SHIPPED_AGENT, SHIPPED_ENCODER
from agents.hanna.training_config import EVALUATIONS, SCALES, HannaEvaluation, TrainingConfig
from agents.hari.config import EXECUTION_SCALES, INTENTION_SCALES, SEES, STATES, ExecutionConfig, IntentionConfig
from agents.iliad.config import LearnerConfig
from agents.iliad.nav.config import NAV_LEARNER_SCALES, NAV_SCALES, NavConfig
from agents.iliad.regex.config import LEARNER_SCALES, REGEX_SCALES, RegexConfig
from agents.vision.config import RENDER_PRESETS, TORCHVISIONS, VisionConfig
from agents.vnla.config import ASK_RULES, ASKERS, TRAINED_UNDER, VnlaSettings
from agents.vnla.config import SCALES as VNLA_SCALES
from embodied.cli.common import add_cache
from embodied.cli.options import REPEATS, add_fields, add_pictures, any_path, folder_to_write, positive, whole


def add_common(parser: argparse.ArgumentParser, threads: int = 2) -> None:
    """Options that all of them share."""
    parser.add_argument(
        "--data",
        type=any_path,
        required=True,
        metavar="DIR",
        help="the data set, a folder that `embodied dataset` built",
    )
    add_cache(parser)
    add_threads(parser, threads)


def add_threads(parser: argparse._ActionsContainer, threads: int = 2) -> None:
    parser.add_argument(
        "--threads", type=whole(), default=threads, metavar="N", help="CPU threads of PyTorch (default: %(default)s)"
    )


def add_encoder(parser: argparse._ActionsContainer) -> None:
    parser.add_argument(
        "--encoder",
        type=any_path,
        default=SHIPPED_ENCODER,
        metavar="FILE",
        help="an encoder of `embodied train vision`, or torchvision weights with --network (default: shipped)",
    )
    parser.add_argument(
        "--network",
        choices=(*TORCHVISIONS, "random"),
        help="torchvision network of --encoder; 'random' for an untrained compact one",
    )
    add_drawn(parser)


def add_drawn(parser: argparse._ActionsContainer) -> None:
    add_pictures(
        parser,
        tuple(RENDER_PRESETS),
        what="how the houses are drawn that features come from, traced and reference at 96 pixels with few rays",
        otherwise="as the panoramas that the data set holds, else unlit",
    )


def add_scale(parser: argparse.ArgumentParser, scales: Mapping[str, object]) -> None:
    parser.add_argument(
        "--scale", choices=sorted(scales), default="mini", help="settings to start from (default: %(default)s)"
    )


def add_run(parser: argparse.ArgumentParser, scales: Mapping[str, object]) -> None:
    """Options of one run that learns: where, from which settings, for how long."""
    parser.add_argument(
        "--out",
        type=folder_to_write,
        required=True,
        metavar="DIR",
        help="run folder; rerun the command to resume an interrupted run",
    )
    add_scale(parser, scales)
    parser.add_argument("--minutes", type=positive, help="stop after so many minutes; rerun the command to resume")


def add_device(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--device", default="cpu", help="'cpu' or 'cuda' (default: %(default)s)")


def add_judged_tasks(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--tasks", type=whole(), metavar="N", help="evaluate on at most N tasks of a split, spread over its houses"
    )


def add_study(
    parser: argparse.ArgumentParser, tables: str, *, seeds: int = 3, data: str | None = None, threads: bool = True
) -> None:
    """Options of every study.

    Args:
      tables: what there are, for the help; '' for a study of one table.
      seeds: how many by default; 0 for a study that trains nothing.
      data: help of --data, where the study has one of another kind.
    """
    if tables:
        parser.add_argument("tables", nargs="+", metavar="TABLE", help=f"make these tables: {tables}")
    if data:
        parser.add_argument("--data", type=any_path, required=True, metavar="DIR", help=data)
    parser.add_argument(
        "--out",
        type=folder_to_write,
        required=True,
        metavar="DIR",
        help="folder of the study: runs, episodes and tables; rerun the command to resume",
    )
    if seeds:
        parser.add_argument(
            "--seeds",
            type=whole(1, REPEATS),
            default=seeds,
            metavar="N",
            help="training seeds of each row, from --seed on (default: %(default)s)",
        )
    parser.add_argument("--rows", nargs="+", metavar="LABEL", help="run only the rows with these labels")
    parser.add_argument(
        "--workers", type=whole(), default=1, metavar="N", help="train N runs in parallel (default: %(default)s)"
    )
    parser.add_argument(
        "--report", action="store_true", help="train and evaluate nothing; write tables of the stored results"
    )
    if threads:
        parser.add_argument(
            "--threads",
            type=whole(),
            default=1,
            metavar="N",
            help="CPU threads of PyTorch per run (default: %(default)s)",
        )


def add_judge_seed(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--judge-seed", type=int, default=0, metavar="N", help="random seed of the evaluation (default: %(default)s)"
    )


def add_train_vision(parser: argparse.ArgumentParser) -> None:
    add_common(parser)
    _add_strips(parser)
    parser.add_argument(
        "--workers", type=whole(), default=1, metavar="N", help="render N houses in parallel (default: %(default)s)"
    )
    parser.add_argument(
        "--distil-from",
        type=any_path,
        dest="example",
        metavar="FILE",
        help="distil from this encoder: start from its weights, and map the new pictures to the features that it gives "
        "for the same places without light, so that agents trained on its features can use either encoder",
    )
    add_fields(parser, VisionConfig, skip=("like",))


def _add_strips(parser: argparse.ArgumentParser) -> None:
    """Where an encoder is made, and from which pictures."""
    add_device(parser)
    parser.add_argument(
        "--out", type=folder_to_write, required=True, metavar="DIR", help="folder for strips, weights and metrics"
    )
    _add_lights(parser)
    _add_strips_folder(parser)
    add_drawn(parser)


def _add_strips_folder(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--strips",
        type=folder_to_write,
        metavar="DIR",
        help="folder for strips, to share them between runs (default: OUT/strips)",
    )


def _add_lights(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--lights",
        type=whole(),
        default=1,
        metavar="K",
        help="render every house under K lightings: its own, and random hours, weathers and lamps "
        "(default: %(default)s)",
    )


def add_study_vision(parser: argparse.ArgumentParser) -> None:
    add_common(parser, threads=1)
    add_study(parser, "encoders, pictures", seeds=1, threads=False)
    add_device(parser)
    _add_lights(parser)
    _add_strips_folder(parser)
    add_drawn(parser)
    _add_named_encoders(
        parser,
        "encoders that are there already, to be judged instead of those that --rows names; those of one name are "
        "training seeds of one kind",
    )
    parser.add_argument(
        "--test-pictures",
        nargs="+",
        choices=tuple(RENDER_PRESETS),
        default=tuple(RENDER_PRESETS),
        metavar="KIND",
        help="the kinds of pictures that the table of pictures evaluates on (default: all)",
    )
    parser.add_argument(
        "--split",
        default="val_unseen",
        help="encoders are evaluated on the houses of this split (default: %(default)s)",
    )
    add_fields(parser, VisionConfig, skip=("network", "begin", "frozen", "like"))


def add_features(parser: argparse.ArgumentParser) -> None:
    add_common(parser)
    add_encoder(parser)
    parser.add_argument(
        "--workers", type=whole(), default=1, metavar="N", help="process N houses in parallel (default: %(default)s)"
    )
    parser.add_argument("--split", nargs="+", metavar="SPLIT", help="use the houses of these splits (default: all)")
    _add_lights(parser)
    parser.add_argument(
        "--houses", type=whole(), metavar="N", help="use the first N houses of each split (default: all)"
    )
    add_shown(parser, several=True)
    parser.add_argument("--ray", metavar="ADDRESS", help="use a Ray cluster instead: its address, or 'local'")
    add_device(parser)


SHOWN = ("same", "camera", "hour", "day", "day-camera", "day-view", "later", "later-camera", "later-view")
"""As in agents.vision.occasions, which --help should not import."""


def add_shown(parser: argparse._ActionsContainer, *, several: bool = False) -> None:
    parser.add_argument(
        "--shown",
        choices=SHOWN,
        nargs="+" if several else None,
        default=() if several else SHOWN[0],
        help="how goal images differ from what the agent sees: not at all (same), by a robot's camera, taken "
        "at another hour, on another day with people elsewhere and small things moved, later (hour and day); by that "
        "camera, and one view of 60 degrees of that" + ("; makes features of these pictures" if several else ""),
    )


def add_train_hanna(parser: argparse.ArgumentParser) -> None:
    add_common(parser)
    add_encoder(parser)
    add_run(parser, SCALES)
    add_device(parser)
    add_begin(parser)
    add_fields(parser, TrainingConfig, scales=SCALES)
    add_fields(parser, HannaEvaluation, scales=EVALUATIONS)


def add_begin(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--begin", type=any_path, metavar="FILE", help="initialise with the weights of this agent")


VNLA_WORDS = {"asker": ASKERS, "ask_rules": tuple(ASK_RULES), "rules": tuple(TRAINED_UNDER)}


def add_train_vnla(parser: argparse.ArgumentParser) -> None:
    add_common(parser)
    add_encoder(parser)
    add_run(parser, VNLA_SCALES)
    add_device(parser)
    add_fields(parser, VnlaSettings, words=VNLA_WORDS, scales=VNLA_SCALES)
    add_fields(parser, EvaluationSettings)


def add_study_vnla(parser: argparse.ArgumentParser) -> None:
    add_common(parser, threads=1)
    add_encoder(parser)
    add_study(parser, "askers, interventions, algorithm-6, rooms or rules", threads=False)
    parser.add_argument(
        "--without-rooms", type=any_path, metavar="DIR", help="a data set of --no-rooms, for the table 'rooms'"
    )
    add_scale(parser, VNLA_SCALES)
    parser.add_argument(
        "--others",
        type=whole(),
        metavar="N",
        help="training seeds of every row but the learned asker's (default: --seeds)",
    )
    add_judged_tasks(parser)
    add_fields(parser, VnlaSettings, skip=("asker", "ask_rules", "rules"), scales=VNLA_SCALES)
    add_fields(parser, EvaluationSettings)


def add_train_hari(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """Two phases, one after the other; returns the parser of the second."""
    phases = parser.add_subparsers(dest="phase", metavar="PHASE", required=True)
    execution = phases.add_parser("execution", help="first: to understand descriptions and walk by them (DAgger)")
    _add_hari(execution, EXECUTION_SCALES)
    add_encoder(execution)
    execution.add_argument(
        "--begin", type=any_path, metavar="FILE", help="initialise with the weights of this execution policy"
    )
    add_fields(execution, ExecutionConfig, scales=EXECUTION_SCALES, words={"sees": SEES})
    intention = phases.add_parser("intention", help="then: which question to ask when (actor-critic)")
    _add_hari(intention, INTENTION_SCALES)
    intention.add_argument(
        "--execution",
        type=any_path,
        required=True,
        metavar="FILE",
        help="a trained execution policy (best.safetensors)",
    )
    add_drawn(intention)
    add_fields(intention, IntentionConfig, scales=INTENTION_SCALES, words={"states": STATES})
    return intention


def _add_hari(parser: argparse.ArgumentParser, scales: Mapping[str, object]) -> None:
    add_common(parser, threads=1)
    add_run(parser, scales)


def add_study_hari(parser: argparse.ArgumentParser) -> None:
    add_common(parser, threads=1)
    add_study(parser, "4.7, 4.8, moves, sight, 'figure 4.5', 'figure 4.5b' or 'figure 4.6'", threads=False)
    add_scale(parser, INTENTION_SCALES)
    parser.add_argument(
        "--execution",
        type=any_path,
        metavar="FILE",
        help="a trained execution policy (default: trained in --out first)",
    )
    add_judged_tasks(parser)
    add_encoder(parser)
    skip = ("stack", "cooperative", "perfect")
    add_fields(parser, IntentionConfig, scales=INTENTION_SCALES, skip=skip, words={"states": STATES})


def add_study_hanna(parser: argparse.ArgumentParser) -> None:
    add_common(parser, threads=1)
    add_study(parser, "4.3, 4.4, 4.5, 4.6, D.1, D.2, houses, lights, departures or requests", seeds=1, threads=False)
    parser.add_argument(
        "--encoder",
        type=any_path,
        default=SHIPPED_ENCODER,
        metavar="FILE",
        help="an encoder of `embodied train vision` (default: shipped)",
    )
    add_scale(parser, SCALES)
    add_judged_tasks(parser)
    add_judge_seed(parser)
    parser.add_argument(
        "--judged-in",
        type=any_path,
        metavar="DIR",
        help="evaluate in the unseen houses of another data set that has features (default: of --data)",
    )
    add_drawn(parser)
    add_device(parser)
    add_begin(parser)
    add_fields(parser, TrainingConfig, skip=("training_houses", "lights"), scales=SCALES)
    add_fields(parser, HannaEvaluation, scales=EVALUATIONS)


def add_study_realism(parser: argparse.ArgumentParser) -> None:
    add_common(parser)
    add_study(parser, "", seeds=0, threads=False)
    parser.add_argument(
        "--agents",
        type=_named_file,
        nargs="+",
        required=True,
        metavar="NAME=FILE",
        help="trained agents; those of one name are training seeds of one kind",
    )
    _add_named_encoders(
        parser,
        "encoders of the agents of a name, one file for all or one for each (default: the encoder that they "
        "learned with)",
    )
    parser.add_argument(
        "--test-pictures",
        nargs="+",
        choices=tuple(RENDER_PRESETS),
        default=("unlit", "fast-matte", "fast", "reference"),
        metavar="KIND",
        help="kinds of pictures that they are evaluated in, of which `embodied features --pictures` made "
        "features; the last is what the others are ranked against (default: %(default)s)",
    )
    parser.add_argument(
        "--split", default="test_unseen", help="evaluate on the tasks of this split (default: %(default)s)"
    )
    parser.add_argument("--houses", type=whole(), metavar="N", help="use only its first N houses (default: all)")
    add_judged_tasks(parser)
    add_judge_seed(parser)


def _add_named_encoders(parser: argparse.ArgumentParser, what: str) -> None:
    parser.add_argument("--encoders", type=_named_file, nargs="+", default=[], metavar="NAME=FILE", help=what)


def _named_file(text: str) -> tuple[str, Path]:
    name, _, path = text.partition("=")
    if not name or not path:
        raise argparse.ArgumentTypeError(f"{text!r} should be NAME=FILE, as in unlit=RUN/best.safetensors")
    return name, any_path(path)


def add_study_bandit(parser: argparse.ArgumentParser) -> None:
    add_study(parser, "3.2, 3.4, 3.5, rates or held-out", data="corpus that `embodied corpus` made")
    add_scale(parser, BANDIT_SCALES)
    add_fields(parser, BanditConfig, scales=BANDIT_SCALES)


ONLY_REGEX = tuple(f.name for f in dataclasses.fields(RegexConfig) if f.name not in NavConfig.__dataclass_fields__)
"""Settings that NAV has not."""
SHARED_SETTINGS = tuple(n for n in NavConfig.__dataclass_fields__ if n in RegexConfig.__dataclass_fields__)


def add_train_iliad(parser: argparse.ArgumentParser) -> None:
    """One world after the other."""
    worlds = parser.add_subparsers(dest="world", metavar="WORLD", required=True)
    regex = worlds.add_parser("regex", help="change words as a request says, by regular expressions")
    _add_iliad(regex)
    _add_regex_files(regex)
    regex.add_argument("--minutes", type=positive, help="stop after so many minutes; rerun the command to resume")
    add_fields(regex, LearnerConfig, scales=LEARNER_SCALES)
    add_fields(regex, RegexConfig, scales=REGEX_SCALES)
    nav = worlds.add_parser("nav", help="follow routes through houses, on a data set `vln` or `hanna` with features")
    _add_iliad(nav)
    add_nav_data(nav, required=True)
    nav.add_argument("--minutes", type=positive, help="stop after so many minutes; rerun the command to resume")
    add_fields(nav, LearnerConfig, scales=NAV_LEARNER_SCALES)
    add_fields(nav, NavConfig, scales=NAV_SCALES)


def add_study_iliad(parser: argparse.ArgumentParser) -> None:
    add_study(parser, "3.4, 3.5, C.1, 'figure 3.7', algorithms, describer or speakers")
    parser.add_argument(
        "--world",
        choices=("regex", "nav"),
        default="regex",
        help="'regex': words to change; 'nav': houses (default: %(default)s)",
    )
    add_scale(parser, REGEX_SCALES)
    _add_regex_files(parser)
    add_nav_data(parser, required=False)
    add_fields(parser, LearnerConfig, scales=LEARNER_SCALES, skip=("learner", "mixing", "anneal_every"))
    add_fields(parser, RegexConfig, scales=REGEX_SCALES, skip=("wrong", "unheard"))
    add_fields(parser, NavConfig, scales=NAV_SCALES, skip=SHARED_SETTINGS)


def add_nav_data(parser: argparse.ArgumentParser, *, required: bool) -> None:
    """Where NAV's houses and what is seen of them come from."""
    parser.add_argument(
        "--data",
        type=any_path,
        required=required,
        metavar="DIR",
        help="NAV: folder that `embodied dataset vln` or `hanna` built",
    )
    add_cache(parser)
    add_encoder(parser)


def _add_iliad(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--out",
        type=folder_to_write,
        required=True,
        metavar="DIR",
        help="data, teacher and students; rerun the command to resume",
    )
    parser.add_argument(
        "--scale", choices=sorted(REGEX_SCALES), default="mini", help="settings to start from (default: %(default)s)"
    )
    parser.add_argument(
        "--threads", type=whole(), default=1, metavar="N", help="CPU threads of PyTorch (default: %(default)s)"
    )


def _add_regex_files(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--words", type=any_path, metavar="FILE", help="words, one a line (default: made-up ones)")
    parser.add_argument(
        "--templates",
        type=any_path,
        metavar="FILE",
        help="requests of your own, JSON: rule -> texts with BEFORE and AFTER (default: the grammar's)",
    )


def add_study_stars(parser: argparse.ArgumentParser) -> None:
    add_common(parser, threads=1)
    add_encoder(parser)
    add_study(parser, "", threads=False)
    parser.add_argument(
        "--agent", type=any_path, default=SHIPPED_AGENT, metavar="FILE", help="agent to begin with (default: shipped)"
    )
    parser.add_argument(
        "--split", default="test_unseen", help="evaluate in the houses of this split (default: %(default)s)"
    )
    parser.add_argument(
        "--rated",
        default="train",
        metavar="SPLIT",
        help="collect ratings in the houses of this split (default: %(default)s)",
    )
    parser.add_argument(
        "--decisions",
        choices=DECISIONS,
        default="drawn",
        help="judge with moves and questions drawn, as they are while they are rated, or as `embodied evaluate` takes "
        "them (default: %(default)s)",
    )
    parser.add_argument(
        "--tasks", type=whole(), metavar="N", help="evaluate on at most N tasks, spread over all houses"
    )
    parser.add_argument(
        "--judgings",
        type=whole(),
        default=3,
        metavar="N",
        help="evaluate every task N times with different seeds (default: %(default)s)",
    )
    add_fields(parser, RatingConfig)

"""Options of the commands that learn: `embodied train vision | hanna`, `embodied features`, `embodied eval --learned`.

Free of torch, so that `embodied --help` answers at once; what they do is in agents.vision.run, agents.hanna.run and agents.judging.
"""

from __future__ import annotations

import argparse
import dataclasses
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path

from agents.bandit.config import SCALES as BANDIT_SCALES
from agents.bandit.config import BanditConfig
from agents.bandit.rating_config import RatingConfig
from agents.hanna.training_config import SCALES, TrainingConfig
from agents.hari.config import EXECUTION_SCALES, INTENTION_SCALES, ExecutionConfig, IntentionConfig
from agents.shipped import SHIPPED_AGENT, SHIPPED_ENCODER
from agents.vision.config import VisionConfig
from assets.cache import default_cache
from embodied.cli.options import field_docs

METAVARS = {int: "N", float: "X", str: "WORD"}


def add_common(parser: argparse.ArgumentParser) -> None:
    """Options that all of them share."""
    parser.add_argument(
        "--data", type=Path, required=True, metavar="DIR", help="folder that `embodied dataset hanna` built"
    )
    parser.add_argument(
        "--cache",
        type=Path,
        default=default_cache(),
        metavar="DIR",
        help="where expensive products are kept; safe to delete (default: %(default)s)",
    )
    parser.add_argument(
        "--threads", type=int, default=2, metavar="N", help="of PyTorch on the CPU (default: %(default)s)"
    )


def add_encoder(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--encoder",
        type=Path,
        default=SHIPPED_ENCODER,
        metavar="FILE",
        help="an encoder of `embodied train vision`, or torchvision weights with --network (default: shipped)",
    )
    parser.add_argument(
        "--network",
        metavar="NAME",
        help="torchvision network of --encoder: resnet18 to resnet152; 'random' for an untrained compact one",
    )


def add_fields(
    parser: argparse.ArgumentParser, config: type, skip: Sequence[str] = (), scales: Mapping[str, object] = SCALES
) -> None:
    """One option per field of a configuration, explained by the sentence below the field; without it, the field
    keeps its default, or that of --scale."""
    hints, helps = typing.get_type_hints(config), field_docs(config)
    for f in dataclasses.fields(config):
        if f.name in skip:
            continue
        option, text = (
            f"--{f.name.replace('_', '-')}",
            f"{helps[f.name]} (default: {default_of(config, f, scales)})".replace("%", "%%"),
        )
        if hints[f.name] is bool:
            parser.add_argument(option, action=argparse.BooleanOptionalAction, default=None, help=text)
        else:
            parser.add_argument(option, type=hints[f.name], default=None, metavar=METAVARS[hints[f.name]], help=text)


def default_of(config: type, field: dataclasses.Field, scales: Mapping[str, object]) -> str:
    """The field's default in words, for every --scale where they differ."""
    of_scale = {name: getattr(c, field.name) for name, c in sorted(scales.items()) if isinstance(c, config)}
    if len(set(of_scale.values())) > 1:
        return ", ".join(f"{name}: {value}" for name, value in of_scale.items())
    return str(field.default)


def chosen(args: argparse.Namespace, config):
    """`config` with the fields that were given on the command line."""
    given = {f.name: getattr(args, f.name, None) for f in dataclasses.fields(config)}
    return dataclasses.replace(config, **{k: v for k, v in given.items() if v is not None})


def add_train_vision(parser: argparse.ArgumentParser) -> None:
    add_common(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="where strips, weights and numbers go")
    parser.add_argument(
        "--workers", type=int, default=1, metavar="N", help="houses drawn side by side (default: %(default)s)"
    )
    add_fields(parser, VisionConfig)


def add_features(parser: argparse.ArgumentParser) -> None:
    add_common(parser)
    add_encoder(parser)
    parser.add_argument(
        "--quality", help="how the houses are drawn (default: the data set's panoramas where it holds them, else unlit)"
    )
    parser.add_argument(
        "--workers", type=int, default=1, metavar="N", help="houses side by side (default: %(default)s)"
    )
    parser.add_argument("--device", default="cpu", help="'cpu' or 'cuda' (default: %(default)s)")


def add_train_hanna(parser: argparse.ArgumentParser) -> None:
    add_common(parser)
    add_encoder(parser)
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="run folder; an interrupted run goes on from it"
    )
    parser.add_argument(
        "--scale", choices=sorted(SCALES), default="mini", help="settings to start from (default: %(default)s)"
    )
    parser.add_argument("--minutes", type=float, help="stop after this long; the same command goes on")
    parser.add_argument("--device", default="cpu", help="'cpu' or 'cuda' (default: %(default)s)")
    parser.add_argument(
        "--begin", type=Path, metavar="FILE", help="begin with the weights of this agent instead of random ones"
    )
    add_fields(parser, TrainingConfig)


def add_train_hari(parser: argparse.ArgumentParser) -> None:
    """Two phases, one after the other."""
    phases = parser.add_subparsers(dest="phase", metavar="PHASE", required=True)
    execution = phases.add_parser("execution", help="first: to understand descriptions and walk by them (DAgger)")
    _add_hari(execution, EXECUTION_SCALES)
    add_fields(execution, ExecutionConfig, scales=EXECUTION_SCALES)
    intention = phases.add_parser("intention", help="then: which question to ask when (actor-critic)")
    _add_hari(intention, INTENTION_SCALES)
    intention.add_argument(
        "--execution", type=Path, required=True, metavar="FILE", help="a trained execution policy (best.safetensors)"
    )
    add_fields(intention, IntentionConfig, scales=INTENTION_SCALES)


def _add_hari(parser: argparse.ArgumentParser, scales: Mapping[str, object]) -> None:
    add_common(parser)
    parser.set_defaults(threads=1)
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="run folder; an interrupted run goes on from it"
    )
    parser.add_argument(
        "--scale", choices=sorted(scales), default="mini", help="settings to start from (default: %(default)s)"
    )
    parser.add_argument("--minutes", type=float, help="stop after this long; the same command goes on")


def add_study_hari(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("tables", nargs="+", metavar="TABLE", help="4.7, 4.8, 'figure 4.5' or 'figure 4.6'")
    _add_hari(parser, INTENTION_SCALES)
    parser.add_argument(
        "--execution", type=Path, metavar="FILE", help="a trained execution policy (default: trained in --out first)"
    )
    parser.add_argument(
        "--seeds", type=int, default=3, metavar="N", help="agents per row, from --seed on (default: %(default)s)"
    )
    parser.add_argument(
        "--tasks", type=int, metavar="N", help="judge on at most so many tasks of a split, from all houses alike"
    )
    parser.add_argument(
        "--workers", type=int, default=2, metavar="N", help="agents trained side by side (default: %(default)s)"
    )
    add_fields(parser, IntentionConfig, scales=INTENTION_SCALES, skip=("stack", "cooperative", "perfect"))


def add_study(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("tables", nargs="+", metavar="TABLE", help="4.3, 4.4, 4.5, 4.6, D.2 or houses")
    add_common(parser)
    parser.add_argument(
        "--encoder",
        type=Path,
        default=SHIPPED_ENCODER,
        metavar="FILE",
        help="an encoder of `embodied train vision` (default: shipped)",
    )
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="agents, episodes and tables; the same command goes on"
    )
    parser.add_argument(
        "--scale", choices=sorted(SCALES), default="mini", help="settings to start from (default: %(default)s)"
    )
    parser.add_argument(
        "--tasks", type=int, metavar="N", help="judge on at most so many tasks of a split, from all houses alike"
    )
    parser.add_argument(
        "--judge-seed", type=int, default=0, metavar="N", help="of what is drawn in judging (default: %(default)s)"
    )
    parser.add_argument(
        "--workers", type=int, default=2, metavar="N", help="agents trained side by side (default: %(default)s)"
    )
    parser.add_argument("--device", default="cpu", help="'cpu' or 'cuda' (default: %(default)s)")
    parser.set_defaults(threads=1)  # per agent; they are trained side by side
    add_fields(parser, TrainingConfig, skip=("training_houses",))


def add_eval(parser: argparse.ArgumentParser) -> None:
    add_common(parser)
    add_encoder(parser)
    parser.add_argument(
        "--agent", type=Path, default=SHIPPED_AGENT, metavar="FILE", help="a trained agent (default: shipped)"
    )
    parser.add_argument("--split", nargs="+", help="which splits (default: test_unseen; HARI: all three of test)")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="which rows (default: all)")
    parser.add_argument("--tasks", type=int, metavar="N", help="at most so many tasks, from all houses alike")
    parser.add_argument("--seed", type=int, default=0, help="of everything that is drawn (default: %(default)s)")
    parser.add_argument(
        "--batch", type=int, default=32, help="episodes side by side; no influence on results (default: %(default)s)"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="where tables and episodes go")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def add_study_bandit(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("tables", nargs="+", choices=("3.2", "3.4", "3.5"), metavar="TABLE", help="3.2, 3.4 or 3.5")
    parser.add_argument("--data", type=Path, required=True, metavar="DIR", help="corpus of `embodied corpus`")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="runs, tables and figures; the same command goes on"
    )
    parser.add_argument(
        "--seeds", type=int, default=3, metavar="N", help="repeats, from --seed on (default: %(default)s)"
    )
    parser.add_argument(
        "--scale", choices=sorted(BANDIT_SCALES), default="mini", help="settings to start from (default: %(default)s)"
    )
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="runs side by side (default: %(default)s)")
    parser.add_argument(
        "--threads", type=int, default=1, metavar="N", help="of PyTorch, per run (default: %(default)s)"
    )
    parser.add_argument("--report", action="store_true", help="run nothing; write tables of what is there")
    add_fields(parser, BanditConfig, scales=BANDIT_SCALES)


def add_study_stars(parser: argparse.ArgumentParser) -> None:
    add_common(parser)
    add_encoder(parser)
    parser.add_argument(
        "--agent", type=Path, default=SHIPPED_AGENT, metavar="FILE", help="agent to begin with (default: shipped)"
    )
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="agents, episodes, table and figure; the same command goes on",
    )
    parser.add_argument("--only", nargs="+", metavar="RATER", help="which raters, such as 'skew 4' (default: all)")
    parser.add_argument(
        "--seeds", type=int, default=3, metavar="N", help="repeats, from --seed on (default: %(default)s)"
    )
    parser.add_argument("--split", default="test_unseen", help="judge in its houses (default: %(default)s)")
    parser.add_argument("--tasks", type=int, metavar="N", help="judge on at most so many tasks, from all houses alike")
    parser.set_defaults(threads=1)
    add_fields(parser, RatingConfig)

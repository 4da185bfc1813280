"""Learn from people's ratings: Table 3.2 and Figures 3.4 and 3.5 for a translator, and the like for navigation.

    embodied ratings translate 3.2 3.4 3.5 --data CORPUS --out STUDY
    embodied ratings navigate --data HOUSES --out STUDY

The first needs a corpus (`embodied corpus`), the second a HANNA data set with features (`embodied
dataset hanna`, `embodied features`). Interrupt them whenever you like: the same command goes on.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from embodied.cli.common import note


def add(parser: argparse.ArgumentParser) -> None:
    kinds = parser.add_subparsers(dest="what", metavar="WHAT", required=True)
    add_translate(kinds.add_parser("translate", help="tables of the dissertation", description=run_translate.__doc__))
    add_navigate(kinds.add_parser("navigate", help="agents in houses", description=run_navigate.__doc__))


def add_translate(parser: argparse.ArgumentParser) -> None:
    from agents.bandit.config import SCALES, BanditConfig
    from embodied.cli.learning import add_fields

    parser.add_argument("tables", nargs="+", choices=("3.2", "3.4", "3.5"), metavar="TABLE", help="3.2, 3.4 or 3.5")
    parser.add_argument("--data", type=Path, required=True, metavar="DIR", help="corpus of `embodied corpus`")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="runs, tables and figures")
    parser.add_argument(
        "--seeds", type=int, default=3, metavar="N", help="repeats, from --seed on (default: %(default)s)"
    )
    parser.add_argument("--scale", choices=sorted(SCALES), default="mini", help="settings (default: %(default)s)")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="runs side by side (default: %(default)s)")
    parser.add_argument(
        "--threads", type=int, default=1, metavar="N", help="of PyTorch, per run (default: %(default)s)"
    )
    parser.add_argument("--report", action="store_true", help="run nothing; write tables of what is there")
    add_fields(parser, BanditConfig, scales=SCALES)


def add_navigate(parser: argparse.ArgumentParser) -> None:
    from agents.bandit.rating_config import RatingConfig
    from embodied.cli.learning import add_common, add_encoder, add_fields

    add_common(parser)
    add_encoder(parser)
    parser.add_argument("--agent", type=Path, metavar="FILE", help="agent to begin with (default: shipped)")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="agents, episodes, table and figure")
    parser.add_argument("--only", nargs="+", metavar="RATER", help="which raters (default: all)")
    parser.add_argument(
        "--seeds", type=int, default=3, metavar="N", help="repeats, from --seed on (default: %(default)s)"
    )
    parser.add_argument("--split", default="test_unseen", help="judge in its houses (default: %(default)s)")
    parser.add_argument("--tasks", type=int, metavar="N", help="judge on at most so many tasks, from all houses alike")
    parser.set_defaults(threads=1)
    add_fields(parser, RatingConfig)


def run(args: argparse.Namespace) -> int:
    return run_translate(args) if args.what == "translate" else run_navigate(args)


def run_translate(args: argparse.Namespace) -> int:
    """Pre-train translators, let them learn from ratings, and write the tables and figures of section 3.1."""
    from agents.bandit.config import SCALES
    from agents.bandit.study import Setting, report, run_study
    from embodied.cli.learning import chosen

    if args.seeds < 1 or args.workers < 1:
        raise ValueError(f"--seeds and --workers should be at least 1, got {args.seeds} and {args.workers}")
    setting = Setting(args.data, args.out, chosen(args, SCALES[args.scale]), args.seeds, args.threads)
    made = (
        report(setting, args.tables)
        if args.report
        else run_study(setting, args.tables, workers=args.workers, note=note)
    )
    for path in made.values():
        print(path.read_text())
    return 0


def run_navigate(args: argparse.Namespace) -> int:
    """Fine-tune an agent by ratings of its episodes, and judge it in houses that were not rated."""
    from agents.bandit.navigation_study import NavigationSetting, run_navigation_study
    from agents.bandit.rating_config import RatingConfig
    from agents.shipped import SHIPPED_AGENT
    from agents.vision.run import encoder_of
    from embodied.cli.learning import chosen

    if args.seeds < 1:
        raise ValueError(f"--seeds should be at least 1, got {args.seeds}")
    config = chosen(args, RatingConfig())
    setting = NavigationSetting(
        args.data,
        encoder_of(args),
        args.agent or SHIPPED_AGENT,
        args.out,
        config,
        tuple(config.seed + k for k in range(args.seeds)),
        args.split,
        args.tasks,
        args.threads,
    )
    print(run_navigation_study(setting, args.only, note=note).read_text())
    return 0

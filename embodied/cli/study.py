"""Train agents for each row of a table of the dissertation, judge them, and print the table.

    embodied study hanna 4.5 houses --data DATA --out STUDY --iterations 600
    embodied study hari 4.7 4.8 --data DATA --out STUDY

HANNA's tables are 4.3, 4.4, 4.5 (with figures D.1 and D.2), 4.6, D.2, and `houses`: success against the
number of training houses. HARI's are 4.7, 4.8, 'figure 4.5' and 'figure 4.6'. Rows that tables share are
trained once. Interrupt it whenever you like: the same command goes on.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from embodied.cli.common import note


def add(parser: argparse.ArgumentParser) -> None:
    from embodied.cli import learning

    kinds = parser.add_subparsers(dest="what", metavar="WHAT", required=True)
    learning.add_study(kinds.add_parser("hanna", help="agents that ask people for help and follow their routes"))
    learning.add_study_hari(kinds.add_parser("hari", help="agents that learn which question to ask"))


def run(args: argparse.Namespace) -> int:
    for path in (run_hanna if args.what == "hanna" else run_hari)(args):
        print(path.read_text())
    return 0


def run_hanna(args: argparse.Namespace) -> list[Path]:
    from agents.hanna.training_config import SCALES
    from agents.study import Setting, run_study
    from embodied.cli.learning import chosen

    setting = Setting(
        args.data,
        args.encoder,
        args.out,
        chosen(args, SCALES[args.scale]),
        args.tasks,
        args.judge_seed,
        args.device,
        args.threads,
    )
    return list(run_study(setting, args.tables, workers=args.workers, note=note).values())


def run_hari(args: argparse.Namespace) -> list[Path]:
    from agents.hari.config import EXECUTION_SCALES, INTENTION_SCALES
    from agents.hari.study import Setting, run_study
    from embodied.cli.learning import chosen

    setting = Setting(
        args.data,
        args.out,
        EXECUTION_SCALES[args.scale],
        chosen(args, INTENTION_SCALES[args.scale]),
        executor=args.execution,
        seeds=args.seeds,
        tasks=args.tasks,
        threads=args.threads,
    )
    return list(run_study(setting, args.tables, workers=args.workers, note=note).values())

"""Train one agent per row of a table of the dissertation, judge them, and print the table.

    embodied study 4.5 houses --data DATA --out STUDY --iterations 600

The tables are 4.3, 4.4, 4.5 (with figures D.1 and D.2), 4.6, D.2, and `houses`: success against the
number of training houses. Rows that tables share are trained once. Interrupt it whenever you like:
the same command goes on.
"""

from __future__ import annotations

import argparse

from embodied.cli.common import note


def add(parser: argparse.ArgumentParser) -> None:
    from embodied.cli import learning

    learning.add_study(parser)


def run(args: argparse.Namespace) -> int:
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
    for path in run_study(setting, args.tables, workers=args.workers, note=note).values():
        print(path.read_text())
    return 0

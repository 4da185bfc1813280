"""Judge a learned HANNA agent (Tables 4.3 to 4.5, and why its episodes fail) or HARI agent (Table 4.7).

Which one it is follows from the data set.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from embodied.cli.common import bar, note, show

if TYPE_CHECKING:
    from collections.abc import Sequence

    from embodied.interface import Episode


def add(parser: argparse.ArgumentParser) -> None:
    from embodied.cli import learning

    learning.add_eval(parser)


def run(args: argparse.Namespace) -> int:
    from embodied.datasets.store import Dataset

    if Dataset(args.data).kind == "hari":
        return run_hari(args)
    from agents import judging

    return judging.run_eval(args, watch=lambda agents: bar(agents, "agents", "agent"))


def run_hari(args: argparse.Namespace) -> int:
    """Rows of Table 4.7 for one agent."""
    from agents.hari.agent import load_agent
    from agents.hari.judging import COLUMNS, TEST, judge
    from agents.imitation.parallel import use_threads
    from agents.shipped import SHIPPED_AGENT
    from embodied.datasets.store import Dataset
    from embodied.evaluation.tables import as_json, markdown, save
    from embodied.records import episodes_file, save_lines

    if args.agent == SHIPPED_AGENT:
        raise ValueError("no HARI agent ships yet; name yours with --agent (`embodied train hari`)")
    use_threads(args.threads)

    def keep(split: str, name: str, episodes: Sequence[Episode]) -> None:
        if args.out:
            save_lines(Path(args.out) / episodes_file(split, name), episodes)

    rows = judge(
        Dataset(args.data),
        load_agent(args.agent),
        args.split or TEST,
        seed=args.seed,
        limit=args.tasks,
        only=args.only or (),
        keep=keep,
        watch=lambda agents: bar(agents, "agents", "agent"),
    )
    if args.out:
        save(rows, args.out, "table")
        note(f"table and episodes in {args.out}")
    show(args, {"rows": json.loads(as_json(rows))}, markdown(rows, COLUMNS))
    return 0

"""Judge a learned HANNA agent (Tables 4.3 to 4.5, and why its episodes fail), VNLA agent or HARI agent (Table 4.7).

Which one it is follows from the data set.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING

from embodied.cli.common import bar, note, show

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from embodied.evaluation.tables import Row
    from embodied.interface import Episode


def add(parser: argparse.ArgumentParser) -> None:
    from embodied.cli import learning

    learning.add_eval(parser)


def run(args: argparse.Namespace) -> int:
    from embodied.datasets.store import Dataset

    kind = Dataset(args.data).kind
    if kind in ("hari", "vnla"):
        return run_hari(args) if kind == "hari" else run_vnla(args)
    from agents import judging

    return judging.run_eval(args, watch=lambda agents: bar(agents, "agents", "agent"))


def run_vnla(args: argparse.Namespace) -> int:
    """The learned asker beside others, direct intervention and agents without learning."""
    from agents.imitation.lessons import Lessons
    from agents.imitation.parallel import use_threads
    from agents.shipped import SHIPPED_AGENT
    from agents.vision.run import encoder_of
    from agents.vnla.agent import load_agent
    from agents.vnla.judging import COLUMNS, judge
    from agents.vnla.run import vnla_data

    if args.agent == SHIPPED_AGENT:
        raise ValueError("no VNLA agent ships yet; name yours with --agent (`embodied train vnla`)")
    use_threads(args.threads)
    agent = load_agent(args.agent)
    agent = dataclasses.replace(agent, config=dataclasses.replace(agent.config, evaluation_batch=args.batch))
    lessons = Lessons(vnla_data(args.data), encoder_of(args), args.quality)

    rows = judge(
        lessons,
        agent,
        args.split or ("test_unseen",),
        seed=args.seed,
        limit=args.tasks,
        only=args.only or (),
        keep=lambda split, name, episodes: _keep(args, split, name, episodes),
        watch=lambda agents: bar(agents, "agents", "agent"),
    )
    _tell(args, rows, COLUMNS, {"rules": agent.config.rules, "learned from": agent.pictures})
    return 0


def run_hari(args: argparse.Namespace) -> int:
    """Rows of Table 4.7 for one agent."""
    from agents.hari.agent import load_agent
    from agents.hari.judging import COLUMNS, TEST, judge
    from agents.hari.run import with_eyes
    from agents.imitation.parallel import use_threads
    from agents.shipped import SHIPPED_AGENT, SHIPPED_HARI
    from assets.cache import digest, write_json
    from embodied.datasets.store import Dataset
    from embodied.locks import locked
    from embodied.records import fingerprint

    file = SHIPPED_HARI if args.agent == SHIPPED_AGENT else args.agent
    data, agent, splits = Dataset(args.data), load_agent(file), args.split or TEST
    agent = dataclasses.replace(agent, executor=with_eyes(agent.executor, data, args.quality))
    use_threads(args.threads)

    with locked(args.out) if args.out else contextlib.nullcontext():
        rows = judge(
            data,
            agent,
            splits,
            seed=args.seed,
            limit=args.tasks,
            only=args.only or (),
            keep=lambda split, name, episodes: _keep(args, split, name, episodes),
            watch=lambda agents: bar(agents, "agents", "agent"),
        )
        if args.out:
            about = {"data": data.digest, "agent": digest(Path(file)), "splits": list(splits)}
            write_json(Path(args.out) / "run.json", fingerprint(seed=args.seed, tasks=args.tasks, **about), indent=1)
        _tell(args, rows, COLUMNS, {})
    return 0


def _keep(args: argparse.Namespace, split: str, name: str, episodes: Sequence[Episode]) -> None:
    """Write the episodes of a row, where that is wanted."""
    from embodied.records import episodes_file, save_lines

    if args.out:
        save_lines(Path(args.out) / episodes_file(split, name), episodes)


def _tell(args: argparse.Namespace, rows: Sequence[Row], columns: Sequence[str], facts: Mapping[str, str]) -> None:
    """Write and print the table, and facts about the agent."""
    from embodied.evaluation.tables import as_json, markdown, save

    if args.out:
        save(rows, args.out, "table")
        note(f"table and episodes in {args.out}")
    said = "".join(f"\n{name}: {value}" for name, value in facts.items())
    show(args, {"rows": json.loads(as_json(rows)), **facts}, markdown(rows, columns) + said)

"""Judge a learned HANNA agent (Tables 4.3 to 4.5, and why its episodes fail), VNLA agent or HARI agent (Table 4.7).

Which one it is follows from the data set. --rrd records what the learned agent did, as `embodied view --episode` does.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from embodied.cli.common import bar, note, show
from embodied.cli.options import whole

if TYPE_CHECKING:
    from embodied.evaluation.tables import Row
    from embodied.interface import Episode


def add(parser: argparse.ArgumentParser) -> None:
    from embodied.cli import learning

    learning.add_eval(parser)
    parser.add_argument(
        "--rrd",
        type=whole(),
        metavar="N",
        help="record the learned agent's first N episodes of each split into OUT/recordings; wants --out",
    )


def run(args: argparse.Namespace) -> int:
    from agents.common.device import use_threads
    from agents.common.shipped import SHIPPED_AGENT, SHIPPED_HARI, SHIPPED_VNLA
    from agents.common.weights import weights_digest
    from agents.hanna.evaluation import behaviour
    from agents.studies.episodes import JUDGES
    from agents.vision.drawn import pictures_of
    from agents.vision.occasions import OCCASIONS
    from assets.cache import write_json
    from embodied.datasets.store import Dataset
    from embodied.evaluation.tables import as_json, markdown, save
    from embodied.identity import identity_of
    from embodied.locks import locked
    from embodied.records import episodes_file, fingerprint, save_lines

    if args.rrd and not args.out:
        raise ValueError("--rrd wants --out DIR beside it: recordings go to DIR/recordings")
    use_threads(args.threads)
    data = Dataset(args.data)
    judged = {"hari": hari, "vnla": vnla}.get(data.kind, hanna)
    shipped = {hari: SHIPPED_HARI, vnla: SHIPPED_VNLA, hanna: SHIPPED_AGENT}[judged]
    file = args.agent or shipped
    facts: dict[str, object] = {}

    def keep(split: str, name: str, episodes: Sequence[Episode]) -> None:
        if args.out:
            save_lines(args.out / episodes_file(split, name), episodes)
        if judged is hanna and name == "learned":
            facts[split] = behaviour(episodes, data.places(split))

    with locked(args.out) if args.out else contextlib.nullcontext():
        how = {"seed": args.seed, "limit": args.tasks, "batch": args.batch, "only": args.only or (), "keep": keep}
        how["watch"] = lambda agents: bar(agents, "agents", "agent")
        rows, columns, looking, splits = judged(args, file, how)
        names = [n for split in splits for n in data.names(split)] if looking else []
        drawn = {n: dataclasses.asdict(pictures_of(data, n, args.pictures)) for n in names}
        if args.out:
            save(rows, args.out, "table")
            about = {"data": data.digest, "agent": weights_digest(file), "seed": args.seed, "tasks": args.tasks}
            about |= {"splits": list(splits), "looking": looking, "pictures": drawn}
            about["shown"] = dataclasses.asdict(OCCASIONS[args.shown])
            write_json(args.out / "run.json", fingerprint(**about, identity=identity_of(*JUDGES)), indent=1)
            write_json(args.out / "behaviour.json", facts, indent=1)
            note(f"table and episodes in {args.out}")
    said = markdown(rows, columns) + (f"\n{json.dumps(facts, indent=1)}" if facts else "")
    show(args, {"rows": json.loads(as_json(rows)), "behaviour": facts}, said)
    if args.rrd:
        record_learned(args)
    return 0


Judged = tuple["list[Row]", Sequence[str], list[str], Sequence[str]]
"""Rows, the columns to show, the rows that look at pictures, and the splits."""


def hanna(args: argparse.Namespace, file: Path, how: Mapping[str, Any]) -> Judged:
    """Tables 4.3 to 4.5, and failures."""
    from agents.common.lessons import Lessons
    from agents.hanna.agent import load_agent
    from agents.hanna.evaluation import COLUMNS, WITHOUT_LEARNING
    from agents.hanna.judging import judge
    from agents.vision.occasions import OCCASIONS
    from agents.vision.run import encoder_of
    from embodied.datasets.store import dataset_of

    lessons = Lessons(dataset_of(args.data, "hanna"), encoder_of(args.encoder, args.network), args.pictures)
    splits = args.split or ("test_unseen",)
    rows = judge(lessons, load_agent(file), splits, shown=OCCASIONS[args.shown], cache=args.cache, **how)
    return rows, COLUMNS, sorted({r.agent for r in rows} - set(WITHOUT_LEARNING)), splits


def vnla(args: argparse.Namespace, file: Path, how: Mapping[str, Any]) -> Judged:
    """The learned asker beside others, direct intervention and agents without learning."""
    from agents.common.lessons import Lessons
    from agents.vision.run import encoder_of
    from agents.vnla.agent import load_agent
    from agents.vnla.judging import COLUMNS, WITHOUT_LEARNING, judge
    from agents.vnla.run import vnla_data

    agent, splits = load_agent(file), args.split or ("test_unseen",)
    lessons = Lessons(vnla_data(args.data), encoder_of(args.encoder, args.network), args.pictures)
    note(f"rules of play: {agent.config.rules}; learned from pictures {agent.pictures}")
    rows = judge(lessons, agent, splits, **how)
    return rows, COLUMNS, sorted({r.agent for r in rows} - set(WITHOUT_LEARNING)), splits


def hari(args: argparse.Namespace, file: Path, how: Mapping[str, Any]) -> Judged:
    """Rows of Table 4.7 for one agent."""
    from agents.hari.agent import load_agent
    from agents.hari.judging import COLUMNS, TEST, judge
    from agents.hari.run import hari_data, with_eyes

    data, agent, splits = hari_data(args.data), load_agent(file), args.split or TEST
    agent = dataclasses.replace(agent, executor=with_eyes(agent.executor, data, args.pictures))
    rows = judge(data, agent, splits, **how)
    return rows, COLUMNS, sorted({r.agent for r in rows}) if agent.executor.seeing else [], splits


def record_learned(args: argparse.Namespace) -> None:
    """The first episodes of the learned agent of each split, recorded in their houses as the data set holds them."""
    from assets.catalogue import load_catalogue
    from embodied.cli.view import record_again
    from embodied.datasets.store import Dataset
    from viz.report import load_run
    from viz.sinks import Sinks

    data, catalogue, counts = Dataset(args.data), load_catalogue(args.cache), Counter[str]()
    args.pictures = args.pictures or "unlit"
    for number, listed in enumerate(load_run(args.out)):
        if listed.agent.endswith(" learned") and counts[listed.agent] < args.rrd:
            counts[listed.agent] += 1
            sinks = Sinks(args.out / "recordings" / f"{number}.rrd", ())
            record_again(args.out, data, listed.episode, sinks, catalogue, args)

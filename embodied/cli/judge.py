"""Judge a learned HANNA agent (Tables 4.3 to 4.5, and why its episodes fail), VNLA agent or HARI agent (Table 4.7).

Which one it is follows from the data set. --rrd records what the learned agent did, as `embodied view --episode` does.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from embodied.cli.common import bar, note, show
from embodied.cli.options import whole

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from embodied.datasets.store import Dataset
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
    from embodied.datasets.store import Dataset

    if args.rrd and not args.out:
        raise ValueError("--rrd wants --out DIR beside it: recordings go to DIR/recordings")
    {"hari": run_hari, "vnla": run_vnla}.get(Dataset(args.data).kind, run_hanna)(args)
    if args.rrd:
        record_learned(args)
    return 0


def run_hanna(args: argparse.Namespace) -> int:
    """Tables 4.3 to 4.5, and failures."""
    from agents.hanna import judging

    return judging.run_eval(args, watch=lambda agents: bar(agents, "agents", "agent"))


def record_learned(args: argparse.Namespace) -> None:
    """The first episodes of the learned agent of each split, recorded in their houses as the data set holds them."""
    from assets.catalogue import load_catalogue
    from embodied.cli.view import record_again
    from embodied.datasets.store import Dataset
    from viz.report import load_run
    from viz.sinks import Sinks

    data, catalogue, counts = Dataset(args.data), load_catalogue(args.cache), Counter[str]()
    args.quality = args.quality or "unlit"
    for number, listed in enumerate(load_run(args.out)):
        if listed.agent.endswith(" learned") and counts[listed.agent] < args.rrd:
            counts[listed.agent] += 1
            sinks = Sinks(args.out / "recordings" / f"{number}.rrd", ())
            record_again(args.out, data, listed.episode, sinks, catalogue, args)


def run_vnla(args: argparse.Namespace) -> int:
    """The learned asker beside others, direct intervention and agents without learning."""
    from agents.common.lessons import Lessons
    from agents.common.parallel import use_threads
    from agents.common.shipped import SHIPPED_AGENT, SHIPPED_VNLA
    from agents.vision.drawn import pictures_of
    from agents.vision.run import encoder_of
    from agents.vnla.agent import load_agent
    from agents.vnla.judging import COLUMNS, WITHOUT_LEARNING, judge
    from agents.vnla.run import vnla_data

    file = SHIPPED_VNLA if args.agent == SHIPPED_AGENT else args.agent
    use_threads(args.threads)
    agent, splits = load_agent(file), args.split or ("test_unseen",)
    agent = dataclasses.replace(agent, config=dataclasses.replace(agent.config, evaluation_batch=args.batch))
    lessons = Lessons(vnla_data(args.data), encoder_of(args), args.quality)
    with _locked(args.out):
        rows = judge(
            lessons,
            agent,
            splits,
            seeds=(args.seed,),
            limit=args.tasks,
            only=args.only or (),
            keep=lambda split, name, episodes: _keep(args, split, name, episodes),
            watch=lambda agents: bar(agents, "agents", "agent"),
        )
        names = [n for split in splits for n in lessons.data.names(split)]
        drawn = {n: dataclasses.asdict(pictures_of(lessons.data, n, args.quality)) for n in names}
        looking = sorted({r.agent for r in rows} - set(WITHOUT_LEARNING))
        _depends(args, lessons.data, file, looking=looking, pictures=drawn)
        _tell(args, rows, COLUMNS, {"rules": agent.config.rules, "learned from": agent.pictures})
    return 0


def run_hari(args: argparse.Namespace) -> int:
    """Rows of Table 4.7 for one agent."""
    from agents.common.parallel import use_threads
    from agents.common.shipped import SHIPPED_AGENT, SHIPPED_HARI
    from agents.hari.agent import load_agent
    from agents.hari.judging import COLUMNS, TEST, judge
    from agents.hari.run import with_eyes
    from agents.vision.drawn import pictures_of
    from embodied.datasets.store import Dataset

    file = SHIPPED_HARI if args.agent == SHIPPED_AGENT else args.agent
    data, agent, splits = Dataset(args.data), load_agent(file), args.split or TEST
    agent = dataclasses.replace(agent, executor=with_eyes(agent.executor, data, args.quality))
    use_threads(args.threads)

    with _locked(args.out):
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
        about: dict[str, object] = {"splits": list(splits)}
        if agent.executor.seeing:
            about["looking"] = sorted({r.agent for r in rows})
            drawn = {n: pictures_of(data, n, args.quality) for split in splits for n in data.names(split)}
            about["pictures"] = {n: dataclasses.asdict(p) for n, p in drawn.items()}
        _depends(args, data, file, **about)
        _tell(args, rows, COLUMNS, {})
    return 0


def _locked(out: Path | None) -> contextlib.AbstractContextManager[None]:
    """Nobody else writes into `out`, where there is one."""
    from embodied.locks import locked

    return locked(out) if out else contextlib.nullcontext()


def _depends(args: argparse.Namespace, data: Dataset, agent: Path, **facts: object) -> None:
    """Write run.json: what the judgement depends on, and `facts`."""
    from assets.cache import digest, write_json
    from embodied.records import fingerprint

    if args.out:
        about = {"data": data.digest, "agent": digest(Path(agent)), "seed": args.seed, "tasks": args.tasks, **facts}
        write_json(Path(args.out) / "run.json", fingerprint(**about), indent=1)


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

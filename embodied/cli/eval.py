"""Judge agents that do not learn on a split of a data set, as in Table 4.3 of the dissertation.

Prints the table with 95 % confidence intervals and writes it as Markdown, CSV and JSON, beside
the episodes, to --out.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from embodied.cli.common import add_cache, add_json, add_packs, bar, catalogue_of, show
from embodied.cli.options import add_hari_rules, add_rules, any_path, folder_to_write, hari_rules_of, whole
from embodied.datasets.scale import KINDS

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset
    from embodied.envs.hari import HariRules
    from embodied.interface import Assistant, Episode

COLUMNS = {
    "vln": ("success", "spl", "navigation error", "nDTW", "SDTW"),
    "hanna": ("success", "spl", "navigation error", "requests"),
    "vnla": ("success", "oracle success", "room success", "navigation error", "path length", "requests"),
    "hari": ("success", "navigation error", "requests", "steps"),
}


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("kind", choices=KINDS, help="kind of task")
    parser.add_argument(
        "--data", type=any_path, required=True, metavar="DIR", help="folder that `embodied dataset` built"
    )
    parser.add_argument("--split", nargs="+", default=["test_unseen"], help="which splits (default: test_unseen)")
    parser.add_argument("--agent", nargs="+", metavar="NAME", help="which agents (default: all of this kind)")
    add_rules(parser)
    add_hari_rules(parser)
    parser.add_argument(
        "--assistant", metavar="MODULE:CLASS", help="who answers requests, instead of the kind's own assistant"
    )
    parser.add_argument("--tasks", type=whole(), metavar="N", help="at most so many tasks, from all houses alike")
    parser.add_argument("--seed", type=int, default=0, help="of everything that is drawn (default: %(default)s)")
    parser.add_argument("--out", type=folder_to_write, metavar="DIR", help="where to write the table and the episodes")
    parser.add_argument(
        "--as-programs",
        action="store_true",
        help="also judge as the authors' program does where it judges otherwise (docs/sources.md, S3, S5, S6)",
    )
    add_cache(parser)
    add_packs(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    from embodied.datasets.store import Dataset
    from embodied.envs.make import assistant_of
    from embodied.evaluation.evaluate import agent_names
    from embodied.locks import locked

    data = Dataset(args.data)
    if data.kind != args.kind:
        raise ValueError(f"{args.data} is a data set of {data.kind!r}, not of {args.kind!r}")
    names, variants = args.agent or agent_names(args.kind), hari_rules_of(args)
    for split in args.split:
        data.names(split)
    if unknown := sorted(set(names) - set(agent_names(args.kind))):
        raise ValueError(f"unknown agents {unknown}; those of {args.kind!r} are {list(agent_names(args.kind))}")
    if args.assistant:
        sys.path.insert(0, "")  # a module in the folder one stands in
    assistant = assistant_of(args.assistant)
    with locked(args.out) if args.out else contextlib.nullcontext():
        return judge(args, data, names, variants, assistant)


def judge(
    args: argparse.Namespace, data: Dataset, names: Sequence[str], variants: HariRules, assistant: Assistant | None
) -> int:
    """The table, and what goes into --out."""
    import json

    from assets.cache import write_bytes
    from embodied.evaluation import as_programs, tables
    from embodied.evaluation.evaluate import LOOKING, agent, evaluate
    from embodied.records import episodes_file, fingerprint, save_lines

    def watch(agents: Iterable[str]) -> Iterable[str]:
        return bar(agents, "agents", "agent")

    rows, theirs = [], []
    for split in args.split:

        def keep(name: str, episodes: Sequence[Episode], split: str = split) -> None:
            if args.as_programs:
                theirs.append(as_programs.row(name, split, episodes, data.places(split), seed=args.seed))
            if args.out:
                save_lines(args.out / episodes_file(split, name), episodes)

        worlds = None
        if set(names) & set(LOOKING.get(args.kind, {})):
            catalogue = catalogue_of(args)
            worlds = {name: data.open_world(name, catalogue, args.cache) for name in data.names(split)}
        agents = {name: agent(args.kind, name, worlds, args.rules) for name in names}
        whole = data.split(split, worlds=worlds, vnla=args.rules, hari=variants, assistant=assistant)
        rows += evaluate(whole, agents, seed=args.seed, limit=args.tasks, keep=keep, watch=watch)
    if args.out:
        tables.save(rows, args.out, "table")
        if theirs:
            tables.save(theirs, args.out, "table_as_programs")
        facts = fingerprint(
            data=data.digest,
            seed=args.seed,
            splits=args.split,
            agents=names,
            tasks=args.tasks,
            rules=args.rules,
            hari=dataclasses.asdict(variants),
            assistant=args.assistant,
        )
        write_bytes(args.out / "run.json", (json.dumps(facts, indent=1) + "\n").encode())
    columns = COLUMNS.get(args.kind, ("success", "spl", "navigation error", "steps"))
    facts = {"data": data.digest, "rows": json.loads(tables.as_json(rows))}
    text = tables.markdown(rows, columns)
    if theirs:
        facts["as programs"] = json.loads(tables.as_json(theirs))
        text += f"\nAs the authors' program judges:\n\n{tables.markdown(theirs)}"
    show(args, facts, text)
    return 0

"""What sight is worth to HANNA: agents that see beside blind ones and beside their rules alone, by what helpers show.

    python -m agents.hanna.sight_study --data TEST --pictures fast-matte --episodes STUDY --out docs/results/data

Every row's episodes are kept in STUDY and not played again; the table is written from them.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import torch

from agents.common.lessons import split_of
from agents.common.shipped import SHIPPED_AGENT
from agents.hanna.agent import load_agent
from agents.hanna.evaluation import hanna_policies, sight_policies
from agents.vision.encoder import load_encoder
from agents.vision.occasions import OCCASIONS, showing
from assets.cache import default_cache, digest, write_json
from embodied.datasets.store import Dataset
from embodied.evaluation.evaluate import agent as agent_without_learning
from embodied.evaluation.evaluate import spread
from embodied.evaluation.rollout import play
from embodied.evaluation.tables import Row, Samples, interval, less, measured, row
from embodied.interface import Agent, Episode
from embodied.locks import locked
from embodied.records import episodes_file, load_lines, save_lines

ROWS = (
    "learned",
    "blind",
    "rules only",
    "learned, no ask",
    "learned, ask every 5",
    "learned, random ask",
    "learned, perfect interpretation",
    "blind, not by image",
    "rules only, ask every 10",
    "rules only, blind",
    "random walk",
)
"""All rows, the most telling first."""
EVERYWHERE = ("learned", "rules only")
"""Rows of every kind of picture; the others are judged with the first kind alone."""
SHOWN = ("later-camera", "same", "later", "later-view")
COLUMNS = (
    {"key": "success", "title": "success", "unit": "%"},
    {"key": "spl", "title": "SPL", "unit": "%"},
    {"key": "requests", "title": "requests", "unit": ""},
    {"key": "navigation error", "title": "distance to the goal", "unit": "m"},
    {"key": "steps", "title": "steps", "unit": ""},
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="data set with features of what is shown")
    parser.add_argument("--split", nargs="+", default=["test_unseen"], help="which tasks (default: test_unseen)")
    parser.add_argument("--agent", type=Path, default=SHIPPED_AGENT, help="a trained agent (default: shipped)")
    parser.add_argument("--pictures", help="how the pictures are drawn, as `embodied features --pictures`")
    parser.add_argument("--shown", nargs="+", choices=OCCASIONS, default=SHOWN, help="of which pictures")
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=ROWS, help="of the first kind of pictures")
    parser.add_argument("--tasks", type=int, help="at most so many, from all houses alike")
    parser.add_argument("--houses", type=int, help="of the first so many houses of each split (default: all)")
    parser.add_argument("--seed", type=int, default=0, help="of the judging (default: %(default)s)")
    parser.add_argument("--episodes", type=Path, required=True, help="folder of the episodes")
    parser.add_argument("--table", default="sight-hanna", help="name of the table (default: %(default)s)")
    parser.add_argument("--out", type=Path, help="folder of the table; without it none is written")
    parser.add_argument("--cache", type=Path, default=default_cache())
    args = parser.parse_args()

    torch.set_num_threads(1)
    data = Dataset(args.data)
    args.episodes.mkdir(parents=True, exist_ok=True)
    rows, taken = [], dict[str, Samples]()
    with locked(args.episodes):
        for shown in args.shown:
            for name in args.rows if shown == args.shown[0] else [r for r in args.rows if r in EVERYWHERE]:
                episodes = [e for split in args.split for e in episodes_of(data, split, shown, name, args)]
                graphs = {e.task.world: data.place(e.task.world).graph for e in episodes}
                if shown == args.shown[0]:
                    taken[name] = measured(episodes, graphs)["success"]
                values = numbers(row(name, args.split[0], episodes, graphs, seed=args.seed))
                print(shown, name, {k: v["mean"] for k, v in values.items()}, flush=True)
                rows.append({"label": f"{name} ({shown})", "values": values, "printed": {}})
    if args.out:
        write_json(
            args.out / f"{args.table}.json",
            {
                "table": args.table,
                "title": "HANNA agents with sight, blind, and with the decoding rules alone",
                "paper": None,
                "command": f"python -m agents.hanna.sight_study --data TEST --pictures {args.pictures} --split "
                f"{' '.join(args.split)} --shown {' '.join(args.shown)} --episodes STUDY --table {args.table}"
                + (f" --houses {args.houses}" if args.houses else ""),
                "identity": {
                    "data": data.digest,
                    "agent": digest(args.agent),
                    "encoder": load_encoder().digest,
                    "seed": args.seed,
                },
                "settings": f"{len(episodes)} tasks in {len(graphs)} house{'s' * (len(graphs) > 1)} "
                f"used for no training (data seed {data.config.seed}, {data.config.area[0]:g} to "
                f"{data.config.area[1]:g} m²), pictures {args.pictures or 'of the data set'}.",
                "columns": COLUMNS,
                "rows": rows,
                "notes": [
                    "In brackets: how the goal image was taken.",
                    "blind: all visual features are zero.",
                    "rules only: random moves under the same decoding rules, with help every 5 steps.",
                    *(lead(taken["learned"], taken[other], other) for other in taken if other != "learned"),
                ],
            },
            indent=1,
        )


def episodes_of(data: Dataset, name: str, shown: str, agent_name: str, args: argparse.Namespace) -> list[Episode]:
    """The episodes of one row on one split, from their file where they were played."""
    path = args.episodes / shown / episodes_file(name, agent_name)
    if not path.exists():
        encoder, agent, split = load_encoder().digest, load_agent(args.agent), data.split(name, houses=args.houses)
        bank = split_of(data, name, encoder, houses=args.houses, picture_kind=args.pictures).bank
        bank = showing(bank, data, list(split.worlds), OCCASIONS[shown], encoder, args.cache, args.pictures)
        judged: Mapping[str, Agent] = {
            **hanna_policies(agent, bank),
            **sight_policies(agent, bank),
            "random walk": agent_without_learning("hanna", "random walk"),
        }
        tasks = spread(split.tasks, args.tasks)
        save_lines(path, play(split.make_env, judged[agent_name], tasks, seed=args.seed, batch=32, agent=agent_name))
    return list(load_lines(path, Episode))


def lead(learned: Samples, other: Samples, name: str) -> str:
    """How far the learned agent is ahead, task by task."""
    ahead = interval([less(learned, other)])
    return f"learned minus {name}: {100 * ahead.mean:.1f} ± {100 * ahead.half:.1f} points of success."


def numbers(made: Row) -> dict[str, dict[str, float | int]]:
    """The columns of one row, shares in per cent."""
    out = {}
    for column in COLUMNS:
        value, scale = made.values[column["key"]], 100.0 if column["unit"] == "%" else 1.0
        mean, half = round(scale * value.mean, 2), round(scale * value.half, 2)
        out[column["key"]] = {"mean": mean, "half_width": half, "n": value.n}
    return out


if __name__ == "__main__":
    main()

"""What sight is worth to HANNA: agents that see beside blind ones and beside their rules alone, by what helpers show.

    python -m agents.hanna.sight_study --data TEST --quality matte --episodes STUDY --out docs/results/data

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
from embodied.evaluation.tables import row
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
    "rules only, blind",
    "random walk",
)
"""All rows, the most telling first."""
EVERYWHERE = ("learned", "rules only")
"""Rows of every kind of picture; the others are judged with the first kind alone."""
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
    parser.add_argument("--split", default="test_unseen", help="which tasks (default: %(default)s)")
    parser.add_argument("--agent", type=Path, default=SHIPPED_AGENT, help="a trained agent (default: shipped)")
    parser.add_argument("--quality", help="how the pictures are drawn, as `embodied features --quality`")
    parser.add_argument(
        "--shown", nargs="+", choices=OCCASIONS, default=["later-camera", "same", "later", "later-view"]
    )
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=ROWS, help="of the first kind of pictures")
    parser.add_argument("--tasks", type=int, help="at most so many, from all houses alike")
    parser.add_argument("--seed", type=int, default=0, help="of the judging (default: %(default)s)")
    parser.add_argument("--episodes", type=Path, required=True, help="folder of the episodes")
    parser.add_argument("--out", type=Path, help="folder of the table; without it none is written")
    parser.add_argument("--cache", type=Path, default=default_cache())
    args = parser.parse_args()

    torch.set_num_threads(1)
    data, encoder, agent = Dataset(args.data), load_encoder().digest, load_agent(args.agent)
    split, own = data.split(args.split), split_of(data, args.split, encoder, quality=args.quality).bank
    tasks, graphs = spread(split.tasks, args.tasks), {n: w.graph for n, w in split.worlds.items()}
    args.episodes.mkdir(parents=True, exist_ok=True)
    rows = []
    with locked(args.episodes):
        for shown in args.shown:
            bank = showing(own, data, list(split.worlds), OCCASIONS[shown], encoder, args.cache, args.quality)
            judged: Mapping[str, Agent] = {
                **hanna_policies(agent, bank),
                **sight_policies(agent, bank),
                "random walk": agent_without_learning("hanna", "random walk"),
            }
            for name in args.rows if shown == args.shown[0] else [r for r in args.rows if r in EVERYWHERE]:
                path = args.episodes / shown / episodes_file(args.split, name)
                if not path.exists():
                    played = play(split.make_env, judged[name], tasks, seed=args.seed, batch=32, agent=name)
                    save_lines(path, played)
                episodes = list(load_lines(path, Episode))
                made = row(name, args.split, episodes, graphs, seed=args.seed)
                scale = lambda key: 100.0 if key in ("success", "spl") else 1.0
                values = {
                    c["key"]: {
                        "mean": round(scale(c["key"]) * made.values[c["key"]].mean, 2),
                        "half_width": round(scale(c["key"]) * made.values[c["key"]].half, 2),
                        "n": made.values[c["key"]].n,
                    }
                    for c in COLUMNS
                }
                print(shown, name, {k: v["mean"] for k, v in values.items()}, flush=True)
                rows.append({"label": f"{name} ({shown})", "values": values, "printed": {}})
    if args.out:
        write_json(
            args.out / "sight-hanna.json",
            {
                "table": "sight-hanna",
                "title": "HANNA with sight, without, and by its rules alone",
                "paper": None,
                "command": "python -m agents.hanna.sight_study --data TEST --episodes STUDY --out docs/results/data",
                "identity": {"data": data.digest, "agent": digest(args.agent), "encoder": encoder, "seed": args.seed},
                "settings": f"{len(tasks)} tasks in {len(graphs)} houses that nothing learned from, pictures "
                f"{args.quality or 'of the data set'}; in brackets when the pictures were taken that helpers show",
                "columns": COLUMNS,
                "rows": rows,
                "notes": [
                    "blind: all features zero, for the networks and for the matcher of pictures.",
                    "rules only: no learned network; moves are drawn evenly under the same rules, help every 5 steps.",
                ],
            },
            indent=1,
        )


if __name__ == "__main__":
    main()

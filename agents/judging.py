"""Judging a learned HANNA agent beside agents without learning: Tables 4.3 to 4.5, and why its episodes fail."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import torch

from agents.failures import failures, hanna_policies, predictions, request_share
from agents.hanna.agent import load_agent
from agents.hanna.run import split_of
from agents.vision.run import encoder_of
from assets.cache import write_json
from embodied.datasets.store import Dataset
from embodied.evaluation.evaluate import agent as agent_without_learning
from embodied.evaluation.evaluate import evaluate
from embodied.evaluation.tables import as_json, markdown, save
from embodied.interface import Agent, Episode, Place
from embodied.records import episodes_file, save_lines

Note = Callable[[str], None]
WITHOUT_LEARNING = ("random walk", "forward 10", "shortest", "perfect interpretation")
"""Agents of embodied.evaluation.evaluate that are judged beside the learned one; they need no pictures."""


def run_eval(
    args: argparse.Namespace, note: Note = print, watch: Callable[[Iterable[str]], Iterable[str]] = iter
) -> int:
    """Tables 4.3 to 4.5 for one agent and the agents without learning, and why its episodes fail.

    Args:
      watch: wraps the iterator over agent names (a progress bar).
    """
    torch.set_num_threads(args.threads)
    data, encoder, agent = Dataset(args.data), encoder_of(args), load_agent(args.agent)
    rows, extra = [], {}
    for split in args.split or ("test_unseen",):
        whole = data.split(split)
        judged = {**_without_learning(), **hanna_policies(agent, split_of(data, split, encoder).bank)}
        names = args.only or list(judged)
        if unknown := sorted(set(names) - set(judged)):
            raise ValueError(f"unknown rows {unknown}; there are {list(judged)}")

        def keep(
            name: str, episodes: Sequence[Episode], split: str = split, worlds: Mapping[str, Place] = whole.worlds
        ) -> None:
            if args.out:
                save_lines(args.out / episodes_file(split, name), episodes)
            if name == "learned":
                extra[split] = about(episodes, worlds)

        rows += evaluate(
            whole,
            {n: judged[n] for n in names},
            seed=args.seed,
            limit=args.tasks,
            batch=args.batch,
            keep=keep,
            watch=watch,
        )
    facts = {"rows": json.loads(as_json(rows)), "behaviour": extra}
    if args.json:
        note(json.dumps(facts, indent=1))
    else:
        note(
            markdown(
                rows,
                (
                    "success",
                    "spl",
                    "navigation error",
                    "requests",
                    "oracle success",
                    "mistake repeat",
                    "request repeat",
                ),
            )
        )
        note(json.dumps(extra, indent=1))
    if args.out:
        save(rows, args.out, "table")
        write_json(args.out / "behaviour.json", facts, indent=1)
    return 0


def _without_learning() -> Mapping[str, Agent]:
    return {name: agent_without_learning("hanna", name) for name in WITHOUT_LEARNING}


def about(episodes: Sequence[Episode], worlds) -> dict[str, object]:
    """Figures D.1 and D.2 and the kinds of failure, as numbers."""
    conditions = [{**dataclasses.asdict(p), "f1": p.f1} for p in predictions(episodes, worlds)]
    return {
        "request share": request_share(episodes),
        "failures": {k: float(v) for k, v in dataclasses.asdict(failures(episodes, worlds)).items()},
        "conditions": [
            {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in c.items()} for c in conditions
        ],  # NaN is no JSON
    }

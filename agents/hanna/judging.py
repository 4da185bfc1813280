"""Judging a learned HANNA agent beside agents without learning: Tables 4.3 to 4.5, and why its episodes fail."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import torch

from agents.common.lessons import split_of
from agents.hanna.agent import load_agent
from agents.hanna.evaluation import (
    failures,
    hanna_policies,
    plainer_policies,
    predictions,
    request_share,
    sight_policies,
)
from agents.vision.config import Looked
from agents.vision.drawn import pictures_of
from agents.vision.occasions import OCCASIONS, showing
from agents.vision.run import encoder_of
from assets.cache import digest, write_json
from embodied.datasets.store import dataset_of
from embodied.evaluation.evaluate import agent as agent_without_learning
from embodied.evaluation.evaluate import evaluate
from embodied.evaluation.tables import Row, as_json, markdown, save
from embodied.interface import Agent, Episode, Place
from embodied.locks import locked
from embodied.records import episodes_file, fingerprint, save_lines

Note = Callable[[str], None]
Places = Mapping[str, Place]
WITHOUT_LEARNING = ("random walk", "forward 10", "shortest", "perfect interpretation")
"""Agents of embodied.evaluation.evaluate that are judged beside the learned one; they need no pictures."""


COLUMNS = ("success", "spl", "navigation error", "requests", "oracle success", "mistake repeat", "request repeat")


def run_eval(
    args: argparse.Namespace, note: Note = print, watch: Callable[[Iterable[str]], Iterable[str]] = iter
) -> int:
    """Tables 4.3 to 4.5 for one agent and the agents without learning, and why its episodes fail.

    What it was made with goes to run.json, also how the pictures were drawn that the agent looked at.

    Args:
      watch: wraps the iterator over agent names (a progress bar).

    Raises:
      LockedError: another process writes to args.out.
    """
    torch.set_num_threads(args.threads)
    data, encoder, agent = dataset_of(args.data, "hanna"), encoder_of(args), load_agent(args.agent)
    rows: list[Row] = []
    extra: dict[str, object] = {}
    looked = Looked()
    with locked(args.out) if args.out else contextlib.nullcontext():
        for split in args.split or ("test_unseen",):
            whole, bank = data.split(split), split_of(data, split, encoder.digest, quality=args.quality).bank
            bank = showing(
                bank, data, list(whole.worlds), OCCASIONS[args.shown], encoder.digest, args.cache, args.quality
            )
            sight = sight_policies(agent, bank)
            learned = {**hanna_policies(agent, bank), **{name: sight.pop(name) for name in ("blind", "rules only")}}
            plainer = {**plainer_policies(agent, bank), **sight}
            judged = _asked_for({**_without_learning(), **learned}, plainer, args.only)
            drawn = {n: pictures_of(data, n, args.quality) for n in whole.worlds}
            looked = Looked((*learned, *plainer), {**looked.pictures, **drawn})

            def keep(name: str, episodes: Sequence[Episode], split: str = split, worlds: Places = whole.worlds) -> None:
                if args.out:
                    save_lines(args.out / episodes_file(split, name), episodes)
                if name == "learned":
                    extra[split] = about(episodes, worlds)

            rows += evaluate(whole, judged, seed=args.seed, limit=args.tasks, batch=args.batch, keep=keep, watch=watch)
        facts = {"rows": json.loads(as_json(rows)), "behaviour": extra}
        if args.out:
            save(rows, args.out, "table")
            write_json(args.out / "behaviour.json", facts, indent=1)
            about_run = fingerprint(
                data=data.digest,
                encoder=encoder.digest,
                agent=digest(args.agent),
                seed=args.seed,
                tasks=args.tasks,
                looking=looked.looking,
                shown=dataclasses.asdict(OCCASIONS[args.shown]),
                pictures={name: dataclasses.asdict(p) for name, p in looked.pictures.items()},
            )
            write_json(args.out / "run.json", about_run, indent=1)
    for text in (json.dumps(facts, indent=1),) if args.json else (markdown(rows, COLUMNS), json.dumps(extra, indent=1)):
        note(text)
    return 0


def _asked_for(
    judged: Mapping[str, Agent], others: Mapping[str, Agent], names: Sequence[str] | None
) -> dict[str, Agent]:
    """The rows `names`, of `judged` or of the `others`; without names all of `judged`.

    Raises:
      ValueError: a row that is none.
    """
    every = {**judged, **others}
    if unknown := sorted(set(names or ()) - set(every)):
        raise ValueError(f"unknown rows {unknown}; there are {list(every)}")
    return {name: every[name] for name in names or judged}


def _without_learning() -> Mapping[str, Agent]:
    return {name: agent_without_learning("hanna", name) for name in WITHOUT_LEARNING}


def about(episodes: Sequence[Episode], worlds: Places) -> dict[str, object]:
    """Figures D.1 and D.2 and the kinds of failure, as numbers."""
    conditions = [{**dataclasses.asdict(p), "f1": p.f1} for p in predictions(episodes, worlds)]
    return {
        "request share": request_share(episodes),
        "failures": {k: float(v) for k, v in dataclasses.asdict(failures(episodes, worlds)).items()},
        "conditions": [
            {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in c.items()} for c in conditions
        ],  # NaN is no JSON
    }

"""The part of `embodied evaluate` that is for trained agents; it loads PyTorch."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from embodied.cli.common import bar, note

if TYPE_CHECKING:
    from embodied.cli.evaluate import Options
    from embodied.datasets.store import Dataset, SplitData
    from embodied.evaluation.tables import Row
    from embodied.interface import Episode


def columns_of(kind: str) -> Sequence[str]:
    """The measures of the paper's tables."""
    from agents.hanna.evaluation import COLUMNS as HANNA
    from agents.hari.judging import COLUMNS as HARI
    from agents.vln.study import COLUMNS as VLN
    from agents.vnla.judging import COLUMNS as VNLA

    return {"hanna": HANNA, "hari": HARI, "vln": VLN, "vnla": VNLA}[kind]


def evaluate_trained(
    args: Options,
    data: Dataset,
    file: Path,
    splits: Sequence[str],
    rows: Sequence[str],
    keep: Callable[[str, str, Sequence[Episode]], None],
    instead: Callable[[SplitData], SplitData],
) -> tuple[list[Row], dict[str, object]]:
    """Rows of a trained agent and of agents beside it, and facts for run.json.

    Args:
      rows: names of rows; none for all of the paper's tables.
      keep: is given split, name and episodes (to save them).
      instead: the split with another assistant.
    """
    from agents.common.device import use_threads
    from agents.common.weights import weights_digest
    from agents.studies.episodes import JUDGES
    from agents.vision.drawn import pictures_of
    from agents.vision.occasions import OCCASIONS
    from embodied.identity import identity_of

    use_threads(args.threads)
    how: dict[str, Any] = {"seed": args.seed, "limit": args.tasks, "batch": args.batch or 32}
    how |= {"only": rows, "keep": keep, "watch": lambda agents: bar(agents, "agents", "agent"), "instead": instead}
    judges = {"hari": _hari, "vln": _vln, "vnla": _vnla, "hanna": _hanna}
    found, looking = judges[args.kind](args, data.folder, file, splits, how)
    names = [n for split in splits for n in data.names(split)] if looking else []
    facts: dict[str, object] = {"agent": weights_digest(file), "looking": looking}
    facts["pictures"] = {n: dataclasses.asdict(pictures_of(data, n, args.pictures)) for n in names}
    facts |= {"shown": dataclasses.asdict(OCCASIONS[args.shown]), "identity": identity_of(*JUDGES)}
    return found, facts


Found = tuple["list[Row]", list[str]]
"""Rows, and names of those whose agents see pictures."""


def _hanna(args: Options, data: Path, file: Path, splits: Sequence[str], how: dict[str, Any]) -> Found:
    """Tables 4.3 to 4.5."""
    from agents.common.lessons import Lessons
    from agents.hanna.agent import load_agent
    from agents.hanna.evaluation import WITHOUT_LEARNING
    from agents.hanna.judging import judge
    from agents.vision.run import encoder_of
    from embodied.datasets.store import dataset_of

    encoder = encoder_of(args.encoder, args.network)
    lessons = Lessons(dataset_of(data, "hanna"), encoder, args.pictures, shown=args.shown, cache=args.cache)
    rows = judge(lessons, load_agent(file), splits, **how)
    return rows, sorted({r.agent for r in rows} - set(WITHOUT_LEARNING))


def _vnla(args: Options, data: Path, file: Path, splits: Sequence[str], how: dict[str, Any]) -> Found:
    """The learned asker beside other askers, direct intervention and agents without learning."""
    from agents.common.lessons import Lessons
    from agents.vision.run import encoder_of
    from agents.vnla.agent import load_agent
    from agents.vnla.judging import WITHOUT_LEARNING, judge
    from agents.vnla.run import vnla_data

    agent = load_agent(file)
    lessons = Lessons(vnla_data(data), encoder_of(args.encoder, args.network), args.pictures)
    note(f"rules of play: {agent.config.rules}; trained on pictures {agent.pictures}")
    rows = judge(lessons, agent, splits, **how)
    return rows, sorted({r.agent for r in rows} - set(WITHOUT_LEARNING))


def _vln(args: Options, data: Path, file: Path, splits: Sequence[str], how: dict[str, Any]) -> Found:
    """The follower beside agents without learning."""
    from agents.common.lessons import Lessons
    from agents.vision.run import encoder_of
    from agents.vln.agent import load_agent
    from embodied.datasets.store import dataset_of
    from embodied.evaluation.evaluate import PLAIN, evaluate

    agent, instead, only, keep = load_agent(file), how.pop("instead"), how.pop("only"), how.pop("keep")
    lessons, rows = Lessons(dataset_of(data, "vln"), encoder_of(args.encoder, args.network), args.pictures), list[Any]()
    note(f"trained on pictures {agent.about.pictures}")
    for split in splits:
        players: dict[str, Any] = {"learned": agent.policy(lessons.split(split).bank)}
        players |= {name: make() for name, make in PLAIN.items()}
        if unknown := sorted(set(only) - set(players)):
            raise ValueError(f"unknown rows {unknown}; there are {list(players)}")
        chosen = {n: p for n, p in players.items() if not only or n in only}
        kept = lambda name, episodes, split=split: keep(split, name, episodes)
        rows += evaluate(instead(lessons.data.split(split)), chosen, keep=kept, **how)
    return rows, ["learned"]


def _hari(args: Options, data: Path, file: Path, splits: Sequence[str], how: dict[str, Any]) -> Found:
    """Rows of Table 4.7 for one agent."""
    from agents.hari.agent import load_agent
    from agents.hari.judging import judge
    from agents.hari.run import hari_data

    return judge(hari_data(data), load_agent(file), splits, **how), []


def record_trained(args: Options, data: Dataset, run: Path, first: int) -> None:
    """Record the `first` episodes of the trained agent on each split, in their houses as the data set holds them."""
    from assets.catalogue import load_catalogue
    from embodied.cli.view import record_again
    from viz.report import load_run
    from viz.sinks import Sinks

    catalogue, counts, pictures = load_catalogue(args.cache), Counter[str](), args.pictures or "unlit"
    for number, listed in enumerate(load_run(run)):
        if listed.agent.endswith(" learned") and counts[listed.agent] < first:
            counts[listed.agent] += 1
            sinks = Sinks(run / "recordings" / f"{number}.rrd", ())
            record_again(run, data, listed.episode, sinks, catalogue, args.cache, pictures=pictures)

"""The part of `embodied evaluate` that is for trained agents; it loads PyTorch."""

from __future__ import annotations

import dataclasses
import functools
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from embodied.cli.common import bar, note
from embodied.render.pictures import in_words

if TYPE_CHECKING:
    from embodied.agents.vision.lessons import Lessons
    from embodied.cli.evaluate_options import Options
    from embodied.datasets.store import Dataset, SplitData
    from embodied.evaluation.tables import Row
    from embodied.interface import Agent, Episode


def columns_of(kind: str) -> Sequence[str]:
    """The measures of the paper's tables."""
    from embodied.agents.hanna.evaluation import COLUMNS as HANNA
    from embodied.agents.hari.judging import COLUMNS as HARI
    from embodied.agents.vln.study import COLUMNS as VLN
    from embodied.agents.vnla.judging import COLUMNS as VNLA

    return {"hanna": HANNA, "hari": HARI, "vln": VLN, "vnla": VNLA}[kind]


def evaluate_trained(
    args: Options,
    data: Dataset,
    file: Path,
    splits: Sequence[str],
    wanted: Sequence[str],
    keep: Callable[[str, str, Sequence[Episode]], None],
    instead: Callable[[SplitData], SplitData],
) -> tuple[list[Row], dict[str, object]]:
    """Rows of a trained agent and of agents beside it, over the same tasks, and facts for run.json.

    Args:
      wanted: names of rows; none for all of the paper's tables.
      keep: is given split, name and episodes (to save them).
      instead: the split with another assistant.

    Raises:
      ValueError: an unknown row.
    """
    from embodied.agents.common.parallel import use_threads
    from embodied.agents.common.weights import weights_digest
    from embodied.agents.studies.episodes import JUDGES, evaluate_frozen
    from embodied.agents.vision.config import CAPTURE_CONDITIONS
    from embodied.agents.vision.drawn import pictures_of
    from embodied.identity import identity_of

    use_threads(args.threads)
    rows_of = {"hari": _hari, "vln": _vln, "vnla": _vnla, "hanna": _hanna}[args.kind](args, data, file)
    found, blind = list[Any](), set[str]()
    for split in splits:
        known = rows_of(split)
        if unknown := sorted(set(wanted) - set(known.players)):
            raise ValueError(f"unknown rows {unknown}; there are {list(known.players)}")
        for name in bar(wanted or known.usual, "agents", "agent"):
            whole, player = known.players[name]
            found += evaluate_frozen(
                instead(whole), {name: player}, seed=args.seed, limit=args.tasks, batch=args.batch or 32,
                keep=functools.partial(keep, split),
            )  # fmt: skip
        blind |= set(known.blind)
    looking = sorted({r.agent for r in found} - blind)
    names = [n for split in splits for n in data.names(split)] if looking else []
    facts: dict[str, object] = {"agent": weights_digest(file), "looking": looking}
    facts["pictures"] = {n: in_words(pictures_of(data, n, args.pictures)) for n in names}
    facts |= {"goal_image": dataclasses.asdict(CAPTURE_CONDITIONS[args.goal_image]), "identity": identity_of(*JUDGES)}
    return found, facts


@dataclass(frozen=True)
class Known:
    """Who can play a split."""

    players: Mapping[str, tuple[SplitData, Agent]]
    """By row, with the split under the rules that the row is judged by."""
    usual: Sequence[str]
    """Rows of the paper's tables."""
    blind: Collection[str]
    """Rows whose agents need no pictures."""


def _hanna(args: Options, data: Dataset, file: Path) -> Callable[[str], Known]:
    """Tables 4.3 to 4.5."""
    from embodied.agents.hanna.agent import HannaAgent
    from embodied.agents.hanna.evaluation import WITHOUT_LEARNING, players

    lessons, agent = _lessons(args, data), HannaAgent.load(file)

    def known(split: str) -> Known:
        whole, (all_, usual) = data.split(split), players(agent, lessons.split(split).bank)
        return Known({name: (whole, player) for name, player in all_.items()}, usual, WITHOUT_LEARNING)

    return known


def _vnla(args: Options, data: Dataset, file: Path) -> Callable[[str], Known]:
    """The learned asker beside other askers, direct intervention and agents without learning."""
    from embodied.agents.vnla.agent import VnlaAgent
    from embodied.agents.vnla.judging import WITHOUT_LEARNING, player, row_names, rules_of_row

    lessons, agent = _lessons(args, data), VnlaAgent.load(file)
    note(f"rules of play: {agent.config.rules}; trained on pictures {agent.about.pictures}")

    def known(split: str) -> Known:
        bank, names = lessons.split(split).bank, row_names(agent)
        under = functools.cache(lambda rules: data.split(split, rules=rules))
        players = {name: (under(rules_of_row(agent, name)), player(agent, bank, name)) for name in names}
        return Known(players, names, WITHOUT_LEARNING)

    return known


def _vln(args: Options, data: Dataset, file: Path) -> Callable[[str], Known]:
    """The follower beside agents without learning."""
    from embodied.agents.vln.agent import VlnAgent
    from embodied.task_kind import PLAIN_AGENTS

    lessons, agent = _lessons(args, data), VlnAgent.load(file)
    note(f"trained on pictures {agent.about.pictures}")

    def known(split: str) -> Known:
        whole, learned = data.split(split), agent.policy(lessons.split(split).bank)
        players = {"learned": (whole, learned), **{name: (whole, make()) for name, make in PLAIN_AGENTS.items()}}
        return Known(players, list(players), PLAIN_AGENTS)

    return known


def _hari(args: Options, data: Dataset, file: Path) -> Callable[[str], Known]:
    """Rows of Table 4.7 for one agent, in the environment that it was trained for."""
    from embodied.agents.hari.agent import load_agent
    from embodied.agents.hari.judging import policies, validation_means
    from embodied.agents.hari.run import rules_of

    agent = load_agent(file)
    means = validation_means(data, agent, seed=args.seed, tasks=agent.config.validation_tasks)
    players = policies(agent, means)

    def known(split: str) -> Known:
        one = data.split(split, rules=rules_of(agent.config))
        return Known({name: (one, player) for name, player in players.items()}, list(players), players)

    return known


def _lessons(args: Options, data: Dataset) -> Lessons:
    from embodied.agents.vision.lessons import Lessons
    from embodied.agents.vision.run import encoder_of

    encoder, goal_image = encoder_of(args.encoder, args.network), args.goal_image if args.kind == "hanna" else "same"
    return Lessons(data, encoder, args.pictures, goal_image=goal_image, cache=args.cache)


def record_trained(args: Options, data: Dataset, run: Path, first: int) -> None:
    """Record the `first` episodes of the trained agent on each split, in their houses as the data set holds them."""
    from embodied.assets.catalogue import load_catalogue
    from embodied.cli.view import record_again
    from embodied.viz.report import load_run
    from embodied.viz.sinks import Sinks

    catalogue, counts, pictures = load_catalogue(args.cache), Counter[str](), args.pictures or "unlit"
    for number, listed in enumerate(load_run(run)):
        if listed.agent.endswith(" learned") and counts[listed.agent] < first:
            counts[listed.agent] += 1
            sinks = Sinks(run / "recordings" / f"{number}.rrd", ())
            record_again(run, data, listed.episode, sinks, catalogue, args.cache, pictures=pictures)

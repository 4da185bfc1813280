"""Evaluate a language model as agent or as assistant, or anybody on Ask-v0, and print the table of measures.

`embodied evaluate hanna --agent llm --model NAME --base-url URL` plays with any server of chat completions. Every
answer is kept in --answers, so that the same command again costs nothing and a run that was cut short goes on.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from embodied.cli.common import add_cache, add_json, add_packs, bar, catalogue_of, show
from embodied.cli.options import any_path, folder_to_write, whole

if TYPE_CHECKING:
    from embodied.envs.base import HelpEnv
    from embodied.interface import Agent, Episode, Place, SeenPlace, Task

KINDS = ("find", "vln", "vnla", "hanna", "hari", "ask")
SEES = ("names", "strip", "panorama", "nothing")
AREA = (90.0, 140.0)
"""Size of Ask-v0's houses, square metres."""


def add(parser: argparse.ArgumentParser) -> None:
    from agents.language_models.options import add_model

    parser.add_argument("kind", choices=KINDS, help="kind of task")
    parser.add_argument(
        "--agent",
        nargs="+",
        default=["llm"],
        metavar="NAME",
        help="who plays: llm, a baseline's name, or (ask) a folder with an agent.py or the http:// address of an agent "
        "(default: llm)",
    )
    parser.add_argument(
        "--assistant",
        default="template",
        metavar="WHO",
        help="who words answers: template, llm, person, or module:Class (default: template)",
    )
    parser.add_argument("--data", type=any_path, metavar="DIR", help="data set (default: one generated flat)")
    parser.add_argument("--split", default="test_unseen", help="of the data set (default: %(default)s)")
    parser.add_argument("--seeds", type=any_path, metavar="FILE", help="ask: seeds of the houses, one a line")
    parser.add_argument("--unseen-classes", action="store_true", help="ask: only classes that are kept from training")
    parser.add_argument("--tasks", type=whole(), default=20, metavar="N", help="at most so many tasks (default: 20)")
    parser.add_argument("--steps", type=whole(), metavar="N", help="most steps of an episode (default: its task's)")
    parser.add_argument("--batch", type=whole(), default=8, metavar="N", help="episodes at a time (default: 8)")
    parser.add_argument("--seed", type=int, default=0, help="of everything that is drawn (default: 0)")
    parser.add_argument(
        "--sees",
        choices=SEES,
        default="names",
        help="what a model is given: true names of what is visible (an oracle), candidate views as one strip, the "
        "panorama with markers, or nothing (default: names)",
    )
    parser.add_argument("--out", type=folder_to_write, metavar="DIR", help="where the table and the episodes go")
    add_model(parser)
    add_cache(parser)
    add_packs(parser)
    add_json(parser)


@dataclass(frozen=True, eq=False)
class _Stage:
    """What is played, and where."""

    split: str
    worlds: Mapping[str, Place]
    tasks: Sequence[Task]
    make_env: Callable[[], HelpEnv]


def run(args: argparse.Namespace) -> int:
    from agents.language_models.assistant import assistant_maker
    from agents.language_models.options import client_of
    from embodied.evaluation import tables
    from embodied.evaluation.rollout import play
    from embodied.records import episodes_file, save_lines

    clients: list[Any] = []

    def client() -> Any:
        if not clients:
            clients.append(client_of(args))
        return clients[0]

    reword = assistant_maker(args.assistant, client, args.prompts)
    stage = _ask_stage(args) if args.kind == "ask" and args.seeds else _stage(args)
    if args.steps:
        tasks = [dataclasses.replace(t, horizon=min(t.horizon, args.steps)) for t in stage.tasks]
        stage = dataclasses.replace(stage, tasks=tasks)
    agents = {name: _agent(args, name, stage, client) for name in args.agent}

    def make_env() -> HelpEnv:
        env = stage.make_env()
        if env.assistant is not None:
            env.assistant = reword(env.assistant)
        return env

    graphs = {name: w.graph for name, w in stage.worlds.items()}
    rows, said = [], {}
    for name, agent in bar(agents.items(), "agents", "agent"):
        called = Path(name).name if "/" in name else name
        episodes = play(make_env, agent, stage.tasks, seed=args.seed, batch=args.batch, agent=called)
        rows.append(tables.row(called, stage.split, episodes, graphs, seed=args.seed))
        if heard := _heard(episodes, stage.worlds):
            said[called] = heard
        if args.out:
            save_lines(args.out / episodes_file(stage.split, called), episodes)
    if args.out:
        tables.save(rows, args.out, "table")
    text = tables.markdown(rows, [c for c in _columns(args.kind) if any(c in r.values for r in rows)])
    for name, heard in said.items():
        text += f"\n{name}: a listener arrives with {heard[0]} of {heard[1]} routes that were told"
    if clients:
        text += f"\n{clients[0].sent} requests were sent, all other answers were in {args.answers}"
    show(args, {"rows": json.loads(tables.as_json(rows)), "listener": said}, text)
    return 0


def _columns(kind: str) -> list[str]:
    from embodied.evaluation import metrics
    from embodied.evaluation.ask import COLUMNS

    plain = ("success", "spl", "navigation error", "requests", "steps")
    return [*(COLUMNS if kind == "ask" else plain), *metrics.USAGE]


def _stage(args: argparse.Namespace) -> _Stage:
    """A split of a data set, or a generated flat, with worlds that can be looked at."""
    from embodied.datasets.store import Dataset
    from embodied.evaluation.evaluate import spread
    from embodied.gym.playground import flat_playground

    seen = ("rgb",) if args.sees in ("strip", "panorama") else ()
    if args.data is None:
        flat = flat_playground(args.kind, args.seed, cache=args.cache, sees=seen)
        return _Stage(f"flat_{args.seed}", flat.worlds, spread(flat.tasks, args.tasks), flat.make_env)
    data, catalogue = Dataset(args.data), catalogue_of(args)
    if data.kind != args.kind:
        raise ValueError(f"{args.data} is a data set of {data.kind!r}, not of {args.kind!r}")
    worlds = {name: data.open_world(name, catalogue, args.cache) for name in data.names(args.split)}
    split = data.split(args.split, worlds=worlds)
    return _Stage(args.split, worlds, spread(split.tasks, args.tasks), split.make_env)


def _ask_stage(args: argparse.Namespace) -> _Stage:
    """Ask-v0 in the houses of a list of seeds. What is written down names houses by their place in the list alone."""
    from embodied.datasets.build import make_dataset_house
    from embodied.envs.make import ask_environment_maker, look_of
    from embodied.evaluation.ask import ask_split, read_seeds
    from embodied.evaluation.evaluate import spread
    from embodied.generate import HouseConfig
    from embodied.world import open_world

    seeds, catalogue = read_seeds(args.seeds), catalogue_of(args)
    worlds = {}
    for k, seed in enumerate(bar(seeds, "houses", "house", len(seeds))):
        house, graph = make_dataset_house(seed, f"ask_{k}", HouseConfig(area=AREA), catalogue)
        worlds[house.name] = open_world(house, catalogue, args.cache, graph=graph)
    look, unseen = look_of(catalogue), args.unseen_classes or None
    per_house = -(-args.tasks // len(seeds))
    tasks = spread(ask_split(worlds, look, per_house, seed=seeds[0], unseen=unseen), args.tasks)
    return _Stage("unseen classes" if unseen else "hidden", worlds, tasks, ask_environment_maker(worlds, look))


def _agent(args: argparse.Namespace, name: str, stage: _Stage, client: Callable[[], Any]) -> Agent:
    from embodied.evaluation.ask import submitted
    from embodied.evaluation.evaluate import agent
    from embodied.policies.ask import baselines

    if name == "llm":
        return _model_agent(args, stage, client())
    if args.kind != "ask":
        return agent(args.kind, name, _seen(stage.worlds))
    known = baselines()
    return known[name] if name in known else submitted(name)


def _model_agent(args: argparse.Namespace, stage: _Stage, client: Any) -> Agent:
    from agents.language_models.agent import LanguageModelAgent
    from agents.language_models.telling import Teller, agent_prompt
    from agents.language_models.words import SeenNames
    from embodied.gym.eyes import PanoramaStore
    from embodied.world import World

    prompt = agent_prompt(args.prompts)
    if args.sees == "names":
        return LanguageModelAgent(client, Teller(SeenNames(_seen(stage.worlds)), prompt=prompt))
    if args.sees == "nothing":
        return LanguageModelAgent(client, Teller(prompt=prompt))
    drawn = {n: w for n, w in stage.worlds.items() if isinstance(w, World)}
    return LanguageModelAgent(client, Teller(None, PanoramaStore(drawn), args.sees, prompt))


def _heard(episodes: Sequence[Episode], worlds: Mapping[str, Place]) -> tuple[int, int] | None:
    """What a scripted listener makes of the routes that were told; None where none were."""
    from agents.language_models.checking import understood

    right, total = understood(episodes, _seen(worlds))
    return (right, total) if total else None


def _seen(worlds: Mapping[str, Place]) -> Mapping[str, SeenPlace]:
    return worlds  # type: ignore[return-value]  # all that are opened here can be looked at

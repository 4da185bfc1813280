"""Evaluate agents of every kind on a data set: scripted baselines, trained agents and language models.

    embodied evaluate hanna --data DATA                                  # the shipped agent, beside baselines
    embodied evaluate hanna --data DATA --agent "random walk" shortest
    embodied evaluate hanna --data DATA --agent RUN/best.safetensors --out RESULTS
    embodied evaluate vnla --data DATA --agent llm --model NAME --base-url URL
    embodied evaluate hanna --data DATA --agent my_module:Policy my_learner:LEARNER=RUN
    embodied evaluate ask --seed-file FILE --agent submissions/team_7

The command prints a table with 95 % confidence intervals. With --out it also writes the table as Markdown, CSV and
JSON, and all episodes, which `embodied view` shows. Every answer of a language model is kept in --answers, so that the
same command resumes an interrupted run without asking twice.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from embodied.agents.language_models.options import client_of
from embodied.cli.common import bar, catalogue_of, note, show
from embodied.cli.evaluate_options import TEMPLATE, Options

if TYPE_CHECKING:
    from embodied.agents.learner import Learner
    from embodied.datasets.store import Dataset, SplitData
    from embodied.envs.base import HelpEnv
    from embodied.evaluation.tables import Row
    from embodied.interface import Agent, Assistant, Episode, Place, SeenPlace

LLM = "llm"
OWN_AGENT = re.compile(r"[\w.]+:\w+")
"""module:Class of a policy of one's own."""
FEW_TASKS = 20
"""How many tasks a language model plays, or anybody in a generated house, unless --tasks says otherwise."""
AREA = (90.0, 140.0)
"""Size of Ask-v0's houses, square metres."""


def run(args: Options) -> None:
    from embodied.datasets.store import dataset_of
    from embodied.locks import locked
    from embodied.task_kind import kind_named

    if args.rrd and not args.out:
        raise ValueError("--rrd wants --out DIR beside it: recordings go to DIR/recordings")
    data = dataset_of(args.data, args.kind) if args.data else None
    names, trained = _agents(args)
    if trained and data is None:
        raise ValueError(f"trained agents need --data, a folder that `embodied dataset {args.kind}` built")
    splits = args.split or kind_named(args.kind).test_splits
    if data is not None:
        for split in splits:
            data.names(split)  # refuses unknown ones
    with locked(args.out) if args.out else contextlib.nullcontext():
        _evaluate(args, data, names, trained, splits)


def _agents(args: Options) -> tuple[list[str], tuple[Learner, Path] | None]:
    """Names of agents, and the trained one with its learner, that --agent lists.

    Raises:
      ValueError: an unknown agent, or several trained ones.
    """
    from embodied.agents.learner import learner_named, playing_learner
    from embodied.task_kind import kind_named

    known = kind_named(args.kind).agent_names
    names, learner = list[str](), playing_learner(args.kind)
    trained: list[tuple[Learner, Path]] = []
    shipped = learner and learner.shipped
    for name in args.agent or (["shipped"] if shipped and args.data else known):
        path, (module, _, run) = Path(name), name.partition("=")
        if name == "shipped" and learner and shipped:
            trained.append((learner, shipped))
        elif ":" in module and run and not name.startswith("http"):
            trained.append((learner_named(module), weights_in(Path(run))))
        elif learner and (path.suffix == ".safetensors" or path.is_dir()):
            trained.append((learner, weights_in(path)))
        elif (
            OWN_AGENT.fullmatch(name)
            or name in known
            or name == LLM
            or (args.kind == "ask" and (name.startswith("http") or path.is_dir()))
        ):
            names.append(name)
        else:
            raise ValueError(f"unknown agent {name!r}; those of {args.kind!r} are {[*known, LLM]}, or a trained one")
    if len(trained) > 1:
        raise ValueError(f"one trained agent can be evaluated at a time, got {[str(file) for _, file in trained]}")
    if trained and trained[0][0].players is None:
        raise ValueError(f"learner {trained[0][0].name!r} says nothing of `players`, who play its agents")
    return names, trained[0] if trained else None


def weights_in(path: Path) -> Path:
    """The weights of a run folder, or the file itself."""
    return path / "best.safetensors" if path.is_dir() else path


def _evaluate(
    args: Options,
    data: Dataset | None,
    names: Sequence[str],
    trained: tuple[Learner, Path] | None,
    splits: Sequence[str],
) -> None:
    """Play, print the table, and write what goes into --out."""
    from embodied.assets.cache import write_json
    from embodied.evaluation import tables
    from embodied.records import episodes_file, fingerprint, save_lines

    def keep(split: str, name: str, episodes: Sequence[Episode]) -> None:
        if args.out:
            save_lines(args.out / episodes_file(split, name), episodes)

    client = functools.cache(lambda: client_of(args))
    changes = _Changes(args, client)
    rows, heard = _play(args, data, names, splits, changes, client, keep) if names else ([], {})
    about: dict[str, object] = {"data": data and data.digest, "seed": args.seed, "tasks": args.tasks, "agents": names}
    about |= {"splits": splits, "rules": args.rules, "assistant": args.assistant}
    if trained and data is not None:
        from embodied.cli.evaluate_trained import evaluate_trained

        rows_wanted = args.rows or (["learned"] if names else ())
        more, facts = evaluate_trained(args, data, *trained, splits, rows_wanted, keep, changes.applied)
        rows, about = [*rows, *more], about | facts
    if args.out:
        tables.save(rows, args.out, "table")
        write_json(args.out / "run.json", fingerprint(**about), indent=1)
        note(f"table and episodes in {args.out}")
    columns = trained[0].columns if trained else ()
    text = tables.markdown(rows, [c for c in columns or _columns(args.kind) if any(c in r.values for r in rows)])
    result: dict[str, object] = {"data": data and data.digest, "rows": json.loads(tables.as_json(rows))}
    result["listener"] = heard
    for name, (right, total) in heard.items():
        text += f"\n{name}: a scripted listener arrives with {right} of the {total} routes that it was told"
    if client.cache_info().currsize:
        text += f"\n{client().sent} requests were sent; all other answers were in {args.answers}"
    show(args, result, text)
    if args.rrd and args.out and trained and data is not None:
        from embodied.cli.evaluate_trained import record_trained

        record_trained(args, data, args.out, args.rrd)


def _columns(kind: str) -> Sequence[str]:
    from embodied import metrics
    from embodied.task_kind import kind_named

    return [*kind_named(kind).columns, *metrics.USAGE]


class _Changes:
    """What the command line changes about a split: who answers requests, and how long episodes are."""

    def __init__(self, args: Options, client: Callable[[], Any]) -> None:
        from embodied.agents.language_models.assistant import assistant_maker
        from embodied.plugins import assistant_of

        self.own: Assistant | None = None
        """An assistant of the user's."""
        self._reword = None
        self._steps: int | None = args.steps
        if ":" in args.assistant:
            self.own = assistant_of(args.assistant)
        elif args.assistant != TEMPLATE:
            self._reword = assistant_maker(args.assistant, client, args.prompts)

    def applied(self, split: SplitData) -> SplitData:
        """The split with this assistant and with episodes of at most --steps."""
        if self._steps:
            tasks = tuple(dataclasses.replace(t, horizon=min(t.horizon, self._steps)) for t in split.tasks)
            split = dataclasses.replace(split, tasks=tasks)

        def make_env() -> HelpEnv:
            env = split.make_env()
            if env.assistant is not None:
                env.assistant = self.own or (self._reword(env.assistant) if self._reword else env.assistant)
            return env

        return dataclasses.replace(split, make_env=make_env) if self.own or self._reword else split


def _play(
    args: Options,
    data: Dataset | None,
    names: Sequence[str],
    splits: Sequence[str],
    changes: _Changes,
    client: Callable[[], Any],
    keep: Callable[[str, str, Sequence[Episode]], None],
) -> tuple[list[Row], dict[str, tuple[int, int]]]:
    """The rows of agents without training, and what a scripted listener makes of the routes that each was told."""
    from embodied.agents.language_models.routes import followed_replies
    from embodied.evaluation.evaluate import evaluate
    from embodied.task_kind import kind_named

    looks = bool({LLM, *kind_named(args.kind).looking} & set(names)) or args.kind == "ask" or args.assistant != TEMPLATE
    limit = args.tasks or (FEW_TASKS if LLM in names or data is None else None)
    watch = functools.partial(bar, name="agents", unit="agent")
    rows: list[Row] = []
    heard: dict[str, tuple[int, int]] = {}
    for split in _stages(args, data, splits, changes.own, limit, looks=looks):

        def kept(name: str, episodes: Sequence[Episode], split: SplitData = split) -> None:
            keep(split.name, name, episodes)
            if looks and (routes := followed_replies(episodes, _seen(split.worlds)))[1]:
                heard[name] = routes

        worlds = _seen(split.worlds) if looks else None
        agents = {Path(n).name if "/" in n else n: _agent(args, n, split, worlds, client) for n in names}
        batch, changed = args.batch or 8, changes.applied(split)
        rows += evaluate(changed, agents, keep=kept, watch=watch, seed=args.seed, limit=limit, batch=batch)
    return rows, heard


def _stages(
    args: Options,
    data: Dataset | None,
    splits: Sequence[str],
    assistant: Assistant | None,
    limit: int | None,
    *,
    looks: bool,
) -> Iterable[SplitData]:
    """The splits of a data set, Ask-v0's hidden houses, or a generated flat."""
    from embodied.datasets.store import SplitData
    from embodied.gym.playground import Asked, flat_playground

    if data is None and args.seed_file:
        yield _hidden_houses(args, args.seed_file, limit or FEW_TASKS)
    elif data is None:
        seen = ("rgb",) if args.sees in ("strip", "panorama") else ()
        how = Asked(args.cache, sees=seen, rules=args.rules, assistant=assistant)
        flat = flat_playground(args.kind, args.seed, how)
        yield SplitData(f"flat_{args.seed}", flat.worlds, tuple(flat.tasks), flat.make_env)
    else:
        catalogue = catalogue_of(args) if looks else None
        for split in splits:
            worlds = None
            if catalogue is not None:
                worlds = {name: data.open_world(name, catalogue, args.cache) for name in data.names(split)}
            yield data.split(split, worlds=worlds, rules=args.rules, assistant=assistant)


def _hidden_houses(args: Options, file: Path, limit: int) -> SplitData:
    """Ask-v0 in the houses of a list of seeds. What is written down names houses by their place in the list alone."""
    from embodied.datasets.build import make_dataset_house
    from embodied.datasets.store import SplitData
    from embodied.evaluation.ask import ask_split, read_seeds
    from embodied.generate import HouseConfig
    from embodied.kinds.ask import ask_environments
    from embodied.tasks.ask import look_of
    from embodied.world import open_world

    seeds, catalogue = read_seeds(file), catalogue_of(args)
    worlds = {}
    for k, seed in enumerate(bar(seeds, "houses", "house", len(seeds))):
        house, graph = make_dataset_house(seed, f"ask_{k}", HouseConfig(area=AREA), catalogue)
        worlds[house.name] = open_world(house, catalogue, args.cache, graph=graph)
    look, unseen = look_of(catalogue), args.unseen_classes or None
    tasks = ask_split(worlds, look, -(-limit // len(seeds)), seed=seeds[0], unseen=unseen)
    name = "unseen classes" if unseen else "hidden"
    return SplitData(name, worlds, tuple(tasks), ask_environments(worlds, look))


def _agent(
    args: Options, name: str, split: SplitData, worlds: Mapping[str, SeenPlace] | None, client: Callable[[], Any]
) -> Agent:
    from embodied.evaluation.ask import submitted
    from embodied.plugins import made_by_name
    from embodied.task_kind import kind_named

    if name == LLM:
        return _model_agent(args, split, client())
    if OWN_AGENT.fullmatch(name):
        return made_by_name(name)
    kind = kind_named(args.kind)
    return kind.agent(name, worlds) if name in kind.agent_names else submitted(name)


def _model_agent(args: Options, split: SplitData, client: Any) -> Agent:
    from embodied.agents.language_models.agent import LanguageModelAgent
    from embodied.agents.language_models.prompts import PromptBuilder, agent_prompt
    from embodied.agents.language_models.words import SeenNames
    from embodied.gym.eyes import PanoramaStore
    from embodied.world import World

    prompt = agent_prompt(args.prompts)
    if args.sees == "names":
        return LanguageModelAgent(client, PromptBuilder(SeenNames(_seen(split.worlds)), prompt=prompt))
    if args.sees == "nothing":
        return LanguageModelAgent(client, PromptBuilder(prompt=prompt))
    drawn = {n: w for n, w in split.worlds.items() if isinstance(w, World)}
    return LanguageModelAgent(client, PromptBuilder(None, PanoramaStore(drawn), args.sees, prompt))


def _seen(worlds: Mapping[str, Place]) -> Mapping[str, SeenPlace]:
    return worlds  # type: ignore[return-value]  # all that are opened here can be seen

"""Evaluate agents of every kind on a data set: scripted baselines, trained agents and language models.

    embodied evaluate hanna --data DATA                                  # the shipped agent, beside baselines
    embodied evaluate hanna --data DATA --agent "random walk" shortest
    embodied evaluate hanna --data DATA --agent RUN/best.safetensors --out RESULTS
    embodied evaluate vnla --data DATA --agent llm --model NAME --base-url URL
    embodied evaluate hanna --data DATA --agent my_module:Policy my_learner:LEARNER=RUN
    embodied evaluate ask --seed-file FILE --agent submissions/team_7
    embodied evaluate my_task:KIND --data DATA

The command prints a table with 95 % confidence intervals. With --out it also writes the table as Markdown, CSV and
JSON, and all episodes, which `embodied view` shows. Every answer of a language model is kept in --answers, so that the
same command resumes an interrupted run without asking twice.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from embodied.agents.language_models.options import client_of
from embodied.cli.common import bar, catalogue_of, note, show
from embodied.cli.evaluate_options import TEMPLATE, EvaluateOptions

if TYPE_CHECKING:
    from embodied.agents.learner import Learner
    from embodied.datasets.store import Dataset, SplitData
    from embodied.envs.base import HelpEnv
    from embodied.evaluation.tables import Row
    from embodied.interface import Agent, Assistant, Episode, Place, SeenPlace
    from embodied.kinds.task_kind import TaskKind

LLM = "llm"
FEW_TASKS = 20
"""How many tasks a language model plays, or anybody in a generated house, unless --tasks says otherwise."""
SEEDED_AREA = (90.0, 140.0)
"""Size of the houses of --seed-file, square metres."""
Keep = Callable[[str, str, Sequence["Episode"]], None]
"""Is given split, agent and episodes, to save them."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Everything that one command evaluates."""

    kind: TaskKind
    data: Dataset | None
    splits: Sequence[str]
    agents: Mapping[str, str]
    """Row of the table to an agent without training: a baseline, 'llm', 'module:Policy', a folder, or an address."""
    trained: tuple[Learner, Path] | None
    """A trained agent: its learner, and its weights or run folder."""
    assistant: Assistant | None
    """A user's own."""
    reword: Callable[[Assistant], Assistant] | None
    """Puts an assistant in the place of the kind's own."""
    client: Callable[[], Any]
    """The client of the language model; made once."""
    limit: int | None
    """Tasks of a split."""
    rules: Any
    steps: int | None

    def changed(self, split: SplitData) -> SplitData:
        """The split with this assistant and with episodes of at most `steps`."""
        if self.steps:
            tasks = tuple(dataclasses.replace(t, horizon=min(t.horizon, self.steps)) for t in split.tasks)
            split = dataclasses.replace(split, tasks=tasks)

        def make_env() -> HelpEnv:
            env = split.make_env()
            if env.assistant is not None:
                env.assistant = self.assistant or (self.reword(env.assistant) if self.reword else env.assistant)
            return env

        return dataclasses.replace(split, make_env=make_env) if self.assistant or self.reword else split


@dataclass(eq=False)
class EvaluationResults:
    """Results, split by split."""

    rows: list[Row] = field(default_factory=list)
    facts: dict[str, object] = field(default_factory=dict)
    """For run.json."""
    listener: dict[str, dict[str, tuple[int, int]]] = field(default_factory=dict)
    """Split and agent to how many of the routes that it was told a scripted listener arrives with, and how many."""


def run(args: EvaluateOptions) -> None:
    from embodied.locks import locked
    from embodied.records import episodes_file, save_lines

    def keep(split: str, name: str, episodes: Sequence[Episode]) -> None:
        if args.out:
            save_lines(args.out / episodes_file(split, name), episodes)

    evaluation = parsed(args)
    with locked(args.out) if args.out else contextlib.nullcontext():
        results = play_all(args, evaluation, keep)
        write(args, evaluation, results)


# What is evaluated -------------------------------------------------------------------------------


def parsed(args: EvaluateOptions) -> Evaluation:
    """
    Raises:
      ValueError: an unknown kind, split, agent, rule or assistant, or options that do not go together.
    """
    from embodied.agents.language_models.assistant import assistant_maker
    from embodied.datasets.store import dataset_of
    from embodied.kinds.plugins import assistant_of
    from embodied.kinds.task_kind import kind_named

    kind = kind_named(args.kind)
    data = dataset_of(args.data, args.kind) if args.data else None
    agents, trained = agents_of(args, kind)
    if trained and data is None:
        raise ValueError(f"trained agents need --data, a folder that `embodied dataset {args.kind}` built")
    splits = args.split or kind.test_splits
    if data is not None:
        for split in splits:
            data.names(split)  # refuses unknown ones
    client = functools.cache(lambda: client_of(args))
    own = assistant_of(args.assistant) if ":" in args.assistant else None
    other = own is None and args.assistant != TEMPLATE
    return Evaluation(
        kind=kind,
        data=data,
        splits=splits,
        agents=agents,
        trained=trained,
        assistant=own,
        reword=assistant_maker(args.assistant, client, args.prompts) if other else None,
        client=client,
        limit=args.tasks or (FEW_TASKS if LLM in agents.values() or data is None else None),
        rules=kind.checked_rules(args.rules),
        steps=args.steps,
    )


def agents_of(args: EvaluateOptions, kind: TaskKind) -> tuple[dict[str, str], tuple[Learner, Path] | None]:
    """The agents without training that --agent lists, by row, and the trained one with its learner.

    Raises:
      ValueError: an unknown agent, several trained ones, or one whose learner does not say who plays it.
    """
    from embodied.agents.learner import learner_named, playing_learner

    known, learner = kind.agent_names, playing_learner(args.kind)
    names: list[str] = []
    trained: list[tuple[Learner, Path]] = []
    shipped = learner and learner.shipped
    for name in args.agent or (["shipped"] if shipped and args.data else known):
        path, (module, _, run) = Path(name), name.partition("=")
        if name == "shipped" and learner and shipped:
            trained.append((learner, shipped))
        elif ":" in module and run and not name.startswith("http"):
            trained.append((learner_named(module), weights_in(Path(run))))
        elif name in known or name == LLM or ":" in name or (path / "agent.py").is_file():
            names.append(name)
        elif learner and (path.suffix == ".safetensors" or path.is_dir()):
            trained.append((learner, weights_in(path)))
        else:
            raise ValueError(
                f"unknown agent {name!r}; those of {args.kind!r} are {[*known, LLM]}, a trained one, MODULE:POLICY, or "
                "a folder with an agent.py"
            )
    if len(trained) > 1:
        raise ValueError(f"one trained agent can be evaluated at a time, got {[str(file) for _, file in trained]}")
    if trained and trained[0][0].players is None:
        raise ValueError(f"learner {trained[0][0].name!r} says nothing of `players`, who play its agents")
    return rows_of(names), trained[0] if trained else None


def weights_in(path: Path) -> Path:
    """The weights of a run folder, or the file itself."""
    return path / "best.safetensors" if path.is_dir() else path


def rows_of(names: Iterable[str]) -> dict[str, str]:
    """Row to agent: the last part of a path or an address, or all of it where two agents end alike."""
    names = list(dict.fromkeys(names))
    ends = [n.rstrip("/").rpartition("/")[2] for n in names]
    return {end if ends.count(end) == 1 else name: name for name, end in zip(names, ends, strict=True)}


# Playing -----------------------------------------------------------------------------------------


def play_all(args: EvaluateOptions, evaluation: Evaluation, keep: Keep) -> EvaluationResults:
    """Play everything; a trained agent last, with the agents of its paper's tables beside it."""
    results, data = EvaluationResults(), evaluation.data
    if evaluation.agents:
        for split in opened_splits(args, evaluation):
            results.rows += play_split(args, evaluation, split, keep, results.listener.setdefault(split.name, {}))
    if evaluation.trained and data is not None:
        from embodied.cli.evaluate_trained import evaluate_trained

        wanted = args.rows or (["learned"] if evaluation.agents else ())
        rows, results.facts = evaluate_trained(
            args, data, *evaluation.trained, evaluation.splits, wanted, keep, evaluation.changed
        )
        results.rows += rows
    return results


def play_split(
    args: EvaluateOptions, evaluation: Evaluation, split: SplitData, keep: Keep, listener: dict[str, tuple[int, int]]
) -> list[Row]:
    """The rows of agents without training; `listener` gets what a scripted one makes of the routes that each heard."""
    from embodied.agents.language_models.routes import followed_replies
    from embodied.evaluation.evaluate import evaluate

    worlds = seen_places(split.worlds) if looks(args, evaluation) else None

    def kept(name: str, episodes: Sequence[Episode]) -> None:
        keep(split.name, name, episodes)
        if worlds is not None and (routes := followed_replies(episodes, worlds))[1]:
            listener[name] = routes

    agents = {row: agent_of(args, evaluation, name, split, worlds) for row, name in evaluation.agents.items()}
    watch = functools.partial(bar, name="agents", unit="agent")
    how: dict[str, Any] = {"seed": args.seed, "limit": evaluation.limit, "batch": args.batch or 8}
    return evaluate(evaluation.changed(split), agents, keep=kept, watch=watch, **how)


def looks(args: EvaluateOptions, evaluation: Evaluation) -> bool:
    """True where somebody looks around, so that houses are opened as worlds; generated ones are anyway."""
    looking = {LLM, *evaluation.kind.looking} & {*evaluation.agents.values()}
    return evaluation.data is None or bool(looking) or args.assistant != TEMPLATE


def opened_splits(args: EvaluateOptions, evaluation: Evaluation) -> Iterable[SplitData]:
    """The splits of a data set, the houses of a list of seeds, or a generated flat."""
    data, assistant = evaluation.data, evaluation.assistant
    if data is None:
        yield generated(args, evaluation)
        return
    catalogue = catalogue_of(args) if looks(args, evaluation) else None
    for split in evaluation.splits:
        worlds = None
        if catalogue is not None:
            worlds = {name: data.open_world(name, catalogue, args.cache) for name in data.names(split)}
        yield data.split(split, worlds=worlds, rules=evaluation.rules, assistant=assistant)


def generated(args: EvaluateOptions, evaluation: Evaluation) -> SplitData:
    """A flat, or the houses of a list of seeds, which what is written down names by their place in the list alone."""
    from embodied.datasets.store import SplitData
    from embodied.evaluation.own_agents import read_seeds
    from embodied.gym.playground import PlaygroundSettings, flat_playground, houses_playground

    kind = evaluation.kind
    seen = ("rgb",) if args.sees in ("strip", "panorama") else ()
    how = PlaygroundSettings(args.cache, observations=seen, rules=evaluation.rules, assistant=evaluation.assistant)
    if args.seed_file is None:
        flat = flat_playground(args.kind, args.seed, how)
        return SplitData(f"flat_{args.seed}", flat.worlds, flat.tasks, flat.make_env)
    seeds = read_seeds(args.seed_file)
    named = [(f"{kind.title.lower()}_{k}", seed) for k, seed in enumerate(seeds)]
    houses, each = bar(named, "houses", "house"), -(-(evaluation.limit or FEW_TASKS) // len(seeds))
    play = houses_playground(args.kind, houses, seeds[0], how, catalogue_of(args), SEEDED_AREA, each, args.part)
    return SplitData(args.part.replace("_", " ") if args.part else "hidden", play.worlds, play.tasks, play.make_env)


# Agents ------------------------------------------------------------------------------------------


def agent_of(
    args: EvaluateOptions, evaluation: Evaluation, name: str, split: SplitData, worlds: Mapping[str, SeenPlace] | None
) -> Agent:
    """An agent without training."""
    from embodied.evaluation.own_agents import submitted

    if name == LLM:
        return model_agent(args, split, evaluation.client())
    kind = evaluation.kind
    return kind.agent(name, worlds) if name in kind.agent_names else submitted(name)


def model_agent(args: EvaluateOptions, split: SplitData, client: Any) -> Agent:
    """A language model that is shown what --sees says."""
    from embodied.agents.language_models.agent import LanguageModelAgent
    from embodied.agents.language_models.observations import OracleNames
    from embodied.agents.language_models.prompts import PromptBuilder, agent_prompt
    from embodied.gym.sensors import PanoramaStore
    from embodied.world import World

    prompt = agent_prompt(args.prompts)
    if args.sees == "names":
        return LanguageModelAgent(client, PromptBuilder(OracleNames(seen_places(split.worlds)), prompt=prompt))
    if args.sees == "nothing":
        return LanguageModelAgent(client, PromptBuilder(prompt=prompt))
    drawn = {n: w for n, w in split.worlds.items() if isinstance(w, World)}
    return LanguageModelAgent(client, PromptBuilder(None, PanoramaStore(drawn), args.sees, prompt))


def seen_places(worlds: Mapping[str, Place]) -> Mapping[str, SeenPlace]:
    return worlds  # type: ignore[return-value]  # all that are opened here can be seen


# Results -----------------------------------------------------------------------------------------


def write(args: EvaluateOptions, evaluation: Evaluation, results: EvaluationResults) -> None:
    """Print the table, and write what goes into --out."""
    from embodied.assets.cache import write_json
    from embodied.evaluation import tables
    from embodied.records import fingerprint

    data, rows, client = evaluation.data, results.rows, evaluation.client
    digest = data and data.digest
    if args.out:
        about: dict[str, object] = {
            "data": digest,
            "seed": args.seed,
            "tasks": args.tasks,
            "agents": [*evaluation.agents.values()],
        }
        about |= {"splits": evaluation.splits, "rules": args.rules, "assistant": args.assistant}
        tables.save(rows, args.out, "table")
        write_json(args.out / "run.json", fingerprint(**{**about, **results.facts}), indent=1)
        note(f"table and episodes in {args.out}")
    text = tables.markdown(rows, [c for c in columns_of(evaluation) if any(c in r.values for r in rows)])
    result = {"data": digest, "rows": json.loads(tables.as_json(rows)), "listener": results.listener}
    for split, heard in results.listener.items():
        for name, (right, total) in heard.items():
            text += f"\n{name}, {split}: a scripted listener arrives with {right} of the {total} routes that it heard"
    if client.cache_info().currsize:  # type: ignore[attr-defined]
        text += f"\n{client().sent} requests were sent; all other answers were in {args.answers}"
    show(args, result, text)


def columns_of(evaluation: Evaluation) -> Sequence[str]:
    """The columns of the table: the learner's where a trained agent was evaluated and it names some."""
    from embodied.kinds import metrics

    learned = evaluation.trained[0].columns if evaluation.trained else ()
    return learned or [*evaluation.kind.columns, *metrics.USAGE]

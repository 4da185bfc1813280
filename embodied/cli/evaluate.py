"""Evaluate agents of every kind on a data set: scripted baselines, trained agents and language models.

    embodied evaluate hanna --data DATA                                  # the shipped agent, beside baselines
    embodied evaluate hanna --data DATA --agent "random walk" shortest
    embodied evaluate hanna --data DATA --agent RUN/best.safetensors --out RESULTS
    embodied evaluate vnla --data DATA --agent llm --model NAME --base-url URL
    embodied evaluate hanna --data DATA --agent my_module:Policy my_learner:LEARNER=RUN
    embodied evaluate ask --seed-file FILE --agent submissions/team_7
    embodied evaluate my_task:KIND --data DATA
    embodied evaluate vqa --data DATA --agent blind llm --model NAME --base-url URL

The command prints a table with 95 % confidence intervals. With --out it also writes the table as Markdown and
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
from typing import TYPE_CHECKING, Annotated, Any, cast

from embodied.agents.language_models.client import WithModel, client_of
from embodied.agents.options import Encoded, Threaded
from embodied.agents.vision.config import GOAL_IMAGES
from embodied.cli.common import Furnished, Printed, bar, catalogue_of, note, show
from embodied.cli.vqa import VQA
from embodied.cli.vqa import evaluate as answer_questions
from embodied.options import Count, InputFolder, InputPath, Option, OutputFolder

if TYPE_CHECKING:
    from embodied.agents.learner import Learner
    from embodied.datasets.store import Dataset, SplitData
    from embodied.envs.base import HelpEnv
    from embodied.evaluation.tables import Row
    from embodied.interface import Agent, Assistant, Episode, SeenPlace
    from embodied.kinds.task_kind import TaskKind

LLM, TEMPLATE = "llm", "template"
FEW_TASKS = 20
"""How many tasks a language model plays, or anybody in a generated house, unless --tasks says otherwise."""
SEEDED_AREA = (90.0, 140.0)
"""Size of the houses of --seed-file, square metres."""
DOOR_RULES = ("open", "push", "walk")
MODEL_SEES = ("names", "strip", "panorama", "nothing")


@dataclass(frozen=True, kw_only=True)
class TaskOptions:
    """Tasks."""

    data: InputFolder | None = None
    """The data set, a folder that `embodied dataset` built (default: one generated flat)."""
    split: tuple[Annotated[str, Option(metavar="SPLIT")], ...] = ()
    """Splits of the data set (default: test_unseen; hari: its three test splits)."""
    tasks: Count | None = None
    """Evaluate on at most N tasks of a split, spread over its houses (default: all, or 20 for a language model or
    without --data)."""
    steps: Count | None = None
    """Longest episode in steps (default: its task's)."""
    seed: int = 0
    """Random seed."""
    assistant: Annotated[str, Option(metavar="WHO")] = TEMPLATE
    """Who answers requests: template (the kind's own assistant), llm, person, or MODULE:CLASS of your own."""
    ask_after: Annotated[float, Option(metavar="SHARE")] = 0.0
    """Nobody can be asked before this share of an episode's steps, 0 to 1: success against the moment of the first
    question."""
    batch: Count | None = None
    """Play N episodes at a time, which does not change results (default: 32 for trained agents, else 8)."""
    rules: Annotated[str | None, Option(metavar="WORD")] = None
    """Rules of play of the kind of task. hanna: people tell the way (told), walk it ahead, too (shown), or do so where
    their day has them and lit pictures show them (living, living-shown). vnla: help in words (indirect, the default),
    the advisor acts and says it (direct) or does not (direct-mute), Algorithm 6 as printed (algorithm-6)."""
    closed_doors: float = 0.0
    """Close this share of the doors at the start of every task, besides those that its kind closes."""
    doors: Annotated[str, Option(words=DOOR_RULES)] = DOOR_RULES[0]
    """Effect of a move towards a closed door. open: none, the agent has to open it first; push: it opens the door;
    walk: it opens the door and goes through, for agents that know no doors."""
    seed_file: InputPath | None = None
    """Without --data: seeds of the houses to play in, one per line."""
    part: Annotated[str | None, Option(metavar="NAME")] = None
    """With --seed-file: the part of each house's tasks (ask: unseen_classes, those held out from training)."""


@dataclass(frozen=True, kw_only=True)
class Results(Printed):
    """Results."""

    out: OutputFolder | None = None
    """Folder for the table and the episodes."""


@dataclass(frozen=True, kw_only=True)
class OfTrained:
    """Trained agents."""

    rows: tuple[Annotated[str, Option(metavar="NAME")], ...] = ()
    """Rows of the table of a trained agent, such as 'learned' or 'learned, no ask' (default: all, or 'learned' where
    other agents are named)."""
    goal_image: Annotated[str, Option(words=GOAL_IMAGES)] = "same"
    """How goal images differ from what the agent sees there; same: not at all; later-camera: taken at another hour of
    another day, with people elsewhere and small things moved, by a robot's camera."""


@dataclass(frozen=True, kw_only=True)
class EvaluateOptions(TaskOptions, Results, OfTrained, WithModel, Encoded, Threaded, Furnished):
    kind: Annotated[str, Option(metavar="KIND", name="kind")]
    """The kind of task: find, goat, eqa, vln, vnla, hanna, hari, ask, doors, social, vqa, or your MODULE:NAME."""
    agent: tuple[Annotated[str, Option(metavar="NAME")], ...] = ()
    """Agents to evaluate: baselines by name, 'shipped', a file or run folder of `embodied train`, 'llm', MODULE:CLASS
    of your own policy, MODULE:LEARNER=RUN of your own learner, or a folder with an agent.py
    (default: shipped, else all baselines)."""
    threads: Count = 2
    sees: Annotated[str, Option(words=MODEL_SEES)] = "names"
    """Input of a language model: the true names of what is visible (an oracle), the candidate views as one strip,
    the panorama with markers, or nothing. vqa: nothing, or else frames."""
    frames: Count = 8
    """vqa: frames of a walk that a language model is shown."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Everything that one command evaluates, and what comes out, split by split."""

    args: EvaluateOptions
    kind: TaskKind
    data: Dataset | None
    splits: Sequence[str]
    agents: Mapping[str, str]
    """Row of the table to an agent without training: a baseline, 'llm', 'module:Policy', a folder, or an address."""
    trained: tuple[Learner, Path] | None
    """A trained agent: its learner, and its weights or run folder."""
    reword: Callable[[Assistant], Assistant]
    """Puts an assistant in the place of the kind's own."""
    client: Callable[[], Any]
    """The client of the language model; made once."""
    limit: int | None
    """Tasks of a split."""
    rules: Any
    rows: list[Row] = field(default_factory=list)
    facts: dict[str, object] = field(default_factory=dict)
    """For run.json."""
    listener: dict[str, dict[str, tuple[int, int]]] = field(default_factory=dict)
    """Split and agent to how many of the routes that it was told a scripted listener arrives with, and how many."""

    def changed(self, split: SplitData) -> SplitData:
        """The split with this assistant, these doors, this moment of asking and episodes of at most --steps."""
        from embodied.envs.base import DoorRule
        from embodied.evaluation.evaluate import late_env, with_doors

        if steps := self.args.steps:
            tasks = tuple(dataclasses.replace(t, horizon=min(t.horizon, steps)) for t in split.tasks)
            split = dataclasses.replace(split, tasks=tasks)
        split = with_doors(split, self.args.closed_doors, DoorRule(self.args.doors), seed=self.args.seed)

        def make_env() -> HelpEnv:
            env = split.make_env()
            if env.assistant is not None and self.args.assistant != TEMPLATE:
                env.assistant = self.reword(env.assistant)
            return env

        usual = self.args.assistant == TEMPLATE and not self.args.ask_after
        late = functools.partial(late_env, make_env, self.args.ask_after)
        return split if usual else dataclasses.replace(split, make_env=late)

    def keep(self, split: str, name: str, episodes: Sequence[Episode]) -> None:
        """Save episodes into --out."""
        from embodied.records import episodes_file, save_lines

        if self.args.out:
            save_lines(self.args.out / episodes_file(split, name), episodes)

    @property
    def looks(self) -> bool:
        """True where somebody looks around, so that houses are opened as worlds; generated ones are anyway."""
        looking = {LLM, *self.kind.looking} & {*self.agents.values()}
        return self.data is None or bool(looking) or self.args.assistant != TEMPLATE


def run(args: EvaluateOptions) -> None:
    from embodied.locks import locked

    if args.kind == VQA:
        answer_questions(args)
        return
    evaluation = parsed(args)
    with locked(args.out) if args.out else contextlib.nullcontext():
        for split in opened_splits(evaluation) if evaluation.agents else ():
            play_split(evaluation, split)
        if evaluation.trained and evaluation.data is not None:
            play_trained(evaluation, evaluation.data, *evaluation.trained)
        write(evaluation)


# What is evaluated -------------------------------------------------------------------------------


def parsed(args: EvaluateOptions) -> Evaluation:
    """
    Raises:
      ValueError: an unknown kind, split, agent, rule or assistant, or options that do not go together.
    """
    from embodied.agents.language_models.agent import assistant_maker
    from embodied.datasets.store import dataset_of
    from embodied.kinds.task_kind import kind_named

    kind = kind_named(args.kind)
    data = dataset_of(args.data, args.kind) if args.data else None
    agents, trained = agents_of(args, kind)
    if trained and data is None:
        raise ValueError(f"trained agents need --data, a folder that `embodied dataset {args.kind}` built")
    if (args.assistant != TEMPLATE or args.ask_after) and kind.help == "none":
        raise ValueError(f"nobody is asked in tasks of kind {kind.name!r}; leave --assistant and --ask-after out")
    for option, share in (("--ask-after", args.ask_after), ("--closed-doors", args.closed_doors)):
        if not 0 <= share <= 1:
            raise ValueError(f"{option} should be a share, 0 to 1, got {share:g}")
    splits = args.split or kind.test_splits
    if data is not None:
        for split in splits:
            data.names(split)  # refuses unknown ones
    client = functools.cache(lambda: client_of(args))
    reword = assistant_maker(args.assistant, client, args.prompts)
    limit = args.tasks or (FEW_TASKS if LLM in agents.values() or data is None else None)
    rules = kind.checked_rules(args.rules)
    return Evaluation(args, kind, data, splits, agents, trained, reword, client, limit, rules)


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


def play_split(evaluation: Evaluation, split: SplitData) -> None:
    """Play with the agents without training, and see what a scripted listener makes of the routes that each heard."""
    from embodied.agents.language_models.agent import followed_replies
    from embodied.evaluation.evaluate import evaluate

    args, worlds = evaluation.args, cast("Mapping[str, SeenPlace]", split.worlds) if evaluation.looks else None

    def kept(name: str, episodes: Sequence[Episode]) -> None:
        evaluation.keep(split.name, name, episodes)
        if worlds is not None and (routes := followed_replies(episodes, worlds))[1]:
            evaluation.listener.setdefault(split.name, {})[name] = routes

    agents = {row: agent_of(evaluation, name, split, worlds) for row, name in evaluation.agents.items()}
    watch = functools.partial(bar, name="agents", unit="agent")
    how: dict[str, Any] = {"seed": args.seed, "limit": evaluation.limit, "batch": args.batch or 8}
    evaluation.rows.extend(evaluate(evaluation.changed(split), agents, keep=kept, watch=watch, **how))


def play_trained(evaluation: Evaluation, data: Dataset, learner: Learner, file: Path) -> None:
    """Play with a trained agent, and with the agents of its paper's tables over the same tasks; loads PyTorch.

    Raises:
      ValueError: an unknown row.
    """
    from embodied.agents.common.tensors import use_threads
    from embodied.agents.common.weights import weights_digest
    from embodied.agents.learner import PlaySettings
    from embodied.agents.studies.episodes import JUDGES, evaluate_frozen
    from embodied.agents.vision.run import pictures_of
    from embodied.records import identity_of
    from embodied.render.pictures import in_words

    args, blind = evaluation.args, set[str]()
    rows: list[Row] = []
    use_threads(args.threads)
    assert learner.players is not None, "others were refused"
    how = PlaySettings(**{f.name: getattr(args, f.name) for f in dataclasses.fields(PlaySettings)})
    players_of = learner.players(file, data, how)
    wanted = args.rows or (["learned"] if evaluation.agents else ())
    for split in evaluation.splits:
        players, keep = players_of(split), functools.partial(evaluation.keep, split)
        if players.about and split == evaluation.splits[0]:
            note(players.about)
        if unknown := sorted(set(wanted) - set(players.agents)):
            raise ValueError(f"unknown rows {unknown}; there are {list(players.agents)}")
        for name in bar(wanted or [*players.agents], "agents", "agent"):
            whole, agent = players.agents[name]
            playing: dict[str, Any] = {"seed": args.seed, "limit": args.tasks, "batch": args.batch or 32, "keep": keep}
            rows += evaluate_frozen(evaluation.changed(whole), {name: agent}, **playing)
        blind |= set(players.blind)
    looking = sorted({r.agent for r in rows} - blind)
    names = [n for split in evaluation.splits for n in data.names(split)] if looking else []
    facts: dict[str, object] = {"agent": weights_digest(file) if file.is_file() else str(file), "looking": looking}
    facts["pictures"] = {n: in_words(pictures_of(data, n, args.pictures)) for n in names}
    facts["goal_image"] = args.goal_image
    evaluation.rows.extend(rows)
    evaluation.facts.update(facts | {"identity": identity_of(*JUDGES)})


def opened_splits(evaluation: Evaluation) -> Iterable[SplitData]:
    """The splits of a data set, the houses of a list of seeds, or a generated flat."""
    args, data = evaluation.args, evaluation.data
    if data is None:
        yield generated(evaluation)
        return
    catalogue = catalogue_of(args) if evaluation.looks else None
    for split in evaluation.splits:
        worlds = None
        if catalogue is not None:
            worlds = {name: data.open_world(name, catalogue, args.cache) for name in data.names(split)}
        yield data.split(split, worlds=worlds, rules=evaluation.rules)


def generated(evaluation: Evaluation) -> SplitData:
    """A flat, or the houses of a list of seeds, which what is written down names by their place in the list alone."""
    from embodied.datasets.store import SplitData
    from embodied.evaluation.evaluate import read_seeds
    from embodied.gym.playground import PlaygroundSettings, flat_playground, houses_playground

    args = evaluation.args
    seen = ("rgb",) if args.sees in ("strip", "panorama") else ()
    how = PlaygroundSettings(args.cache, observations=seen, rules=evaluation.rules)
    if args.seed_file is None:
        flat = flat_playground(args.kind, args.seed, how)
        return SplitData(flat.worlds, flat.tasks, flat.make_env, f"flat_{args.seed}")
    seeds = read_seeds(args.seed_file)
    named = [(f"{evaluation.kind.title.lower()}_{k}", seed) for k, seed in enumerate(seeds)]
    houses, each = bar(named, "houses", "house"), -(-(evaluation.limit or FEW_TASKS) // len(seeds))
    play = houses_playground(args.kind, houses, seeds[0], how, catalogue_of(args), SEEDED_AREA, each, args.part)
    return SplitData(play.worlds, play.tasks, play.make_env, args.part.replace("_", " ") if args.part else "hidden")


def agent_of(evaluation: Evaluation, name: str, split: SplitData, worlds: Mapping[str, SeenPlace] | None) -> Agent:
    """An agent without training; a language model is shown what --sees says."""
    from embodied.evaluation.evaluate import submitted

    if name != LLM:
        kind = evaluation.kind
        return kind.agent(name, worlds) if name in kind.agent_names else submitted(name)
    from embodied.agents.language_models.agent import LanguageModelAgent
    from embodied.agents.language_models.prompts import PromptBuilder, agent_prompt, oracle_names
    from embodied.gym.sensors import PanoramaStore
    from embodied.world import World

    prompt, sees = agent_prompt(evaluation.args.prompts), evaluation.args.sees
    if sees == "names":
        builder = PromptBuilder(oracle_names(cast("Mapping[str, SeenPlace]", split.worlds)), prompt=prompt)
    elif sees == "nothing":
        builder = PromptBuilder(prompt=prompt)
    else:
        drawn = {n: w for n, w in split.worlds.items() if isinstance(w, World)}
        builder = PromptBuilder(None, PanoramaStore(drawn), sees, prompt)
    return LanguageModelAgent(evaluation.client(), builder)


# Results -----------------------------------------------------------------------------------------


def write(evaluation: Evaluation) -> None:
    """Print the table, and write what goes into --out."""
    from embodied.assets.cache import write_json
    from embodied.evaluation import tables
    from embodied.kinds import metrics
    from embodied.records import fingerprint

    args, rows, client = evaluation.args, evaluation.rows, evaluation.client
    digest, agents = evaluation.data and evaluation.data.digest, [*evaluation.agents.values()]
    if args.out:
        about: dict[str, object] = {"data": digest, "seed": args.seed, "tasks": args.tasks, "agents": agents}
        about |= {"splits": evaluation.splits, "rules": args.rules, "doors": [args.closed_doors, args.doors]}
        about |= {"assistant": args.assistant, "ask_after": args.ask_after}
        tables.save(rows, args.out, "table")
        write_json(args.out / "run.json", fingerprint(**{**about, **evaluation.facts}), indent=1)
        note(f"table and episodes in {args.out}")
    learned = evaluation.trained[0].columns if evaluation.trained else ()
    columns = learned or [*evaluation.kind.columns, *metrics.USAGE]
    text = tables.markdown(rows, [c for c in columns if any(c in r.values for r in rows)])
    result = {"data": digest, "rows": json.loads(tables.as_json(rows)), "listener": evaluation.listener}
    for split, heard in evaluation.listener.items():
        for name, (right, total) in heard.items():
            text += f"\n{name}, {split}: a scripted listener arrives with {right} of the {total} routes that it heard"
    if client.cache_info().currsize:  # type: ignore[attr-defined]
        text += f"\n{client().sent} requests were sent; all other answers were in {args.answers}"
    show(args, result, text)

"""The dissertation's tables on our houses (agents.hanna.study_tables): train the agents of each row, judge all on the
same tasks, print both."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib
import torch

from agents.common.figures import conditions_figure, curves_figure, houses_figure, requests_curves, requests_figure
from agents.common.lessons import Lessons, drawings, split_of
from agents.common.processor_time import ProcessorTime
from agents.common.studies import kept_episodes, refuse_unknown
from agents.common.tables import side_by_side as beside
from agents.hanna.agent import load_agent
from agents.hanna.evaluation import PRICED, hanna_policies, plainer_policies, priced_policies
from agents.hanna.judging import about
from agents.hanna.run import train_agent
from agents.hanna.study_tables import COMPARED, PRICES, SHORTER, TABLES, TEST, VARIANTS, Line, Table
from agents.hanna.training_config import TrainingConfig
from agents.vision.bank import FeatureBank
from agents.vision.drawn import pictures_of
from agents.vision.encoder import Encoder, load_encoder
from assets.cache import write_bytes, write_json
from embodied.datasets.store import Dataset, SplitData, dataset_of
from embodied.evaluation.evaluate import agent as agent_without_learning
from embodied.evaluation.tables import Estimate, Row, difference, row, save, shown
from embodied.interface import Agent, Episode
from embodied.locks import locked
from embodied.navigation.graph import NavGraph

Note = Callable[[str], None]


@dataclass(frozen=True)
class StudySetting:
    """What all agents of a study share."""

    data: Path
    encoder: Path
    out: Path
    config: TrainingConfig
    """Where the variants start from."""
    tasks: int | None = None
    """At most so many tasks per split, from all houses alike."""
    seed: int = 0
    """Of judging; training has its own in `config`."""
    device: str = "cpu"
    threads: int = 1
    """Of PyTorch, per agent in training."""
    quality: str | None = None
    """Of the pictures that features come from; as the data set holds them where not given."""
    seeds: int = 1
    """Agents per row, from the seed of `config` on."""
    begin: Path | None = None
    """A trained agent whose weights and words every row begins with; None: random weights."""
    judged_in: Path | None = None
    """Another data set, in whose houses, that nobody learned from, agents are judged; None: in those of `data`."""

    @property
    def judges(self) -> Path:
        """The data set that agents are judged in."""
        return self.data if self.judged_in is None else self.judged_in

    def config_of(self, variant: str, seed: int | None = None) -> TrainingConfig:
        chosen = VARIANTS[SHORTER.get(variant, variant)]
        config = dataclasses.replace(self.config, seed=self.config.seed if seed is None else seed, **chosen)
        if variant not in SHORTER:
            return config
        share = min(1.0, config.training_houses / len(dataset_of(self.data, "hanna").names("train")))
        iterations = max(1, round(config.iterations * share))
        return dataclasses.replace(config, iterations=iterations, validate_every=min(config.validate_every, iterations))

    def folder_of(self, variant: str, seed: int | None = None) -> Path:
        name = variant.replace(",", "").replace(" ", "_")
        return self.out / "agents" / name / f"seed_{self.config.seed if seed is None else seed}"

    def repeats(self) -> range:
        """Training seeds."""
        return range(self.config.seed, self.config.seed + self.seeds)


def run_study(
    setting: StudySetting,
    names: Sequence[str],
    *,
    rows: Sequence[str] | None = None,
    workers: int = 1,
    note: Note = print,
) -> dict[str, Path]:
    """Train what is missing, judge, and write the tables as Markdown, CSV and JSON, and the learning curves;
    returns the Markdown files.

    Agents are trained in `workers` processes; each goes on from its run folder, so the same
    command continues after an interruption. Results, but for the processor time they took, do not depend on `workers`.

    Args:
      rows: train and judge these agents of VARIANTS and SHORTER only; tables say which rows they lack.

    Raises:
      ValueError: an unknown study, or rows that none of the tables can have.
      FileNotFoundError: features of a split that agents are judged on are missing; said before any is trained.
      LockedError: another process writes to the study's folder.
    """
    refuse_unknown(names, TABLES)
    data = dataset_of(setting.judges, "hanna")
    whole = [_possible(TABLES[n], setting, data, None) for n in names]
    refuse_unknown(rows or (), _agents(whole), "rows of these tables")
    tables = {n: _possible(TABLES[n], setting, data, rows) for n in names}
    if empty := [n for n, table in tables.items() if not table.lines]:
        raise ValueError(f"rows {list(rows or ())} leave nothing of {empty}; leave these out, or add rows of theirs")
    wanted = _agents(tables.values())
    jobs = (
        joblib.delayed(_train)(setting, v, seed, note if workers == 1 else None)
        for seed in setting.repeats()
        for v in wanted
    )
    for split in dict.fromkeys(split for table in tables.values() for split in table.splits):
        _bank(setting, data, split)
    with locked(setting.out):
        cost = ProcessorTime(setting.out / "judging_seconds.json")
        for variant, trained, line in joblib.Parallel(n_jobs=workers, return_as="generator_unordered")(jobs):
            cost.trained(variant, trained)
            note(line)
        curves_figure({v: _validations(setting.folder_of(v)) for v in wanted}, setting.out / "figure_curves.png")
        plays = _plays(setting, tables.values())
        for took, line in joblib.Parallel(n_jobs=workers, return_as="generator_unordered")(
            joblib.delayed(_play)(setting, *where, names) for where, names in plays.items()
        ):
            cost.judged(took)
            note(line)
        judged = _Judge(setting, data, cost, note)
        return {name: _write(setting, name, table, judged) for name, table in tables.items()}


def _agents(tables: Iterable[Table]) -> list[str]:
    """The learning agents that tables show or compare, each once."""
    names = ([*(line.variant for line in t.lines), *itertools.chain(*t.compared)] for t in tables)
    return [*dict.fromkeys(name for name in itertools.chain(*names) if name)]


def _plays(setting: StudySetting, tables: Iterable[Table]) -> Mapping[tuple[str, str, int], list[str]]:
    """(variant, split, training seed) to what is played of that agent."""
    found: dict[tuple[str, str, int], dict[str, None]] = {}
    for table in tables:
        pairs = [Line(name, name) for pair in table.compared for name in pair]
        for line in (*table.lines, *pairs):
            for split in table.splits:
                for seed in setting.repeats() if line.variant else (setting.config.seed,):
                    found.setdefault((line.variant, split, seed), {})[line.played] = None
    return {where: list(names) for where, names in found.items()}


def _play(
    setting: StudySetting, variant: str, split: str, seed: int, names: Sequence[str]
) -> tuple[dict[str, float], str]:
    """Play what has not been played; the seconds of processor time that each took, and what to tell."""
    torch.set_num_threads(setting.threads)
    player, took = _Player(setting, Dataset(setting.judges)), {}
    for name in names:
        began = time.process_time()
        player.episodes(variant, name, split, seed)
        took[player.named(variant, name, split, seed)] = time.process_time() - began
    return took, f"{variant or 'without learning'}, seed {seed}: judged on {split}"


def _possible(table: Table, setting: StudySetting, data: Dataset, rows: Sequence[str] | None) -> Table:
    """The table without agents that are not wanted, or that learn from as many training houses as there are, or more;
    with the splits out of distribution that there are, and without seen houses where agents are judged in those of
    another data set.

    Args:
      data: that agents are judged in.
      rows: agents that are wanted; None: all.
    """
    houses = len(dataset_of(setting.data, "hanna").names("train"))
    wanted = lambda variant: rows is None or variant in rows
    there = lambda variant: not variant or (wanted(variant) and setting.config_of(variant).training_houses < houses)
    kept = [k for k, s in enumerate(table.splits) if setting.judged_in is None or not s.endswith("_seen")]
    printed = lambda line: {name: [x[k] for k in kept if k < len(x)] for name, x in line.printed.items()}
    return dataclasses.replace(
        table,
        lines=tuple(dataclasses.replace(x, printed=printed(x)) for x in table.lines if there(x.variant)),
        splits=(*(table.splits[k] for k in kept), *(data.ood if table.splits == TEST else ())),
        compared=tuple(pair for pair in table.compared if all(map(there, pair))),
    )


def _train(setting: StudySetting, variant: str, seed: int, note: Note | None) -> tuple[str, float | None, str]:
    """Train an agent, or go on; which, the seconds of processor time it took, and what to tell."""
    torch.set_num_threads(setting.threads)
    data, encoder, folder = Dataset(setting.data), load_encoder(setting.encoder), setting.folder_of(variant, seed)
    config = setting.config_of(variant, seed)
    with contextlib.ExitStack() as stack:
        if note is None:
            folder.mkdir(parents=True, exist_ok=True)
            log = stack.enter_context(open(folder / "log.txt", "a", buffering=1, encoding="utf-8"))
            note = lambda line: print(line, file=log)
        lessons = Lessons(data, encoder, setting.quality, device=setting.device)
        progress = train_agent(lessons, config, folder, begin=setting.begin, note=note)
    best = f"best validation {100 * progress.best:.1f} %, kept after {progress.best_update}"
    return variant, progress.processor, f"{variant}, seed {seed}: {progress.update} updates, {best}"


def _validations(folder: Path) -> list[dict[str, float]]:
    """How a training went, validation by validation."""
    path = folder / "validation.jsonl"
    text = path.read_text(encoding="utf-8").splitlines()
    try:
        lines: list[dict[str, float]] = [json.loads(line) for line in text]
    except ValueError as e:
        raise ValueError(f"{path} holds a line that is no JSON ({e}); delete that line") from e
    return list({line["update"]: line for line in lines}.values())  # a resumed run may have validated twice


class _Player:
    """Plays an agent of a study on a split, or takes from the study's folder what it played before."""

    def __init__(self, setting: StudySetting, data: Dataset) -> None:
        self.setting, self.data = setting, data
        self.encoder: Encoder = load_encoder(setting.encoder)
        self._splits: dict[str, tuple[SplitData, FeatureBank, dict[str, Any]]] = {}

    def episodes(self, variant: str, played: str, split: str, seed: int) -> list[Episode]:
        whole, bank, drawn = self._split(split)
        path = self.setting.folder_of(variant, seed) / "best.safetensors"
        looks = (path, self.encoder.digest, drawn) if variant else ()

        def policy() -> Agent:
            if not variant:
                return agent_without_learning("hanna", played)
            agent = load_agent(path)
            every = (hanna_policies, priced_policies, plainer_policies)
            return {name: policy for make in every for name, policy in make(agent, bank).items()}[played]

        name = f"{variant}, seed {seed}, {played}" if variant else played
        return kept_episodes(
            self.setting.out / "episodes",
            name,
            (self.data.digest, played, *looks),
            whole,
            policy,
            seed=self.setting.seed,
            limit=self.setting.tasks,
        )

    def named(self, variant: str, played: str, split: str, seed: int) -> str:
        """What `episodes` plays, in words."""
        agent = f"{variant}, seed {seed}, {played}" if variant else played
        how = f"{self.setting.tasks or 'all'} tasks, judged with seed {self.setting.seed}"
        return f"{agent} on {split} of {self.data.digest}, {how}"

    def _split(self, name: str) -> tuple[SplitData, FeatureBank, dict[str, Any]]:
        if name not in self._splits:
            quality = self.setting.quality
            drawn = {n: dataclasses.asdict(pictures_of(self.data, n, quality)) for n in self.data.names(name)}
            self._splits[name] = self.data.split(name), _bank(self.setting, self.data, name), drawn
        return self._splits[name]


def _bank(setting: StudySetting, data: Dataset, split: str) -> FeatureBank:
    """What agents see in a split's houses."""
    return split_of(data, split, load_encoder(setting.encoder).digest, quality=setting.quality).bank


class _Judge:
    """The episodes of a table's rows, with all of their training seeds, and what they come to."""

    def __init__(self, setting: StudySetting, data: Dataset, cost: ProcessorTime, note: Note) -> None:
        self.setting, self.data, self.cost, self.note = setting, data, cost, note
        self.folder = setting.out if setting.judged_in is None else setting.out / f"judged_in_{data.digest[:16]}"
        """Where tables and figures go; agents and episodes are shared."""
        self.behaviour: dict[tuple[str, str], dict] = {}
        self.player = _Player(setting, data)
        self._episodes: dict[tuple[str, str], list[Episode]] = {}

    def row(self, line: Line, split: str) -> Row:
        episodes = self.episodes(line, split)
        return row(line.key, split, episodes, self._graphs(split), seed=self.setting.seed)

    def difference(self, first: str, second: str, split: str, column: str) -> Estimate:
        """How far agent `first` lies above `second`, task by task."""
        pair = [self.episodes(Line(name, name), split) for name in (first, second)]
        return difference(pair[0], pair[1], column, self._graphs(split))

    def episodes(self, line: Line, split: str) -> list[Episode]:
        """Those of all training seeds, one seed after the other."""
        if (line.key, split) not in self._episodes:
            seeds = self.setting.repeats() if line.variant else [self.setting.config.seed]
            found = [e for seed in seeds for e in self.player.episodes(line.variant, line.played, split, seed)]
            if line.variant and line.played == "learned":
                self.behaviour[line.key, split] = about(found, self.data.places(split))
            self._episodes[line.key, split] = found
            success = self.row(line, split).values["success"]
            self.note(f"{line.key} on {split}: success {shown('success', success)} %")
        return self._episodes[line.key, split]

    def _graphs(self, split: str) -> dict[str, NavGraph]:
        return {name: place.graph for name, place in self.data.places(split).items()}


def _write(setting: StudySetting, name: str, table: Table, judged: _Judge) -> Path:
    """One study's files; the figures go with the tables they belong to."""
    rows = [
        dataclasses.replace(judged.row(line, split), agent=line.label) for split in table.splits for line in table.lines
    ]
    stem = f"table_{name}"
    save(rows, judged.folder, stem)
    path = judged.folder / f"{stem}.md"
    write_bytes(path, side_by_side(setting, name, table, rows, judged).encode())
    learned = [line for line in table.lines if line.variant == "final"]
    if name == "4.5" and learned:
        behaviour = judged.behaviour[learned[-1].key, "test_unseen"]
        write_json(judged.folder / "behaviour.json", behaviour, indent=1)
        requests_figure(behaviour, judged.folder / "figure_D.1.png")
        conditions_figure(behaviour, judged.folder / "figure_D.2.png")
    if name == "requests":
        by = {line.played: r.values for line, r in zip(table.lines, rows, strict=True)}
        trained = [r.values for line, r in zip(table.lines, rows, strict=True) if line.variant in PRICES]
        requests_curves(
            {kind: [(by[n]["requests"], by[n]["success"]) for n in rules if n in by] for kind, rules in PRICED.items()}
            | {"trained at a price": [(v["requests"], v["success"]) for v in trained]},
            judged.folder / "figure_requests.png",
        )
    if name == "houses":
        there = len(dataset_of(setting.data, "hanna").names("train"))
        count = {line.variant: setting.config_of(line.variant).training_houses or there for line in table.lines}
        lines = [line for _ in table.splits for line in table.lines]
        by_trail = {(r.split, x.variant): r for x, r in zip(lines, rows, strict=True) if x.played == "learned"}
        houses_figure(
            {
                f"{s}, {how}": [
                    (n, by_trail[s, variant].values["success"])
                    for variant, n in count.items()
                    if n == there or (variant in SHORTER) == (how == "equal passes")
                ]
                for s in table.splits
                for how in ("equal updates", "equal passes")
            },
            judged.folder / "figure_houses.png",
        )
    return path


def side_by_side(setting: StudySetting, name: str, table: Table, rows: Sequence[Row], judged: _Judge) -> str:
    """The table with the dissertation's numbers in brackets, and what it was made with."""
    by = {(r.agent, r.split): r for r in rows}
    first = {r.split: r for r in rows}
    tasks = {s: len({e.task.id for e in judged.episodes(table.lines[0], s)}) for s in table.splits}
    counts = "; ".join(f"{s}: {tasks[s]} tasks in {first[s].houses} houses" for s in table.splits)
    c = setting.config
    brackets = "; in brackets the dissertation's numbers" if any(line.printed for line in table.lines) else ""
    how = (
        f"{counts}{_where(setting, table, judged)}. Mean and 95 % interval clustered by "
        f"house{' and training seed' if setting.seeds > 1 else ''}{brackets}. Trained {c.iterations} updates of "
        f"{c.batch} episodes, "
        f"{f'begun with {setting.begin.name}, ' if setting.begin else ''}"
        f"{'seeds' if setting.seeds > 1 else 'seed'} {', '.join(map(str, setting.repeats()))}; judged with seed "
        f"{setting.seed}, temperature {c.evaluation_temperature:g}, ask threshold {c.ask_threshold:g}. Rates in per "
        f"cent.{_cost(setting, table, judged)}"
    )
    title = f"{name}: {table.title}" if name.isalpha() else f"Table {name}: {table.title}"
    lines = [(line.label, line.printed) for line in table.lines]
    value = lambda label, split, column: by[label, split].values[column]
    pairs = [
        f"- {first} less {second}, {split}: "
        + ", ".join(f"{column} {shown(column, judged.difference(first, second, split, column))}" for column in COMPARED)
        for first, second in table.compared
        for split in table.splits
    ]
    told = ["", "Task by task, between agents that differ in one thing:", "", *pairs, ""] if pairs else []
    there = _agents([table])
    if missing := [a for a in _agents([_possible(TABLES[name], setting, judged.data, None)]) if a not in there]:
        told += ["", f"Not run: {', '.join(missing)}.", ""]
    return beside(title, table.splits, table.columns, lines, value, how) + "\n".join(told)


def _where(setting: StudySetting, table: Table, judged: _Judge) -> str:
    """How the pictures are drawn that agents are judged by and learn from, and whose houses those are."""
    seen = drawings(judged.data, itertools.chain(*map(judged.data.names, table.splits)), setting.quality)
    data = dataset_of(setting.data, "hanna")
    other = f", of the data set {judged.data.digest[:16]}, not that of training" if setting.judged_in else ""
    return f"{other}; drawn {seen}, those of training {drawings(data, data.names('train'), setting.quality)}"


def _cost(setting: StudySetting, table: Table, judged: _Judge) -> str:
    """The processor time of a table's agents, where it was counted."""
    plays = [(*where, name) for where, names in _plays(setting, [table]).items() for name in names]
    played = (judged.player.named(variant, name, split, seed) for variant, split, seed, name in plays)
    hours = judged.cost.hours(_agents([table]), played)
    return "" if hours is None else f" Processor time: {hours[0]:.2f} hours to train, {hours[1]:.2f} to judge."

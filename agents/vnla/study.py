"""The tables of VNLA's first paper (Nguyen et al. 2019, arXiv 1812.04155): train what is missing, judge, print.

A study is a folder: `VARIANT/seed_N` holds an agent and what it did. Variants that tables share are trained once, and
everything goes on where it stopped. Agents are judged with the program's five seeds, from which budgets are drawn.
Who asks as its teacher does is the learned asker's agent: they are trained alike (docs/sources.md, S160).
"""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch

from agents.common.lessons import Lessons
from agents.common.session import Note
from agents.common.studies import refuse_unknown, run_all, seeds_with
from agents.common.tables import Printed, side_by_side
from agents.vision.encoder import Encoder
from agents.vnla.agent import load_agent
from agents.vnla.config import VnlaSettings
from agents.vnla.judging import DIRECT, LEARNED, TEACHER, judge
from agents.vnla.run import train_agent, vnla_data
from assets.cache import write_bytes
from embodied.evaluation.tables import Estimate, across_seeds, as_json
from embodied.interface import Episode
from embodied.records import episodes_file, save_lines

EVALUATION_SEEDS = (123, 435, 6757, 867, 983)
"""The program's."""
SPLITS = ("test_seen", "test_unseen")
COLUMNS = ("success", "room success", "navigation error", "requests")


@dataclass(frozen=True)
class VnlaVariant:
    """An agent of the study: what differs from the chosen settings, and whether its requests name rooms."""

    changes: Mapping[str, Any] = field(default_factory=dict)
    rooms: bool = True


VARIANTS: Mapping[str, VnlaVariant] = {
    "learned": VnlaVariant(),
    "none": VnlaVariant({"asker": "none"}),
    "first": VnlaVariant({"asker": "first"}),
    "random": VnlaVariant({"asker": "random"}),
    "direct, not in words": VnlaVariant({"rules": "direct-mute"}),
    "rules a and e": VnlaVariant({"ask_rules": "a and e"}),
    "rules b to d": VnlaVariant({"ask_rules": "b to d"}),
    "learned without rooms": VnlaVariant(rooms=False),
    "random without rooms": VnlaVariant({"asker": "random"}, rooms=False),
}


@dataclass(frozen=True)
class VnlaLine:
    """One row of a table: who was trained, how it is played and on which requests."""

    label: str
    variant: str
    played: str = LEARNED
    """A row of agents.vnla.judging."""
    rooms: bool = True
    printed: Printed = field(default_factory=dict)
    """Column to the paper's numbers, one per split of SPLITS; only those that we can cite."""

    @property
    def key(self) -> str:
        return f"{self.played}, {'rooms' if self.rooms else 'no rooms'}"


TABLES: Mapping[str, tuple[str, tuple[VnlaLine, ...]]] = {
    "askers": (
        "Who decides when to ask",
        (
            VnlaLine("none", "none", printed={"success": (28.39, 6.36)}),
            VnlaLine("first", "first", printed={"success": (None, 20.0)}),
            VnlaLine("random", "random", printed={"success": (None, 25.05)}),
            VnlaLine("teacher", "learned", TEACHER, printed={"success": (None, 34.95)}),
            VnlaLine("learned", "learned", printed={"success": (52.09, 34.5)}),
        ),
    ),
    "interventions": (
        "Direct and indirect intervention",
        (
            VnlaLine("direct, not in words", "direct, not in words"),
            VnlaLine("direct, in words", "learned", DIRECT),
            VnlaLine("indirect", "learned"),
        ),
    ),
    "rooms": (
        "Requests that name no room",
        (
            VnlaLine("random, trained without rooms", "random without rooms", rooms=False),
            VnlaLine("learned, trained without rooms", "learned without rooms", rooms=False),
            VnlaLine("learned, trained with rooms", "learned", rooms=False),
        ),
    ),
    "rules": (
        "Rules of the asking teacher",
        (VnlaLine("a and e", "rules a and e"), VnlaLine("b to d", "rules b to d"), VnlaLine("all", "learned")),
    ),
}
"""The paper's Tables 2, 3, 4 and 7, in this order."""


@dataclass(frozen=True, eq=False)
class VnlaStudySetting:
    """What all agents of a study share."""

    data: Path
    out: Path
    encoder: Encoder
    config: VnlaSettings
    """Where the variants start from; its seed is the first one."""
    without_rooms: Path | None = None
    """A data set whose requests name no room, for the table 'rooms'."""
    seeds: int = 3
    """Agents of the learned asker."""
    others: int = 3
    """Agents of every other variant."""
    tasks: int | None = None
    """Judge on at most so many tasks of a split, from all houses alike."""
    quality: str | None = None
    """Of the pictures that features come from."""
    threads: int = 1
    """Of PyTorch, per agent."""

    def repeats(self, variant: str) -> list[int]:
        """Training seeds of a variant."""
        return [self.config.seed + k for k in range(self.seeds if variant == LEARNED else self.others)]

    def folder(self, variant: str, seed: int) -> Path:
        return self.out / variant.replace(",", "").replace(" ", "_") / f"seed_{seed}"

    def lessons(self, rooms: bool) -> Lessons:
        """What agents of one of the two kinds of requests learn from.

        Raises:
          ValueError: requests without rooms are wanted and there are none, or the data set names (no) rooms.
        """
        folder = self.data if rooms else self.without_rooms
        if folder is None:
            raise ValueError(
                "the table 'rooms' needs requests that name no room: `embodied dataset vnla --no-rooms --out DIR2`, "
                "features for it, and --without-rooms DIR2"
            )
        data = vnla_data(folder)
        if data.config.rooms != rooms:
            raise ValueError(
                f"the requests of {folder} {'name no' if rooms else 'name'} rooms; name the other data set"
            )
        return Lessons(data, self.encoder, self.quality)


def run_study(
    setting: VnlaStudySetting,
    names: Sequence[str],
    *,
    rows: Sequence[str] | None = None,
    workers: int = 1,
    note: Note = print,
) -> dict[str, Path]:
    """Train and judge what is missing and write the tables; returns the Markdown files.

    Results do not depend on `workers`.

    Args:
      rows: train and judge these variants only; tables say which rows they lack.

    Raises:
      ValueError: an unknown table or variant, or data that it lacks.
    """
    refuse_unknown(names, TABLES)
    refuse_unknown(rows or (), VARIANTS, "rows")
    wanted: dict[str, dict[str, VnlaLine]] = {}
    for line in (line for name in names for line in TABLES[name][1]):
        if rows is None or line.variant in rows:
            wanted.setdefault(line.variant, {})[line.key] = line
    for rooms in sorted(
        {r for v, lines in wanted.items() for r in (VARIANTS[v].rooms, *(x.rooms for x in lines.values()))}
    ):
        setting.lessons(rooms)  # refused before anything is trained
    work = functools.partial(_run, setting, wanted, note)
    for n in sorted({setting.seeds, setting.others}):
        alike = [v for v in wanted if len(setting.repeats(v)) == n]
        run_all(alike, range(setting.config.seed, setting.config.seed + n), work, workers=workers, note=note)
    return {name: _write(setting, name) for name in names}


def _run(
    setting: VnlaStudySetting, wanted: Mapping[str, Mapping[str, VnlaLine]], note: Note, seed: int, variant: str
) -> str:
    """Train one agent and judge it for the rows that are made of it, unless that is done."""
    torch.set_num_threads(setting.threads)
    about, folder = VARIANTS[variant], setting.folder(variant, seed)
    config = dataclasses.replace(setting.config, seed=seed, **about.changes)
    mine: Note = lambda line: note(f"{variant}, seed {seed}: {line}")
    train_agent(setting.lessons(about.rooms), config, folder, note=mine)
    agent = load_agent(folder / "best.safetensors")
    for line in wanted[variant].values():
        path = _rows_file(setting, line, seed)
        if path.exists():
            continue

        def keep(split: str, name: str, episodes: Sequence[Episode], line: VnlaLine = line) -> None:
            save_lines(folder / "episodes" / episodes_file(split, line.key), episodes)

        lessons, limit = setting.lessons(line.rooms), setting.tasks
        splits = (*SPLITS, *lessons.data.ood)
        found = judge(lessons, agent, splits, seeds=EVALUATION_SEEDS, limit=limit, only=[line.played], keep=keep)
        write_bytes(path, as_json(found).encode())
    return f"{variant}, seed {seed}: trained and judged"


def _rows_file(setting: VnlaStudySetting, line: VnlaLine, seed: int) -> Path:
    return setting.folder(line.variant, seed) / f"rows_{line.key.replace(', ', '_').replace(' ', '_')}.json"


def judged_with(setting: VnlaStudySetting, line: VnlaLine) -> list[int]:
    """The training seeds of a row that were judged."""
    return seeds_with(setting.repeats(line.variant), lambda seed: _rows_file(setting, line, seed).exists())


def estimate(setting: VnlaStudySetting, line: VnlaLine, split: str, column: str) -> Estimate:
    """A number of a row: over trained agents, each the mean of its judgings; of a single agent over its judgings."""
    means = []
    for seed in judged_with(setting, line):
        body = json.loads(_rows_file(setting, line, seed).read_text(encoding="utf-8"))
        means.append([r["values"][column]["mean"] for r in body if r["split"] == split])
    if len(means) == 1:
        return across_seeds(means[0])
    return across_seeds([sum(m) / len(m) for m in means])


def _write(setting: VnlaStudySetting, name: str) -> Path:
    title, lines = TABLES[name]
    counts = {line.label: len(judged_with(setting, line)) for line in lines}
    there = [line for line in lines if counts[line.label]]
    by = {_labelled(line, counts): line for line in there}
    value = lambda label, split, column: estimate(setting, by[label], split, column)
    rows = [(label, line.printed) for label, line in by.items()]
    splits = (*SPLITS, *setting.lessons(rooms=True).data.ood)
    text = side_by_side(title, splits, COLUMNS, rows, value, _made_with(setting, there))
    if missing := [label for label, n in counts.items() if not n]:
        text += f"\nNot run yet: {', '.join(missing)}.\n"
    path = setting.out / f"table_{name}.md"
    write_bytes(path, text.encode())
    return path


def _labelled(line: VnlaLine, counts: Mapping[str, int]) -> str:
    n = counts[line.label]
    return f"{line.label} ({n} agent{'s' * (n > 1)})"


def _made_with(setting: VnlaStudySetting, there: Sequence[VnlaLine]) -> str:
    """The sentences below a table of the rows that are there."""
    if not there:
        return "No row was run."
    seed = judged_with(setting, there[0])[0]
    first = json.loads(_rows_file(setting, there[0], seed).read_text(encoding="utf-8"))
    counts = "; ".join(
        f"{r['split']}: {r['episodes']} episodes in {r['houses']} houses"
        for r in first
        if r["seed"] == EVALUATION_SEEDS[0]
    )
    pictures = load_agent(setting.folder(there[0].variant, seed) / "best.safetensors").pictures
    return (
        f"{counts}, judged with seeds {', '.join(map(str, EVALUATION_SEEDS))}. Mean and Student's 95 % interval over "
        "trained agents, each the mean of its judgings; of a single agent over its judgings, which says nothing about "
        f"another agent. Trained {setting.config.iterations} updates of {setting.config.batch} episodes on pictures "
        f"{pictures}. In brackets the paper's. Rates in per cent."
    )

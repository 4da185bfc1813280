"""The tables of VNLA's first paper (Nguyen et al. 2019, arXiv 1812.04155): train what is missing, judge, print.

A study is a folder: `VARIANT/seed_N` holds an agent and what it did. Variants that tables share are trained once, and
everything goes on where it stopped. Agents are judged with the program's five seeds, from which budgets are drawn.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import joblib
import torch

from agents.imitation.lessons import Lessons
from agents.imitation.loop import Note
from agents.tables import side_by_side
from agents.vision.encoder import Encoder
from agents.vnla.agent import load_agent
from agents.vnla.config import VnlaSettings
from agents.vnla.judging import DIRECT, LEARNED, judge
from agents.vnla.run import train_agent, vnla_data
from assets.cache import write_bytes
from embodied.evaluation.tables import Estimate, Row, across_seeds, as_json
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
    "teacher": VnlaVariant({"asker": "teacher"}),
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
    printed: Mapping[str, Sequence[float]] = field(default_factory=dict)
    """Column to the paper's numbers, one per split of SPLITS; only those that we can cite."""

    @property
    def key(self) -> str:
        return f"{self.played}, {'rooms' if self.rooms else 'no rooms'}"


TABLES: Mapping[str, tuple[str, tuple[VnlaLine, ...]]] = {
    "askers": (
        "Who decides when to ask",
        tuple(VnlaLine(name, name) for name in ("none", "first", "random", "teacher", "learned")),
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
    """Agents of each variant."""
    tasks: int | None = None
    """Judge on at most so many tasks of a split, from all houses alike."""
    quality: str | None = None
    """Of the pictures that features come from."""
    threads: int = 1
    """Of PyTorch, per agent."""

    @property
    def repeats(self) -> list[int]:
        return [self.config.seed + k for k in range(self.seeds)]

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
    setting: VnlaStudySetting, names: Sequence[str], *, workers: int = 1, note: Note = print
) -> dict[str, Path]:
    """Train and judge what is missing and write the tables; returns the Markdown files.

    Results do not depend on `workers`.

    Raises:
      ValueError: an unknown table, or data that it lacks.
    """
    if unknown := [n for n in names if n not in TABLES]:
        raise ValueError(f"unknown tables {unknown}; VNLA's are {list(TABLES)}")
    wanted: dict[str, dict[str, VnlaLine]] = {}
    for name in names:
        for line in TABLES[name][1]:
            wanted.setdefault(line.variant, {})[line.key] = line
    for rooms in sorted(
        {r for v, lines in wanted.items() for r in (VARIANTS[v].rooms, *(x.rooms for x in lines.values()))}
    ):
        setting.lessons(rooms)  # refused before anything is trained
    jobs = [(v, s) for v in wanted for s in setting.repeats]
    parallel = joblib.Parallel(n_jobs=workers, return_as="generator_unordered")
    for said in parallel(joblib.delayed(_run)(setting, v, s, list(wanted[v].values()), note) for v, s in jobs):
        note(said)
    return {name: _write(setting, name) for name in names}


def _run(setting: VnlaStudySetting, variant: str, seed: int, lines: Sequence[VnlaLine], note: Note) -> str:
    """Train one agent and judge it for some rows, unless that is done."""
    torch.set_num_threads(setting.threads)
    about, folder = VARIANTS[variant], setting.folder(variant, seed)
    config = dataclasses.replace(setting.config, seed=seed, **about.changes)
    mine: Note = lambda line: note(f"{variant}, seed {seed}: {line}")
    train_agent(setting.lessons(about.rooms), config, folder, note=mine)
    agent = load_agent(folder / "best.safetensors")
    for line in lines:
        path = _rows_file(setting, line, seed)
        if path.exists():
            continue
        lessons, rows = setting.lessons(line.rooms), list[Row]()

        def keep(split: str, name: str, episodes: Sequence[Episode], line: VnlaLine = line) -> None:
            save_lines(folder / "episodes" / episodes_file(split, line.key), episodes)

        for k, judged in enumerate(EVALUATION_SEEDS):
            first: Callable[[str, str, Sequence[Episode]], None] | None = None if k else keep
            rows += judge(lessons, agent, SPLITS, seed=judged, limit=setting.tasks, only=[line.played], keep=first)
        write_bytes(path, as_json(rows).encode())
    return f"{variant}, seed {seed}: trained and judged"


def _rows_file(setting: VnlaStudySetting, line: VnlaLine, seed: int) -> Path:
    return setting.folder(line.variant, seed) / f"rows_{line.key.replace(', ', '_').replace(' ', '_')}.json"


def estimate(setting: VnlaStudySetting, line: VnlaLine, split: str, column: str) -> Estimate:
    """A number of a row: over trained agents, each the mean of its judgings; of a single agent over its judgings."""
    means = []
    for seed in setting.repeats:
        body = json.loads(_rows_file(setting, line, seed).read_text(encoding="utf-8"))
        means.append([r["values"][column]["mean"] for r in body if r["split"] == split])
    if len(means) == 1:
        return across_seeds(means[0])
    return across_seeds([sum(m) / len(m) for m in means])


def _write(setting: VnlaStudySetting, name: str) -> Path:
    title, lines = TABLES[name]
    by = {line.label: line for line in lines}
    first = json.loads(_rows_file(setting, lines[0], setting.repeats[0]).read_text(encoding="utf-8"))
    counts = "; ".join(
        f"{s}: {r['episodes']} episodes in {r['houses']} houses"
        for s in SPLITS
        for r in first[::1]
        if r["split"] == s and r["seed"] == EVALUATION_SEEDS[0]
    )
    c, over = setting.config, "trained agents" if setting.seeds > 1 else "judgings of one agent"
    pictures = load_agent(setting.folder(lines[0].variant, setting.repeats[0]) / "best.safetensors").pictures
    how = (
        f"{counts}, judged with seeds {', '.join(map(str, EVALUATION_SEEDS))}. Mean and Student's 95 % interval over "
        f"{over} ({setting.seeds} per row). Trained {c.iterations} updates of {c.batch} episodes on pictures "
        f"{pictures}. Rates in per cent."
    )
    value = lambda label, split, column: estimate(setting, by[label], split, column)
    text = side_by_side(title, SPLITS, COLUMNS, [(line.label, line.printed) for line in lines], value, how)
    path = setting.out / f"table_{name}.md"
    write_bytes(path, text.encode())
    return path

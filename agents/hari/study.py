"""Tables 4.7 and 4.8 and Figures 4.5 and 4.6: train what is missing, judge it, print it beside the dissertation's.

A study is a folder: `execution` holds the execution policy, `VARIANT/seed_N` an intention policy
and what it did in `episodes`. Variants that tables share are trained once, and everything goes on
where it stopped.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from agents.common.session import Note
from agents.common.studies import refuse_unknown, run_all, table, write_all, write_markdown
from agents.hari.agent import load_agent, load_executor
from agents.hari.figures import costs_figure, requests_figure, times_figure
from agents.hari.judging import TEST, judge
from agents.hari.networks import INTENTIONS
from agents.hari.run import CONDITIONS, hari_data, train_execution, train_intention, with_eyes
from agents.hari.sight_study import KINDS, train_and_judge, write_sight
from agents.hari.study_setting import HariStudySetting, estimates
from assets.cache import digest, write_bytes, write_json
from embodied.evaluation.tables import as_json, save, shown
from embodied.interface import Ask, Episode, Move
from embodied.records import load_lines, read_json, save_lines

VALIDATION = tuple(f"val_{c}" for c in CONDITIONS)
COSTS = (0.01, 0.05, 0.1, 0.2, 0.5)
HORIZONS = (10, 20, 30)
"""Figure 4.6."""
VARIANTS: Mapping[str, Mapping[str, object]] = {
    "learned": {},
    "uncooperative": {"cooperative": False},
    "skyline": {"perfect": True},
    "moves drawn": {"move_temperature": 0.5},
    "stack 1": {"stack": 1},
    "stack 3": {"stack": 3},
    **{f"cost {c:g}, H {h}": {"cost": c, "horizon": h} for c in COSTS for h in HORIZONS if (c, h) != (0.01, 30)},
}
"""Name of a variant to what differs from the settings of the study."""
BESIDE_RULES = ("learned", "moves drawn")
"""Variants that are judged beside rules, whose moves are drawn as theirs are."""
RULE_ROWS = ("no assistance", "dense goal", "dense state", "dense goal and state", "random + rules")
PRINTED: Mapping[str, str] = {
    "no assistance": "43.4 / 16.4 / 3.0 (–, –, –, 13.1)",
    "dense goal": "67.2 / 56.6 / 9.7 (–, 1.0, –, 12.6)",
    "dense state": "77.9 / 30.6 / 4.1 (12.0, –, –, 12.0)",
    "dense goal and state": "97.8 / 81.7 / 9.4 (11.0, 1.0, –, 11.0)",
    "random + rules": "78.8 / 68.5 / 12.7 (2.0, 1.0, 1.7, 11.3)",
    "learned": "85.8 / 78.2 / 19.8 (2.1, 1.0, 1.7, 11.1)",
    "uncooperative": "81.1 / 71.2 / 16.1 (2.7, 2.7, 1.5, 9.6)",
    "skyline": "94.3 / 95.1 / 92.6 (0.0, 0.0, 6.3, 7.3)",
    "stack 1": "92.2 / 78.4 / 12.5 (5.1, 1.9, 0.0, 10.7)",
    "stack 2": "86.9 / 77.6 / 21.6 (2.1, 1.0, 1.7, 11.2)",
    "stack 3": "83.2 / 78.6 / 33.5 (1.3, 1.0, 5.0, 8.2)",
}
"""Success on unseen starts, objects and environments, and CUR, GOAL, SUB, DO, of Tables 4.7 and 4.8."""


TABLES: Mapping[str, Sequence[str]] = {
    "4.7": ("learned", "uncooperative", "skyline"),
    "4.8": ("stack 1", "learned", "stack 3"),
    "moves": ("learned", "moves drawn"),
    "sight": tuple(KINDS),
    "figure 4.5": ("learned",),
    "figure 4.6": tuple(v for v in VARIANTS if v.startswith("cost ")) + ("learned",),
}
"""Table or figure to the variants it needs."""


def run_study(
    setting: HariStudySetting, names: Sequence[str], *, workers: int = 1, note: Note = print
) -> dict[str, Path]:
    """Train and judge what is missing and write tables and figures; returns the Markdown files.

    Results do not depend on `workers`.

    Raises:
      ValueError: an unknown table.
    """
    refuse_unknown(names, TABLES)
    executor = setting.executor or setting.out / "execution" / "best.safetensors"
    variants = [v for n in names for v in TABLES[n]]
    if setting.executor is None and set(variants) - set(KINDS):
        torch.set_num_threads(setting.threads)
        train_execution(hari_data(setting.data), setting.execution, setting.out / "execution", note=note)
    work = functools.partial(_run, setting, executor, note=note)
    run_all(variants, setting.repeats, work, workers=workers, note=note)
    writers: Mapping[str, Callable[[], Path]] = {
        "4.7": lambda: _write_table(setting, "4.7", [*BY_RULES, *map(_learned, TABLES["4.7"])], "test"),
        "4.8": lambda: _write_table(setting, "4.8", [_stacked(v) for v in TABLES["4.8"]], "val"),
        "moves": lambda: _write_table(setting, "moves", MOVES, "test"),
        "sight": lambda: write_sight(setting),
        "figure 4.5": lambda: _write_behaviour(setting),
        "figure 4.6": lambda: _write_costs(setting),
    }
    return write_all(names, writers)


def _run(setting: HariStudySetting, executor: Path, seed: int, variant: str, *, note: Note) -> str:
    """Train one policy and judge it on validation and test splits, unless that is done."""
    if variant in KINDS:
        return train_and_judge(setting, seed, KINDS[variant], note)
    torch.set_num_threads(setting.threads)
    data, folder = hari_data(setting.data), setting.folder(variant, seed)
    config = dataclasses.replace(setting.intention, seed=seed, **VARIANTS[variant])  # type: ignore[arg-type]
    walking = with_eyes(load_executor(executor), data, setting.quality)
    quiet: Note = lambda line: None
    train_intention(data, walking, config, folder, note=note if seed == setting.repeats[0] else quiet)
    agent = load_agent(folder / "best.safetensors")
    agent = dataclasses.replace(agent, executor=dataclasses.replace(agent.executor, eyes=walking.eyes))
    mark, of_what = folder / "judged.json", digest(folder / "best.safetensors", setting.tasks)
    if mark.exists() and read_json(mark) == {"of": of_what}:
        return f"{variant}, seed {seed}: judged before"

    def keep(split: str, name: str, episodes: Sequence[Episode]) -> None:
        if name == "learned":
            save_lines(folder / "episodes" / f"{split}.jsonl", episodes)

    only = ("learned", *(RULE_ROWS if variant in BESIDE_RULES else ()))
    rows = judge(data, agent, (*VALIDATION, *TEST, *data.ood), seed=seed, limit=setting.tasks, only=only, keep=keep)
    save(rows, folder, "table")
    write_bytes(folder / "rows.json", as_json(rows).encode())
    write_json(mark, {"of": of_what})
    return f"{variant}, seed {seed}: trained and judged"


@dataclass(frozen=True)
class TableLine:
    """A line of a table: a row of what was judged of the agents of a variant."""

    variant: str
    row: str
    shown: str
    printed: str = ""
    """What the dissertation has there."""


def _learned(variant: str) -> TableLine:
    return TableLine(variant, "learned", variant, PRINTED[variant])


def _stacked(variant: str) -> TableLine:
    name = "stack 2" if variant == "learned" else variant
    return TableLine(variant, "learned", name, PRINTED[name])


BY_RULES = [TableLine("learned", row, row, PRINTED[row]) for row in RULE_ROWS]
MOVES = [
    TableLine(variant, row, f"{row}, {how}", PRINTED[row] if variant == "learned" else "")
    for row in ("no assistance", "dense goal and state", "random + rules", "learned")
    for variant, how in (("learned", "likeliest moves"), ("moves drawn", "moves drawn"))
]
"""What drawing DO's moves instead of taking the likeliest is worth; not in the dissertation."""


def _write_table(setting: HariStudySetting, name: str, rows: Sequence[TableLine], when: str) -> Path:
    """Success per condition and, where there are such, in houses out of distribution; actions over the conditions,
    beside what the dissertation prints."""
    splits = [*(f"{when}_{c}" for c in CONDITIONS), *(hari_data(setting.data).ood if when == "test" else ())]
    heads = ["agent", *(s.replace("_", " ") for s in splits), "CUR", "GOAL", "SUB", "DO", "dissertation"]
    lines = []
    for line in rows:
        number = lambda split, column, line=line: estimates(setting, line.variant, split, column, line.row)
        successes = [shown("success", number(s, "success")) for s in splits]
        actions = [f"{np.mean([number(s, a).mean for s in splits[:3]]):.1f}" for a in ("CUR", "GOAL", "SUB", "DO")]
        lines.append([line.shown, *successes, *actions, line.printed])
    return write_markdown(setting.out / f"table_{name}.md", f"Table {name}", table(heads, lines), _seeds(setting))


def _write_behaviour(setting: HariStudySetting) -> Path:
    """Figure 4.5: which requests are made in which condition, and when."""
    per_condition = {
        c: {a: estimates(setting, "learned", f"val_{c}", a) for a in ("CUR", "GOAL", "SUB")} for c in CONDITIONS
    }
    episodes = [
        e
        for seed in setting.repeats
        for e in load_lines(setting.folder("learned", seed) / "episodes" / "val_unseen_env.jsonl", Episode)
    ]
    requests_figure(per_condition, setting.out / "figure_4_5a.png")
    times_figure(intentions_by_time(episodes, setting.intention.horizon), setting.out / "figure_4_5b.png")
    pictures = ["![Requests per condition](figure_4_5a.png)", "![Intentions by time](figure_4_5b.png)"]
    return write_markdown(setting.out / "figure_4_5.md", "Figure 4.5", pictures, _seeds(setting))


def intentions_by_time(episodes: Sequence[Episode], horizon: int) -> np.ndarray:
    """(horizon, 5): how many of the episodes chose each intention at each time step."""
    counts = np.zeros((horizon, len(INTENTIONS)))
    for episode in episodes:
        for t, step in enumerate(episode.steps[:horizon]):
            action = step.action
            name = action.intention.value if isinstance(action, Ask) else "do" if isinstance(action, Move) else "done"
            counts[t, INTENTIONS.index(name)] += 1
    return counts


def _write_costs(setting: HariStudySetting) -> Path:
    """Figure 4.6: success and actions against the cost of an action, for several horizons."""
    variant = lambda c, h: "learned" if (c, h) == (0.01, 30) else f"cost {c:g}, H {h}"
    success = {
        (condition, h): [estimates(setting, variant(c, h), f"val_{condition}", "success") for c in COSTS]
        for condition in CONDITIONS
        for h in HORIZONS
    }
    actions = {
        a: [float(np.mean([estimates(setting, variant(c, 30), f"val_{k}", a).mean for k in CONDITIONS])) for c in COSTS]
        for a in ("CUR", "GOAL", "SUB", "DO")
    }
    costs_figure(COSTS, success, actions, setting.out / "figure_4_6.png")
    pictures = ["![Success and actions against cost](figure_4_6.png)"]
    return write_markdown(setting.out / "figure_4_6.md", "Figure 4.6", pictures, _seeds(setting))


def _seeds(setting: HariStudySetting) -> str:
    return f"{setting.seeds} training seeds; intervals are Student's, 95 %, over them."

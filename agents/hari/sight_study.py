"""What seeing is worth: execution policies that read words beside such that see, nobody or somebody being asked.

No counterpart in the dissertation, whose agent perceives words alone; "no assistance" of Table 4.7 is the second row.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from agents.common.session import Note
from agents.common.studies import table, write_markdown
from agents.hari.agent import Executor, load_executor
from agents.hari.config import SEES
from agents.hari.judging import TEST
from agents.hari.rules import RULES, RuleAgent
from agents.hari.run import hari_data, rules_of, train_execution, with_eyes
from agents.hari.study_setting import HariStudySetting, estimates
from assets.cache import digest, write_bytes, write_json
from embodied.evaluation.evaluate import spread
from embodied.evaluation.rollout import play
from embodied.evaluation.tables import Row, as_json, row, shown
from embodied.interface import Sight
from embodied.records import episodes_file, read_json, save_lines

TEMPERATURE = 0.5
"""At which moves are drawn in the second half of the table (docs/sources.md, S82)."""


@dataclass(frozen=True)
class SightLine:
    """One row: what the execution policy learned to know its place by, what it is told unasked, and what it asks."""

    shown: str
    sees: str
    states: str
    rule: str = "no assistance"
    covered: bool = False
    """Whether its eyes are covered when it is judged."""


LINES = (
    SightLine("no assistance, d^s of nothing", "words", "none"),
    SightLine("no assistance, d^s of sparse words", "words", "sparse"),
    SightLine("no assistance, sight", "features", "none"),
    SightLine("no assistance, sight covered", "features", "none", covered=True),
    SightLine("no assistance, sight and sparse words", "features", "sparse"),
    SightLine("dense goal, d^s of sparse words", "words", "sparse", "dense goal"),
    SightLine("dense goal, sight", "features", "none", "dense goal"),
    SightLine("dense goal and state", "words", "sparse", "dense goal and state"),
    SightLine("dense goal and state, sight beside them", "features", "none", "dense goal and state"),
)
DRAWN = {False: "", True: ", moves drawn"}


class Covered:
    """Eyes that are shut: a FeatureSource of zeros, the mean of whitened features."""

    def __init__(self, size: int) -> None:
        self.size = size

    def features(self, sight: Sight) -> np.ndarray:
        """(36, D) float32."""
        return np.zeros((36, self.size), dtype=np.float32)


def variant_of(sees: str) -> str:
    """The folder of a study that holds execution policies of one kind."""
    return f"execution {sees}"


def train_and_judge(setting: HariStudySetting, seed: int, sees: str, note: Note) -> str:
    """Train one execution policy and judge it without and with questions, unless that is done.

    Where the study was given an execution policy, that one stands for all seeds of its kind.
    """
    torch.set_num_threads(setting.threads)
    variant, data = variant_of(sees), hari_data(setting.data)
    folder = setting.folder(variant, seed)
    file = given(setting, sees) or folder / "best.safetensors"
    if file.parent == folder:
        config = dataclasses.replace(setting.execution, seed=seed, sees=sees)
        say: Note = lambda line: note(f"{variant}, seed {seed}: {line}")
        train_execution(data, config, folder, encoder=setting.encoder, quality=setting.quality, note=say)
    mark, of_what = folder / "judged.json", digest(file, setting.tasks)
    if mark.exists() and read_json(mark) == {"of": of_what}:
        return f"{variant}, seed {seed}: judged before"
    executor = with_eyes(load_executor(file), data, setting.quality)
    mine = [(line, drawn) for line in LINES if line.sees == sees for drawn in DRAWN]
    rows = [r for line, drawn in mine for r in judged(setting, executor, line, drawn, seed)]
    write_bytes(folder / "rows.json", as_json(rows).encode())
    write_json(mark, {"of": of_what})
    return f"{variant}, seed {seed}: trained and judged"


def given(setting: HariStudySetting, sees: str) -> Path | None:
    """The execution policy that the study was given, if it is one of this kind."""
    if setting.executor is None or load_executor(setting.executor).config.sees != sees:
        return None
    return setting.executor


def judged(setting: HariStudySetting, executor: Executor, line: SightLine, drawn: bool, seed: int) -> list[Row]:
    """One row of the table on all test splits; episodes are kept."""
    data, config = hari_data(setting.data), dataclasses.replace(setting.intention, states=line.states)
    if line.covered and executor.seeing:
        executor = dataclasses.replace(executor, eyes=Covered(executor.seeing.size))
    agent = RuleAgent(executor, RULES[line.rule], TEMPERATURE if drawn else None)
    name, rows = line.shown + DRAWN[drawn], []
    for split in TEST:
        whole = data.split(split, hari=rules_of(config))
        with torch.inference_mode():
            episodes = play(
                whole.make_env, agent, spread(whole.tasks, setting.tasks), seed=seed, batch=config.batch, agent=name
            )
        rows.append(row(name, split, episodes, {n: p.graph for n, p in whole.worlds.items()}, seed=seed))
        save_lines(setting.folder(variant_of(line.sees), seed) / "episodes" / episodes_file(split, name), episodes)
    return rows


def write_sight(setting: HariStudySetting) -> Path:
    """The table: success per condition with the likeliest moves, and with drawn ones."""
    splits = [s.removeprefix("test_").replace("_", " ") for s in TEST]
    heads = ["agent", *splits, *(f"{s}, moves drawn" for s in splits), "DO"]
    lines = []
    for line in LINES:
        found = lambda split, drawn, line=line: estimates(
            setting, variant_of(line.sees), split, "success", line.shown + DRAWN[drawn]
        )
        moves = [estimates(setting, variant_of(line.sees), s, "DO", line.shown).mean for s in TEST]
        cells = [shown("success", found(s, drawn)) for drawn in DRAWN for s in TEST]
        lines.append([line.shown, *cells, f"{np.mean(moves):.1f}"])
    about = f"{setting.seeds} execution policies of each kind; ± is Student's 95 % interval over them."
    return write_markdown(setting.out / "table_sight.md", "What seeing is worth", table(heads, lines), about)


KINDS: Mapping[str, str] = {variant_of(sees): sees for sees in SEES}

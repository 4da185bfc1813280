"""Success against realism: agents that learned from one kind of pictures, judged in houses drawn in others (no
counterpart in the dissertation).

    embodied features --data DATA --encoder ENCODER --quality reference --split test_unseen --houses 8
    embodied study realism --data DATA --out STUDY --houses 8 --agents unlit=A.safetensors lit=B.safetensors

Each agent looks through the encoder it learned with, or through another that sees alike. Which way of drawing ranks
agents as path-traced pictures do is told by Spearman's rank correlation over all agents.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import scipy.stats
import torch

from agents.common.figures import realism_figure
from agents.common.lessons import split_of
from agents.common.session import Note
from agents.common.studies import kept_episodes, table, write_markdown
from agents.hanna.agent import load_agent
from agents.vision.config import drawing
from agents.vision.drawn import pictures_of
from agents.vision.encoder import load_encoder
from embodied.datasets.store import Dataset, dataset_of
from embodied.evaluation.tables import Row, row, save, shown
from embodied.interface import Agent, Episode
from embodied.locks import locked

LEAST = 3
"""Agents of which a rank correlation is told."""


@dataclass(frozen=True)
class RealismSetting:
    """Who is judged, where, and how that is drawn."""

    data: Path
    out: Path
    arms: Mapping[str, Sequence[Path]]
    """Kind of agent to the files of its training seeds."""
    pictures: tuple[str, ...]
    """Keys of agents.vision.config.WAYS; the last is what the others are ranked against."""
    split: str = "test_unseen"
    tasks: int | None = None
    """At most so many, from all houses alike."""
    seed: int = 0
    """Of judging."""
    houses: int | None = None
    """The first so many houses of the split; None: all."""
    encoders: Mapping[str, Sequence[Path]] = field(default_factory=dict)
    """Kind of agent to the encoder that all of its agents look through, or to one for each of them; those without look
    through the one they learned with."""

    def __post_init__(self) -> None:
        if unknown := [*(self.encoders.keys() - self.arms.keys())]:
            raise ValueError(f"encoders are given for {sorted(unknown)}, agents for {sorted(self.arms)}")
        for arm, paths in self.encoders.items():
            if len(paths) not in (1, len(self.arms[arm])):
                raise ValueError(
                    f"{arm!r} has {len(self.arms[arm])} agents and {len(paths)} encoders; give one or each"
                )

    def watched(self, arm: str) -> list[tuple[Path, Path | None]]:
        """The agents of a kind, each with what it looks through if that is not what it learned with."""
        paths, through = self.arms[arm], self.encoders.get(arm, (None,))
        return [*zip(paths, through if len(through) > 1 else [*through] * len(paths), strict=True)]

    def names(self, data: Dataset) -> tuple[str, ...]:
        """The houses that agents are judged in."""
        return data.names(self.split)[: self.houses]


def run_study(setting: RealismSetting, *, threads: int = 1, note: Note = print) -> Path:
    """Judge what has not been judged yet, write table and figure; returns the Markdown file.

    Raises:
      FileNotFoundError: an agent, or features that it needs; says the command that makes them.
      LockedError: another process writes to the study's folder.
    """
    torch.set_num_threads(threads)
    data = dataset_of(setting.data, "hanna")
    graphs = {name: place.graph for name, place in data.places(setting.split).items()}
    rows: dict[tuple[str, str], Row] = {}
    successes: dict[str, list[float]] = {way: [] for way in setting.pictures}
    with locked(setting.out):
        for way in setting.pictures:
            for arm in setting.arms:
                seeds = [_episodes(setting, data, arm, *pair, way) for pair in setting.watched(arm)]
                alone = [row(arm, way, episodes, graphs, seed=setting.seed) for episodes in seeds]
                successes[way] += [r.values["success"].mean for r in alone]
                everybody = [e for episodes in seeds for e in episodes]
                rows[arm, way] = row(arm, way, everybody, graphs, seed=setting.seed)
                note(f"{arm} in {way} pictures: success {shown('success', rows[arm, way].values['success'])} %")
        save(list(rows.values()), setting.out, "table_realism")
        lines = {arm: [rows[arm, way].values["success"] for way in setting.pictures] for arm in setting.arms}
        realism_figure(lines, setting.pictures, setting.out / "figure_realism.png")
        return _page(setting, data, rows, successes)


def rank_correlation(first: Sequence[float], second: Sequence[float]) -> float:
    """Spearman's, ties sharing their ranks; NaN for fewer than LEAST agents, or where all are equal."""
    if len(first) < LEAST or len({*first}) == 1 or len({*second}) == 1:
        return math.nan
    return float(scipy.stats.spearmanr(first, second).statistic)


def _episodes(
    setting: RealismSetting, data: Dataset, arm: str, path: Path, encoder: Path | None, way: str
) -> list[Episode]:
    """Those of one agent in houses drawn so, from the study's folder if it played them before."""
    looking = "" if encoder is None else load_encoder(encoder).digest
    drawn = {name: dataclasses.asdict(pictures_of(data, name, way)) for name in setting.names(data)}

    def policy() -> Agent:
        agent = load_agent(path)
        digest = looking or agent.encoder_digest
        return agent.policy(split_of(data, setting.split, digest, houses=setting.houses, quality=way).bank)

    return kept_episodes(
        setting.out / "episodes",
        f"{arm} {way}",
        (data.digest, path, drawn, looking),
        data.split(setting.split, houses=setting.houses),
        policy,
        seed=setting.seed,
        limit=setting.tasks,
    )


def _page(
    setting: RealismSetting, data: Dataset, rows: Mapping[tuple[str, str], Row], successes: Mapping[str, list[float]]
) -> Path:
    best = setting.pictures[-1]
    cells = [
        [arm, str(len(paths)), *(_cell(rows[arm, way]) for way in setting.pictures)]
        for arm, paths in setting.arms.items()
    ]
    agents = len(successes[best])
    ranks = [rank_correlation(successes[way], successes[best]) for way in setting.pictures[:-1]]
    told = ["–" if math.isnan(r) else f"{r:.2f}" for r in ranks]
    cells.append([f"rank correlation with {best}", str(agents), *told, ""])
    (arm, paths), *_ = setting.arms.items()
    first = rows[arm, best]
    drawn = "; ".join(
        f"{way}: " + ", ".join(sorted({drawing(pictures_of(data, n, way)) for n in setting.names(data)}))
        for way in setting.pictures
    )
    how = (
        f"Success in per cent and, in brackets, requests, on {setting.split}: {first.episodes // len(paths)} tasks in "
        f"{first.houses} houses, judged with seed {setting.seed}; 95 % intervals clustered by house and, where there "
        f"are several, training seed. Spearman's rank correlation over all agents. Drawn {drawn}."
    )
    heads = ["learned from", "agents", *setting.pictures]
    return write_markdown(setting.out / "table_realism.md", "Success against realism", table(heads, cells), how)


def _cell(r: Row) -> str:
    return f"{shown('success', r.values['success'])} ({shown('requests', r.values['requests'])})"

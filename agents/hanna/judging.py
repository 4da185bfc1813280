"""Judging a learned HANNA agent beside agents without learning: Tables 4.3 to 4.5."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from agents.common.lessons import Lessons
from agents.hanna.agent import HannaAgent
from agents.hanna.evaluation import Keep, players
from embodied.datasets.store import SplitData
from embodied.evaluation.evaluate import evaluate
from embodied.evaluation.tables import Row


def judge(
    lessons: Lessons,
    agent: HannaAgent,
    splits: Sequence[str],
    *,
    seed: int = 0,
    limit: int | None = None,
    batch: int = 32,
    only: Sequence[str] = (),
    keep: Keep | None = None,
    watch: Callable[[Iterable[str]], Iterable[str]] = iter,
    instead: Callable[[SplitData], SplitData] = lambda split: split,
) -> list[Row]:
    """One row per player and split, over the same tasks.

    Args:
      limit: at most so many tasks per split, from all houses alike.
      only: names of rows; none for those of the paper's tables.
      watch: wraps the iterator over rows (a progress bar).
      instead: gives a split another assistant.

    Raises:
      ValueError: an unknown row.
    """
    rows = []
    for split in splits:
        whole = instead(lessons.data.split(split))
        judged = players(agent, lessons.split(split).bank, only)
        kept = None if keep is None else lambda name, episodes, split=split: keep(split, name, episodes)
        rows += evaluate(whole, judged, seed=seed, limit=limit, batch=batch, keep=kept, watch=watch)
    return rows

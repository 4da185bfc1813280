"""What studies of learners share: jobs times seeds, made once however many tables ask for them, and tables of them.

A study is a folder; each of its runs is a folder of it that goes on where it stopped. A learner says
what its jobs are, how one is run, and which rows its tables have; the rest is here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import joblib

from agents.common.session import Note
from assets.cache import digest, write_bytes
from embodied.datasets.store import SplitData
from embodied.evaluation.evaluate import evaluate
from embodied.evaluation.tables import Estimate
from embodied.interface import Agent, Episode
from embodied.records import RecordError, episodes_file, load_lines, read_json, save_lines

J = TypeVar("J", bound=Hashable)


def refuse_unknown(names: Sequence[str], known: Iterable[str], what: str = "studies") -> None:
    """
    Raises:
      ValueError: a table or figure (or what else it is) that this learner has not.
    """
    there = list(known)
    if unknown := [n for n in names if n not in there]:
        raise ValueError(f"unknown {what} {unknown}; there are {there}")


def run_all(
    jobs: Iterable[J], seeds: Sequence[int], work: Callable[[int, J], str], *, workers: int, note: Note
) -> None:
    """Do each distinct job with each seed, `workers` side by side, and note what `work` says of it."""
    pairs = [(seed, job) for job in dict.fromkeys(jobs) for seed in seeds]
    for line in joblib.Parallel(n_jobs=workers, return_as="generator_unordered")(
        joblib.delayed(work)(seed, job) for seed, job in pairs
    ):
        note(line)


def kept_episodes(
    folder: Path,
    name: str,
    parts: Sequence[object],
    split: SplitData,
    policy: Callable[[], Agent],
    *,
    seed: int,
    limit: int | None,
) -> list[Episode]:
    """An agent's episodes on a split, out of `folder` if they were played before.

    Args:
      name: of the agent, which the file is called after.
      parts: all that they come from besides split, seed and limit, as assets.cache.digest takes it.
      policy: makes the agent; called only where there is something to play.
      limit: at most so many tasks, from all houses alike.
    """
    stem = Path(episodes_file(split.name, name)).stem
    path = folder / f"{stem}_{digest(*parts, split.name, seed, limit or 0)[:16]}.jsonl"
    if path.exists():
        return list(load_lines(path, Episode))
    found: list[Episode] = []
    keep = lambda name, episodes: found.extend(episodes)
    evaluate(split, {name: policy()}, seed=seed, limit=limit, batch=32, keep=keep)
    save_lines(path, found)
    return found


def history_of(folder: Path) -> list[dict[str, Any]]:
    """What a run of agents.common.runs found so far; nothing if it has not begun.

    Raises:
      RecordError: result.json is damaged.
    """
    path = Path(folder) / "result.json"
    if not path.exists():
        return []
    found = read_json(path).get("history")
    if not isinstance(found, list) or not all(isinstance(entry, dict) for entry in found):
        raise RecordError(
            f"{path} should hold the history of a run, a list of objects; delete its folder to run it again"
        )
    return found


def seeds_with(seeds: Sequence[int], has: Callable[[int], bool]) -> list[int]:
    """The seeds of which everything is there."""
    return [seed for seed in seeds if has(seed)]


def shown(e: Estimate, digits: int = 2, scale: float = 1.0) -> str:
    """'1.82 ± 0.08'; the mean alone where there is no interval."""
    mean = f"{scale * e.mean:.{digits}f}"
    return mean if math.isnan(e.half) else f"{mean} ± {scale * e.half:.{digits}f}"


def beside(cell: str, printed: str | None) -> str:
    """A cell with the dissertation's number in brackets."""
    return cell if not printed else f"{cell} ({printed})"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """The lines of a Markdown table."""
    lines = [heads, ["---"] * len(heads), *rows]
    return ["| " + " | ".join(row) + " |" for row in lines]


def write_markdown(path: Path, title: str, lines: Sequence[str], how: str, missing: Sequence[str] = ()) -> Path:
    """A study's page: title, lines, what it was made with, what has not been run."""
    rest = [f"Not run yet: {', '.join(missing)}."] if missing else []
    write_bytes(path, "\n".join([f"# {title}", "", *lines, "", how, *rest, ""]).encode())
    return path


def write_all(names: Sequence[str], writers: Mapping[str, Callable[[], Path]]) -> dict[str, Path]:
    """The pages of the studies in `names`."""
    return {name: writers[name]() for name in names}

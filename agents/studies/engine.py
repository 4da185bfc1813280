"""Studies: train what the rows of a table need, judge it, and write the table beside the numbers of its paper.

A study is a folder. `runs/NAME_KEY` holds what was trained under one identity and, in `judged`, what was counted of it;
runs that tables share are made once, and everything goes on where it stopped. Settings that change lead to other runs,
never to old numbers under new captions. A table is written as LEARNER-TABLE.json with its identity, as .md, and as .png
where it has a figure.
"""

import dataclasses
import functools
import itertools
import json
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import joblib

from embodied import records
from embodied.agents.common.session import Note
from embodied.agents.common.tensors import use_threads
from embodied.agents.common.weights import read_checkpoint, weights_digest
from embodied.agents.studies.tables import StudyRow, StudyTable, draw, page
from embodied.assets.cache import digest, write_bytes, write_json
from embodied.evaluation.tables import Samples, in_percent, interval, less
from embodied.locks import locked

PRINTED = Path(__file__).parent / "data" / "printed.json"
"""Numbers of papers: table to row to column, in the table's own units."""
Measured = Mapping[str, Samples]
"""Counts of one run, by name."""


class StudyLearner:
    """Interface of a learner to the engine, whose studies are frozen records of it; small, so that it can be sent to
    other processes. What has no body here every learner says."""

    repeats: tuple[int, ...]
    """Training seeds."""
    threads: int
    """Of PyTorch, per run."""

    @property
    def makers(self) -> tuple[str, ...]:
        """Modules that decide what is trained: the learner's, if it is one of ours."""
        module = type(self).__module__
        return (module,) if module.startswith("embodied.") else ()

    @property
    def judges(self) -> tuple[str, ...]:
        """Modules that decide how it is judged."""
        return self.makers

    @property
    def name(self) -> str:
        raise NotImplementedError

    def tables(self) -> Mapping[str, StudyTable]:
        """The tables by name, with the rows and splits that the data at hand allow."""
        raise NotImplementedError

    def seeds(self, row: StudyRow) -> Sequence[int]:
        """Training seeds of a row; one for a row that does not learn."""
        return self.repeats if row.train is not None else self.repeats[:1]

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Make what all runs share; refuse what cannot be run before anything is trained."""

    def prepare_seed(self, rows: Sequence[StudyRow], seed: int, folder: Path, note: Note) -> None:
        """Make what the runs of a seed share; seeds are made side by side."""

    def trained(self, train: Mapping[str, Any], seed: int, folder: Path) -> records.Identity:
        """All that a trained run depends on; `folder` is the study's, for what `prepare` made."""
        raise NotImplementedError

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        """Train a run in `home`, or go on, and return its weights."""
        raise NotImplementedError

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        """All that a judgement depends on besides the weights."""
        raise NotImplementedError

    def judge(self, weights: Path | None, row: StudyRow, split: str, seed: int, folder: Path, keep: Path) -> Measured:
        """Counts of a run; `seed` is that of its training, `keep` names files of its own, without a suffix."""
        raise NotImplementedError

    def about(self) -> str:
        """Facts that all rows have in common, in sentences."""
        raise NotImplementedError


def run_study(
    learner: StudyLearner,
    names: Sequence[str],
    out: Path,
    *,
    rows: Sequence[str] | None = None,
    workers: int = 1,
    report: bool = False,
    command: str = "",
    note: Note = print,
) -> dict[str, Path]:
    """Train and judge what is missing and write the tables; returns their Markdown files.

    Results do not depend on `workers`.

    Args:
      rows: labels; only these are run, and tables say which they lack.
      report: run nothing, write tables of what is there.
      command: what makes the tables, for whoever reads them.

    Raises:
      ValueError: an unknown table or row.
      LockedError: another process writes to the study's folder.
    """
    known = learner.tables()
    refuse_unknown(names, known, "studies")
    tables = {name: known[name] for name in names}
    refuse_unknown(rows or (), {r.label for t in tables.values() for r in t.rows}, "rows of these tables")
    jobs: dict[str, _Job] = {}
    for table in tables.values():
        for row, split in itertools.product(_rows_of(table, rows), table.splits):
            for seed in learner.seeds(row):
                job = jobs.setdefault(digest(row.train, seed), _Job(row, seed))
                job.judgings[digest(row.judge, split)] = (row, split)
    with locked(out):
        if not report:
            wanted = [row for t in tables.values() for row in _rows_of(t, rows)]
            splits = list(dict.fromkeys(split for t in tables.values() for split in t.splits))
            seeds = sorted({job.seed for job in jobs.values()})
            use_threads(learner.threads)
            learner.prepare(wanted, splits, out, note)
            _in_parallel(functools.partial(_begin, learner, wanted, out, note), seeds, workers, note)
            _in_parallel(functools.partial(_run, learner, out, note), list(jobs.values()), workers, note)
        return {name: _write(learner, name, table, out, rows, command) for name, table in tables.items()}


def refuse_unknown(names: Iterable[str], known: Iterable[str], what: str) -> None:
    """
    Raises:
      ValueError: a table, row or whatever else it is that there is not.
    """
    there = list(known)
    if unknown := [n for n in names if n not in there]:
        raise ValueError(f"unknown {what} {unknown}; there are {there}")


@dataclass(frozen=True)
class _Job:
    """One run and its judgings."""

    row: StudyRow
    seed: int
    judgings: dict[str, tuple[StudyRow, str]] = field(default_factory=dict)


def _rows_of(table: StudyTable, wanted: Sequence[str] | None) -> list[StudyRow]:
    """The wanted rows, and those that they are compared with or whose numbers are subtracted."""
    chosen = [r for r in table.rows if wanted is None or r.label in wanted]
    pairs = [r for pair in table.compared for r in pair] if wanted is None else []
    return [*chosen, *(r.minus for r in chosen if r.minus is not None), *pairs]


def _in_parallel(work: Callable[[Any], str], items: Sequence[Any], workers: int, note: Note) -> None:
    for line in joblib.Parallel(n_jobs=workers, return_as="generator_unordered")(
        joblib.delayed(work)(x) for x in items
    ):
        note(line)


def _begin(learner: StudyLearner, rows: Sequence[StudyRow], out: Path, note: Note, seed: int) -> str:
    use_threads(learner.threads)
    learner.prepare_seed(rows, seed, out, note)
    return f"seed {seed}: ready"


def _run(learner: StudyLearner, out: Path, note: Note, job: _Job) -> str:
    """Train a run and judge it, unless that is done."""
    use_threads(learner.threads)
    row, seed = job.row, job.seed
    home, weights = _home(learner, out, row, seed), None
    name = home.name
    if row.train is not None:
        identity = learner.trained(row.train, seed, out)
        weights = _weights(home, identity)
        if weights is None:
            weights = learner.train(row.train, seed, out, home, lambda line: note(f"{name}: {line}"))
            facts = {"weights": os.path.relpath(weights, home), "seconds": _processor(home)}
            records.write_finished(home / "trained.json", identity, facts)
    for judged, split in job.judgings.values():
        path, identity_of_judging = _judged(learner, home, weights, judged, split)
        if records.finished(path, identity_of_judging) is None:
            counts = learner.judge(weights, judged, split, seed, out, path.with_suffix(""))
            samples = {k: dataclasses.asdict(_storable(v)) for k, v in counts.items()}
            records.write_finished(path, identity_of_judging, {"samples": samples})
    return f"{name}: judged"


def _home(learner: StudyLearner, out: Path, row: StudyRow, seed: int) -> Path:
    """The folder of a run."""
    if row.train is None:
        return out / "runs" / "without_learning"
    settings = "_".join(f"{k}_{v}" for k, v in sorted(row.train.items())) or "as_it_is"
    return out / "runs" / f"{_slug(settings)}_seed_{seed}_{records.key_of(learner.trained(row.train, seed, out))}"


def _weights(home: Path, identity: records.Identity) -> Path | None:
    """Of a run that was trained under this identity."""
    done = records.finished(home / "trained.json", identity, (records.CODE, records.MAKERS))
    return home / str(done["weights"]) if done and (home / str(done["weights"])).exists() else None


def _judged(
    learner: StudyLearner, home: Path, weights: Path | None, row: StudyRow, split: str
) -> tuple[Path, dict[str, Any]]:
    """The file of a judgement, and its identity."""
    about = {"weights": weights and _digest_of(weights, weights.stat().st_mtime_ns), "judge": row.judge, "split": split}
    identity = records.identity_of(*learner.judges, **about, **learner.judged(row, split))
    how = "_".join(map(str, row.judge.values()))
    return home / "judged" / f"{_slug(f'{split} {how}')}_{records.key_of(identity)}.json", identity


@functools.lru_cache(maxsize=256)
def _digest_of(path: Path, changed: int) -> str:
    """Of weights that were last changed then."""
    return weights_digest(path)


def _processor(home: Path) -> float:
    """Seconds of processor time that a run took, over all sessions; 0 where it keeps no checkpoint."""
    path = home / "checkpoint.pt"
    return float(read_checkpoint(path)["progress"]["processor"]) if path.exists() else 0.0


def _slug(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9.]+", "_", text).strip("_")[:60]


def _storable(samples: Samples) -> Samples:
    """NaN, which is no JSON, as a ratio of nothing."""
    if all(v == v for v in samples.values):
        return samples
    weights = samples.weights or (1.0,) * len(samples.values)
    kept = [(v, w) if v == v else (0.0, 0.0) for v, w in zip(samples.values, weights, strict=True)]
    return dataclasses.replace(samples, values=tuple(v for v, _ in kept), weights=tuple(w for _, w in kept))


def _write(
    learner: StudyLearner, name: str, table: StudyTable, out: Path, rows: Sequence[str] | None, command: str
) -> Path:
    """A table's files."""
    body = result(learner, name, table, out, rows, command)
    stem = out / str(body["table"])
    write_json(stem.with_name(f"{stem.name}.json"), body, indent=1)
    if table.figure is not None and body["rows"]:
        draw(table, body, stem.with_name(f"{stem.name}.png"))
    path = stem.with_name(f"{stem.name}.md")
    write_bytes(path, page(body, f"{stem.name}.png" if table.figure else None).encode())
    return path


def result(
    learner: StudyLearner, name: str, table: StudyTable, out: Path, rows: Sequence[str] | None = None, command: str = ""
) -> dict[str, Any]:
    """A table as it is stored, of all that was judged."""
    key = f"{learner.name}-{name}".lower().replace(" ", "-")
    printed = _printed().get(key, {})
    shown, missing, columns, runs = [], [], dict[str, dict[str, str]](), dict[str, list[str]]()
    seconds, codes = dict[str, float](), dict[str, Any]()
    for row in table.rows:
        counts = {} if rows is not None and row.label not in rows else _found(learner, table, row, out)
        if not counts:
            missing.append(row.label)
            continue
        values = {}
        for (split, metric), samples in counts.items():
            scale = 100.0 if in_percent(metric) else 1.0
            column = f"{metric} {split}".strip().replace(" ", "_")
            e = interval(samples)
            values[column] = {"mean": _number(scale * e.mean), "half_width": _number(scale * e.half), "n": e.n}
            title = f"{metric}, {split.replace('_', ' ')}" if split else metric
            columns[column] = {"key": column, "title": title, "unit": "%" if in_percent(metric) else ""}
        for seed in learner.seeds(row) if row.train is not None else ():
            home = _home(learner, out, row, seed)
            identity, facts = records.read_finished(home / "trained.json")
            runs.setdefault(row.label, []).append(home.name)
            seconds[home.name] = float(facts["seconds"])  # several rows may judge one run
            codes = {k: identity.get(k) for k in (records.MAKERS, records.CODE)}
        shown.append({"label": row.label, "values": values, "printed": printed.get("rows", {}).get(row.label, {})})
    notes = [*(f"Not run: {', '.join(missing)}." for _ in missing[:1]), *_comparisons(learner, table, out, rows)]
    if sum(seconds.values()) > 0:  # learners of seconds count none
        notes.append(f"Processor time of training: {sum(seconds.values()) / 3600:.2f} hours.")
    identity = {
        "judged": records.identity_of(*learner.judges),
        "trained": codes or records.identity_of(*learner.judges),
        "runs": runs,
    }
    identity |= {"settings": learner.about()}
    return {
        "table": key,
        "title": table.title,
        "paper": printed.get("paper"),
        "command": command,
        "identity": identity,
        "settings": learner.about(),
        "columns": sorted(columns.values(), key=lambda c: c["key"] in table.pooled),
        "rows": shown,
        "notes": notes,
    }


def _found(learner: StudyLearner, table: StudyTable, row: StudyRow, out: Path) -> dict[tuple[str, str], list[Samples]]:
    """Counts of a row, by split and name, per training seed; nothing if some of it is missing."""
    counts: dict[tuple[str, str], list[Samples]] = {}
    for split in table.splits:
        runs = _samples(learner, row, split, out)
        others = _samples(learner, row.minus, split, out) if row.minus else None
        if runs is None or (row.minus and others is None):
            return {}
        for k, run in enumerate(runs):  # who does not learn was judged once
            for metric in (*table.columns, *table.pooled) or run:
                if metric not in run:  # counted on another split
                    continue
                one = run[metric] if others is None else less(run[metric], others[k % len(others)][metric])
                where = "" if metric in table.pooled else split
                counted = counts.setdefault((where, metric), [])
                if len(counted) <= k:
                    counted.append(one)
                else:  # pooled, on the next split
                    counted[k] = _together(counted[k], one)
    return counts


def _together(a: Samples, b: Samples) -> Samples:
    return Samples(a.values + b.values, a.groups + b.groups, a.weights + b.weights, a.share and b.share)


def _samples(learner: StudyLearner, row: StudyRow, split: str, out: Path) -> list[Measured] | None:
    """Counts of a row on a split, per training seed."""
    counts: list[Measured] = []
    for seed in learner.seeds(row):
        home, weights = _home(learner, out, row, seed), None
        if row.train is not None and (weights := _weights(home, learner.trained(row.train, seed, out))) is None:
            return None
        path, identity = _judged(learner, home, weights, row, split)
        body = records.finished(path, identity)
        if body is None:
            return None
        counts.append({k: records.from_plain(Samples, v, f"{path}: {k}") for k, v in body["samples"].items()})
    return counts


def _comparisons(learner: StudyLearner, table: StudyTable, out: Path, rows: Sequence[str] | None) -> list[str]:
    """The differences of a table's pairs, in words."""
    lines = []
    for first, second in table.compared if rows is None else ():
        pair = StudyRow(first.label, first.train, first.judge, minus=second)
        for (split, metric), samples in _found(learner, dataclasses.replace(table, pooled=()), pair, out).items():
            scale, e = 100.0 if in_percent(metric) else 1.0, interval(samples)
            lines.append(
                f"{first.label} minus {second.label}, {metric}, {split.replace('_', ' ')}: "
                f"{scale * e.mean:+.2f} ± {scale * e.half:.2f}{' points' * in_percent(metric)}"
            )
    return lines


def _number(x: float) -> float | None:
    return None if x != x else round(x, 6)


@functools.cache
def _printed() -> dict[str, Any]:
    return json.loads(PRINTED.read_text(encoding="utf-8"))

"""Tables 3.4, 3.5 and C.1 and Figure 3.7 on REGEX: run what is missing, put it beside the dissertation's numbers.

A study is a folder: `shared` holds data and teacher, `students` the runs. Runs that tables share are
made once, and everything goes on where it stopped. `describer` is not in the dissertation: success
against the share of wrong descriptions of a teacher that is otherwise consistent.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import torch

from agents.iliad.config import LearnerConfig
from agents.iliad.figures import curves_figure, describer_figure
from agents.iliad.regex.config import RegexConfig, students_of
from agents.iliad.regex.run import Grounds, learn, load_student, name_of, prepare
from agents.iliad.regex.world import RegexWorld
from agents.iliad.training import episodes_to, success_rate
from agents.imitation.loop import Note
from agents.imitation.studies import (
    beside,
    history_of,
    refuse_unknown,
    run_all,
    seeds_with,
    shown,
    table,
    write_all,
    write_markdown,
)
from assets.cache import write_json
from embodied.evaluation.tables import Estimate, across_seeds

UPDATES = 30_000
"""Of the dissertation: after how many of them lambda is annealed is scaled to other numbers of updates
(docs/sources.md, S99)."""
WRONG = (0.1, 0.25, 0.5)


@dataclass(frozen=True)
class IliadJob:
    """One learner; all else is as the study's settings say."""

    label: str
    learner: str = "adel"
    mixing: float = 0.5
    annealed: int = 0
    """L, in updates of the dissertation; 0 for never."""
    wrong: float | None = None
    """Share of wrong descriptions, by the grammar; None for the study's teacher."""
    printed: tuple[str, str, str] = field(default=("", "", ""), compare=False)
    """Validation and test success and episodes, in the dissertation."""


ADEL = IliadJob("ADEL", printed=("88.1 ± 1.60", "89.0 ± 1.30", "573K ± 116K"))
HALF = IliadJob("λ = 0.5", printed=("88.0", "", "608K"))
TABLES: Mapping[str, Sequence[IliadJob]] = {
    "3.4": (
        IliadJob("DAgger", "dagger", printed=("92.5 ± 0.53", "93.0 ± 0.37", "118K ± 16K")),
        IliadJob("REINFORCE, binary", "binary", printed=("0.0 ± 0.00", "0.0 ± 0.00", "∞")),
        IliadJob("REINFORCE, continuous", "continuous", printed=("0.0 ± 0.00", "0.0 ± 0.00", "∞")),
        ADEL,
    ),
    "3.5": (
        IliadJob("λ = 0", mixing=0.0, printed=("0.2", "", "∞")),
        IliadJob("λ = 1", mixing=1.0, printed=("55.7", "", "∞")),
        HALF,
    ),
    "C.1": (
        IliadJob("every 2000", annealed=2000, printed=("87.7", "", "368K")),
        IliadJob("every 5000", annealed=5000, printed=("86.4", "", "448K")),
        IliadJob("never", printed=("88.0", "", "608K")),
    ),
    "figure 3.7": (
        IliadJob("DAgger", "dagger"),
        IliadJob("REINFORCE, binary", "binary"),
        IliadJob("REINFORCE, continuous", "continuous"),
        IliadJob("ADEL"),
    ),
    "describer": tuple(IliadJob(f"{100 * w:g} % wrong", wrong=w) for w in (0.0, *WRONG)),
}
"""What the tables need; numbers of the dissertation are for REGEX."""
TITLES = {
    "3.4": "Table 3.4: learning from descriptions, demonstrations and rewards, REGEX",
    "3.5": "Table 3.5: the mixing weight, REGEX",
    "C.1": "Table C.1: annealing the mixing weight, REGEX",
    "figure 3.7": "Figure 3.7: success over the course of training, REGEX",
    "describer": "How good must the describer be? (no counterpart in the dissertation)",
}


@dataclass(frozen=True)
class IliadStudySetting:
    """What all runs of a study share."""

    out: Path
    config: RegexConfig
    learner: LearnerConfig
    """Its seed is the first one."""
    seeds: int = 3
    words: Path | None = None
    templates: Path | None = None
    threads: int = 1
    """Of PyTorch, per run."""

    @property
    def repeats(self) -> list[int]:
        return [self.learner.seed + k for k in range(self.seeds)]

    def regex_of(self, job: IliadJob) -> RegexConfig:
        if job.wrong is None:
            return self.config
        return dataclasses.replace(self.config, teacher="grammar", wrong=job.wrong)

    def learner_of(self, job: IliadJob, seed: int) -> LearnerConfig:
        every = max(1, round(job.annealed * self.learner.iterations / UPDATES)) if job.annealed else 0
        return dataclasses.replace(self.learner, learner=job.learner, mixing=job.mixing, anneal_every=every, seed=seed)

    def home(self, job: IliadJob) -> Path:
        """Folder of a teacher's students."""
        return self.out / "students" / students_of(self.regex_of(job))

    def folder(self, job: IliadJob, seed: int) -> Path:
        return self.home(job) / f"seed_{seed}" / name_of(self.learner_of(job, seed))


def run_study(
    setting: IliadStudySetting, names: Sequence[str], *, workers: int = 1, note: Note = print
) -> dict[str, Path]:
    """Train and judge what is missing, and write tables and figures; returns the Markdown files.

    Results do not depend on `workers`.

    Raises:
      ValueError: an unknown study, or files that cannot be used.
    """
    refuse_unknown(names, TABLES)
    torch.set_num_threads(setting.threads)
    jobs = [job for name in names for job in TABLES[name]]
    for config in dict.fromkeys(setting.regex_of(job) for job in jobs):
        _grounds(setting, config, note)
    unique = {setting.folder(job, setting.repeats[0]): job for job in reversed(jobs)}
    run_all(
        reversed(unique.values()), setting.repeats, lambda s, j: _run(setting, s, j, note), workers=workers, note=note
    )
    return report(setting, names)


def report(setting: IliadStudySetting, names: Sequence[str]) -> dict[str, Path]:
    """Write the tables and figures of what there is; what is missing is named."""
    refuse_unknown(names, TABLES)
    return write_all(names, {name: functools.partial(_write, setting, name) for name in TABLES})


def _grounds(setting: IliadStudySetting, config: RegexConfig, note: Note) -> Grounds:
    return prepare(config, setting.out / "shared", words=setting.words, templates=setting.templates, note=note)


def _run(setting: IliadStudySetting, seed: int, job: IliadJob, note: Note) -> str:
    folder = setting.folder(job, seed)
    judged = folder / "judged.json"
    if not judged.exists():
        torch.set_num_threads(setting.threads)
        grounds = _grounds(setting, setting.regex_of(job), lambda line: None)
        learn(grounds, setting.learner_of(job, seed), setting.home(job), note=note)
        student, world = load_student(folder / "best.safetensors")[0], RegexWorld()
        splits = {s: grounds.data.splits[s] for s in ("validation", "test")}
        write_json(judged, {s: success_rate(world, student, items) for s, items in splits.items()}, indent=1)
    found = json.loads(judged.read_text(encoding="utf-8"))
    said = ", ".join(f"{split} {100 * value:.1f} %" for split, value in found.items())
    return f"{folder.relative_to(setting.out)}: {said}"


def _write(setting: IliadStudySetting, name: str) -> Path:
    """One study: its table, its facts as JSON, and its figure."""
    jobs, stem = TABLES[name], name.replace(" ", "_")
    rows, facts, missing = [], {}, []
    curves: dict[str, dict[str, list[tuple[float, Estimate]]]] = {}
    for job in jobs:
        seeds = seeds_with(setting.repeats, functools.partial(_is_judged, setting, job))
        if not seeds:
            missing.append(job.label)
            continue
        folders = [setting.folder(job, s) for s in seeds]
        judged = [json.loads((f / "judged.json").read_text(encoding="utf-8")) for f in folders]
        histories = [history_of(f) for f in folders]
        success = {split: across_seeds([j[split] for j in judged]) for split in ("validation", "test")}
        needed = [episodes_to(h, setting.learner.threshold) for h in histories]
        cells = [shown(success["validation"], 1, 100), shown(success["test"], 1, 100), _episodes(needed)]
        rows.append([job.label, str(len(seeds)), *(beside(c, p) for c, p in zip(cells, job.printed))])
        facts[job.label] = {
            **{split: dataclasses.asdict(e) for split, e in success.items()},
            "episodes": [None if math.isinf(n) else n for n in needed],
            "described": [h[-1].get("described") for h in histories],
        }
        curves[job.label] = {k: _curve(histories, k) for k in ("success", "training success")}
    write_json(setting.out / f"{stem}.json", facts, indent=1)
    c = f"{100 * setting.learner.threshold:g} %"
    lines = table(["", "seeds", "validation success (%)", "test success (%)", f"episodes until {c}"], rows)
    if name == "figure 3.7" and curves:
        curves_figure(curves, setting.out / f"{stem}.png")
        lines += ["", f"![Success over the course of training]({stem}.png)"]
    if name == "describer" and facts:
        wrong = {job.wrong or 0.0: across_seeds(_judged(setting, job, "test")) for job in jobs if job.label in facts}
        describer_figure(wrong, setting.out / f"{stem}.png")
        lines += ["", f"![Success against the share of wrong descriptions]({stem}.png)"]
    return write_markdown(setting.out / f"{stem}.md", TITLES[name], lines, _how(setting), missing)


def _is_judged(setting: IliadStudySetting, job: IliadJob, seed: int) -> bool:
    return (setting.folder(job, seed) / "judged.json").exists()


def _judged(setting: IliadStudySetting, job: IliadJob, split: str) -> list[float]:
    paths = [setting.folder(job, s) / "judged.json" for s in setting.repeats]
    return [json.loads(p.read_text(encoding="utf-8"))[split] for p in paths if p.exists()]


def _curve(histories: Sequence[Sequence[Mapping[str, float]]], key: str) -> list[tuple[float, Estimate]]:
    """Episodes and the mean over seeds, for every validation that all have."""
    return [(at[0]["episodes"], across_seeds([h[key] for h in at])) for at in zip(*histories, strict=False)]


def _episodes(needed: Sequence[float]) -> str:
    """'96K ± 12K', or how many of the seeds never got there."""
    never = sum(math.isinf(n) for n in needed)
    if never:
        return "∞" if never == len(needed) else f"∞ ({never} of {len(needed)})"
    return shown(across_seeds(needed), 1, 1e-3).replace(" ± ", "K ± ") + "K"


def _how(setting: IliadStudySetting) -> str:
    c, x = setting.config, setting.learner
    teacher = (
        "teacher: the grammar that makes the requests"
        if c.teacher == "grammar"
        else f"teacher: describer and executor of {c.describer_iterations:,} and {c.executor_iterations:,} updates"
    )
    return (
        f"{c.items:,} data points with three requests each, {c.held_out_items:,} for validation and for test, whose "
        f"templates nobody learned from. Hidden size {c.hidden_size}, {x.iterations:,} updates of {x.batch} episodes, "
        f"learning rate {x.learning_rate:g} (REINFORCE a tenth), {c.pretraining_iterations:,} updates of pre-training "
        f"on rules alone; {teacher}. Mean over seeds from {setting.repeats[0]} on, with Student's 95 % interval; in "
        "brackets the dissertation's numbers (people's requests, hidden size 512, 960,000 episodes; ± is a standard "
        "deviation there): comparable in shape, not in level."
    )

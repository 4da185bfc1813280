"""Tables 3.4, 3.5 and C.1 and Figure 3.7, REGEX and NAV: run what is missing, put it beside the dissertation's numbers.

A study is a folder: `shared` holds data and teacher, `students` the runs. Runs that tables share are
made once, and everything goes on where it stopped. `describer` is not in the dissertation: success
against the share of wrong descriptions of a teacher that is otherwise consistent.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import torch

from agents.common.session import Note
from agents.common.studies import (
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
from agents.iliad.config import LearnerConfig, folder_name
from agents.iliad.figures import curves_figure, describer_figure
from agents.iliad.regex.language import MANNERS
from agents.iliad.subjects import Subject
from agents.iliad.training import episodes_to
from assets.cache import write_json
from embodied.evaluation.tables import Estimate, across_seeds

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
    unheard: str = ""
    """The speaker of 'speakers' that it never hears, or 'none'."""
    printed: Mapping[str, tuple[str, str, str]] = field(default_factory=dict, compare=False)
    """World to validation and test success and episodes, in the dissertation."""


def _of(regex: tuple[str, str, str], nav: tuple[str, str, str]) -> Mapping[str, tuple[str, str, str]]:
    return {"REGEX": regex, "NAV": nav}


NOTHING_LEARNED = ("0.0 ± 0.00", "0.0 ± 0.00", "∞")
TABLES: Mapping[str, Sequence[IliadJob]] = {
    "3.4": (
        IliadJob(
            "DAgger",
            "dagger",
            printed=_of(("92.5 ± 0.53", "93.0 ± 0.37", "118K ± 16K"), ("35.6 ± 1.35", "32.0 ± 1.63", "45K ± 26K")),
        ),
        IliadJob("REINFORCE, binary", "binary", printed=_of(NOTHING_LEARNED, ("22.4 ± 1.15", "20.5 ± 0.58", "∞"))),
        IliadJob(
            "REINFORCE, continuous", "continuous", printed=_of(NOTHING_LEARNED, ("11.1 ± 2.19", "11.3 ± 1.25", "∞"))
        ),
        IliadJob(
            "ADEL",
            printed=_of(("88.1 ± 1.60", "89.0 ± 1.30", "573K ± 116K"), ("32.2 ± 0.97", "31.9 ± 0.76", "406K ± 31K")),
        ),
    ),
    "3.5": (
        IliadJob("λ = 0", mixing=0.0, printed=_of(("0.2", "", "∞"), ("0.0", "", "∞"))),
        IliadJob("λ = 1", mixing=1.0, printed=_of(("55.7", "", "∞"), ("29.4", "", "∞"))),
        IliadJob("λ = 0.5", printed=_of(("88.0", "", "608K"), ("32.0", "", "384K"))),
    ),
    "C.1": (
        IliadJob("every 2000", annealed=2000, printed=_of(("87.7", "", "368K"), ("31.4", "", "304K"))),
        IliadJob("every 5000", annealed=5000, printed=_of(("86.4", "", "448K"), ("32.5", "", "384K"))),
        IliadJob("never", printed=_of(("88.0", "", "608K"), ("32.0", "", "384K"))),
    ),
    "figure 3.7": (
        IliadJob("DAgger", "dagger"),
        IliadJob("REINFORCE, binary", "binary"),
        IliadJob("REINFORCE, continuous", "continuous"),
        IliadJob("ADEL"),
    ),
    "describer": tuple(IliadJob(f"{100 * w:g} % wrong", wrong=w) for w in (0.0, *WRONG)),
    "speakers": tuple(IliadJob(f"without {name}", unheard=name) for name in ("none", *MANNERS)),
}
"""What the tables need."""
TITLES = {
    "3.4": "Table 3.4: learning from descriptions, demonstrations and rewards",
    "3.5": "Table 3.5: the mixing weight",
    "C.1": "Table C.1: annealing the mixing weight",
    "figure 3.7": "Figure 3.7: success over the course of training",
    "describer": "How good must the describer be? (no counterpart in the dissertation)",
    "speakers": "Who heard three speakers, does it understand the fourth? (no counterpart in the dissertation)",
}


@dataclass(frozen=True)
class IliadStudySetting:
    """What all runs of a study share."""

    out: Path
    subject: Subject
    learner: LearnerConfig
    """Its seed is the first one."""
    seeds: int = 3
    threads: int = 1
    """Of PyTorch, per run."""

    @property
    def repeats(self) -> list[int]:
        return [self.learner.seed + k for k in range(self.seeds)]

    def subject_of(self, job: IliadJob) -> Subject:
        if job.unheard:
            return self.subject.without(job.unheard)
        return self.subject if job.wrong is None else self.subject.erring(job.wrong)

    def learner_of(self, job: IliadJob, seed: int) -> LearnerConfig:
        share = job.annealed / self.subject.updates
        every = max(1, round(share * self.learner.iterations)) if job.annealed else 0
        return dataclasses.replace(self.learner, learner=job.learner, mixing=job.mixing, anneal_every=every, seed=seed)

    @property
    def shared(self) -> Path:
        """Folder of data and teacher."""
        return self.out / "shared"

    def home(self, job: IliadJob) -> Path:
        """Folder of a teacher's students."""
        return self.out / "students" / self.subject_of(job).students

    def folder(self, job: IliadJob, seed: int) -> Path:
        return self.home(job) / f"seed_{seed}" / folder_name(self.learner_of(job, seed))


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
    for subject in dict.fromkeys(setting.subject_of(job) for job in jobs):
        subject.prepare(setting.shared, note)
    unique = {setting.folder(job, setting.repeats[0]): job for job in reversed(jobs)}
    run_all(
        reversed(unique.values()), setting.repeats, lambda s, j: _run(setting, s, j, note), workers=workers, note=note
    )
    return report(setting, names)


def report(setting: IliadStudySetting, names: Sequence[str]) -> dict[str, Path]:
    """Write the tables and figures of what there is; what is missing is named."""
    refuse_unknown(names, TABLES)
    pages: dict[str, Callable[[], Path]] = {name: functools.partial(_write, setting, name) for name in TABLES}
    return write_all(names, pages | {"speakers": lambda: _write_speakers(setting)})


def _run(setting: IliadStudySetting, seed: int, job: IliadJob, note: Note) -> str:
    folder = setting.folder(job, seed)
    judged = folder / "judged.json"
    if not judged.exists():
        torch.set_num_threads(setting.threads)
        subject = setting.subject_of(job)
        grounds = subject.prepare(setting.shared, lambda line: None)
        subject.learn(grounds, setting.learner_of(job, seed), setting.home(job), note)
        write_json(judged, subject.judge(grounds, folder / "best.safetensors"), indent=1)
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
        rows.append(
            [
                job.label,
                str(len(seeds)),
                *(beside(c, p) for c, p in zip(cells, job.printed.get(setting.subject.name, ("", "", "")))),
            ]
        )
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
    return write_markdown(
        setting.out / f"{stem}.md", f"{TITLES[name]}, {setting.subject.name}", lines, _how(setting, jobs[0]), missing
    )


def _write_speakers(setting: IliadStudySetting) -> Path:
    """Success on each speaker's requests in new wordings, by who has heard it and who has not."""
    everybody, *jobs = TABLES["speakers"]
    rows, facts, missing = [], {}, []
    for job in jobs:
        there = [s for s in setting.repeats if _is_judged(setting, job, s)]
        if not there:
            missing.append(job.label)
            continue
        of = {name: _judged(setting, job, f"test {name}") for name in MANNERS}
        friends = [sum(of[n][k] for n in MANNERS if n != job.unheard) / (len(MANNERS) - 1) for k in range(len(there))]
        cells = {
            "others": friends,
            "unheard": of[job.unheard],
            "heard": _judged(setting, everybody, f"test {job.unheard}"),
        }
        facts[job.unheard] = cells
        shares = [shown(across_seeds(c), 1, 100) if c else "" for c in cells.values()]
        rows.append([job.unheard, str(len(there)), *shares])
    write_json(setting.out / "speakers.json", facts, indent=1)
    heads = [
        "fourth speaker",
        "seeds",
        "the three that were heard (%)",
        "the fourth (%)",
        "the fourth, had it been heard (%)",
    ]
    return write_markdown(
        setting.out / "speakers.md", TITLES["speakers"], table(heads, rows), _how(setting, everybody), missing
    )


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


def _how(setting: IliadStudySetting, job: IliadJob) -> str:
    """What a table's students have in common; `job` is one of them, and names the teacher."""
    x, told = setting.learner, setting.subject_of(job).told()
    theirs = {"REGEX": "people's requests, hidden size 512, 960,000 episodes", "NAV": "Room-to-Room, 800,000 episodes"}
    return (
        f"{told} {x.iterations:,} updates of {x.batch} episodes, learning rate {x.learning_rate:g} "
        f"(REINFORCE a tenth). Mean over seeds from {setting.repeats[0]} on, with Student's 95 % interval; in brackets "
        f"the dissertation's numbers ({theirs[setting.subject.name]}; ± is a standard deviation there): comparable in "
        "shape, not in level."
    )

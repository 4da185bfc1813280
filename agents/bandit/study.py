"""Table 3.2, Figures 3.4 and 3.5, and how learners behave on held-out sentences: run what is missing, make the page.

A study is a folder: `seed_N/pretrain`, `seed_N/full` and `seed_N/weak` with a critic and one folder
per learner and rater. Runs that tables share are made once, and everything goes on where it stopped.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch

from agents.bandit.behaviour import COLUMNS, behaviour, translator_of_run
from agents.bandit.config import BanditConfig
from agents.bandit.corpus import pairs_of
from agents.bandit.figures import curves_figure, gains_figure
from agents.bandit.ratings import CLEAN, Rater, rater_of
from agents.bandit.training import LEARNERS, REFERENCES, bandit, material, pretrain, teach_critic
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
from assets.cache import write_json
from embodied.evaluation.tables import Estimate, across_seeds
from embodied.records import read_json

Note = Callable[[str], None]
SENTENCE, HELD_OUT = "per-sentence BLEU", "held-out BLEU"
SWEEPS: Mapping[str, Sequence[float]] = {
    "granularity": (1, 2, 3, 4, 5, 6, 7, 8, 9, 10),
    "variance": (0.1, 0.2, 0.5, 1, 2, 5),
    "skew": (0.25, 0.5, 0.67, 1.5, 2, 4),
}
"""Figure 3.5's settings; a skew of 1 is the clean rater."""
PASSES = 5
"""Of Figure 3.4."""
PRINTED: Mapping[tuple[str, str], Sequence[str]] = {
    ("full", SENTENCE): ("38.26 ± 0.02", "0.07 ± 0.05", "2.82 ± 0.03"),
    ("full", HELD_OUT): ("24.94 ± 0.00", "1.48 ± 0.00", "1.82 ± 0.08"),
    ("weak", SENTENCE): ("19.15 ± 0.01", "2.94 ± 0.02", "7.07 ± 0.06"),
    ("weak", HELD_OUT): ("19.63 ± 0.00", "3.94 ± 0.00", "1.61 ± 0.17"),
}
"""Table 3.2, De-En: reference, difference by supervised learning, difference by NED-A2C."""


@dataclass(frozen=True)
class BanditStudySetting:
    """What all runs of a study share."""

    data: Path
    out: Path
    config: BanditConfig
    """Its seed is the first one."""
    seeds: int = 3
    """Repeats, each with its own pre-training."""
    threads: int = 1
    """Of PyTorch, per run."""

    @property
    def repeats(self) -> list[int]:
        return [self.config.seed + k for k in range(self.seeds)]


@dataclass(frozen=True)
class Job:
    """One learner on one reference model, under one rater."""

    reference: str
    learner: str
    rater: Rater = CLEAN
    passes: int = 1

    @property
    def name(self) -> str:
        off = [f"{k}_{v:g}" for k, v in dataclasses.asdict(self.rater).items() if v != getattr(CLEAN, k)]
        return "_".join([self.learner, *off])


def table_jobs() -> list[Job]:
    return [Job(reference, learner) for reference in REFERENCES for learner in LEARNERS]


def held_out_jobs() -> list[Job]:
    return [Job("full", learner) for learner in LEARNERS]


def curve_jobs() -> list[Job]:
    return [Job("full", "reference"), Job("full", "a2c", passes=PASSES)]


def sweep_jobs(sweeps: Mapping[str, Sequence[float]] = SWEEPS) -> list[Job]:
    raters = [rater_of(name, v) for name, values in sweeps.items() for v in values]
    return [Job("full", "reference"), Job("full", "a2c"), *(Job("full", "a2c", rater) for rater in raters)]


STUDIES: Mapping[str, Callable[[], list[Job]]] = {
    "3.2": table_jobs,
    "3.4": curve_jobs,
    "3.5": sweep_jobs,
    "held-out": held_out_jobs,
}


def run_study(
    setting: BanditStudySetting, names: Sequence[str], *, workers: int = 1, note: Note = print
) -> dict[str, Path]:
    """Run what is missing and write tables and figures; returns the Markdown files.

    Results do not depend on `workers`.

    Raises:
      ValueError: an unknown study, or a corpus that cannot be read.
    """
    refuse_unknown(names, STUDIES)
    jobs = distinct([job for name in names for job in STUDIES[name]()])
    references = dict.fromkeys(job.reference for job in jobs)
    seeds, ready = setting.repeats, functools.partial(_prepare, setting, references=tuple(references), note=note)
    run_all([""], seeds, lambda seed, _: ready(seed), workers=workers, note=note)
    run_all(jobs, seeds, lambda seed, job: _run(setting, seed, job, note), workers=workers, note=note)
    return report(setting, names)


def distinct(jobs: Sequence[Job]) -> list[Job]:
    """Every run once, with the most passes that anyone asks for: two runs never share a folder."""
    longest: dict[tuple[str, str], Job] = {}
    for job in jobs:
        key = job.reference, job.name
        if key not in longest or longest[key].passes < job.passes:
            longest[key] = job
    return list(longest.values())


def report(setting: BanditStudySetting, names: Sequence[str]) -> dict[str, Path]:
    """Write the tables and figures of runs that are there; sweeps show the settings that all seeds have."""
    writers = {"3.2": _write_table, "3.4": _write_curves, "3.5": _write_sweeps, "held-out": _write_held_out}
    return write_all(names, {name: functools.partial(write, setting) for name, write in writers.items()})


def history(setting: BanditStudySetting, seed: int, job: Job) -> list[dict[str, float]]:
    """What each finished pass of a run gave; nothing if it has not all its passes."""
    found = history_of(folder_of(setting, seed, job))
    return found[: job.passes] if len(found) >= job.passes else []


def done(setting: BanditStudySetting, *jobs: Job) -> list[int]:
    """The seeds that have all these runs."""
    return seeds_with(setting.repeats, lambda s: all(history(setting, s, job) for job in jobs))


def gains(setting: BanditStudySetting, job: Job, column: str, turn: int = 0) -> list[float]:
    """Difference to the reference model in a pass, of each seed that has both."""
    base = Job(job.reference, "reference")
    seeds = done(setting, job, base)
    return [history(setting, s, job)[turn][column] - history(setting, s, base)[0][column] for s in seeds]


def folder_of(setting: BanditStudySetting, seed: int, job: Job) -> Path:
    return setting.out / f"seed_{seed}" / job.reference / job.name


_material = functools.lru_cache(maxsize=8)(material)
"""Corpora in numbers of the seeds at hand: reading one takes as long as many updates."""


def _prepare(setting: BanditStudySetting, seed: int, references: Sequence[str], note: Note) -> str:
    torch.set_num_threads(setting.threads)
    m, home = _material(setting.data, dataclasses.replace(setting.config, seed=seed)), setting.out / f"seed_{seed}"
    pretrain(m, home / "pretrain", note=note)
    for reference in references:
        teach_critic(m, home / "pretrain" / f"{reference}.safetensors", home / reference / "critic", note=note)
    return f"seed {seed}: references and critics are ready"


def _run(setting: BanditStudySetting, seed: int, job: Job, note: Note) -> str:
    if not history(setting, seed, job):
        torch.set_num_threads(setting.threads)
        m, home = _material(setting.data, dataclasses.replace(setting.config, seed=seed)), setting.out / f"seed_{seed}"
        bandit(
            m,
            home / "pretrain" / f"{job.reference}.safetensors",
            home / job.reference / "critic" / "critic.safetensors",
            folder_of(setting, seed, job),
            job.learner,
            rater=job.rater,
            passes=job.passes,
            note=note,
        )
    last = history(setting, seed, job)[-1]
    return f"seed {seed}, {job.reference}, {job.name}: {SENTENCE} {last[SENTENCE]:.2f}, {HELD_OUT} {last[HELD_OUT]:.2f}"


def _write_table(setting: BanditStudySetting) -> Path:
    rows, facts = [], {}
    for reference in REFERENCES:
        jobs = [Job(reference, learner) for learner in LEARNERS]
        seeds = done(setting, *jobs)
        if not seeds:
            raise ValueError(f"{setting.out}: no seed has all runs of Table 3.2 yet; run the study without --report")
        for column in (SENTENCE, HELD_OUT):
            each = [[history(setting, s, job)[0][column] for s in seeds] for job in jobs]
            base = each[0]
            found = [across_seeds(base), *(across_seeds([b - a for a, b in zip(base, e)]) for e in each[1:])]
            facts[f"{reference}, {column}"] = [dataclasses.asdict(e) for e in found]
            cells = [beside(shown(e), p) for e, p in zip(found, PRINTED[reference, column], strict=True)]
            label = f"{'fully' if reference == 'full' else 'weakly'} pre-trained, {column}"
            rows.append([label, str(len(seeds)), *cells])
    write_json(setting.out / "table_3.2.json", facts, indent=1)
    title = "Table 3.2: translation scores and their improvement by one round of ratings"
    return _markdown(
        setting, "table_3.2.md", title, table(["", "seeds", "reference", "Δ supervised", "Δ NED-A2C"], rows)
    )


def _write_curves(setting: BanditStudySetting) -> Path:
    job = Job("full", "a2c", passes=PASSES)
    if not gains(setting, job, SENTENCE):
        raise ValueError(f"{setting.out}: no seed has the {PASSES} passes of Figure 3.4 yet; run it without --report")
    curves = {c: [across_seeds(gains(setting, job, c, turn)) for turn in range(PASSES)] for c in (SENTENCE, HELD_OUT)}
    curves_figure(curves, setting.out / "figure_3.4.png")
    heads = ["", "seeds", *(f"pass {k + 1}" for k in range(PASSES))]
    lines = table(heads, [[f"Δ {c}", str(e[0].n), *map(shown, e)] for c, e in curves.items()])
    facts = {c: [dataclasses.asdict(e) for e in v] for c, v in curves.items()}
    write_json(setting.out / "figure_3.4.json", facts, indent=1)
    printed = "The dissertation (De-En): +6.73 per-sentence BLEU in the fifth pass."
    title = "Figure 3.4: NED-A2C for five passes, gain over the fully pre-trained reference"
    return _markdown(setting, "figure_3.4.md", title, [*lines, "", printed])


def _write_sweeps(setting: BanditStudySetting) -> Path:
    """Every setting that some seed has; those that are missing are named."""
    columns = (SENTENCE, HELD_OUT)
    clean = Job("full", "a2c")
    if not gains(setting, clean, SENTENCE):
        raise ValueError(f"{setting.out}: no seed has learned from clean ratings yet; run it without --report")
    band = {c: across_seeds(gains(setting, clean, c)) for c in columns}
    found: dict[str, dict[float, dict[str, Estimate]]] = {name: {} for name in SWEEPS}
    missing: list[str] = []
    rows = [["clean", str(band[SENTENCE].n), shown(band[SENTENCE]), "100 %", shown(band[HELD_OUT])]]
    for name, value in ((name, value) for name, values in SWEEPS.items() for value in values):
        job = Job("full", "a2c", rater_of(name, value))
        if not gains(setting, job, SENTENCE):
            missing.append(f"{name} {value:g}")
            continue
        e = found[name][value] = {c: across_seeds(gains(setting, job, c)) for c in columns}
        share = 100 * sum(gains(setting, job, SENTENCE)) / sum(_clean_gains(setting, job))
        rows.append([f"{name} {value:g}", str(e[SENTENCE].n), shown(e[SENTENCE]), f"{share:.0f} %", shown(e[HELD_OUT])])
    if any(found.values()):
        swept = {name: values for name, values in found.items() if values}
        gains_figure(swept, band, setting.out / "figure_3.5.png")
    facts = {
        n: {f"{v:g}": {c: vars(x) for c, x in e.items()} for v, e in values.items()} for n, values in found.items()
    }
    write_json(setting.out / "figure_3.5.json", facts, indent=1)
    heads = ["rater", "seeds", f"Δ {SENTENCE}", "share of the clean rater's, same seeds", f"Δ {HELD_OUT}"]
    title = "Figure 3.5: gain by NED-A2C under imperfect ratings"
    return _markdown(setting, "figure_3.5.md", title, table(heads, rows), missing)


def _write_held_out(setting: BanditStudySetting) -> Path:
    """Of each learner after its first pass, on the test set."""
    jobs = held_out_jobs()
    found = {seed: [_behaviour(setting, seed, job) for job in jobs] for seed in done(setting, *jobs)}
    seeds = [seed for seed, row in found.items() if all(row)]
    if not seeds:
        raise ValueError(
            f"{setting.out}: no seed has the three learners after one pass: either they were not run yet (leave "
            "--report out) or 3.4 went on with them for more passes (take another --out, or ask for held-out first)"
        )
    each = {job.learner: [found[seed][i] for seed in seeds] for i, job in enumerate(jobs)}
    base = each["reference"]
    rows = []
    for column in COLUMNS:
        cells = [shown(across_seeds([b[column] for b in base]), 3)]
        for learner in LEARNERS[1:]:
            differences = [a[column] - b[column] for a, b in zip(each[learner], base, strict=True)]
            cells.append(shown(across_seeds(differences), 3))
        rows.append([column, str(len(seeds)), *cells])
    write_json(setting.out / "held_out.json", each, indent=1)
    title = "Held-out sentences: how learners translate them after one round of ratings"
    heads = ["", "seeds", "reference", "Δ supervised", "Δ NED-A2C"]
    return _markdown(setting, "held_out.md", title, table(heads, rows))


def _behaviour(setting: BanditStudySetting, seed: int, job: Job) -> Mapping[str, float]:
    """How the translator of a run behaves after one pass; nothing if that was not asked for before it went on."""
    folder = folder_of(setting, seed, job)
    path = folder / "behaviour.json"
    if not path.exists():
        if len(history_of(folder)) > 1:
            return {}
        m = _material(setting.data, dataclasses.replace(setting.config, seed=seed))
        write_json(path, behaviour(translator_of_run(m, folder), m, "test"), indent=1)
    return read_json(path)


def _clean_gains(setting: BanditStudySetting, job: Job) -> list[float]:
    """What the clean rater gave the seeds that have `job`."""
    base, clean = Job(job.reference, "reference"), Job(job.reference, "a2c")
    seeds = done(setting, job, base, clean)
    return [history(setting, s, clean)[0][SENTENCE] - history(setting, s, base)[0][SENTENCE] for s in seeds]


def _markdown(
    setting: BanditStudySetting, name: str, title: str, lines: Sequence[str], missing: Sequence[str] = ()
) -> Path:
    c = setting.config
    counts = pairs_of(setting.data)
    sizes = ", ".join(f"{s} {counts[s]:,}" for s in ("supervised", c.bandit_set, "dev", "test") if s in counts)
    how = (
        f"Pairs: {sizes}. Hidden size {c.hidden_size}, {c.source_words:,} and {c.target_words:,} {c.units}, "
        f"{c.pretraining_passes} passes of pre-training at {c.pretraining_rate:g}, {c.critic_passes} of the critic, "
        f"learning rate {c.bandit_rate:g} with ratings. Mean over seeds {', '.join(map(str, setting.repeats))}, each "
        "with its own pre-training, and Student's 95 % interval; differences are taken seed by seed. In brackets the "
        "dissertation's numbers (De-En TED talks, hidden size 500, 167,000 ratings): comparable in shape, not in level."
    )
    return write_markdown(setting.out / name, title, lines, how, missing)

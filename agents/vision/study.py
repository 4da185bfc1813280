"""Encoders on equal terms: the same pictures, as many passes, judged on the same houses (no counterpart in the
dissertation, whose features are a ResNet-152's).

    embodied study vision encoders --data DATA --out STUDY
    embodied study vision pictures --data DATA --out STUDY --split test_unseen
    embodied study vision pictures --data DATA --out STUDY --lights 3 --encoders one=A.safetensors three=B.safetensors

A run is a folder of the study that goes on where it stopped. Readers are fitted on training houses, in the pictures
that the encoders of the study learn from; 'pictures' judges houses in their own light.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import statistics
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch

from agents.common.device import check_device
from agents.common.session import Note
from agents.common.studies import refuse_unknown, run_all, seeds_with, shown, table, write_markdown
from agents.vision.config import WAYS, VisionConfig
from agents.vision.drawn import StripSource, houses_of
from agents.vision.encoder import Encoder, load_encoder
from agents.vision.labels import HouseStrips
from agents.vision.probe import read
from agents.vision.reading import as_numbers, labelled
from agents.vision.run import taught, training_houses
from agents.vision.training import frequent_classes
from assets.cache import digest, write_json
from embodied.datasets.store import Dataset
from embodied.evaluation.tables import Estimate, across_seeds
from embodied.locks import locked
from embodied.records import read_json

ENCODERS: Mapping[str, Mapping[str, Any]] = {
    "compact": {"network": "compact"},
    "keen": {"network": "keen"},
    "lite0, frozen": {"network": "lite0", "begin": "imagenet", "frozen": True},
    "lite0 means, frozen": {"network": "lite0_means", "begin": "imagenet", "frozen": True},
    "lite0, fine-tuned": {"network": "lite0", "begin": "imagenet", "learning_rate": 5e-4},
}
"""What differs from the chosen settings, by encoder; who goes on from what ImageNet taught goes slowly."""
COLUMNS: Mapping[str, tuple[str, int, float]] = {
    "mean_ap": ("AP", 3, 1),
    "room_accuracy": ("room, %", 1, 100),
    "depth_r2": ("depth, R²", 3, 1),
    "place_auc": ("place, AUC", 3, 1),
    "milliseconds": ("ms a node", 1, 1),
    "megabytes": ("MB", 1, 1),
}
"""A number of a reading: its heading, digits and scale."""
PICTURES = tuple(WAYS)
STUDIES = ("encoders", "pictures")
STRIPS = 8
"""Strips at once when an encoder's price is measured."""


@dataclass(frozen=True)
class EncoderStudySetting:
    """What all encoders of a study share."""

    source: StripSource
    out: Path
    config: VisionConfig
    """Where the encoders start from; its seed is the first one."""
    seeds: int = 1
    """Encoders of each kind."""
    split: str = "val_unseen"
    """Whose houses they are judged on; choose on validation houses."""
    threads: int = 1
    """Of PyTorch, per encoder."""
    device: str = "cpu"
    ready: Mapping[str, Sequence[Path]] = field(default_factory=dict)
    """Encoders that are there already, to be judged beside those that are trained: by row, one file per training
    seed."""

    def __post_init__(self) -> None:
        if twice := sorted(self.ready.keys() & ENCODERS.keys()):
            raise ValueError(f"encoders of the names {twice} are trained by the study; give those of --encoders others")

    def folder(self, encoder: str, seed: int) -> Path:
        if encoder in self.ready:
            return self.out / "ready" / digest(self.ready[encoder][seed])[:16]
        return self.out / encoder.replace(",", "").replace(" ", "_") / f"seed_{seed}"

    def reading(self, encoder: str, seed: int, quality: str | None = None) -> Path:
        """Where the numbers are that an encoder reaches on pictures drawn so."""
        return self.folder(encoder, seed) / f"reading_{self.split}{'_' + quality if quality else ''}.json"

    def rows(self) -> list[str]:
        """Of the tables."""
        return [*ENCODERS, *self.ready]

    def repeats(self, encoder: str) -> range:
        """Its training seeds, or the files given for it."""
        if encoder in self.ready:
            return range(len(self.ready[encoder]))
        return range(self.config.seed, self.config.seed + self.seeds)

    def judging(self, quality: str | None) -> StripSource:
        """What they are judged on: pictures as they learned from, or drawn otherwise."""
        return self.source if quality is None else dataclasses.replace(self.source, quality=quality, lights=1)


def run_study(
    setting: EncoderStudySetting,
    names: Sequence[str],
    *,
    rows: Sequence[str] | None = None,
    pictures: Sequence[str] = PICTURES,
    workers: int = 1,
    note: Note = print,
) -> dict[str, Path]:
    """Train and judge what is missing and write the tables; returns the Markdown files.

    Args:
      rows: train and judge these encoders only; None: all, or none where some are there already.
      pictures: qualities that 'pictures' judges on.

    Raises:
      ValueError: an unknown table or encoder.
    """
    refuse_unknown(names, STUDIES)
    refuse_unknown(rows or (), ENCODERS, "rows")
    check_device(setting.device)
    data, ways = Dataset(setting.source.data), tuple(pictures) if "pictures" in names else ()
    chosen = [*(rows or (() if setting.ready else ENCODERS)), *setting.ready]
    for quality in (None, *ways):  # drawn before encoders share the cores
        houses = houses_of(data, (setting.split,))
        setting.judging(quality).strips(
            houses + (training_houses(data, setting.config) if quality is None else []), workers=workers
        )
    work = functools.partial(_run, setting, ways, note)
    jobs = [(name, k) for name in chosen for k in setting.repeats(name)]
    run_all(jobs, (setting.config.seed,), work, workers=workers, note=note)
    writers = {"encoders": lambda: _encoders(setting), "pictures": lambda: _pictures(setting, ways)}
    return {name: writers[name]() for name in names}


def _run(setting: EncoderStudySetting, ways: Sequence[str], note: Note, seed: int, job: tuple[str, int]) -> str:
    """Judge one encoder, and train it before if it is not there, unless that is done; `seed` is that of the readers."""
    torch.set_num_threads(setting.threads)
    (name, k), data = job, Dataset(setting.source.data)
    missing = [q for q in (None, *ways) if not setting.reading(name, k, q).exists()]
    if not missing:
        return f"{name}, seed {k}: done before"
    with locked(setting.folder(name, k)):
        seen = setting.source.strips(training_houses(data, setting.config))
        encoder, classes, path = _encoder(setting, name, k, seen, lambda line: note(f"{name}, seed {k}: {line}"))
        known = labelled(data, seen, encoder, classes)
        for quality in missing:
            unseen = setting.judging(quality).strips(houses_of(data, (setting.split,)))
            numbers = as_numbers(read(known, labelled(data, unseen, encoder, classes), seed=seed), classes)
            facts = {"milliseconds": price(encoder, unseen), "megabytes": path.stat().st_size / 1e6}
            facts |= {"houses": len(unseen), "strips": len(known.room)}
            write_json(setting.reading(name, k, quality), numbers | facts, indent=1)
    return f"{name}, seed {k}: judged"


def _encoder(
    setting: EncoderStudySetting, name: str, seed: int, seen: Sequence[HouseStrips], note: Note
) -> tuple[Encoder, list[str], Path]:
    """An encoder, the classes that readers look for, and its file."""
    if name in setting.ready:
        path = setting.ready[name][seed]
        classes = [seen[0].classes[i] for i in frequent_classes(seen, setting.config.least_views)]
        return load_encoder(path), classes, path
    folder, config = setting.folder(name, seed), dataclasses.replace(setting.config, seed=seed, **ENCODERS[name])
    encoder, classes = taught(seen, config, folder, note, device=setting.device)
    return encoder, classes, folder / "encoder.safetensors"


def price(encoder: Encoder, houses: Sequence[HouseStrips], rounds: int = 5) -> float:
    """Milliseconds of processor time per viewpoint, the median of some looks at several strips."""
    strips, times = houses[0].rgb[:STRIPS], []
    for _ in range(rounds + 1):
        began = time.process_time()
        encoder.encode_strips(strips)
        times.append((time.process_time() - began) / len(strips) * 1000)
    return statistics.median(times[1:])


def _encoders(setting: EncoderStudySetting) -> Path:
    judged = {name: _judged(setting, name, None) for name in setting.rows()}
    lines = table(_heads("encoder"), [_cells(setting, name, None) for name, seeds in judged.items() if seeds])
    return write_markdown(
        setting.out / "table_encoders.md",
        "Encoders: what linear readers make of them",
        lines,
        _made_with(setting, judged, None),
        [name for name, seeds in judged.items() if not seeds],
    )


def _pictures(setting: EncoderStudySetting, ways: Sequence[str]) -> Path:
    rows, missing = [], []
    for name in setting.rows():
        for quality in ways:
            if _judged(setting, name, quality):
                rows.append([f"{name}, {quality}", *_cells(setting, name, quality)[1:]])
            elif _judged(setting, name, None):
                missing.append(f"{name} on {quality}")
    judged = {name: _judged(setting, name, None) for name in setting.rows()}
    how = _made_with(setting, judged, None) + " Readers were fitted in the pictures that the study learns from."
    return write_markdown(
        setting.out / "table_pictures.md",
        "Encoders, judged on other pictures",
        table(_heads("encoder, pictures"), rows),
        how,
        missing,
    )


def _heads(first: str) -> list[str]:
    return [first, "seeds", *(heading for heading, _, _ in COLUMNS.values())]


def _cells(setting: EncoderStudySetting, name: str, quality: str | None) -> list[str]:
    seeds = _judged(setting, name, quality)
    found = [read_json(setting.reading(name, seed, quality)) for seed in seeds]
    cells = [name, str(len(seeds))]
    for column, (_, digits, scale) in COLUMNS.items():
        values = [float(body[column]) for body in found]
        one = Estimate(values[0], math.nan, 1) if len(values) == 1 else across_seeds(values)
        cells.append(shown(one, digits, scale))
    return cells


def _judged(setting: EncoderStudySetting, name: str, quality: str | None) -> list[int]:
    """The seeds of an encoder that were judged on such pictures."""
    return seeds_with(setting.repeats(name), lambda seed: setting.reading(name, seed, quality).exists())


def _made_with(setting: EncoderStudySetting, judged: Mapping[str, Sequence[int]], quality: str | None) -> str:
    """The sentences below a table."""
    first = next(((name, seeds[0]) for name, seeds in judged.items() if seeds), None)
    if first is None:
        return "No encoder was trained."
    body = read_json(setting.reading(*first, quality))
    return (
        f"Readers fitted on {body['strips']} strips of training houses, judged on {body['nodes']} viewpoints of "
        f"{body['houses']} lightings of houses of {setting.split}; AP over {body['classes']} classes (chance "
        f"{body['chance_ap']:.3f}), the commonest room {100 * body['common_room']:.0f} %. {setting.config.epochs} "
        "passes. Mean and Student's 95 % interval over training seeds, where there are several; prices in processor "
        "time of one core."
    )

"""Encoders on equal terms: the same pictures, as many passes, judged on the same houses (no counterpart in the
dissertation, whose features are a ResNet-152's).

    embodied study vision encoders --data DATA --out STUDY
    embodied study vision pictures --data DATA --out STUDY --split test_unseen
    embodied study vision pictures --data DATA --out STUDY --lights 3 --encoders one=A.safetensors three=B.safetensors
    embodied study vision houses --data DATA --out STUDY --pictures unlit --houses 12 48 128 --test-pictures unlit fast

Readers are fitted on training houses, in the pictures that the encoders of the study learn from; 'pictures' judges
houses in their own light. In 'houses', encoders learn in so many houses, all for as many updates, and readers are
fitted in the same few houses for all, in the kind of pictures that is judged; `--encoders` adds those that are there.
"""

from __future__ import annotations

import dataclasses
import statistics
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from agents.common.session import Note
from agents.common.weights import weights_digest
from agents.studies.engine import Measured, StudyLearner
from agents.studies.tables import StudyRow, StudyTable
from agents.vision.config import RENDER_PRESETS, VisionConfig
from agents.vision.drawn import StripSource, houses_of
from agents.vision.encoder import load_encoder
from agents.vision.labels import HouseStrips
from agents.vision.probe import labelled, read
from agents.vision.run import trained_encoder, training_houses
from agents.vision.training import frequent_classes
from embodied.datasets.store import Dataset
from embodied.evaluation.tables import Samples
from embodied.identity import identity_of
from embodied.interface import FindObject

COLUMNS = ("AP", "goal AP", "chance AP", "room accuracy", "depth R²", "place AUC", "ms a node", "MB")
GOALS = 60
"""The goal AP is a mean over so many classes: those that tasks seek most often, or all if they seek none."""
READY = "ready"
"""In a row: the name of encoders that are there already."""
LIT = "lit"
"""In a row: so many of the houses to learn from are seen in light."""
READERS = "readers"
"""In a row: readers are fitted in so many houses, drawn as those that are judged."""
STRIPS = 8
"""Strips at once when an encoder's price is measured."""


@dataclass(frozen=True)
class EncoderStudy(StudyLearner):
    """Encoders of several kinds, whose splits are ways of drawing."""

    source: StripSource
    config: VisionConfig
    """Where the encoders start from."""
    repeats: tuple[int, ...]
    split: str = "val_unseen"
    """Whose houses they are judged on; choose on validation houses."""
    pictures: tuple[str, ...] = tuple(RENDER_PRESETS)
    """What the table of pictures judges on."""
    threads: int = 1
    device: str = "cpu"
    workers: int = 1
    """Houses drawn side by side."""
    houses: tuple[int, ...] = ()
    """Numbers of houses that encoders of the table of houses learn in."""
    lit_houses: int = 12
    """In that table: so many houses are seen in light by one more encoder, and by readers."""
    ready: Mapping[str, Sequence[Path]] = field(default_factory=dict)
    """Encoders that are there already, judged beside those that are trained: by row, one file per training seed."""

    name = "vision"
    judges = ("agents.vision.study",)

    def __post_init__(self) -> None:
        if twice := sorted(self.ready.keys() & {self.config.network}):
            raise ValueError(f"encoders of the names {twice} are trained by the study; give those of --encoders others")

    def tables(self) -> Mapping[str, StudyTable]:
        rows = (StudyRow(self.config.network, {}), *(StudyRow(n, {READY: n}) for n in self.ready))
        return {
            "encoders": StudyTable("Encoders: what linear readers make of them", rows, COLUMNS),
            "pictures": StudyTable("Encoders, judged on other pictures", rows, COLUMNS[:6], self.pictures),
            "houses": StudyTable("Encoders by houses to learn in", self._by_houses(), COLUMNS[:6], self.pictures),
        }

    def _by_houses(self) -> tuple[StudyRow, ...]:
        """As many updates in fewer and in more houses, and in the most with some of them lit; then encoders that are
        there already."""
        if not self.houses:
            return ()
        most = max(self.houses)
        train = {n: {"training_houses": n, "epochs": round(self.config.epochs * most / n)} for n in self.houses}
        judge = {READERS: self.lit_houses}
        mixed = StudyRow(f"{most} houses, {self.lit_houses} of them lit", {**train[most], LIT: self.lit_houses}, judge)
        ready = (StudyRow(name, {READY: name}, judge) for name in self.ready)
        return (*(StudyRow(f"{n} houses", train[n], judge) for n in self.houses), mixed, *ready)

    def seeds(self, row: StudyRow) -> Sequence[int]:
        train = row.train or {}
        return range(len(self.ready[train[READY]])) if READY in train else self.repeats

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Strips are drawn before encoders share the cores."""
        data = Dataset(self.source.data)
        lit = max((row.judge.get(READERS, 0) for row in rows), default=0)
        for way in ("", *splits):
            seen = training_houses(data, self.config)[: lit if way else None]
            self._source(way).strips([*houses_of(data, (self.split,)), *seen], workers=self.workers, note=note)

    def trained(self, train: Mapping[str, Any], seed: int, folder: Path) -> Mapping[str, Any]:
        if READY in train:
            return identity_of(file=weights_digest(self.ready[train[READY]][seed]))
        light = {LIT: train[LIT], "lit pictures": self._lit().picture_kind} if LIT in train else {}
        return identity_of("agents.vision.run", settings=self._settings(train, seed), **light, **self._drawn())

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        if READY in train:
            return self.ready[train[READY]][seed]
        config, lit = self._settings(train, seed), train.get(LIT, 0)
        names = training_houses(Dataset(self.source.data), config)
        seen = [*self._lit().strips(names[:lit], note=note), *self.source.strips(names[lit:], note=note)]
        trained_encoder(seen, config, home, note, identity=self.trained(train, seed, folder), device=self.device)
        return home / "encoder.safetensors"

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {**self._drawn(), "of": self.split, "least views": self.config.least_views}

    def _settings(self, train: Mapping[str, Any], seed: int) -> VisionConfig:
        return dataclasses.replace(self.config, seed=seed, **{k: v for k, v in train.items() if k != LIT})

    def _lit(self) -> StripSource:
        """Pictures with light: of the first kind that is judged and has any."""
        return self._source(next((k for k in self.pictures if RENDER_PRESETS[k].lit_by), "fast"))

    def judge(self, weights: Path | None, row: StudyRow, split: str, seed: int, folder: Path, keep: Path) -> Measured:
        assert weights is not None, "every row is an encoder"
        data, encoder, seen = Dataset(self.source.data), load_encoder(weights), self._seen()
        classes = [seen[0].classes[i] for i in frequent_classes(seen, self.config.least_views)]
        unseen = self._source(split).strips(houses_of(data, (self.split,)))
        if READERS in row.judge:
            names = training_houses(data, self.config)[: row.judge[READERS]]
            seen = self._source(split).strips(names, note=lambda line: None)
        known, other = (labelled(data, houses, encoder, classes) for houses in (seen, unseen))
        found = read(known, other, seed=self.config.seed)
        ap = dict(zip(classes, found.ap, strict=True))
        goals = float(np.nanmean([ap[c] for c in sought(data) or classes if c in ap]))
        numbers = (found.mean_ap, goals, found.chance_ap, 100 * found.room_accuracy, found.depth_r2, found.place_auc)
        cost = (encoding_ms(encoder.encode_strips, unseen), weights.stat().st_size / 1e6)
        return {name: Samples((float(v),)) for name, v in zip(COLUMNS, (*numbers, *cost), strict=True)}

    def about(self) -> str:
        data = Dataset(self.source.data)
        return (
            f"Readers fitted on {len(training_houses(data, self.config))} training houses, judged on "
            f"{len(houses_of(data, (self.split,)))} of {self.split}. {self.config.epochs} passes; seeds "
            f"{', '.join(map(str, self.repeats))}; rooms in per cent; prices in processor time of one core."
        )

    def _drawn(self) -> dict[str, object]:
        return {
            "data": Dataset(self.source.data).digest, "pictures": self.source.picture_kind, "lights": self.source.lights
        }  # fmt: skip

    def _source(self, way: str) -> StripSource:
        """Pictures as they learned from, or drawn otherwise."""
        return dataclasses.replace(self.source, picture_kind=way, lights=1) if way else self.source

    def _seen(self) -> list[HouseStrips]:
        return self.source.strips(training_houses(Dataset(self.source.data), self.config), note=lambda line: None)


def sought(data: Dataset) -> list[str]:
    """The classes that training tasks seek most often."""
    goals = Counter(t.goal.object_class for t in data.tasks("train") if isinstance(t.goal, FindObject))
    return [name for name, _ in goals.most_common(GOALS)]


def encoding_ms(encode: Any, houses: Sequence[HouseStrips], rounds: int = 5) -> float:
    """Milliseconds of processor time per viewpoint, the median of some looks at several strips."""
    strips, times = houses[0].rgb[:STRIPS], []
    for _ in range(rounds + 1):
        began = time.process_time()
        encode(strips)
        times.append((time.process_time() - began) / len(strips) * 1000)
    return statistics.median(times[1:])

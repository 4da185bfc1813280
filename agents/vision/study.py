"""Encoders by the number of houses that they learn in, all from the same number of pictures, judged on the same houses
(no counterpart in the dissertation, whose features are a ResNet-152's).

    embodied study vision --data DATA --out STUDY --pictures unlit --houses 12 48 128 --test-pictures unlit fast

Readers are fitted in the same few houses for all, in the kind of pictures that is judged; `--encoders` adds encoders
that are there already, and detectors of the shipped encoder.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from embodied.agents.common.session import Note
from embodied.agents.common.weights import kind_of, weights_digest
from embodied.agents.studies.engine import Measured, StudyLearner
from embodied.agents.studies.tables import StudyRow, StudyTable
from embodied.agents.vision.config import RENDER_PRESETS, VisionConfig
from embodied.agents.vision.detector import Detector
from embodied.agents.vision.drawn import StripSource, houses_of
from embodied.agents.vision.encoder import load_encoder
from embodied.agents.vision.labels import HouseStrips, visible_in_views
from embodied.agents.vision.probe import labelled, read
from embodied.agents.vision.run import trained_encoder, training_houses
from embodied.agents.vision.training import frequent_classes
from embodied.datasets.store import Dataset
from embodied.evaluation.tables import Samples
from embodied.identity import identity_of
from embodied.interface import FindObject

ENCODER_MEASURES = ("AP", "goal AP", "chance AP", "room accuracy", "depth R²", "place AUC")
GOALS = 60
"""The goal AP is a mean over so many classes: those that tasks seek most often, or all if they seek none."""
READY = "ready"
"""In a row: the name of encoders that are there already."""
LIT = "lit"
"""In a row: so many of the houses to learn from are seen in light."""
SHARE = "share"
"""In a row: such a share of the viewpoints of each house is seen."""


@dataclass(frozen=True)
class EncoderStudy(StudyLearner):
    """Encoders, whose splits are ways of drawing."""

    source: StripSource
    config: VisionConfig
    """Settings that the encoders start from."""
    repeats: tuple[int, ...]
    split: str = "val_unseen"
    """The split whose houses they are judged on; choose on validation houses."""
    pictures: tuple[str, ...] = ("unlit", "fast")
    """Kinds of pictures that encoders are judged on."""
    threads: int = 1
    device: str = "cpu"
    workers: int = 1
    """Houses drawn side by side."""
    houses: tuple[int, ...] = ()
    """Numbers of houses that encoders learn in."""
    budget: int = 0
    """All learn from as many pictures as so many houses have in all epochs; 0: the most of `houses`. Of more houses
    than this times the epochs, only some viewpoints are seen."""
    lit_houses: int = 12
    """So many houses are seen in light by one more encoder, and by readers."""
    ready: Mapping[str, Sequence[Path]] = field(default_factory=dict)
    """Encoders, and detectors of the shipped encoder, that are there already, judged beside those that are trained: by
    row, one file per training seed."""

    name = "vision"
    judges = ("embodied.agents.vision.study",)

    def __post_init__(self) -> None:
        labels = [row.label for row in self.tables()["houses"].rows]
        if not labels:
            raise ValueError("nothing to compare: give --houses, or --encoders that are there")
        if twice := {name for name in labels if labels.count(name) > 1}:
            raise ValueError(f"several rows are called {sorted(twice)}; each of --houses and --encoders is one")

    @property
    def _budget(self) -> int:
        return self.budget or max(self.houses, default=0)

    def tables(self) -> Mapping[str, StudyTable]:
        """As many updates in fewer and in more houses, and in the budget's with some of them lit; then encoders that
        are there already."""
        budget, rows = self._budget, []
        pictures = self.config.epochs * budget
        for n in self.houses:
            share = {SHARE: pictures / n} if n > pictures else {}
            rows.append(StudyRow(f"{n} houses", {"training_houses": n, "epochs": round(pictures / n) or 1, **share}))
        if self.houses:
            lit = {"training_houses": budget, "epochs": self.config.epochs, LIT: self.lit_houses}
            rows.append(StudyRow(f"{budget} houses, {self.lit_houses} of them lit", lit))
        rows += [StudyRow(name, {READY: name}) for name in self.ready]
        return {"houses": StudyTable("Encoders by houses to learn in", tuple(rows), ENCODER_MEASURES, self.pictures)}

    def seeds(self, row: StudyRow) -> Sequence[int]:
        train = row.train or {}
        return range(len(self.ready[train[READY]])) if READY in train else self.repeats

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Strips are drawn before encoders share the cores.

        Raises:
          ValueError: more houses than the data set has.
        """
        data = Dataset(self.source.data)
        if max(self.houses, default=0) > (there := len(houses_of(data, ("train",)))):
            raise ValueError(f"--houses {max(self.houses)}: the data set has {there} training houses")
        seen, unseen = self._known(data), houses_of(data, (self.split,))
        self.source.strips([*unseen, *seen], workers=self.workers, note=note)
        for way in splits:
            self._source(way).strips([*unseen, *seen[: self.lit_houses]], workers=self.workers, note=note)
        for row in rows:
            if {SHARE, LIT} & (row.train or {}).keys():
                self._strips(row.train or {}, 0, note)

    def trained(self, train: Mapping[str, Any], seed: int, folder: Path) -> Mapping[str, Any]:
        if READY in train:
            return identity_of(file=weights_digest(self.ready[train[READY]][seed]))
        other: dict[str, object] = {k: train[k] for k in (LIT, SHARE) if k in train}
        if LIT in train:
            other["lit pictures"] = self._lit().picture_kind
        return identity_of("embodied.agents.vision.run", settings=self._settings(train, seed), **other, **self._drawn())

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        if READY in train:
            return self.ready[train[READY]][seed]
        config = self._settings(train, seed)
        seen = self._strips(train, seed, note)
        trained_encoder(seen, config, home, note, identity=self.trained(train, seed, folder), device=self.device)
        return home / "encoder.safetensors"

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {**self._drawn(), "of": self.split, "least views": self.config.least_views, "lit": self.lit_houses}

    def _known(self, data: Dataset) -> list[str]:
        """Names of the houses whose classes are judged."""
        return training_houses(data, self.config)[: self._budget or None]

    def _strips(self, train: Mapping[str, Any], seed: int, note: Note) -> list[HouseStrips]:
        """Strips that an encoder learns from."""
        names, lit = training_houses(Dataset(self.source.data), self._settings(train, seed)), train.get(LIT, 0)
        unlit = dataclasses.replace(self.source, share=train.get(SHARE, 1.0))
        lit_ones = self._lit().strips(names[:lit], workers=self.workers, note=note)
        return [*lit_ones, *unlit.strips(names[lit:], workers=self.workers, note=note)]

    def _settings(self, train: Mapping[str, Any], seed: int) -> VisionConfig:
        return dataclasses.replace(self.config, seed=seed, **{k: v for k, v in train.items() if k not in (LIT, SHARE)})

    def _lit(self) -> StripSource:
        """Pictures with light: of the first kind that is judged and has any."""
        return self._source(next((k for k in self.pictures if RENDER_PRESETS[k].quality), "fast"))

    def judge(self, weights: Path | None, row: StudyRow, split: str, seed: int, folder: Path, keep: Path) -> Measured:
        assert weights is not None, "every row is an encoder or a detector"
        data = Dataset(self.source.data)
        names = self._known(data)
        shown = self.source.strips(names, note=lambda line: None)
        classes = [shown[0].classes[i] for i in frequent_classes(shown, self.config.least_views)]
        drawn = self._source(split)
        read_in = drawn.strips(names[: self.lit_houses], note=lambda line: None)
        unseen = drawn.strips(houses_of(data, (self.split,)), note=lambda line: None)
        goals = sought(data) or classes
        if kind_of(weights) == "detector":
            precision = Detector.load(load_encoder(), weights).precision(unseen)
            known = [c for c in classes if _shown(c, read_in) and _shown(c, unseen)]
            return _measured(ENCODER_MEASURES[:2], _mean_precision({c: precision.get(c, 0.0) for c in known}, goals))
        first, other = (labelled(data, houses, load_encoder(weights), classes) for houses in (read_in, unseen))
        reading = read(first, other, seed=self.config.seed)
        ap, goal_ap = _mean_precision(dict(zip(classes, reading.ap, strict=True)), goals)
        rest = (reading.chance_ap, 100 * reading.room_accuracy, reading.depth_r2, reading.place_auc)
        return _measured(ENCODER_MEASURES, (ap, goal_ap, *rest))

    def about(self) -> str:
        data = Dataset(self.source.data)
        return (
            f"Linear readers fitted in {self.lit_houses} training houses in the pictures that are judged, judged in "
            f"{len(houses_of(data, (self.split,)))} houses of {self.split}; seeds "
            f"{', '.join(map(str, self.repeats))}; rooms in per cent."
        )

    def _drawn(self) -> dict[str, object]:
        return {
            "data": Dataset(self.source.data).digest, "pictures": self.source.picture_kind
        }  # fmt: skip

    def _source(self, way: str) -> StripSource:
        """Pictures as they learned from, or drawn otherwise."""
        return dataclasses.replace(self.source, picture_kind=way) if way else self.source


def _shown(name: str, houses: Sequence[HouseStrips]) -> bool:
    """True if some view of `houses` shows a class."""
    return any(visible_in_views(h.share[..., [h.classes.index(name)]]).any() for h in houses)


def _mean_precision(ap: Mapping[str, float], goals: Sequence[str]) -> tuple[float, float]:
    """Mean average precision over all classes that are known, and over those of `goals`."""
    return float(np.nanmean(list(ap.values()))), float(np.nanmean([ap[c] for c in goals if c in ap]))


def _measured(names: Iterable[str], numbers: Iterable[float]) -> Measured:
    return {name: Samples((float(v),)) for name, v in zip(names, numbers, strict=True)}


def sought(data: Dataset) -> list[str]:
    """The classes that training tasks seek most often."""
    goals = Counter(t.goal.object_class for t in data.tasks("train") if isinstance(t.goal, FindObject))
    return [name for name, _ in goals.most_common(GOALS)]

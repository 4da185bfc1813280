"""The work of the encoder's commands: train it, train a detector on it, and make features with it."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from embodied.agents.common.parallel import check_device
from embodied.agents.common.session import Note
from embodied.agents.vision.config import StripTraining, VisionConfig, drawing
from embodied.agents.vision.detector import labelled, read, train_detector
from embodied.agents.vision.encoder import Encoder, load_encoder, save_encoder
from embodied.agents.vision.extract import Extractor, StripSource, drawings_of, pictures_of
from embodied.agents.vision.training import train_encoder, whitened
from embodied.assets.cache import write_json
from embodied.datasets.build import for_each_unit
from embodied.datasets.store import Dataset
from embodied.locks import locked
from embodied.records import Identity, identity_of


def train_vision(
    source: StripSource, config: VisionConfig, out: Path, *, device: str = "cpu", note: Note = print
) -> None:
    """Train an encoder on the training houses, and measure in validation houses what linear readers of its features
    tell; training goes on from the last epoch that was finished. Where some houses are lit, readers are fitted in
    these, and judged with light and without.

    Raises:
      LockedError: another process writes to `out`.
    """
    check_device(device)
    data = Dataset(source.data)
    names, unseen = training_houses(data, config), data.names("val_unseen")
    with locked(out):
        seen = source.training_strips(names, note)
        encoder, classes = train_encoder(seen, config, out / "training", device=device, note=note)
        file = out / "encoder.safetensors"
        save_encoder(whitened(encoder, seen), file, _learned_in(source, config))
        encoder, readings = load_encoder(file), dict[str, Any]()
        for kind in dict.fromkeys((source.picture_kind, *["fast"][: source.lit])):
            drawn = dataclasses.replace(source, picture_kind=kind)
            first, other = (
                labelled(drawn.strips(houses, note), encoder, classes)
                for houses in (names[: source.lit or None], unseen)
            )
            reading = read(first, other, classes, seed=config.seed)
            readings[drawing(pictures_of(data, unseen[0], kind))] = reading
            note(", ".join(f"{k} {v:.3g}" for k, v in reading.items() if not isinstance(v, dict)))
        write_json(out / "readings.json", readings, indent=1)


def detector_for(
    encoder: Encoder, source: StripSource, config: StripTraining, out: Path, *, device: str = "cpu", note: Note = print
) -> None:
    """Train a detector on an encoder, in the training houses, and measure its precision in validation houses; training
    goes on from the last epoch that was finished.

    Raises:
      LockedError: another process writes to `out`.
    """
    check_device(device)
    data = Dataset(source.data)
    with locked(out):
        seen = source.training_strips(training_houses(data, config), note)
        unseen = source.strips(data.names("val_unseen"), note)
        detector = train_detector(seen, encoder, config, out / "training", device=device, note=note)
        learned = {**_learned_in(source, config), "encoder": encoder.digest}
        detector.save(out / "detector.safetensors", learned)
        precision = detector.precision(unseen)
        whole = float(np.mean(list(precision.values())))
        write_json(out / "readings.json", {"AP": whole, "AP by class": precision}, indent=1)
        note(f"average precision {whole:.3f}, {len(precision)} classes in validation houses")


def training_houses(data: Dataset, config: StripTraining) -> Sequence[str]:
    """Names of the houses to learn from."""
    return data.names("train")[: config.training_houses or None]


def _learned_in(source: StripSource, config: StripTraining) -> Identity:
    """The identity of what is trained on strips."""
    data = Dataset(source.data)
    pictures = drawings_of(data, training_houses(data, config), source.picture_kind)
    return identity_of(
        "embodied.agents.vision.run", settings=config, data=data.digest, pictures=pictures, lit=source.lit
    )


# Features ----------------------------------------------------------------------------------------


def make_features(extract: Extractor, names: Sequence[str], *, workers: int = 1, note: Note = print) -> None:
    """Extract the missing features of some houses."""

    def watch(lines: Iterable[str], total: int) -> Iterable[str]:
        for line in lines:
            note(line)
            yield line

    missing = [n for n in names if extract.missing(n)]
    for_each_unit(extract, missing, (), workers=workers, watch=watch)
    data = Dataset(extract.data)
    count = Counter(drawing(pictures_of(data, n, extract.picture_kind)) for n in names)
    ways = ", ".join(f"{n} {way}" for way, n in sorted(count.items()))
    note(f"{len(missing)} of {len(names)} houses made, pictures: {ways}, encoder {extract.encoder.digest[:16]}")

"""The work of the encoder's commands: train it, train a detector on it, and make features with it.

What belongs to viz, such as recordings, is passed in from the console command as a function.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from embodied.agents.common.parallel import check_device
from embodied.agents.common.session import Note
from embodied.agents.vision.config import StripTraining, VisionConfig, drawing
from embodied.agents.vision.detector import train_detector
from embodied.agents.vision.drawn import StripSource, houses_of, pictures_of
from embodied.agents.vision.encoder import Encoder, load_encoder, random_encoder
from embodied.agents.vision.extract import Extractor
from embodied.agents.vision.labels import HouseStrips
from embodied.agents.vision.probe import as_numbers, labelled, read
from embodied.agents.vision.training import save_training, train_encoder, trained_classes, whitened
from embodied.assets.cache import write_json
from embodied.datasets.build import for_each_unit
from embodied.datasets.store import Dataset
from embodied.identity import Identity, identity_of
from embodied.locks import locked


def train_vision(
    source: StripSource, config: VisionConfig, out: Path, *, device: str = "cpu", workers: int = 1, note: Note = print
) -> None:
    """Cut strips from the pictures of all houses, train on the training houses, evaluate on validation houses, save.

    What is there already, strips or an encoder of the same settings, is not made again; training goes on from the
    last epoch that was finished.

    Raises:
      LockedError: another process writes to `out`.
    """
    check_device(device)
    data = Dataset(source.data)
    with locked(out):
        seen = source.strips(training_houses(data, config), workers=workers, note=note)
        unseen = source.strips(houses_of(data, ("val_unseen",)), workers=workers, note=note)
        drawn = sorted({drawing(pictures_of(data, h.name, source.picture_kind)) for h in seen})
        identity = identity_of(
            "embodied.agents.vision.run", settings=config, data=data.digest, pictures=", ".join(drawn)
        )
        encoder, classes = trained_encoder(seen, config, out, note, identity=identity, device=device)
        untrained = whitened(random_encoder(seed=config.seed), seen)
        numbers = {}
        for name, who in (("trained", encoder), ("random", untrained)):
            halves = [labelled(data, houses, who, classes) for houses in (seen, unseen)]
            numbers[name] = as_numbers(read(halves[0], halves[1], seed=config.seed), classes)
            note(f"{name}: " + ", ".join(f"{k} {v:.3g}" for k, v in numbers[name].items() if not isinstance(v, dict)))
        write_json(out / "readings.json", numbers, indent=1)


def detector_for(
    encoder: Encoder,
    source: StripSource,
    config: StripTraining,
    out: Path,
    *,
    lit: int = 0,
    also: StripSource | None = None,
    device: str = "cpu",
    workers: int = 1,
    note: Note = print,
) -> None:
    """Train a detector on an encoder, in the training houses, and measure its precision in validation houses; training
    goes on from the last epoch that was finished.

    Args:
      lit: so many training houses are seen in light ('fast'), too.
      also: of another data set, whose training houses are seen, too, but for those that are in the first.

    Raises:
      ValueError: `also` has no further houses.
      LockedError: another process writes to `out`.
    """
    check_device(device)
    data = Dataset(source.data)
    names = training_houses(data, config)
    further = _further(data, Dataset(also.data)) if also else []
    with locked(out):
        in_light = dataclasses.replace(source, picture_kind="fast")
        seen = source.strips(names, workers=workers, note=note)
        seen += in_light.strips(names[:lit], workers=workers, note=note)
        if also:
            others = also.strips(further, workers=workers, note=note)
            seen += [dataclasses.replace(h, name=f"also/{h.name}") for h in others]
        unseen = source.strips(houses_of(data, ("val_unseen",)), workers=workers, note=note)
        detector = train_detector(seen, encoder, config, out / "training", device=device, note=note)
        learned = identity_of(
            "embodied.agents.vision.run",
            settings=config,
            data=data.digest,
            encoder=encoder.digest,
            pictures=", ".join(sorted({drawing(pictures_of(data, n, source.picture_kind)) for n in names})),
            lit=lit,
            also=Dataset(also.data).digest if also else None,
            share=also.share if also else None,
        )
        detector.save(out / "detector.safetensors", learned)
        precision = detector.precision(unseen)
        whole = float(np.mean(list(precision.values())))
        write_json(out / "readings.json", {"AP": whole, "AP by class": precision}, indent=1)
        note(f"average precision {whole:.3f}, {len(precision)} classes in validation houses")


def _further(data: Dataset, other: Dataset) -> list[str]:
    """Names of the training houses of another data set that are in no split of the first."""
    known = {data.place(name).house.digest for name in houses_of(data, data.splits)}
    further = [n for n in houses_of(other, ("train",)) if other.place(n).house.digest not in known]
    if not further:
        raise ValueError(f"{other.folder}: all its training houses are in {data.folder}; name a larger data set")
    return further


def trained_encoder(
    seen: Sequence[HouseStrips],
    config: VisionConfig,
    folder: Path,
    note: Note = print,
    *,
    identity: Identity | None = None,
    device: str = "cpu",
) -> tuple[Encoder, list[str]]:
    """The encoder that `config` makes of strips, from `folder` if it is there, and the classes that it learned to tell.

    Args:
      identity: what it is trained with, for its file.
    """
    classes = trained_classes(folder, config)
    if classes is None:
        home = folder / "training"
        encoder, classes = train_encoder(seen, config, home, device=device, note=note)
        encoder = whitened(encoder, seen)
        save_training(encoder, classes, config, folder, identity)
        (home / "checkpoint.pt").unlink(missing_ok=True)
    return load_encoder(folder / "encoder.safetensors"), classes


def training_houses(data: Dataset, config: StripTraining) -> list[str]:
    """Names of the houses to learn from."""
    return houses_of(data, ("train",))[: config.training_houses or None]


# Features ----------------------------------------------------------------------------------------


def make_features(
    extract: Extractor, names: Sequence[str], *, workers: int = 1, ray: str | None = None, note: Note = print
) -> None:
    """Extract the missing features of some houses.

    Args:
      ray: address of a Ray cluster to use instead of `workers`.
    """

    def watch(lines: Iterable[str], total: int) -> Iterable[str]:
        for line in lines:
            note(line)
            yield line

    missing = [n for n in names if extract.missing(n)]
    for_each_unit(extract, missing, (), workers=workers, watch=watch, ray_address=ray)
    data = Dataset(extract.data)
    count = Counter(drawing(pictures_of(data, n, extract.picture_kind)) for n in names)
    ways = ", ".join(f"{n} {way}" for way, n in sorted(count.items()))
    note(f"{len(missing)} of {len(names)} houses made, pictures: {ways}, encoder {extract.encoder.digest[:16]}")

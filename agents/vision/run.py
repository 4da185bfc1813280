"""What the commands of the encoder do: train it, and make features with it.

What belongs to viz, such as recordings, is passed in from the console command as a function.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import torch

from agents.device import check_device
from agents.vision.config import PLAIN, VisionConfig, drawing
from agents.vision.encoder import Encoder, imagenet_encoder, load_encoder, random_encoder
from agents.vision.features import encode_panoramas, feature_path, load_features, save_features
from agents.vision.labels import HouseStrips, all_classes, look, mean_log_depth_of_views, visible_in_views
from agents.vision.probe import Labelled, read
from agents.vision.strip import view_of_strip
from agents.vision.training import save_training, train_encoder, trained_classes, whitened
from assets.cache import write_json
from assets.catalogue import load_catalogue
from embodied.datasets.build import for_each_unit
from embodied.datasets.store import Dataset
from embodied.interface import VIEWS
from embodied.locks import locked
from embodied.render.pictures import PictureSettings
from embodied.world import World, open_world

Note = Callable[[str], None]


def run_train_vision(args: argparse.Namespace, config: VisionConfig, note: Note = print) -> int:
    """Render strips of all houses, train on the training houses, judge on the others, save.

    What is there already, strips or an encoder of the same settings, is not made again.

    Raises:
      LockedError: another process writes to args.out.
    """
    torch.set_num_threads(args.threads)
    data = Dataset(args.data)
    train_names, test_names = _houses(data, ("train",)), _houses(data, ("val_unseen", "test_unseen"))
    train_names = train_names[: config.training_houses or None]
    with locked(args.out):
        strips = _strips(data, [*train_names, *test_names], args, note)
        seen, unseen = ([strips[n] for n in names] for names in (train_names, test_names))
        classes = trained_classes(args.out, config)
        if classes is None:
            encoder, heads, classes = train_encoder(seen, config, note=note)
            save_training(whitened(encoder, seen), heads, classes, config, args.out)
        encoder = load_encoder(args.out / "encoder.safetensors")
        untrained = whitened(random_encoder(config.network, seed=config.seed), seen)
        numbers = {}
        for name, who, alone in (
            ("trained", encoder, False),
            ("trained, each view alone", encoder, True),
            ("random", untrained, False),
        ):
            began = time.perf_counter()
            halves = [labelled(data, houses, who, classes, alone=alone) for houses in (seen, unseen)]
            numbers[name] = _numbers(halves, classes, time.perf_counter() - began, config.seed)
            note(f"{name}: " + ", ".join(f"{k} {v:.3g}" for k, v in numbers[name].items() if not isinstance(v, dict)))
        write_json(args.out / "readings.json", numbers, indent=1)
    return 0


def _strips(data: Dataset, names: Sequence[str], args: argparse.Namespace, note: Note) -> dict[str, HouseStrips]:
    """The strips of houses, drawn where they are missing."""
    missing = [n for n in names if not _strips_path(args, n).exists()]
    jobs = (joblib.delayed(_draw_strips)(data, n, args) for n in missing)
    for name in joblib.Parallel(n_jobs=args.workers, return_as="generator_unordered")(jobs):
        note(f"drawn: {name}")
    return {n: HouseStrips.load(_strips_path(args, n)) for n in names}


def _numbers(halves: Sequence[Labelled], classes: Sequence[str], seconds: float, seed: int) -> dict[str, Any]:
    """What linear readers make of an encoder's features, fitted on the first half and judged on the second."""
    reading = read(halves[0], halves[1], seed=seed)
    numbers: dict[str, Any] = {k: v for k, v in dataclasses.asdict(reading).items() if k != "ap"}
    numbers["nodes per second"] = sum(len(h.room) for h in halves) / seconds
    numbers["ap by class"] = dict(zip(classes, reading.ap, strict=True))
    return numbers


def labelled(
    data: Dataset, houses: Sequence[HouseStrips], encoder: Encoder, classes: Sequence[str], *, alone: bool = False
) -> Labelled:
    """Features of houses and what a linear reader should read from them.

    Args:
      alone: the network looks at each of the 36 views by itself, four times the work, instead of
        once at the strip that they overlap in.
    """
    columns = [houses[0].classes.index(c) for c in classes]
    encode = encoder.encode_strips
    if alone:
        encode = lambda strips: encoder.encode_views(
            np.stack([[view_of_strip(s, k) for k in range(VIEWS)] for s in strips])
        )
    features = [np.concatenate([encode(h.rgb[i : i + 8]) for i in range(0, len(h.rgb), 8)]) for h in houses]
    return Labelled(
        np.concatenate(features),
        np.concatenate([visible_in_views(h.share[..., columns]) for h in houses]),
        np.concatenate([h.room for h in houses]).astype(np.int64),
        np.concatenate([mean_log_depth_of_views(h.log_depth) for h in houses]),
        np.concatenate([np.full(len(h.rgb), i) for i, h in enumerate(houses)]),
        np.concatenate([data.place(h.name).graph.positions for h in houses]),
    )


def _strips_path(args: argparse.Namespace, name: str) -> Path:
    return args.out / "strips" / f"{name}.npz"


def _draw_strips(data: Dataset, name: str, args: argparse.Namespace) -> str:
    with drawn_world(data, name, args.cache, PLAIN) as world:
        look(world, all_classes(world.catalogue)).save(_strips_path(args, name))
    return name


def _houses(data: Dataset, splits: Sequence[str]) -> list[str]:
    return list(dict.fromkeys(n for s in splits for n in data.names(s)))


# Features ----------------------------------------------------------------------------------------


def encoder_of(args: argparse.Namespace) -> Encoder:
    """The encoder that --encoder and --network describe."""
    if args.network == "random":
        return random_encoder(seed=0)
    return imagenet_encoder(args.network, args.encoder) if args.network else load_encoder(args.encoder)


def pictures_of(data: Dataset, name: str, quality: str | None = None) -> PictureSettings:
    """How the pictures of a house are drawn that features are made from.

    Args:
      quality: None takes the panoramas that the data set holds, and plain ones where it holds none.
    """
    drawn = data.drawn_pictures(name)
    if drawn is None or quality not in (None, drawn.quality):
        return dataclasses.replace(PLAIN, quality=quality or PLAIN.quality)
    return drawn


def run_features(args: argparse.Namespace, note: Note = print) -> int:
    """Features of every house of a data set; houses that have them, from pictures drawn so, are skipped."""
    check_device(args.device)
    data, encoder = Dataset(args.data), encoder_of(args).to(args.device)
    wanted = {n: pictures_of(data, n, args.quality) for n in _houses(data, data.splits)}
    missing = [(n, pictures) for n, pictures in wanted.items() if not _has_features(data, n, encoder, pictures)]

    def watch(lines: Iterable[str], total: int) -> Iterable[str]:
        for line in lines:
            note(line)
            yield line

    arguments = (args.data.resolve(), encoder, args.cache, args.threads)
    for_each_unit(_make_features, missing, arguments, workers=args.workers, watch=watch, ray_address=args.ray)
    note(f"{len(missing)} of {len(wanted)} houses made, {_ways(wanted.values())}, encoder {encoder.digest[:16]}")
    return 0


def _ways(pictures: Iterable[PictureSettings]) -> str:
    """'pictures: 40 fast_256, 2 unlit_192'."""
    count = Counter(drawing(p) for p in pictures)
    return "pictures: " + ", ".join(f"{n} {way}" for way, n in sorted(count.items()))


def _has_features(data: Dataset, name: str, encoder: Encoder, pictures: PictureSettings) -> bool:
    """False: missing, damaged, or of another house."""
    path = feature_path(data.folder / "features", encoder.digest, name, pictures)
    try:
        load_features(path, encoder=encoder.digest, source=data.place(name).house.digest, pictures=pictures)
        return True
    except (FileNotFoundError, ValueError):
        return False


def _make_features(unit: tuple[str, PictureSettings], folder: Path, encoder: Encoder, cache: Path, threads: int) -> str:
    """The features of one house (name, how it is drawn) into the data set's folder; returns what was done."""
    torch.set_num_threads(threads)
    (name, pictures), data = unit, Dataset(folder)
    with drawn_world(data, name, cache, pictures) as world:
        panoramas = (world.panorama(v) for v in range(len(world.graph.positions)))
        path = feature_path(data.folder / "features", encoder.digest, name, pictures)
        save_features(path, encode_panoramas(encoder, panoramas), encoder, world.house.digest, pictures)
        return f"{name}: {len(world.graph.positions)} nodes, {pictures.quality} pictures of {pictures.size} pixels"


def drawn_world(data: Dataset, name: str, cache: Path, pictures: PictureSettings) -> World:
    """A house drawn so: the panoramas that the data set holds, if they are, else new ones, and those are left alone."""
    place, catalogue = data.place(name), load_catalogue(cache)
    if pictures == data.drawn_pictures(name):
        return data.open_world(name, catalogue, cache, pictures)
    return open_world(place.house, catalogue, cache, pictures, graph=place.graph)

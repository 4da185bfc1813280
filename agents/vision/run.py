"""What the commands of the encoder do: train it, and make features with it.

What belongs to viz, such as recordings, is passed in from the console command as a function.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import torch

from agents.common.device import check_device
from agents.vision.config import VisionConfig, drawing, lit_name
from agents.vision.drawn import StripSource, baked_lightings, drawn_world, houses_of, pictures_of
from agents.vision.encoder import Encoder, imagenet_encoder, load_encoder, random_encoder
from agents.vision.features import encode_panoramas, feature_path, load_features, save_features
from agents.vision.labels import HouseStrips
from agents.vision.occasions import OCCASIONS, Occasion, make_shown
from agents.vision.probe import read
from agents.vision.reading import as_numbers, labelled
from agents.vision.training import Example, matched, save_training, train_encoder, trained_classes, whitened
from assets.cache import write_json
from embodied.datasets.build import for_each_unit
from embodied.datasets.store import Dataset
from embodied.house.house import House
from embodied.light import lightings_of
from embodied.locks import locked
from embodied.render.pictures import TRACED, PictureSettings

Note = Callable[[str], None]


def run_train_vision(args: argparse.Namespace, config: VisionConfig, note: Note = print) -> int:
    """Cut strips from the pictures of all houses, train on the training houses, judge on validation houses, save.

    What is there already, strips or an encoder of the same settings, is not made again; training goes on from the
    last epoch that was finished.

    Raises:
      LockedError: another process writes to args.out.
    """
    torch.set_num_threads(args.threads)
    check_device(args.device)
    data = Dataset(args.data)
    source = StripSource(data.folder, args.strips or args.out / "strips", args.cache, args.quality, args.lights)
    other = None if args.example is None else load_encoder(args.example)
    if other is not None:
        config = dataclasses.replace(config, like=other.digest)
    with locked(args.out):
        seen = source.strips(training_houses(data, config), workers=args.workers, note=note)
        example = None
        if other is not None:
            example = example_of(other, source, training_houses(data, config), workers=args.workers, note=note)
        unseen = source.strips(houses_of(data, ("val_unseen",)), workers=args.workers, note=note)
        shown = seen if example is None else [*seen, *example.strips.values()]  # plain ones as one more lighting
        encoder, classes = taught(shown, config, args.out, note, example=example, device=args.device)
        untrained = whitened(random_encoder(config.network, seed=config.seed), seen)
        numbers = {}
        for name, who, alone in (
            ("trained", encoder, False),
            ("trained, each view alone", encoder, True),
            ("random", untrained, False),
        ):
            halves = [labelled(data, houses, who, classes, alone=alone) for houses in (seen, unseen)]
            numbers[name] = as_numbers(read(halves[0], halves[1], seed=config.seed), classes)
            note(f"{name}: " + ", ".join(f"{k} {v:.3g}" for k, v in numbers[name].items() if not isinstance(v, dict)))
        write_json(args.out / "readings.json", numbers, indent=1)
    return 0


def example_of(
    encoder: Encoder, source: StripSource, names: Sequence[str], *, workers: int = 1, note: Note = print
) -> Example:
    """What an encoder sees in houses when they are drawn without light."""
    plain = dataclasses.replace(source, quality="unlit", lights=1)
    return Example(encoder, {h.name: h for h in plain.strips(names, workers=workers, note=note)})


def taught(
    seen: Sequence[HouseStrips],
    config: VisionConfig,
    folder: Path,
    note: Note = print,
    *,
    example: Example | None = None,
    device: str = "cpu",
) -> tuple[Encoder, list[str]]:
    """The encoder that `config` makes of strips, from `folder` if it is there, and the classes it was taught."""
    classes = trained_classes(folder, config)
    if classes is None:
        checkpoint = folder / "checkpoint.pt"
        encoder, heads, classes = train_encoder(seen, config, checkpoint, example=example, device=device, note=note)
        encoder = matched(encoder, seen, example) if example else whitened(encoder, seen)
        save_training(encoder, heads, classes, config, folder)
        (folder / "checkpoint.pt").unlink(missing_ok=True)
    return load_encoder(folder / "encoder.safetensors"), classes


def training_houses(data: Dataset, config: VisionConfig) -> list[str]:
    """Names of the houses to learn from."""
    return houses_of(data, ("train",))[: config.training_houses or None]


# Features ----------------------------------------------------------------------------------------


def encoder_of(args: argparse.Namespace) -> Encoder:
    """The encoder that --encoder and --network describe."""
    if args.network == "random":
        return random_encoder(seed=0)
    return imagenet_encoder(args.network, args.encoder) if args.network else load_encoder(args.encoder)


def run_features(args: argparse.Namespace, note: Note = print) -> int:
    """Features of every house of a data set, in so many lightings; houses that have them, from pictures drawn so, are
    skipped.

    Raises:
      ValueError: several lightings of pictures without light.
    """
    check_device(args.device)
    data, encoder = Dataset(args.data), encoder_of(args).to(args.device)
    names = houses_of(data, args.split or data.splits, args.houses)
    wanted = {n: pictures_of(data, n, args.quality) for n in names}
    houses = {n: lightings_of(data.place(n).house, args.lights) for n in names}
    missing = [
        (n, pictures)
        for n, pictures in wanted.items()
        if not all(_has_features(data, n, k, lit, encoder, pictures) for k, lit in enumerate(houses[n]))
    ]

    def watch(lines: Iterable[str], total: int) -> Iterable[str]:
        for line in lines:
            note(line)
            yield line

    arguments = (args.data.resolve(), encoder, args.cache, args.threads, args.lights)
    for_each_unit(_make_features, missing, arguments, workers=args.workers, watch=watch, ray_address=args.ray)
    shown = [OCCASIONS[word] for word in args.shown if OCCASIONS[word] != Occasion()]
    for name in names if shown else ():
        made = make_shown(data, name, shown, encoder, args.cache, wanted[name])
        note(f"{name}: {len(made)} of {len(shown)} kinds of pictures made that are shown")
    note(f"{len(missing)} of {len(wanted)} houses made, {_ways(wanted.values())}, encoder {encoder.digest[:16]}")
    return 0


def _ways(pictures: Iterable[PictureSettings]) -> str:
    """'pictures: 40 fast_256, 2 unlit_192'."""
    count = Counter(drawing(p) for p in pictures)
    return "pictures: " + ", ".join(f"{n} {way}" for way, n in sorted(count.items()))


def _has_features(
    data: Dataset, name: str, lighting: int, house: House, encoder: Encoder, pictures: PictureSettings
) -> bool:
    """False: missing, damaged, or of another house."""
    path = feature_path(data.folder / "features", encoder.digest, lit_name(name, lighting), pictures)
    try:
        load_features(path, encoder=encoder.digest, source=house.digest, pictures=pictures)
        return True
    except (FileNotFoundError, ValueError):
        return False


def _make_features(
    unit: tuple[str, PictureSettings], folder: Path, encoder: Encoder, cache: Path, threads: int, lights: int
) -> str:
    """The features of one house (name, how it is drawn) into the data set's folder; returns what was done."""
    torch.set_num_threads(threads)
    (name, pictures), data, nodes = unit, Dataset(folder), 0
    for k, lit in enumerate(baked_lightings(data, name, lights, cache, pictures)):
        if _has_features(data, name, k, lit, encoder, pictures):
            continue
        with drawn_world(data, name, cache, pictures, lit) as world:
            if pictures.quality in TRACED:
                world.render_all()  # kept for the next encoder: they cost minutes a house
            panoramas = (world.panorama(v) for v in range(len(world.graph.positions)))
            path = feature_path(data.folder / "features", encoder.digest, lit_name(name, k), pictures)
            save_features(path, encode_panoramas(encoder, panoramas), encoder, world.house.digest, pictures)
            nodes += len(world.graph.positions)
    return f"{name}: {nodes} nodes, {pictures.quality} pictures of {pictures.size} pixels"

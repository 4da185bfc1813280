"""What the commands that learn do: train vision, train hanna, features, eval; their options are in agents.options.

The console command (embodied.cli) calls these; what belongs to viz, such as recordings, is passed
in from there as a function.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import joblib
import numpy as np
import torch

from agents.evaluate import failures, hanna_policies, predictions, request_share
from agents.hanna.agent import load_agent, new_agent, take_weights
from agents.imitation.checkpoint import Progress
from agents.imitation.config import SCALES, TrainingConfig
from agents.imitation.parallel import check_device, join_launcher, one_voice
from agents.imitation.training import Split, train
from agents.options import chosen
from agents.vision.config import VisionConfig
from agents.vision.encoder import Encoder, imagenet_encoder, load_encoder, random_encoder
from agents.vision.features import encode_panoramas, feature_path, load_bank, load_features, save_features
from agents.vision.labels import HouseStrips, all_classes, look, mean_log_depth_of_views, visible_in_views
from agents.vision.probe import Labelled, read
from agents.vision.strip import view_of_strip
from agents.vision.training import save_training, train_encoder, trained_classes, whitened
from agents.vocabulary import build_vocabulary
from assets.cache import write_json
from assets.catalogue import load_catalogue
from embodied.datasets.store import Dataset
from embodied.evaluation.evaluate import agent as agent_without_learning
from embodied.evaluation.evaluate import evaluate, spread
from embodied.interface import VIEWS, Episode
from embodied.records import episodes_file, save_lines
from embodied.evaluation.tables import as_json, markdown, save
from embodied.teachers.hanna import HannaTeacher

Note = Callable[[str], None]
WITHOUT_LEARNING = ("random walk", "forward 10", "shortest", "perfect interpretation")
"""Agents of embodied.evaluation.evaluate that are judged beside the learned one; they need no pictures."""
FACES = 192
"""Side of the cube faces from which features are made: the strip's resolution."""


# Vision ------------------------------------------------------------------------------------------

def run_train_vision(args: argparse.Namespace, note: Note = print) -> int:
    """Render strips of all houses, train on the training houses, judge on the others, save.

    What is there already, strips or an encoder of the same settings, is not made again.
    """
    torch.set_num_threads(args.threads)
    data, config = Dataset(args.data), chosen(args, VisionConfig())
    train_names, test_names = _houses(data, ("train",)), _houses(data, ("val_unseen", "test_unseen"))
    train_names = train_names[: config.training_houses or None]
    missing = [n for n in (*train_names, *test_names) if not _strips_path(args, n).exists()]
    jobs = (joblib.delayed(_draw_strips)(data, n, args) for n in missing)
    for name in joblib.Parallel(n_jobs=args.workers, return_as="generator_unordered")(jobs):
        note(f"drawn: {name}")
    strips = {n: HouseStrips.load(_strips_path(args, n)) for n in (*train_names, *test_names)}
    seen = [strips[n] for n in train_names]
    classes = trained_classes(args.out, config)
    if classes is None:
        encoder, heads, classes = train_encoder(seen, config, note=note)
        save_training(whitened(encoder, seen), heads, classes, config, args.out)
    encoder = load_encoder(args.out / "encoder.safetensors")
    untrained = whitened(random_encoder(config.network, seed=config.seed), seen)
    numbers = {}
    for name, who, alone in (("trained", encoder, False), ("trained, each view alone", encoder, True), ("random", untrained, False)):
        began = time.perf_counter()
        halves = [labelled(data, [strips[n] for n in names], who, classes, alone=alone) for names in (train_names, test_names)]
        spent = time.perf_counter() - began
        reading = read(*halves, seed=config.seed)
        numbers[name] = {k: v for k, v in dataclasses.asdict(reading).items() if k != "ap"}
        numbers[name]["nodes per second"] = sum(len(h.room) for h in halves) / spent
        numbers[name]["ap by class"] = dict(zip(classes, reading.ap, strict=True))
        note(f"{name}: " + ", ".join(f"{k} {v:.3g}" for k, v in numbers[name].items() if not isinstance(v, dict)))
    write_json(args.out / "readings.json", numbers, indent=1)
    return 0


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
            np.stack([[view_of_strip(s, k) for k in range(VIEWS)] for s in strips]))
    features = [np.concatenate([encode(h.rgb[i : i + 8]) for i in range(0, len(h.rgb), 8)]) for h in houses]
    return Labelled(
        np.concatenate(features), np.concatenate([visible_in_views(h.share[..., columns]) for h in houses]),
        np.concatenate([h.room for h in houses]).astype(np.int64),
        np.concatenate([mean_log_depth_of_views(h.log_depth) for h in houses]),
        np.concatenate([np.full(len(h.rgb), i) for i, h in enumerate(houses)]),
        np.concatenate([data.place(h.name).graph.positions for h in houses]),
    )


def _strips_path(args: argparse.Namespace, name: str) -> Path:
    return args.out / "strips" / f"{name}.npz"


def _draw_strips(data: Dataset, name: str, args: argparse.Namespace) -> str:
    catalogue = load_catalogue(args.cache)
    with data.open_world(name, catalogue, args.cache, size=FACES) as world:
        look(world, all_classes(catalogue)).save(_strips_path(args, name))
    return name


def _houses(data: Dataset, splits: Sequence[str]) -> list[str]:
    return list(dict.fromkeys(n for s in splits for n in data.names(s)))


# Features ----------------------------------------------------------------------------------------

def encoder_of(args: argparse.Namespace) -> Encoder:
    """The encoder that --encoder and --network describe."""
    if args.network == "random":
        return random_encoder(seed=0)
    return imagenet_encoder(args.network, args.encoder) if args.network else load_encoder(args.encoder)


def run_features(args: argparse.Namespace, note: Note = print) -> int:
    """Features of every house of a data set; houses that have them are skipped."""
    check_device(args.device)
    data, encoder = Dataset(args.data), encoder_of(args).to(args.device)
    missing = [n for n in _houses(data, data.splits) if not _has_features(data, n, encoder)]
    jobs = (joblib.delayed(_make_features)(data, n, encoder, args) for n in missing)
    for line in joblib.Parallel(n_jobs=args.workers, return_as="generator_unordered")(jobs):
        note(line)
    note(f"{len(missing)} houses made, encoder {encoder.digest[:16]}")
    return 0


def _has_features(data: Dataset, name: str, encoder: Encoder) -> bool:
    """False: missing, damaged, or of another house."""
    path = feature_path(data.folder / "features", encoder.digest, name)
    try:
        load_features(path, encoder=encoder.digest, source=data.place(name).house.digest)
        return True
    except (FileNotFoundError, ValueError):
        return False


def _make_features(data: Dataset, name: str, encoder: Encoder, args: argparse.Namespace) -> str:
    torch.set_num_threads(args.threads)
    with data.open_world(name, load_catalogue(args.cache), args.cache, size=FACES, quality=args.quality) as world:
        panoramas = (world.panorama(v) for v in range(len(world.graph.positions)))
        path = feature_path(data.folder / "features", encoder.digest, name)
        save_features(path, encode_panoramas(encoder, panoramas), encoder, world.house.digest)
        return f"{name}: {len(world.graph.positions)} nodes"


# HANNA -------------------------------------------------------------------------------------------

def split_of(
    data: Dataset, name: str, encoder: Encoder, device: str = "cpu", limit: int | None = None, houses: int | None = None
) -> Split:
    """A split of a data set, ready to be played with features; at most `limit` tasks, of its first `houses` houses."""
    names = data.names(name)[:houses]
    paths = {n: feature_path(data.folder / "features", encoder.digest, n) for n in names}
    tasks = [t for t in data.tasks(name) if t.world in paths]
    return Split(
        data.places(name), tasks if limit is None else spread(tasks, limit), data.environment(name),
        load_bank(paths, encoder.digest).to(device),
    )


def vocabulary_of(data: Dataset, houses: int | None = None):
    """Words of the training split's first `houses` houses: requests and the routes that training hears."""
    names = data.names("train")[:houses]
    routes = [r.instruction for n in names for r in data.routes(n) if r.split == "train_seen"]
    return build_vocabulary([*(t.request for t in data.tasks("train") if t.world in names), *routes], least=2)


def run_train_hanna(
    args: argparse.Namespace, note: Note = print,
    on_validation: Callable[[int, Sequence[Episode]], None] | None = None,
) -> int:
    """Train an agent on a data set's training houses, validating on its unseen validation houses."""
    torch.set_num_threads(args.threads)
    train_agent(
        Dataset(args.data), encoder_of(args), chosen(args, SCALES[args.scale]), args.out,
        device=join_launcher(args.device), minutes=args.minutes, begin=args.begin, note=note, on_validation=on_validation,
    )
    return 0


def train_agent(
    data: Dataset, encoder: Encoder, config: TrainingConfig, folder: Path, *, device: str = "cpu",
    minutes: float | None = None, begin: Path | None = None, note: Note = print,
    on_validation: Callable[[int, Sequence[Episode]], None] | None = None,
) -> Progress:
    """Train, or go on training, the agent of a run folder; other arguments as in agents.imitation.training.train.

    Args:
      begin: a trained agent whose weights and words a new run begins with.

    Raises:
      ValueError: `begin` has networks of other sizes, or learned from another encoder.
    """
    houses, note = config.training_houses or None, one_voice(note)
    training = split_of(data, "train", encoder, device, houses=houses)
    validation = split_of(data, "val_unseen", encoder, device, config.validation_tasks)
    other = None if begin is None else load_agent(begin)
    agent = new_agent(config, other.vocabulary if other else vocabulary_of(data, houses), encoder.digest, encoder.size)
    if other is not None:
        take_weights(agent, other, begin)  # a checkpoint in `folder` replaces them
        note(f"new runs begin with the weights of {begin}")
    agent.network.to(device)
    parameters = sum(p.numel() for p in agent.network.parameters())
    count = len({t.world for t in training.tasks})
    note(f"{len(training.tasks)} tasks in {count} houses, {len(agent.vocabulary)} words, {parameters:,} parameters")
    return train(agent, training, validation, HannaTeacher(), folder, minutes=minutes, note=note, on_validation=on_validation)


def run_eval(args: argparse.Namespace, note: Note = print, watch: Callable[[Iterable[str]], Iterable[str]] = iter) -> int:
    """Tables 4.3 to 4.5 for one agent and the agents without learning, and why its episodes fail.

    Args:
      watch: wraps the iterator over agent names (a progress bar).
    """
    torch.set_num_threads(args.threads)
    data, encoder, agent = Dataset(args.data), encoder_of(args), load_agent(args.agent)
    rows, extra = [], {}
    for split in args.split:
        worlds = data.places(split)
        judged = {**_without_learning(), **hanna_policies(agent, split_of(data, split, encoder).bank)}
        names = args.only or list(judged)
        if unknown := sorted(set(names) - set(judged)):
            raise ValueError(f"unknown rows {unknown}; there are {list(judged)}")

        def keep(name: str, episodes: Sequence[Episode], split: str = split, worlds=worlds) -> None:
            if args.out:
                save_lines(args.out / episodes_file(split, name), episodes)
            if name == "learned":
                extra[split] = about(episodes, worlds)

        rows += evaluate(
            data, split, {n: judged[n] for n in names}, seed=args.seed, limit=args.tasks, batch=args.batch, keep=keep,
            watch=watch,
        )
    facts = {"rows": json.loads(as_json(rows)), "behaviour": extra}
    if args.json:
        note(json.dumps(facts, indent=1))
    else:
        note(markdown(rows, ("success", "spl", "navigation error", "requests", "oracle success", "mistake repeat", "request repeat")))
        note(json.dumps(extra, indent=1))
    if args.out:
        save(rows, args.out, "table")
        write_json(args.out / "behaviour.json", facts, indent=1)
    return 0


def _without_learning():
    return {name: agent_without_learning("hanna", name) for name in WITHOUT_LEARNING}


def about(episodes: Sequence[Episode], worlds) -> dict[str, object]:
    """Figures D.1 and D.2 and the kinds of failure, as numbers."""
    conditions = [{**dataclasses.asdict(p), "f1": p.f1} for p in predictions(episodes, worlds)]
    return {
        "request share": request_share(episodes),
        "failures": {k: float(v) for k, v in dataclasses.asdict(failures(episodes, worlds)).items()},
        "conditions": [{k: None if isinstance(v, float) and math.isnan(v) else v for k, v in c.items()} for c in conditions],  # NaN is no JSON
    }



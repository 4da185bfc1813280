"""A data set becomes tensors: which way would the teacher go, given what is seen around?

    python examples/dataset_to_torch.py --data data/find_flats

A small network learns from the shortest paths of the training houses in which of the 36 views the next step lies, and
is judged in a house it has never seen, beside guessing. What it sees are the cheap semantic features; `embodied
features` makes those of a CNN. Without --data a data set of small flats is built first, which takes about a minute.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch
from torch.utils.data import DataLoader, TensorDataset

from assets.cache import default_cache
from assets.catalogue import load_catalogue
from embodied.datasets.build import DatasetConfig, build_dataset
from embodied.datasets.store import Dataset
from embodied.evaluation.rollout import rollout
from embodied.gym.playground import seen_features
from embodied.gym.semantic_features import FeatureTable
from embodied.interface import FindObject, Move
from embodied.policies.baselines import Shortest


def samples(data: Dataset, split: str, classes: list[str]) -> TensorDataset:
    """The steps of the teacher in a split: (n, 36, D + 2) what is in each view, and (n,) the view that it took."""
    catalogue, cache = load_catalogue(), default_cache()
    tables = {}
    for name in data.names(split):
        with data.open_world(name, catalogue, cache) as world:
            tables[name] = seen_features(world, catalogue, cache)
    source = FeatureTable(tables)
    seen, taken = [], []
    whole = data.split(split)
    for frame in rollout(whole.make_env, Shortest(), whole.tasks, seed=0):
        goal = frame.situation.task.goal
        if not isinstance(frame.step.action, Move) or not isinstance(goal, FindObject):
            continue
        views = source.features(frame.observation.sight)
        way = np.zeros((36, 2), np.float32)
        way[frame.observation.candidates.view, 0] = 1.0  # where one can go
        way[:, 1] = views[:, classes.index(goal.object_class)]  # where what is looked for can be seen
        seen.append(np.concatenate([views, way], axis=1))
        taken.append(frame.observation.candidates.view[frame.step.action.candidate])
    return TensorDataset(torch.from_numpy(np.stack(seen)), torch.tensor(taken))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path("data/find_flats"))
    parser.add_argument("--epochs", type=int, default=30)
    args = parser.parse_args()
    torch.manual_seed(0)

    if not (args.data / "dataset.json").exists():
        build_dataset(DatasetConfig("find", "tiny", area=(45.0, 60.0)), args.data, default_cache())
    data, classes = Dataset(args.data), list(load_catalogue().classes)
    train, test = samples(data, "train", classes), samples(data, "test_unseen", classes)
    print(f"{len(train)} steps to learn from, {len(test)} in a house that is not among them")

    size = train.tensors[0].shape[2]
    layers = torch.nn.Linear(size, 64), torch.nn.ReLU(), torch.nn.Linear(64, 1), torch.nn.Flatten()
    network = torch.nn.Sequential(*layers)
    optimiser = torch.optim.Adam(network.parameters(), lr=3e-3)
    for _ in range(args.epochs):
        for seen, taken in DataLoader(train, batch_size=32, shuffle=True):
            loss = torch.nn.functional.cross_entropy(scores(network, seen), taken)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
    for name, part in (("training", train), ("unseen", test)):
        seen, taken = part.tensors
        right = (scores(network, seen).argmax(1) == taken).float().mean().item()
        guess = (1 / seen[:, :, -2].sum(1)).mean().item()
        print(f"{name}: {100 * right:.0f} % of {len(part)} steps right, {100 * guess:.0f} % by guessing")


def scores(network: torch.nn.Module, seen: torch.Tensor) -> torch.Tensor:
    """(n, 36) logits, only where there is a way."""
    return network(seen).masked_fill(seen[:, :, -2] == 0, -torch.inf)


if __name__ == "__main__":
    main()

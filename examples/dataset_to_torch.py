"""A data set becomes tensors: a small network learns from pictures how far things are.

    python examples/dataset_to_torch.py --data data/find_flats

Every viewpoint of a flat is seen in 36 views; from the colours of each the network tells its mean distance, and is
evaluated in a house it has never seen, beside a constant prediction. Without --data a data set of small flats is
built and drawn first, which takes about a minute; with `--pictures fast` they are lit, too. Object classes, instance
ids, poses and rooms are in the same batches (agents/vision/pictures.py).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import torch
from torch.utils.data import DataLoader

from embodied.agents.vision.pictures import ViewpointPictures
from embodied.assets.cache import default_cache
from embodied.datasets.build import DatasetConfig, build_dataset, draw_panoramas
from embodied.datasets.store import Dataset
from embodied.gym.sensors import ViewSettings
from embodied.render.pictures import parse_pictures

VIEW = ViewSettings("view", 24, 32)


def flats(folder: Path, kind: str) -> Dataset:
    """The data set in `folder`, built and drawn where it is not."""
    if not (folder / "dataset.json").exists():
        build_dataset(DatasetConfig("find", "tiny", area=(45.0, 60.0)), folder, default_cache())
    data = Dataset(folder)
    if data.pictures is None:
        draw_panoramas(data.config, folder, default_cache(), pictures=parse_pictures(kind, 64))
    return data


def small_network() -> torch.nn.Module:
    layers: list[torch.nn.Module] = []
    for inputs, outputs in ((3, 16), (16, 32), (32, 32)):
        layers += [torch.nn.Conv2d(inputs, outputs, 3, stride=2, padding=1), torch.nn.ReLU()]
    return torch.nn.Sequential(*layers, torch.nn.Flatten(), torch.nn.Linear(32 * 3 * 4, 1), torch.nn.Flatten(0))


def colours_and_distance(batch: dict[str, torch.Tensor]) -> tuple[torch.Tensor, torch.Tensor]:
    """(n, 3, h, w) in [-1, 1], and (n,) the mean logarithm of the distance in metres."""
    return batch["rgb"].float() / 127.5 - 1, batch["depth"].clamp(0.1, 20.0).log().mean((1, 2))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path("data/find_flats"))
    parser.add_argument(
        "--pictures", choices=("unlit", "fast"), default="unlit", help="of pictures that are drawn first"
    )
    parser.add_argument("--epochs", type=int, default=10)
    args = parser.parse_args()
    torch.manual_seed(0)

    data = flats(args.data, args.pictures)
    train, test = (
        ViewpointPictures(data, split, view=VIEW, channels=("rgb", "depth")) for split in ("train", "test_unseen")
    )
    print(f"{len(train)} views to learn from, {len(test)} in a house that is not among them; {train.pictures}")

    network = small_network()
    optimiser = torch.optim.Adam(network.parameters(), lr=2e-3)
    loader = DataLoader(train, batch_size=32, shuffle=True, num_workers=2, persistent_workers=True)
    for _ in range(args.epochs):
        for batch in loader:
            colours, distance = colours_and_distance(batch)
            if torch.rand(()) < 0.5:
                colours = colours.flip(-1)  # what is mirrored is as far away
            loss = torch.nn.functional.mse_loss(network(colours), distance)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()

    with torch.no_grad():
        told, true = zip(*((network(c), d) for c, d in map(colours_and_distance, DataLoader(test, batch_size=64))))
    error = (torch.cat(told) - torch.cat(true)).square().mean().sqrt().item()
    print(f"unseen house: {100 * error:.0f} % off, {100 * torch.cat(true).std().item():.0f} % by a constant")


if __name__ == "__main__":
    main()

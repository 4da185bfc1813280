"""Pixels of a Gymnasium environment through a network of your own, step by step.

    python examples/encode.py --network resnet18 --weights resnet18-f37072fd.pth

The environment shows colours; a torchvision network (if that package is installed; without --weights it is untrained)
or the encoder that ships with this package turns each view into numbers. At the end it prints how similar views from
one room are, and views from different rooms. Without data a flat is generated and lit once, in a minute or two.
"""

from __future__ import annotations

import argparse
import importlib.util
from collections.abc import Callable

import gymnasium
import numpy as np
import torch

import embodied  # noqa: F401 - registers the environments
from embodied.agents.vision.encoder import load_encoder
from embodied.gym.sensors import ViewSettings
from embodied.render.pictures import parse_pictures

MEAN, DEVIATION = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
"""What torchvision's networks were trained with."""


def shipped() -> Callable[[np.ndarray], np.ndarray]:
    encoder = load_encoder()
    return lambda rgb: encoder.encode_views(rgb[None, None])[0, 0]


def torchvision_network(name: str, weights: str | None) -> Callable[[np.ndarray], np.ndarray]:
    """The network without its last layer: (h, w, 3) uint8 -> (D,)."""
    import torchvision

    network = torchvision.models.get_model(name, weights=None)
    if weights:
        network.load_state_dict(torch.load(weights, weights_only=True))
    network.fc = torch.nn.Identity()
    network.eval()

    @torch.no_grad()
    def encode(rgb: np.ndarray) -> np.ndarray:
        picture = (torch.from_numpy(rgb) / 255.0 - MEAN) / DEVIATION
        return network(picture.permute(2, 0, 1)[None])[0].numpy()

    return encode


def alike(features: np.ndarray, rooms: list[str]) -> tuple[float, float]:
    """Mean correlation of the (n, D) features of looks from one room, and of looks from two."""
    close = np.corrcoef(features - features.mean(0))
    same = np.array(rooms)[:, None] == np.array(rooms)
    apart = ~np.eye(len(rooms), dtype=bool)
    return float(close[same & apart].mean()), float(close[~same].mean()) if (~same).any() else float("nan")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--network", help="of torchvision, such as resnet18 (default: the shipped encoder)")
    parser.add_argument("--weights", help="its weights, a .pth file")
    parser.add_argument("--pictures", default="fast", choices=("unlit", "fast", "normal"))
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()

    if args.network and importlib.util.find_spec("torchvision") is None:
        parser.error("--network needs torchvision (pip install torchvision); without it the shipped encoder is used")
    encode = torchvision_network(args.network, args.weights) if args.network else shipped()
    env = gymnasium.make(
        "embodied/Find-v0",
        seed=args.seed,
        observations="rgb",
        view=ViewSettings("view", 128, 128),
        pictures=parse_pictures(args.pictures, 128),
    )
    rng, features, rooms = np.random.default_rng(args.seed), [], []
    observation, _ = env.reset(seed=args.seed)
    for _ in range(args.steps):
        features.append(encode(observation["rgb"]))
        rooms.append(env.unwrapped.room)  # for the judgement below, not for an agent
        moves = np.flatnonzero(observation["action_mask"][:-4])  # neither stop nor ask
        observation, _, terminated, truncated, _ = env.step(int(rng.choice(moves)))
        if terminated or truncated:
            observation, _ = env.reset()
    one, two = alike(np.stack(features), rooms)
    print(f"{len(features)} looks of {len(features[0])} numbers from {len(set(rooms))} rooms")
    print(f"correlation of looks from one room {one:.2f}, from two rooms {two:.2f}")
    env.close()


if __name__ == "__main__":
    main()

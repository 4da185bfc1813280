"""The Gymnasium loop: an agent that moves at random asks for help as often as it may.

    python examples/gymnasium_loop.py --kind HANNA --episodes 3

Observations are arrays (`embodied.gym.spaces` says which), the action is a number, and `action_mask` says which numbers
are possible now; `info` has the words. Without `data=` a small flat is generated.
"""

from __future__ import annotations

import argparse

import gymnasium
import numpy as np

import embodied  # noqa: F401 - registers embodied/Find-v0, VLN-v0, VNLA-v0, HANNA-v0 and HARI-v0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kind", default="HANNA", choices=("Find", "VLN", "VNLA", "HANNA", "HARI"))
    parser.add_argument("--episodes", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--observations", nargs="+", default=["oracle"], help="rgb, depth, ids, features or oracle")
    args = parser.parse_args()

    env = gymnasium.make(f"embodied/{args.kind}-v0", seed=args.seed, observations=args.observations)
    rng = np.random.default_rng(args.seed)
    for episode in range(args.episodes):
        observation, info = env.reset(seed=args.seed + episode)
        heard, total, ended = info["instruction"], 0.0, False
        print(f"{info['task']}: “{heard}”")
        while not ended:
            possible = np.flatnonzero(observation["action_mask"])
            observation, reward, terminated, truncated, info = env.step(int(rng.choice(possible)))
            total, ended = total + float(reward), terminated or truncated
            if info["instruction"] != heard:
                heard = info["instruction"]
                print(f"    now: “{heard}”")
        print(f"    reward {total:.2f}, success {info['success']:.0f}, {info['steps']:.0f} steps")
    env.close()


if __name__ == "__main__":
    main()

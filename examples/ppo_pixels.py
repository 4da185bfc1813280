"""PPO of Stable-Baselines3 learns from colours alone to find objects in a lit flat.

    pip install stable-baselines3 && python examples/ppo_pixels.py --minutes 40 --out out/ppo

The agent sees 64 x 64 pixels straight ahead and hears what to look for, one of --goals requests as a number; it goes
ahead, turns by 30 degrees or stops, and is right when it stops within 2 m of such an object. Reward: 1 for that, minus
0.01 a step, plus what a step brings it nearer (metres / 10). The flat is generated from --seed and lit once. At the
end: how often it finds what it should, beside a random walk, and the curve of its training in OUT/curve.csv.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from assets.cache import default_cache
from embodied.action_spaces import MonocularMoves
from embodied.envs.base import HelpEnv
from embodied.gym.env import HelpGymEnv
from embodied.gym.eyes import PanoramaStore, PictureEyes, ViewSettings
from embodied.gym.playground import flat_playground
from embodied.gym.spaces import SpaceLayout, text_of
from embodied.interface import Task
from embodied.render.pictures import PictureSettings

LAYOUT = SpaceLayout(candidates=5, text=200)
ACTIONS = (0, 1, 2, LAYOUT.candidates)
"""Ahead, left, right, stop, as the environment counts them."""
HORIZON = 60
"""Steps of an episode: three turns may stand before every move."""


class Seeker(gymnasium.Wrapper):
    """What PPO sees and does: colours, the number of the request, four actions."""

    def __init__(self, env: gymnasium.Env, requests: list[str]) -> None:
        super().__init__(env)
        self._requests = requests
        goal = gymnasium.spaces.Box(0.0, 1.0, (len(requests),), np.float32)
        self.observation_space = gymnasium.spaces.Dict({"rgb": env.observation_space["rgb"], "goal": goal})
        self.action_space = gymnasium.spaces.Discrete(len(ACTIONS))

    def reset(self, **options: Any) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        observation, info = self.env.reset(**options)
        return self._seen(observation), info

    def step(self, action: Any) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, info = self.env.step(ACTIONS[int(action)])
        return self._seen(observation), float(reward), terminated, truncated, info

    def _seen(self, observation: dict[str, Any]) -> dict[str, np.ndarray]:
        goal = np.zeros(len(self._requests), np.float32)
        goal[self._requests.index(text_of(observation["instruction"]))] = 1.0
        return {"rgb": observation["rgb"], "goal": goal}


class Curve(BaseCallback):
    """Writes how the episodes of every rollout ended, and stops when the time is over."""

    def __init__(self, path: Path, minutes: float) -> None:
        super().__init__()
        self._path, self._until, self._ended = path, time.monotonic() + 60 * minutes, []
        self._rows: list[dict[str, float]] = []

    def _on_step(self) -> bool:
        self._ended += [info for info in self.locals["infos"] if "episode" in info]
        return time.monotonic() < self._until

    def _on_rollout_end(self) -> None:
        if not self._ended:
            return
        found = float(np.mean([info.get("success", 0.0) for info in self._ended]))
        reward = float(np.mean([info["episode"]["r"] for info in self._ended]))
        row = {"steps": self.num_timesteps, "episodes": len(self._ended), "success": found, "reward": reward}
        self._rows.append({k: round(v, 4) for k, v in row.items()})
        self._ended = []
        print(", ".join(f"{k} {v:g}" for k, v in self._rows[-1].items()), flush=True)
        with self._path.open("w", newline="") as f:
            table = csv.DictWriter(f, self._rows[0])
            table.writeheader()
            table.writerows(self._rows)


def makers(args: argparse.Namespace) -> Callable[[], Seeker]:
    """A maker of environments that share the flat and its decoded panoramas."""
    drawn = PictureSettings(128, args.quality)
    play = flat_playground("find", args.seed, cache=default_cache(), pictures=drawn, sees=("rgb",))
    tasks = chosen(play.tasks, args.goals)
    requests = sorted({t.request for t in tasks})
    print(f"{len(tasks)} tasks: {', '.join(requests)}")
    eyes = PictureEyes(PanoramaStore(play.worlds), ("rgb",), ViewSettings("view", 64, 64))
    moves = MonocularMoves()

    def make() -> Seeker:
        env = HelpGymEnv(lambda: HelpEnv(play.worlds, moves=moves), tasks, eyes, layout=LAYOUT, shaping=True)
        return Seeker(env, requests)

    return make


def chosen(tasks: tuple[Task, ...], goals: int) -> list[Task]:
    """The tasks of the requests that most of them make."""
    requests = [t.request for t in tasks]
    most = sorted(set(requests), key=lambda r: (-requests.count(r), r))[:goals]
    return [dataclasses.replace(t, horizon=HORIZON) for t in tasks if t.request in most]


def judged(env: gymnasium.Env, act: Callable[[dict[str, np.ndarray]], int], episodes: int, seed: int) -> float:
    """Share of episodes that succeed."""
    found = 0.0
    for k in range(episodes):
        (observation, _), ended = env.reset(seed=seed + k), False
        while not ended:
            observation, _, terminated, truncated, info = env.step(act(observation))
            ended = terminated or truncated
        found += info.get("success", 0.0)
    return found / episodes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=40.0)
    parser.add_argument("--steps", type=int, default=10_000_000, help="at most so many")
    parser.add_argument("--goals", type=int, default=4, help="how many different things it looks for")
    parser.add_argument("--envs", type=int, default=16)
    parser.add_argument("--rollout", type=int, default=128, help="steps of each environment between updates")
    parser.add_argument("--judge", type=int, default=100, help="episodes")
    parser.add_argument("--quality", default="fast", choices=("unlit", "fast", "normal"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/ppo"))
    args = parser.parse_args()
    torch.set_num_threads(2)
    args.out.mkdir(parents=True, exist_ok=True)

    make = makers(args)
    envs = DummyVecEnv([lambda: Monitor(make())] * args.envs)
    learner = PPO(
        "MultiInputPolicy",
        envs,
        n_steps=args.rollout,
        batch_size=256,
        n_epochs=4,
        learning_rate=3e-4,
        ent_coef=0.01,
        gamma=0.97,
        seed=args.seed,
        device="cpu",
    )
    learner.learn(args.steps, callback=Curve(args.out / "curve.csv", args.minutes))
    learner.save(args.out / "agent.zip")

    env, rng = make(), np.random.default_rng(args.seed)
    learned = lambda o: int(learner.predict(o, deterministic=False)[0])
    found = judged(env, learned, args.judge, 1000)
    random = judged(env, lambda o: int(rng.integers(len(ACTIONS))), args.judge, 1000)
    print(f"finds it in {100 * found:.0f} % of {args.judge} episodes, random walk {100 * random:.0f} %")


if __name__ == "__main__":
    main()

"""PPO of Stable-Baselines3 learns from the colours of lit flats to go where it should, or to find things.

    pip install stable-baselines3 && python examples/ppo_pixels.py --minutes 40 --out out/ppo

The same command resumes an interrupted run; --minutes of processor time count over all its parts. The agent sees
64 x 64 pixels straight ahead (90 degrees) and its goal; it moves ahead, turns by 30 degrees or stops. Flats are
generated from --house-seed and lit once.

--task point is point navigation: the goal is a distance and a direction relative to the agent, which has no map.
--task find: the goal is one of --goals requests, as a number; success is a stop within 2 m of such an object.
Reward: 1 for success, -0.3 for a stop elsewhere, -0.01 a step, and progress along the shortest path (metres / 10).

At the end the script prints success in the training flats and in --unseen others, beside a random walk with the best
probability of stopping. OUT/curve.csv and curve.png hold the curve, OUT/result.json the numbers.

--blind is an ablation with black pictures. --eyes encoder shows features of the shipped, frozen encoder of three views
around straight ahead. --eyes detector (with --task find) shows what a small network predicts from these features:
whether the object is visible in each of the three views, and near enough to stop. It is trained before PPO, on the
simulator's labels of the training flats.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import DummyVecEnv

from embodied.action_spaces import MonocularMoves
from embodied.agents.common.settings import SHIPPED_ENCODER
from embodied.agents.common.weights import seeded
from embodied.agents.vision.encoder import load_encoder
from embodied.agents.vision.features import encode_panoramas, look, visible_in_views
from embodied.agents.vision.live import shipped_features
from embodied.assets.cache import atomic_path, default_cache
from embodied.assets.catalogue import load_catalogue
from embodied.datasets.build import make_dataset_house
from embodied.envs.base import HelpEnv
from embodied.generate import HouseConfig
from embodied.geometry import wrap
from embodied.gym.env import HelpGymEnv
from embodied.gym.sensors import CameraSensor, FeatureSensor, PanoramaStore, ViewSettings
from embodied.gym.spaces import SpaceLayout
from embodied.interface import TURNS, FeatureSource, FollowRoute, Pose, Sight, Task, Viewpoint, viewpoint
from embodied.language.plain_language import PlainLanguage
from embodied.render.pictures import parse_pictures
from embodied.seeds import stream
from embodied.tasks.goals import FindConfig, find_pool, find_task
from embodied.world import World, open_world

LAYOUT = SpaceLayout(candidates=5, text=200)
ACTIONS = (0, 1, 2, LAYOUT.candidates)
"""Ahead, left, right, stop, as the environment counts them."""
STOP = len(ACTIONS) - 1
AREA = (50.0, 75.0)
"""Size of the flats, square metres."""
HORIZON = 40
"""Steps of an episode."""
WRONG_STOP = -0.3
GOALS = ("bed", "cooker", "fridge", "sofa", "toilet", "wardrobe")
HOPS = (1, 3)
"""Fewest and most edges between start and goal."""
FAR = 10.0
"""A goal so far away, or farther, looks the same, metres."""
SIDE, ANGLE = 64, math.radians(90.0)
AHEAD = (-1, 0, 1)
"""Views that are seen through the encoder, in turns of 30 degrees from straight ahead."""
SAVED_EVERY = 20
"""Rollouts between savings."""
STOPS = (0.25, 0.1, 0.05, 0.025)
"""How often the random walk may stop."""


@dataclass(frozen=True, eq=False)
class Arena:
    """Flats and what there is to do in them."""

    worlds: dict[str, World]
    tasks: list[Task]
    goals: tuple[str, ...]
    """The requests that are numbered; none for points."""


class Detector:
    """Whether each goal is visible in each view, and near enough to stop: what a network that was trained on the
    simulator's labels of some flats reads of an encoder's features."""

    def __init__(self, network: torch.nn.Module, source: FeatureSource, goals: int) -> None:
        self._network, self._source, self.size = network, source, 2 * goals
        self._read: dict[Viewpoint, np.ndarray] = {}

    def features(self, sight: Sight) -> np.ndarray:
        """(36, 2 C) float32 probabilities: of being visible, then of being near, too."""
        key = viewpoint(sight)
        if key not in self._read:
            with torch.inference_mode():
                logits = self._network(torch.from_numpy(self._source.features(sight)))
            self._read[key] = torch.sigmoid(logits).numpy()
        return self._read[key]


def train_detector(place: Arena, seed: int, epochs: int = 30, batch: int = 512) -> torch.nn.Module:
    """(..., D) features -> (..., 2 C) logits, trained on every view of the flats."""
    encoder, seen, labels = load_encoder(SHIPPED_ENCODER), [], []
    for world in place.worlds.values():
        visible = visible_in_views(look(world, place.goals).share)  # (n, 36, C)
        near = np.zeros((len(visible), 1, len(place.goals)), dtype=bool)
        for task in place.tasks:
            if task.world == world.name:
                near[list(task.goal_nodes), 0, place.goals.index(task.request)] = True
        seen.append(encode_panoramas(encoder, [world.panorama(n) for n in range(len(visible))]))
        labels.append(np.concatenate([visible, visible & near], -1))
    x = torch.from_numpy(np.concatenate(seen).astype(np.float32)).flatten(0, 1)
    y = torch.from_numpy(np.concatenate(labels).astype(np.float32)).flatten(0, 1)
    with seeded(seed):  # an agent that goes on learning, or is judged again, sees with the same detector
        network = torch.nn.Sequential(
            torch.nn.LayerNorm(x.shape[1]),
            torch.nn.Dropout(0.3),
            torch.nn.Linear(x.shape[1], 64),
            torch.nn.ReLU(),
            torch.nn.Dropout(0.3),
            torch.nn.Linear(64, y.shape[1]),
        )
        optimizer = torch.optim.AdamW(network.parameters(), 1e-3, weight_decay=0.01)
        for _ in range(epochs):
            for rows in torch.randperm(len(x)).split(batch):
                optimizer.zero_grad()
                torch.nn.functional.binary_cross_entropy_with_logits(network(x[rows]), y[rows]).backward()
                optimizer.step()
    return network.eval()


class Seeker(gymnasium.Wrapper):
    """What PPO sees and does: colours or features of them, the goal as numbers, four actions."""

    def __init__(self, env: HelpGymEnv, goals: Sequence[str], blind: bool, detected: bool) -> None:
        super().__init__(env)
        self._goals, self._blind, self._detected = goals, blind, detected
        goal = gymnasium.spaces.Box(-1.0, 1.0, (len(goals) or 3,), np.float32)
        self._coloured = "rgb" in env.observation_space.spaces
        if self._coloured:
            seen = env.observation_space["rgb"]
        else:
            many = 2 if detected else env.observation_space["features"].shape[1]
            seen = gymnasium.spaces.Box(-np.inf, np.inf, (len(AHEAD) * many,), np.float32)
        self.observation_space = gymnasium.spaces.Dict({"seen": seen, "goal": goal})
        self.action_space = gymnasium.spaces.Discrete(len(ACTIONS))

    def reset(self, **options: Any) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        observation, info = self.env.reset(**options)
        return self._seen(observation), info

    def step(self, action: Any) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, info = self.env.step(ACTIONS[int(action)])
        if terminated and not info["success"]:
            reward += WRONG_STOP
        return self._seen(observation), float(reward), terminated, truncated, info

    def _seen(self, observation: dict[str, Any]) -> dict[str, np.ndarray]:
        seen = observation["rgb"] if self._coloured else self._ahead(observation["features"])
        seen = np.zeros_like(seen) if self._blind else seen
        return {"seen": seen, "goal": self._numbered() if self._goals else self._direction()}

    def _ahead(self, features: np.ndarray) -> np.ndarray:
        """Features of the level views around straight ahead; of a detector's, those of the goal alone."""
        turn = self.env._env.pose.turn
        seen = features[[TURNS + (turn + k) % TURNS for k in AHEAD]]
        if self._detected:
            seen = seen[:, self._goals.index(self.env.task.request) :: len(self._goals)]
        return seen.ravel()

    def _numbered(self) -> np.ndarray:
        goal = np.zeros(len(self._goals), np.float32)
        goal[self._goals.index(self.env.task.request)] = 1.0
        return goal

    def _direction(self) -> np.ndarray:
        """(3,) how far, and sine and cosine of where from straight ahead, left positive."""
        env, positions = self.env, self.env.world.graph.positions
        x, y, _ = positions[env.task.goal_nodes[0]] - positions[env.pose.node]
        aside = float(wrap(math.atan2(y, x) - env.pose.yaw))
        return np.array([min(math.hypot(x, y) / FAR, 1.0), math.sin(aside), math.cos(aside)], np.float32)


class Eyes(BaseFeaturesExtractor):
    """Three small convolutions of colours, or one layer over features, and the goal beside what they find."""

    def __init__(self, space: gymnasium.spaces.Dict, size: int = 128) -> None:
        super().__init__(space, size + space["goal"].shape[0])
        relu, flat = torch.nn.ReLU, torch.nn.Flatten
        if len(space["seen"].shape) == 1:
            many = space["seen"].shape[0]
            self.eyes = torch.nn.Sequential(torch.nn.LayerNorm(many), torch.nn.Linear(many, size), relu())
            return
        layers = [torch.nn.Conv2d(3, 16, 8, 4), relu(), torch.nn.Conv2d(16, 32, 4, 2), relu()]
        layers += [torch.nn.Conv2d(32, 32, 3, 1), relu(), flat(), torch.nn.Linear(32 * 4 * 4, size), relu()]
        self.eyes = torch.nn.Sequential(*layers)

    def forward(self, seen: dict[str, torch.Tensor]) -> torch.Tensor:
        return torch.cat([self.eyes(seen["seen"]), seen["goal"]], 1)


class Curve(BaseCallback):
    """Writes how the episodes of every rollout ended, saves the agent, and stops when the time is over."""

    def __init__(self, out: Path, minutes: float) -> None:
        super().__init__()
        self._path, self._agent, self._ended = out / "curve.csv", out / "agent.zip", []
        self._rows: list[dict[str, str | float]] = []
        if self._agent.exists():
            with self._path.open(newline="") as f:
                self._rows = list(csv.DictReader(f))
        self._spent = float(self._rows[-1]["seconds"]) if self._rows else 0.0
        self._began, self._minutes = time.process_time(), minutes

    @property
    def seconds(self) -> float:
        """Of processor time, earlier runs of the command included."""
        return self._spent + time.process_time() - self._began

    def _on_step(self) -> bool:
        self._ended += [info for info in self.locals["infos"] if "episode" in info]
        return self.seconds < 60 * self._minutes

    def _on_rollout_end(self) -> None:
        if not self._ended:
            return
        success = float(np.mean([info.get("success", 0.0) for info in self._ended]))
        reward = float(np.mean([info["episode"]["r"] for info in self._ended]))
        row = {"steps": self.num_timesteps, "episodes": len(self._ended), "success": success, "reward": reward}
        self._rows.append({k: round(v, 4) for k, v in row.items()} | {"seconds": round(self.seconds)})
        self._ended = []
        print(", ".join(f"{k} {v:g}" for k, v in self._rows[-1].items()), flush=True)
        if len(self._rows) % SAVED_EVERY == 0:
            self.save()

    def save(self) -> None:
        """Write the agent and the curve so far, atomically."""
        with atomic_path(self._agent) as temporary, temporary.open("wb") as f:
            self.model.save(f)
        with atomic_path(self._path) as temporary, temporary.open("w", newline="") as f:
            table = csv.DictWriter(f, self._rows[0])
            table.writeheader()
            table.writerows(self._rows)


def arena(args: argparse.Namespace, numbers: Sequence[int]) -> Arena:
    """The flats of these numbers, drawn where they are not yet."""
    catalogue, worlds, tasks = load_catalogue(default_cache()), {}, []
    for n in numbers:
        house, graph = make_dataset_house(args.house_seed, f"flat_{n}", HouseConfig(area=AREA), catalogue)
        drawn = parse_pictures(args.pictures, 128)
        world = worlds[house.name] = open_world(house, catalogue, default_cache(), drawn, graph=graph)
        world.render_all()
        world.close()  # the pictures are on disk; forty renderers would fill the memory
        tasks += point_tasks(world, args.house_seed) if args.task == "point" else find_tasks(world, args.house_seed)
        print(f"{house.name}: {len(house.rooms)} rooms, {len(graph.positions)} viewpoints", flush=True)
    if args.task == "point":
        return Arena(worlds, tasks, ())
    return Arena(worlds, [t for t in tasks if t.request in args.goals], tuple(args.goals))


def point_tasks(world: World, seed: int) -> list[Task]:
    """Every start with every goal that is HOPS away, with a drawn heading."""
    rng, graph = stream(seed, "point tasks", world.name), world.graph
    pairs = np.argwhere((graph.hops >= HOPS[0]) & (graph.hops <= HOPS[1]))
    return [
        Task(
            id=f"{world.name}/point/{k}",
            kind="find",
            world=world.name,
            start=Pose(int(start), int(rng.integers(TURNS))),
            goal=FollowRoute("point", graph.path(int(start), int(goal))),
            goal_nodes=(int(goal),),
            request="go there",
            radius=0.0,
            horizon=HORIZON,
        )
        for k, (start, goal) in enumerate(pairs.tolist())
    ]


def find_tasks(world: World, seed: int) -> list[Task]:
    """Every start near a thing that can be found."""
    config = FindConfig(fewest_nodes=HOPS[0] + 1, most_nodes=HOPS[1] + 1, horizon=HORIZON)
    pool, language = find_pool(world, seed=seed, config=config), PlainLanguage()
    tasks = [find_task(pool, i, seed=seed, language=language, config=config) for i in range(len(pool))]
    return [dataclasses.replace(t, request=t.goal.object_class) for t in tasks]


def maker(place: Arena, blind: bool, eyes: str, detector: torch.nn.Module | None = None) -> Callable[[], Seeker]:
    """A maker of environments that share the flats and their decoded panoramas."""
    store = PanoramaStore(place.worlds)
    if eyes == "pixels":
        sensor = CameraSensor(store, ("rgb",), ViewSettings("view", SIDE, SIDE, ANGLE))
    else:
        source = shipped_features(store)
        if detector:
            source = Detector(detector, source, len(place.goals))
        sensor = FeatureSensor("features", source)
    moves = MonocularMoves()

    def make() -> Seeker:
        env = HelpGymEnv(
            lambda: HelpEnv(place.worlds, moves=moves),
            place.tasks,
            sensor,
            layout=LAYOUT,
            shaping=True,
            patience=HORIZON,
        )
        return Seeker(env, place.goals, blind, detector is not None)

    return make


Outcomes = dict[str, list[float]]
"""By flat, of each episode: 1 where it succeeded."""


def judged(env: Seeker, act: Callable[[dict[str, np.ndarray]], int], episodes: int, seed: int) -> Outcomes:
    """Which episodes succeed."""
    found: Outcomes = {}
    for k in range(episodes):
        (observation, _), ended = env.reset(seed=seed + k), False
        while not ended:
            observation, _, terminated, truncated, info = env.step(act(observation))
            ended = terminated or truncated
        found.setdefault(env.env.task.world, []).append(info.get("success", 0.0))
    return found


def share(found: Outcomes) -> float:
    return float(np.mean(sum(found.values(), [])))


def interval(p: float, n: int) -> str:
    """A share p of n episodes and its 95 % interval, per cent. Source: Wilson 1927."""
    z = 1.96
    middle, half = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    low, high = (abs(100 * (middle + s * half) / (1 + z * z / n)) for s in (-1, 1))
    return f"{100 * p:.0f} % ({low:.0f} to {high:.0f})"


def walker(chance: float, rng: np.random.Generator) -> Callable[[dict[str, np.ndarray]], int]:
    """Moves at random and stops with a chance, whatever it sees."""
    return lambda o: STOP if rng.random() < chance else int(rng.integers(STOP))


def report(name: str, make: Callable[[], Seeker], learner: PPO, args: argparse.Namespace) -> dict[str, Any]:
    """Says how the learner and the random walk fare; returns their shares of success and the learner's outcomes."""
    env, rng = make(), np.random.default_rng(args.seed)
    outcomes = judged(env, lambda o: int(learner.predict(o, deterministic=False)[0]), args.judge, 1000)
    random = max(share(judged(env, walker(chance, rng), args.judge, 1000)) for chance in STOPS)
    learned, n = share(outcomes), args.judge
    print(f"{name}: succeeds in {interval(learned, n)} of {n} episodes, random walk {interval(random, n)}", flush=True)
    return {"learned": learned, "random walk": random, "episodes": n, "outcomes": outcomes}


def draw_curve(table: Path, random: float, picture: Path) -> None:
    """Success of the training's episodes against its steps, and the random walk's."""
    rows = np.atleast_1d(np.genfromtxt(table, delimiter=",", names=True))
    figure, axes = plt.subplots(figsize=(5.2, 2.8), layout="constrained")
    axes.plot(rows["steps"] / 1000, 100 * rows["success"], label="PPO while it learns, drawn actions")
    axes.axhline(100 * random, color="grey", linestyle="--", label="random walk, at the end")
    axes.set(xlabel="thousand steps", ylabel="success, %", ylim=(0, 100))
    axes.legend(loc="upper left", frameon=False, fontsize=8)
    figure.savefig(picture, dpi=150)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--task", default="point", choices=("point", "find"))
    parser.add_argument("--minutes", type=float, default=40.0, help="of processor time, for learning")
    parser.add_argument("--steps", type=int, default=10_000_000, help="at most so many environment steps")
    parser.add_argument("--flats", type=int, default=3, help="how many flats it learns in")
    parser.add_argument("--unseen", type=int, default=1, help="in how many other flats it is evaluated")
    parser.add_argument("--eyes", default="pixels", choices=("pixels", "encoder", "detector"), help="what it sees")
    parser.add_argument("--goals", nargs="+", default=GOALS, metavar="CLASS", help="what it looks for")
    parser.add_argument("--blind", action="store_true", help="black pictures, to compare with")
    parser.add_argument("--envs", type=int, default=16)
    parser.add_argument("--rollout", type=int, default=128, help="steps of each environment between updates")
    parser.add_argument("--judge", type=int, default=300, help="episodes of the evaluation")
    parser.add_argument("--pictures", default="fast", choices=("unlit", "fast", "normal"))
    parser.add_argument("--seed", type=int, default=0, help="of the training")
    parser.add_argument("--house-seed", type=int, default=0, help="of the flats and their tasks")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/ppo"))
    args = parser.parse_args()
    if args.eyes == "detector" and args.task != "find":
        parser.error("--eyes detector needs --task find: it detects what is sought")
    torch.set_num_threads(args.threads)
    args.out.mkdir(parents=True, exist_ok=True)

    home = arena(args, range(args.flats))
    print(f"{len(home.tasks)} tasks {', '.join(home.goals)}", flush=True)
    detector = train_detector(home, args.seed) if args.eyes == "detector" else None
    make = maker(home, args.blind, args.eyes, detector)
    envs, agent = DummyVecEnv([lambda: Monitor(make())] * args.envs), args.out / "agent.zip"
    learner = (
        PPO.load(agent, envs, device="cpu")
        if agent.exists()
        else PPO(
            "MultiInputPolicy",
            envs,
            policy_kwargs={"features_extractor_class": Eyes, "net_arch": [64]},
            n_steps=args.rollout,
            batch_size=256,
            n_epochs=4,
            learning_rate=5e-4,
            ent_coef=0.01,
            gamma=0.97,
            seed=args.seed,
            device="cpu",
        )
    )
    curve = Curve(args.out, args.minutes)
    left = args.steps - learner.num_timesteps
    if left > 0:
        learner.learn(left, callback=curve, reset_num_timesteps=False)
        curve.save()
    result = {"flats it learned in": report("flats it learned in", make, learner, args)}
    draw_curve(args.out / "curve.csv", result["flats it learned in"]["random walk"], args.out / "curve.png")
    away = arena(args, range(args.flats, args.flats + args.unseen))
    if away.tasks:
        others = maker(away, args.blind, args.eyes, detector)
        result["flats it never saw"] = report("flats it never saw", others, learner, args)
    settings = {name: value for name, value in vars(args).items() if name != "out"}
    (args.out / "result.json").write_text(
        json.dumps(
            {"settings": settings, "steps": learner.num_timesteps, "processor seconds": round(curve.seconds), **result}
        )
    )


if __name__ == "__main__":
    main()

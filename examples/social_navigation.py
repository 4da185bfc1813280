"""Social navigation and following a person: baselines, and PPO of Stable-Baselines3 that learns from depth.

    pip install stable-baselines3 && python examples/social_navigation.py --minutes 20 --out out/social

The agents play `embodied/SocialNav-v0` and `FollowNav-v0` in --unseen flats; PPO learns in --flats others, which nobody
draws: its camera is ROWS x COLUMNS rays among the collision boxes of the house, and people are cylinders. It sees three
such pictures, the last one first, and the goal; it moves ahead or turns, and stops where the goal is nearer than
0.27 m. It first imitates the shortest way for --imitate actions, then learns by PPO for --minutes of processor time
(reward: embodied.gym.continuous). --blind learns with black pictures.

OUT/agent.zip holds the weights, OUT/social-social.json and social-follow.json are tables as docs/results/data has them.
With --weights seeing/agent.zip blind/agent.zip nothing is trained, and these agents are judged beside the others.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import DummyVecEnv

from embodied.assets.cache import default_cache
from embodied.assets.catalogue import load_catalogue
from embodied.datasets.build import make_dataset_house
from embodied.envs.continuous import (
    CONTACT,
    FOLLOWS,
    PACE,
    SPIN,
    ContinuousEnv,
    HabitatAction,
    ShortestPathFollower,
    goal_cells,
)
from embodied.evaluation.tables import Samples, interval
from embodied.generate import HouseConfig
from embodied.geometry import wrap
from embodied.gym.continuous import ContinuousGymEnv, EpisodeDataset, open_episodes
from embodied.gym.sensors import with_people
from embodied.records import identity_of
from embodied.render.camera import camera_at
from embodied.scene.model import build_spec
from embodied.world import World, open_world

COMMAND = "\n".join(
    f"python examples/social_navigation.py {words}"
    for words in (
        "--flats 20 --imitate 15000 --steps 61440 --judge 0 --out seeing",
        "--flats 20 --imitate 15000 --steps 61440 --judge 0 --blind --out blind",
        "--unseen 10 --judge 15 --weights seeing/agent.zip blind/agent.zip --out OUT",
    )
)
AREA = (50.0, 75.0)
"""Size of the flats, square metres."""
ROWS, COLUMNS, TALL, EYE, FAR = 3, 32, math.radians(18.0), 1.0, 8.0
"""Of the camera: rays, radians of its height, metres above the floor, and metres beyond which all looks the same."""
SEEN, NEAR = 3, 0.27
"""Pictures that are seen at once; metres to the goal from which an agent that learns, or moves at random, stops."""
ACTIONS = (HabitatAction.FORWARD, HabitatAction.LEFT, HabitatAction.RIGHT)
Agent = Callable[[], int]
LOOK_AHEAD, MARGIN, TIME = 8, 0.1, 2.5
"""Cells of a way that an agent goes towards; metres kept free besides; seconds without touch that ORCA plans for."""
WAITS, SEES = 1.5, 5.0
"""Metres from which who waits for people does so, and ORCA counts them in."""
BESIDE, KEPT = 1.5, 0.75
"""Metres from who is followed, and from the way on which they come."""
TURNING, AGAINST = 0.05, 100.0
"""Metres a second that a turn counts when velocities are compared, and of a metre a second against ORCA."""


class WaitAndGo:
    """The shortest way, but standing while somebody is close before the body: turning to and fro."""

    def __init__(self, env: ContinuousEnv) -> None:
        self.env, self._expert = env, ShortestPathFollower(env)

    def action(self) -> int:
        env, wanted = self.env, self._expert.action()
        to = env.crowd.places[:, :2] - env.position
        ahead = to @ (math.cos(env.yaw), math.sin(env.yaw))
        waits = wanted == HabitatAction.FORWARD and ((np.hypot(*to.T) < WAITS) & (ahead > 0)).any()
        return turned_to_and_fro(env) if waits else wanted


class Orca:
    """Goes to the goal, or after the first of the people, by the velocity nearest to the wanted one that touches nobody
    for TIME seconds, of those that the body can have: standing, or a step along each of its headings.

    Optimal reciprocal collision avoidance (van den Berg et al. 2011), whose half-planes take all of the change upon
    the agent, since people do not avoid it.
    """

    def __init__(self, env: ContinuousEnv, *, knows: bool = True) -> None:
        """
        Args:
          knows: it knows where people are now; otherwise only where they were at first.
        """
        self.env, self._knows, self._was = env, knows, env.position
        self._people, self._clocks = env.crowd.places, env.crowd.clocks
        self._ways = env.ground.wide_ways(goal_cells(env.episode, env.ground))

    def action(self) -> int:
        env, here = self.env, self.env.position
        people, clocks = (env.crowd.places, env.crowd.clocks) if self._knows else (self._people, self._clocks)
        seconds = np.maximum(clocks - self._clocks, 1e-9)[:, None]
        velocities = (people - self._people) / seconds
        self._people, self._clocks = people, clocks
        own, self._was = PACE * (here - self._was) / env.body.forward, here
        if not (follows := env.episode.follows) and env.distance < 0.9 * env.episode.radius:
            return HabitatAction.STOP
        ways = env.ground.wide_ways(env.ground.cells_at(people[:1, :2])) if follows else self._ways
        way = env.ground.xy[ways.cells(env.ground.cell_at(here))[: LOOK_AHEAD + 1]]
        there = follows and math.dist(people[0, :2], here) < sum(FOLLOWS) / 2
        to = (
            people[0, :2] - here
            if there
            else way[int(env.ground.is_free(here, way).nonzero()[0].max(initial=0))] - here
        )
        wanted = PACE * to / max(float(np.linalg.norm(to)), 1e-9)
        number = 360 // env.body.turn
        turns = (np.arange(number) + number // 2) % number - number // 2
        angles = env.yaw + turns * math.radians(env.body.turn)
        units = np.stack([np.cos(angles), np.sin(angles)], 1)
        moves = np.flatnonzero(env.ground.is_free(here, here + env.body.forward * units))
        choices = np.vstack([PACE * units[moves], np.zeros((1, 2))])
        cost = np.linalg.norm(choices - (0 if there else wanted), axis=1)
        cost += TURNING * np.append(np.abs(turns[moves]), 0)
        for p, v in zip(people[:, :2] - here, velocities):
            if np.hypot(*p) < SEES:
                change, normal = half_plane(p, own - v[:2], CONTACT + MARGIN, env.body.forward / PACE)
                cost += AGAINST * np.maximum(-(choices - own - change) @ normal, 0.0)
        best = int(np.argmin(cost))
        stands = best == len(moves)
        turn = turns[int(np.argmax(units @ wanted)) if stands else moves[best]]
        if turn:
            return HabitatAction.LEFT if turn > 0 else HabitatAction.RIGHT
        return turned_to_and_fro(env) if stands else HabitatAction.FORWARD


class StepsAside:
    """Follows the first of the people at BESIDE metres, out of the way on which they came and go.

    It foresees that who stands goes back, and that who comes back goes on as before, and goes to the nearest place
    beside that way. Otherwise it compares headings and numbers of steps by how near the person will come, and by where
    it then stands.
    """

    def __init__(self, env: ContinuousEnv) -> None:
        self.env, self._track = env, env.crowd.places[:1, :2]
        self._clock = float(env.crowd.clocks[0])
        self._far = Orca(env)

    def action(self) -> int:
        env, here, person = self.env, self.env.position, self.env.crowd.places[0, :2]
        clock, far = float(env.crowd.clocks[0]), self._far.action()  # which looks on, too
        pace = math.dist(person, self._track[-1]) / max(clock - self._clock, 1e-9)
        way, self._clock = self._foreseen(person, pace), clock
        if pace > 0.1:
            self._track = np.vstack([self._track, person])
        if np.linalg.norm(way - here, axis=1).min() < KEPT and (refuge := self._beside(way, person)) is not None:
            aside = float(wrap(math.atan2(*(refuge - here)[::-1]) - env.yaw))
            if abs(aside) < math.radians(env.body.turn) / 2 + 1e-6:
                return HabitatAction.FORWARD
            return HabitatAction.LEFT if aside > 0 else HabitatAction.RIGHT
        if math.dist(person, here) > BESIDE + 1.0 or not env.ground.is_free(here, person[None])[0]:
            return far
        number, stride = 360 // env.body.turn, env.body.forward
        turns = (np.arange(number) + number // 2) % number - number // 2
        angles = env.yaw + turns * math.radians(env.body.turn)
        units, steps = np.stack([np.cos(angles), np.sin(angles)], 1), np.arange(5)
        ends = here + stride * steps[:, None, None] * units
        free = env.ground.is_free(here, ends.reshape(-1, 2)).reshape(ends.shape[:2])
        spun, times = np.abs(turns) * math.radians(env.body.turn) / SPIN, np.arange(0, TIME, 0.1)
        gone = np.clip((times[:, None, None] - spun) * PACE, 0, stride * steps[:, None])
        at = here + gone[..., None] * units
        metres = np.append(0, np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1)))
        coming = np.column_stack([np.interp(times * max(pace, PACE), metres, c) for c in way.T])
        nearest = np.linalg.norm(at - coming[:, None, None], axis=-1).min(0)
        lines = np.vstack([way, self._track[-80:]])[::2]
        aside = np.linalg.norm(ends[..., None, :] - lines, axis=-1).min(-1)
        apart = np.linalg.norm(ends - coming[len(times) // 2], axis=-1)
        cost = 10 * np.maximum(KEPT - nearest, 0) + np.abs(apart - BESIDE) + 2 * np.maximum(KEPT - aside, 0)
        cost += np.where(free, 0.1 * spun + 0.05 * steps[:, None], np.inf)
        count, k = np.unravel_index(int(np.argmin(cost)), cost.shape)
        turn = turns[int(np.argmax(units @ (person - here)))] if count == 0 else turns[k]
        if turn:
            return HabitatAction.LEFT if turn > 0 else HabitatAction.RIGHT
        return HabitatAction.FORWARD if count else turned_to_and_fro(env)

    def _beside(self, way: np.ndarray, person: np.ndarray) -> np.ndarray | None:
        """(2,) where to go next to the nearest place KEPT from a way; None where there is none."""
        ground, here = self.env.ground, self.env.position
        near = np.linalg.norm(ground.xy - person, axis=1) < CONTACT + MARGIN
        ways = ground.wide_ways(np.array([ground.cell_at(here)]), near)
        free = np.linalg.norm(ground.xy[:, None] - way, axis=2).min(1) > KEPT + MARGIN
        metres = np.where(free, ways.metres, np.inf)
        if not np.isfinite(metres.min()):
            return None
        path = ground.xy[ways.cells(int(metres.argmin()))[::-1][1 : LOOK_AHEAD + 2]]
        return path[int(ground.is_free(here, path).nonzero()[0].max(initial=0))]

    def _foreseen(self, person: np.ndarray, pace: float) -> np.ndarray:
        """(n, 2) points of the way that the person will go: back where they stand, on where they have been before."""
        track, ahead = self._track, person - self._track[-1]
        back = np.vstack([person, track[::-1][:60], track[::-1][-1:]])
        if pace < 0.1:
            return back
        before = track[:-20]
        k = int(np.linalg.norm(before - person, axis=1).argmin()) if len(before) > 2 else 0
        if len(before) > 2 and math.dist(before[k], person) < 0.3:
            onward = (before[min(k + 1, len(before) - 1)] - before[max(k - 1, 0)]) @ ahead > 0
            return np.vstack([person, track[k : k + 60] if onward else before[k::-1][:60]])
        return person + np.arange(8)[:, None] * 0.4 * ahead / np.linalg.norm(ahead)


def half_plane(p: np.ndarray, v: np.ndarray, radius: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """(2,) the smallest change of velocity after which two discs do not touch for TIME seconds, and (2,) the direction
    in which more is allowed, too.

    Args:
      p, v: (2,) from the one to the other, metres, and its velocity less the other's.
      radius: the sum of both, metres.
      step: seconds in which they have to part where they touch.
    """
    apart, time = float(np.hypot(*p)), TIME
    if apart <= radius:
        time = step
    w = v - p / time
    if apart <= radius or (w @ p < 0 and (w @ p) ** 2 > (radius * np.hypot(*w)) ** 2):  # on the round end of the cone
        normal = w / max(float(np.hypot(*w)), 1e-9)
        return (radius / time - float(np.hypot(*w))) * normal, normal
    leg, side = math.sqrt(apart**2 - radius**2), 1.0 if p[0] * w[1] - p[1] * w[0] > 0 else -1.0
    along = np.array([p[0] * leg - side * p[1] * radius, side * p[0] * radius + p[1] * leg]) / apart**2
    return (v @ along) * along - v, side * np.array([-along[1], along[0]])


def turned_to_and_fro(env: ContinuousEnv) -> int:
    """Waiting, for a body that cannot."""
    return HabitatAction.LEFT if env.steps % 2 else HabitatAction.RIGHT


class Rays:
    """Depth pictures of a few rays, for learning."""

    def __init__(self, world: World) -> None:
        self._model = build_spec(world.house, world.catalogue, parts=()).compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)

    def depth(self, play: ContinuousEnv) -> np.ndarray:
        """(ROWS, COLUMNS) float32 metres."""
        camera = camera_at((*play.eye[:2], play.floor + EYE), play.yaw, 0.0, TALL)
        tall = math.tan(TALL / 2) / ROWS
        across, up = np.meshgrid(tall * (2 * np.arange(COLUMNS) + 1 - COLUMNS), tall * (ROWS - 1 - 2 * np.arange(ROWS)))
        rays = camera.forward + across[..., None] * camera.right + up[..., None] * np.array(camera.up)
        stretch, count = np.linalg.norm(rays, axis=-1), ROWS * COLUMNS
        geoms, metres = np.empty(count, np.int32), np.empty(count)
        eye, lines = np.array(camera.position), (rays / stretch[..., None]).ravel()
        mujoco.mj_multiRay(
            self._model, self._data, eye, lines, None, 1, -1, geoms, metres, None, count, mujoco.mjMAXVAL
        )
        depth = np.where(geoms < 0, FAR, metres).reshape(ROWS, COLUMNS) / stretch
        return np.minimum(with_people(depth, camera, play.crowd.places), FAR).astype(np.float32)


class Seeing(gymnasium.Wrapper):
    """What PPO sees and does."""

    def __init__(self, env: ContinuousGymEnv, rays: dict[str, Rays], blind: bool) -> None:
        super().__init__(env)
        self._rays, self._blind, self._pictures = rays, blind, deque[np.ndarray](maxlen=SEEN)
        size = SEEN * ROWS * COLUMNS + 3 + len(ACTIONS)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)
        self.action_space = gymnasium.spaces.Discrete(len(ACTIONS))

    def reset(self, **options: Any) -> tuple[np.ndarray, dict[str, Any]]:
        observation, info = self.env.reset(**options)
        self._pictures.clear()
        return self.seen(observation), info

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        near = self._goal[0] < NEAR
        observation, *rest = self.env.step(HabitatAction.STOP if near else ACTIONS[int(action)])
        return self.seen(observation, int(action)), *rest

    def seen(self, observation: dict[str, Any], action: int = -1) -> np.ndarray:
        """The pictures, the goal and the last action as one vector."""
        play = self.env.play
        if not self._blind:
            world = self.env.dataset.worlds[play.episode.world]
            if world.name not in self._rays:
                self._rays[world.name] = Rays(world)
            picture = 1 - self._rays[world.name].depth(play).ravel() / FAR
        else:
            picture = np.zeros(ROWS * COLUMNS, np.float32)
        while len(self._pictures) < SEEN:
            self._pictures.append(picture)
        self._pictures.append(picture)
        metres, aside = self._goal = observation["goal"]
        goal = [min(metres / FAR, 1.0), math.sin(aside), math.cos(aside)]
        last = np.arange(len(ACTIONS)) == action
        return np.concatenate([*reversed(self._pictures), goal, last]).astype(np.float32)


def flats(numbers: range, seed: int) -> dict[str, World]:
    catalogue, worlds = load_catalogue(default_cache()), {}
    for n in numbers:
        house, graph = make_dataset_house(seed, f"flat_{n}", HouseConfig(area=AREA), catalogue)
        worlds[house.name] = open_world(house, catalogue, default_cache(), "unlit", graph=graph)
    return worlds


def imitated(learner: PPO, envs: list[Seeing], actions: int, seed: int) -> None:
    """Teaches the shortest way, and what it is worth, before PPO begins; every tenth action is drawn."""
    rng, seen, done, worth = np.random.default_rng(seed), [], [], []
    while len(seen) < actions:
        env, rewards = envs[len(worth) % len(envs)], []
        observation, _ = env.reset(seed=int(rng.integers(2**31)))
        expert, ended = ShortestPathFollower(env.env.play), False
        while not ended:
            wanted = expert.action()
            right = ACTIONS.index(wanted) if wanted in ACTIONS else 0
            seen.append(observation)
            done.append(right)
            drawn = right if rng.random() > 0.1 else int(rng.integers(len(ACTIONS)))
            observation, reward, terminated, truncated, _ = env.step(drawn)
            rewards.append(reward)
            ended = terminated or truncated
        back = 0.0
        values = [back := r + learner.gamma * back for r in reversed(rewards)][::-1]
        worth += values
    x, y, v = torch.tensor(np.array(seen)), torch.tensor(done), torch.tensor(worth, dtype=torch.float32)
    optimizer = torch.optim.Adam(learner.policy.parameters(), 1e-3)
    for k in range(min(2000, actions)):
        rows = torch.from_numpy(rng.integers(len(x), size=512))
        values, log_probability, _ = learner.policy.evaluate_actions(x[rows], y[rows])
        loss = -log_probability.mean() + 0.5 * (values[:, 0] - v[rows]).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        if k % 500 == 499:
            print(f"imitation, {len(x)} actions: loss {float(loss.detach()):.3f}", flush=True)


class Until(BaseCallback):
    """Prints how episodes ended, saves the agent, and stops when the time is over."""

    def __init__(self, out: Path, minutes: float) -> None:
        super().__init__()
        self._out, self._end, self._ended, self._rollouts = out, time.process_time() + 60 * minutes, [], 0

    def _on_step(self) -> bool:
        self._ended += [info for info, done in zip(self.locals["infos"], self.locals["dones"]) if done]
        return time.process_time() < self._end

    def _on_rollout_end(self) -> None:
        self._rollouts += 1
        if self._rollouts % 10 == 0 and self._ended:
            numbers = {k: float(np.mean([i[k] for i in self._ended])) for k in ("success", "human_collision", "psc")}
            print(f"{self.num_timesteps} steps", *(f"{k} {v:.3f}" for k, v in numbers.items()), flush=True)
            self._ended = []
            self.model.save(self._out / "agent.zip")


def train(args: argparse.Namespace) -> None:
    worlds, rays = flats(range(args.flats), args.house_seed), dict[str, Rays]()
    played = open_episodes("social", worlds=worlds, observations=())
    print(f"{len(worlds)} flats, {len(played.episodes)} episodes", flush=True)
    envs = [Seeing(ContinuousGymEnv(played), rays, args.blind) for _ in range(16)]
    how = {"n_steps": 128, "batch_size": 512, "n_epochs": 4, "ent_coef": 0.01, "learning_rate": 2e-4, "seed": args.seed}
    nets = {"net_arch": [256, 128]}
    learner = PPO("MlpPolicy", DummyVecEnv([lambda e=e: e for e in envs]), policy_kwargs=nets, device="cpu", **how)
    imitated(learner, envs, args.imitate, args.seed)
    learner.learn(args.steps, callback=Until(args.out, args.minutes))
    learner.save(args.out / "agent.zip")


def judged(played: EpisodeDataset, agent: Callable[[ContinuousGymEnv], Agent], each: int) -> dict[str, Samples]:
    """Measures of the first episodes of each house."""
    env, found, houses, count = ContinuousGymEnv(played), dict[str, list[float]](), list[str](), dict[str, int]()
    for k, episode in enumerate(played.episodes):
        count[episode.world] = count.get(episode.world, 0) + 1
        if count[episode.world] > each:
            continue
        env.reset(seed=k, options={"episode": k})
        act, ended = agent(env), False
        while not ended:
            _, _, terminated, truncated, info = env.step(act())
            ended = terminated or truncated
        houses.append(episode.world)
        for name in set(TITLES) & set(info):
            found.setdefault(name, []).append(float(info[name]))
    return {name: Samples(tuple(x), tuple(houses), share=name in SHARES) for name, x in found.items()}


def learned(weights: Path, rays: dict[str, Rays], blind: bool) -> Callable[[ContinuousGymEnv], Agent]:
    """Draws the actions of trained weights."""
    policy = PPO.load(weights, device="cpu").policy

    def agent(env: ContinuousGymEnv) -> Agent:
        eyes, last = Seeing(env, rays, blind), -1

        def act() -> int:
            nonlocal last
            seen = eyes.seen(env.look(), last)
            last = int(policy.predict(seen, deterministic=False)[0])
            return HabitatAction.STOP if eyes._goal[0] < NEAR else ACTIONS[last]

        return act

    return agent


def at_random(env: ContinuousGymEnv) -> Agent:
    """Moves at random, and stops where PPO does."""
    rng, play = np.random.default_rng(env.np_random.integers(2**31)), env.play
    there = lambda: not play.episode.follows and math.dist(play.position, play.episode.goals[0].position[:2]) < NEAR
    return lambda: HabitatAction.STOP if there() else int(rng.choice(ACTIONS))


TITLES = {
    "success": "success", "spl": "SPL", "stl": "STL", "psc": "personal space", "human_collision": "human collision",
    "found": "found", "steps_to_find": "steps to find", "following": "following",
    "following_after_found": "following, once found", "distance": "metres apart", "steps_taken": "steps",
}  # fmt: skip
NUMBERS, SHARES = ("steps_to_find", "distance", "steps_taken"), ("success", "human_collision", "found")
SHOWN = {
    "social": ("success", "spl", "stl", "psc", "human_collision", "steps_taken"),
    "follow": (
        "success",
        "found",
        "steps_to_find",
        "following",
        "following_after_found",
        "distance",
        "human_collision",
    ),
}
BASELINES = {
    "random": at_random,
    "shortest path, ignores people": lambda env: ShortestPathFollower(env.play).action,
    "wait and go": lambda env: WaitAndGo(env.play).action,
    "ORCA": lambda env: Orca(env.play).action,
}
FOLLOWERS = {
    "random": at_random,
    "goes where the person was at first": lambda env: Orca(env.play, knows=False).action,
    "knows where the person is": lambda env: Orca(env.play).action,
    "knows, and steps aside": lambda env: StepsAside(env.play).action,
}


def judge(args: argparse.Namespace) -> None:
    """Writes the tables; rows that are there are kept."""
    worlds, rays = flats(range(1000, 1000 + args.unseen), args.house_seed), dict[str, Rays]()
    agents = dict(BASELINES)
    for path in [args.out / "agent.zip"] if args.weights is None else args.weights:
        agents[f"PPO, {path.parent.name}"] = learned(path, rays, path.parent.name == "blind")
    for kind, rows, title, people in (
        ("social", agents, "Going to a point among people", "One to three people"),
        ("follow", FOLLOWERS, "Following a person", "One person"),
    ):
        file = args.out / f"social-{kind}.json"
        known = {row["label"]: row for row in json.loads(file.read_text())["rows"]} if file.exists() else {}
        played = open_episodes(kind, worlds=worlds, observations=(), polite=args.polite)
        for label, agent in rows.items():
            if label not in known:
                torch.manual_seed(0)
                values = {}
                for k, samples in judged(played, agent, args.judge).items():
                    e, scale = interval([samples]), 1.0 if k in NUMBERS else 100.0
                    values[k] = {"mean": round(scale * e.mean, 2), "half_width": round(scale * e.half, 2), "n": e.n}
                known[label] = {"label": label, "values": values, "printed": {}}
                print(kind, label, {k: v["mean"] for k, v in values.items()}, flush=True)
        keys = [k for k in SHOWN[kind] if all(k in row["values"] for row in known.values())]
        about = (
            f"{args.judge} episodes in each of {args.unseen} flats of 50 to 75 m² that nobody learned in. {people}; "
        )
        body = {"table": f"social-{kind}", "title": title, "paper": None, "command": args.command}
        body |= {"identity": {"judged": identity_of("embodied.envs.continuous", "embodied.kinds.shipped.social")}}
        body |= {"settings": f"{about}95 % intervals clustered by house.", "notes": []}
        body["columns"] = [{"key": k, "title": TITLES[k], "unit": "" if k in NUMBERS else "%"} for k in keys]
        file.write_text(json.dumps(body | {"rows": list(known.values())}, indent=1, ensure_ascii=False) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder of weights and tables")
    parser.add_argument("--minutes", type=float, default=20.0, help="of processor time, for PPO")
    parser.add_argument("--steps", type=int, default=10**9, help="at most so many actions of PPO")
    parser.add_argument("--flats", type=int, default=32, help="how many flats it learns in")
    parser.add_argument("--unseen", type=int, default=12, help="in how many other flats agents are judged")
    parser.add_argument("--imitate", type=int, default=30_000, help="actions of the shortest way to begin with")
    parser.add_argument("--judge", type=int, default=20, help="episodes of each flat; 0 judges nothing")
    parser.add_argument("--weights", type=Path, nargs="*", help="judge these agents, or none; train nothing")
    parser.add_argument("--blind", action="store_true", help="learn with black pictures")
    parser.add_argument("--polite", action="store_true", help="people stand while the agent is close before them")
    parser.add_argument("--house-seed", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    args.command = COMMAND
    torch.set_num_threads(1)
    args.out.mkdir(parents=True, exist_ok=True)
    if args.weights is None:
        train(args)
    if args.judge:
        judge(args)


if __name__ == "__main__":
    main()

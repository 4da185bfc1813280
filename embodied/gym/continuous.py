"""Continuous navigation with Habitat's actions and live pictures: embodied/VLNCE-v0 and embodied/ObjectNav-v0.

    env = gymnasium.make("embodied/VLNCE-v0", data="DIR", split="val_unseen")
    env = gymnasium.make("embodied/VLNCE-v0", data="DIR", episodes="val_unseen.json.gz", height=480, width=640, hfov=79)
    env = gymnasium.make("embodied/ObjectNav-v0", data="DIR", split="train", sliding=False)

Actions: 0 stop, 1 forward, 2 left, 3 right, and for ObjectNav 4 up, 5 down. Every picture is drawn at the pose of the
camera. Episodes are the tasks of a `vln` data set, or objects of the houses of any, or a file in Habitat's format.
"""

import dataclasses
import functools
import math
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from embodied.assets.cache import default_cache
from embodied.datasets.store import Dataset
from embodied.envs import continuous
from embodied.geometry import wrap
from embodied.gym.drive import chosen_worlds
from embodied.gym.env import VIEW, LiveEnv
from embodied.gym.registration import register_environment
from embodied.gym.sensors import LARGE, among, check_live, live_pixels, pixel_spaces
from embodied.gym.spaces import codes_of, whole
from embodied.gym.vector_env import in_step
from embodied.kinds.metrics import warping
from embodied.kinds.plugins import Registry, titled_files
from embodied.render.camera import camera_at
from embodied.render.pictures import PictureSettings
from embodied.seeds import checked_seed
from embodied.world import World

LONGEST_INSTRUCTION = 1000
"""Most characters of an instruction; longer ones are cut."""
STEP_COST, PER_METRE = 0.01, 0.1
"""Of every action, and what a metre nearer to the goal is worth."""
CONTACT_COST, FOLLOWING = 1.0, 0.05
"""Of touching a person, and what an action of following is worth."""
KEPT = 4
"""Houses whose renderers are held open, the last used."""
LIVE_CHANNELS = ("rgb", "depth")


@dataclass(frozen=True, eq=False)
class EpisodeSource:
    """Everything that episodes are made from where no file says them."""

    worlds: Mapping[str, World]
    data: Dataset | None
    """The data set that the worlds are of; None for given and generated ones."""
    split: str
    seed: int
    cache: Path
    navmeshes: continuous.NavMeshCache


@dataclass(frozen=True)
class ContinuousTask:
    """A task of an agent that moves as Habitat's do: a file of embodied/gym/continuous_tasks, or one of your own."""

    name: str
    """The file's, or 'module:NAME' of one's own, so that it is found."""
    title: str
    """Gymnasium has it as embodied/TITLE-v0."""
    read: Callable[[Path], list[continuous.ContinuousEpisode]] | None
    """The episodes of a file in Habitat's format; None where there is none."""
    episodes: Callable[[EpisodeSource], list[continuous.ContinuousEpisode]]
    body: continuous.Body = continuous.Body()
    camera: continuous.CameraConfig = continuous.CameraConfig()
    gps: bool = False
    """Observations have gps and compass."""
    point: bool = False
    """Observations have the goal: metres as the crow flies, and radians, left positive."""


CONTINUOUS_TASKS = Registry(
    ContinuousTask, "embodied.gym.continuous_tasks", functools.partial(titled_files, "gym/continuous_tasks")
)
continuous_task = CONTINUOUS_TASKS.named


def register_continuous(task: ContinuousTask) -> ContinuousTask:
    """Make a task known by its name, and to Gymnasium as embodied/TITLE-v0; returns it. Call it where it is defined."""
    register_environment(gym, task.title, task.name, __name__, __name__)
    return CONTINUOUS_TASKS.add(task)


@dataclass(frozen=True, eq=False)
class EpisodeDataset:
    """Houses, episodes and floors that the environments of one batch share."""

    task: ContinuousTask
    worlds: Mapping[str, World]
    episodes: tuple[continuous.ContinuousEpisode, ...]
    body: continuous.Body = continuous.Body()
    camera: continuous.CameraConfig = continuous.CameraConfig()
    observations: tuple[str, ...] = LIVE_CHANNELS
    navmeshes: continuous.NavMeshCache = dataclasses.field(default_factory=continuous.NavMeshCache)
    opened: OrderedDict[str, World] = dataclasses.field(default_factory=OrderedDict)

    def __post_init__(self) -> None:
        if not self.episodes:
            raise ValueError("there are no episodes to play; choose another split or file")
        check_live(self.observations, LIVE_CHANNELS, self.camera.height, self.camera.width)
        if lost := sorted({e.world for e in self.episodes} - set(self.worlds)):
            raise ValueError(
                f"episodes play in houses that are not here: {lost[:4]}; there are {sorted(self.worlds)[:4]}"
            )

    def world(self, name: str) -> World:
        """A house to draw; of the others that are open, the one used longest ago is closed."""
        self.opened[name] = self.worlds[name]
        self.opened.move_to_end(name)
        if len(self.opened) > KEPT:
            self.opened.popitem(last=False)[1].close()
        return self.worlds[name]


class ContinuousGymEnv(LiveEnv):
    """Continuous navigation as a Gymnasium environment.

    Reward: 1 on success, minus 0.01 an action, plus a tenth for every metre nearer to the goal along the floor. STOP
    terminates, the last action truncates. Every info has success, is_success and spl (zero before STOP),
    distance_to_goal, collided and steps_taken; the last one of an episode that ends by itself has what `judged` gives.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 4}

    def __init__(self, dataset: EpisodeDataset, *, render_mode: str | None = None) -> None:
        super().__init__(render_mode, dataset.opened.values())
        self.dataset = dataset
        self.play = continuous.ContinuousEnv(dataset.body, dataset.navmeshes)
        """The pose of the body, and what is privileged: distance, ways, the walk so far."""
        self.action_space: gym.Space[Any] = spaces.Discrete(dataset.body.actions)
        self.observation_space = observation_space(dataset)
        self._max_episode_steps = dataset.body.steps

    @property
    def episodes(self) -> tuple[continuous.ContinuousEpisode, ...]:
        """All episodes; reset(options={"episode": k}) plays number k."""
        return self.dataset.episodes

    @property
    def task_description(self) -> str:
        """The instruction."""
        return self.play.episode.instruction

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """An episode drawn with this environment's generator, or the one of number options["episode"].

        Raises:
          ValueError: there is no such episode.
        """
        number, last = (options or {}).get("episode"), len(self.episodes) - 1
        if number is not None and not (isinstance(number, (int, np.integer)) and 0 <= number <= last):
            raise ValueError(f"options['episode'] should be a number from 0 to {last}, got {number!r:.80}")
        super().reset(seed=None if seed is None else checked_seed(seed))
        drawn = int(self.np_random.integers(len(self.episodes)))
        episode = self.episodes[drawn if number is None else int(number)]
        self.play.reset(episode, self.dataset.worlds[episode.world])
        return self.look(), self._facts() | {"episode": episode.id, "instruction": episode.instruction}

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        play, before = self.play, self.play.distance
        play.step(whole(action))
        stopped, info = action == continuous.HabitatAction.STOP, self._facts()
        if play.ended:
            info |= judged(play.trajectory())
            if play.episode.people:
                info |= continuous.social_measures(play.trajectory(), self.dataset.body.steps)
            info["is_success"] = info["success"] > 0
        gain = FOLLOWING * play.is_following if play.episode.follows else PER_METRE * (before - play.distance)
        reward, ended = float(info["is_success"]) - STEP_COST - CONTACT_COST * play.contact, stopped or play.contact
        return self.look(), reward + gain, bool(ended), play.ended and not ended, info

    def look(self) -> dict[str, Any]:
        """The observation."""
        observation: dict[str, Any] = self.pixels()
        observation["instruction"] = codes_of(self.task_description, LONGEST_INSTRUCTION).copy()
        if self.dataset.task.gps:
            turned = float(wrap(self.play.yaw - self.play.episode.yaw))
            observation["gps"], observation["compass"] = self.odometry()[:2], np.array([turned], np.float32)
        if self.dataset.task.point:
            x, y = np.subtract(self.play.episode.goals[0].position[:2], self.play.position)
            aside = float(wrap(math.atan2(y, x) - self.play.yaw))
            observation["goal"] = np.array([math.hypot(x, y), aside], np.float32)
        return observation

    def pixels(self) -> dict[str, np.ndarray]:
        """rgb (h, w, 3) uint8 and depth (h, w) float32, metres along the optical axis."""
        camera, world = self.dataset.camera, self._seen()
        pose = camera_at(self.play.eye, self.play.yaw, self.play.pitch, camera.vfov)
        size = camera.height, camera.width
        return live_pixels(world, pose, size, self.dataset.observations, self.play.crowd.places)

    def odometry(self) -> np.ndarray:
        """(5,) float32 of embodied.envs.continuous.POSITION."""
        return continuous.odometry(self.play.episode, np.array(self.play.eye), self.play.yaw, self.play.pitch)

    def expert(self, *, along: bool = False) -> continuous.ShortestPathFollower:
        """Who knows the way from wherever the body is, for training."""
        return continuous.ShortestPathFollower(self.play, along=along)

    def _picture(self) -> np.ndarray:
        camera = dataclasses.replace(self.dataset.camera, height=VIEW[0], width=VIEW[1])
        pose = camera_at(self.play.eye, self.play.yaw, self.play.pitch, camera.vfov)
        return self._seen().renderer.rgb(pose, VIEW)

    def _seen(self) -> World:
        """The house with the doors that were pushed, and the people."""
        world = self.dataset.world(self.play.episode.world)
        return among(world, self.play.crowd, dict.fromkeys(self.play.pushed, 1.0))

    def _facts(self) -> dict[str, Any]:
        play = self.play
        state = {"distance_to_goal": play.distance, "collided": play.collided, "steps_taken": play.steps}
        return {"success": 0.0, "is_success": False, "spl": 0.0, **state}


def observation_space(dataset: EpisodeDataset) -> spaces.Dict:
    whole: dict[str, spaces.Space[Any]] = {
        **pixel_spaces((dataset.camera.height, dataset.camera.width), dataset.observations)
    }
    whole["instruction"] = spaces.Box(0, 255, (LONGEST_INSTRUCTION,), np.uint8)
    if dataset.task.point:
        whole["goal"] = spaces.Box(np.array([0, -4], np.float32), np.array([LARGE, 4], np.float32))
    if dataset.task.gps:
        whole["gps"] = spaces.Box(-LARGE, LARGE, (2,), np.float32)
        whole["compass"] = spaces.Box(-4.0, 4.0, (1,), np.float32)
    return spaces.Dict(whole)


def make(kind: str, *, render_mode: str | None = None, **options: Any) -> ContinuousGymEnv:
    """The environment; options as of `open_episodes`."""
    return ContinuousGymEnv(open_episodes(kind, **options), render_mode=render_mode)


def make_vec(
    kind: str,
    num_envs: int = 1,
    *,
    render_mode: str | None = None,
    max_episode_steps: int | None = None,
    disable_env_checker: bool | None = None,
    **options: Any,
) -> gym.vector.SyncVectorEnv:
    """Environments in this process that share houses and floors; arguments as of embodied.gym.vector_env.make_vec.

    Raises:
      ValueError: no such limit, and what `open_episodes` raises.
    """
    dataset = open_episodes(kind, **options)
    return in_step(lambda: ContinuousGymEnv(dataset, render_mode=render_mode), num_envs, max_episode_steps)


def open_episodes(
    kind: str,
    *,
    data: str | Path | None = None,
    split: str = "train",
    episodes: str | Path | None = None,
    seed: int = 0,
    cache: str | Path | None = None,
    pictures: PictureSettings | str | None = None,
    worlds: Mapping[str, World] | None = None,
    observations: str | Sequence[str] = LIVE_CHANNELS,
    **changes: Any,
) -> EpisodeDataset:
    """Houses and episodes: of a data set, of given worlds, or of one flat that is generated from `seed` and lit.

    Args:
      data, split: of kind 'vln' for VLNCE-v0, of any kind for ObjectNav-v0.
      episodes: a .json.gz file in Habitat's format that plays in these houses, instead of their own episodes.
      pictures: how houses are drawn; as the data set's pictures are, 'fast' elsewhere, matte unless they name a look.
      observations: some of LIVE_CHANNELS.
      changes: fields of Body and CameraConfig that differ from the task's.

    Raises:
      ValueError: an unknown option, or episodes of other houses or in another frame.
    """
    task = continuous_task(kind)
    body, camera = chosen(task, changes)
    where, navmeshes = Path(cache) if cache else default_cache(), continuous.NavMeshCache()
    whole = Dataset(Path(data)) if data is not None and worlds is None else None
    worlds, _ = chosen_worlds(data=data, split=split, seed=seed, cache=where, pictures=pictures, worlds=worlds)
    if episodes is None:
        played = task.episodes(EpisodeSource(worlds, whole, split, seed, where, navmeshes))
    elif task.read is None:
        raise ValueError(f"{task.title}-v0 reads no files of episodes; leave episodes={str(episodes)!r} out")
    else:
        played = task.read(Path(episodes))
        for e in (e for e in played if e.world in worlds):
            house = worlds[e.world].house
            try:
                continuous.check_on_floor(e, house, navmeshes.of(house), body.forward)
            except ValueError as error:
                raise ValueError(f"{episodes}: {error}") from error
    seen = (observations,) if isinstance(observations, str) else tuple(observations)
    return EpisodeDataset(task, dict(worlds), tuple(played), body, camera, seen, navmeshes)


def chosen(task: ContinuousTask, changes: Mapping[str, Any]) -> tuple[continuous.Body, continuous.CameraConfig]:
    """The body and the camera of a task with some fields changed.

    Raises:
      ValueError: an unknown field.
    """
    names = [{f.name for f in dataclasses.fields(x)} for x in (task.body, task.camera)]
    if unknown := sorted(set(changes) - names[0] - names[1]):
        raise ValueError(f"unknown options {unknown}; expected some of {sorted(names[0] | names[1])}")
    fields = [{k: v for k, v in changes.items() if k in n} for n in names]
    return dataclasses.replace(task.body, **fields[0]), dataclasses.replace(task.camera, **fields[1])


WARPING = 3.0
"""Metres that nDTW is normalised by (Magalhaes et al. 2019)."""


def ndtw(trajectory: continuous.ContinuousTrajectory) -> float:
    """exp(-DTW / (3 m |expert|)) of the positions after each action, without repeats; the episode needs a path."""
    reference = expert_path(trajectory.episode)
    after = trajectory.positions[1:] if len(trajectory.actions) else trajectory.positions
    kept = np.concatenate([[True], (np.diff(after, axis=0) != 0).any(1)])
    metres = np.linalg.norm(after[kept][:, None] - reference[None], axis=2)
    return float(np.exp(-warping(metres) / (len(reference) * WARPING)))


def judged(trajectory: continuous.ContinuousTrajectory) -> dict[str, float]:
    """Every measure of one walk by the names of VLN-CE's and ObjectNav's evaluators (Krantz et al. 2020, Anderson et
    al. 2018); nDTW and SDTW where its episode has a path.

    Success is strictly nearer than the radius, after STOP. SPL and path length count straight lines between consecutive
    positions, nDTW and SDTW straight lines between positions and the expert's (exact dynamic time warping, where the
    published program may approximate it).
    """
    t, steps = trajectory, sum(a == continuous.HabitatAction.FORWARD for a in trajectory.actions)
    numbers = {"success": t.success, "spl": t.spl}
    if len(expert_path(t.episode)):
        numbers |= {"ndtw": (alike := ndtw(t)), "sdtw": alike * t.success}
    numbers |= {"oracle_success": t.oracle_success, "oracle_spl": t.oracle_spl}
    numbers |= {"distance_to_goal": float(t.distances[-1]), "oracle_navigation_error": float(t.distances.min())}
    numbers |= {"path_length": float(t.lengths[-1]), "steps_taken": float(len(t.actions))}
    return {**numbers, "collisions": t.collisions / steps if steps else 0.0}  # of the steps ahead, those that touched


def expert_path(episode: continuous.ContinuousEpisode) -> np.ndarray:
    """(m, 3) metres that nDTW compares with; (0, 3) without."""
    return np.array(episode.expert or episode.reference, float).reshape(-1, 3)

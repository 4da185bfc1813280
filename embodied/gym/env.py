"""Gymnasium environments embodied/Find-v0, VLN-v0, VNLA-v0, HANNA-v0, HARI-v0, Ask-v0, Doors-v0.

They are registered by `import embodied`.

    env = gymnasium.make("embodied/HANNA-v0", data="DIR", split="train", observations=("rgb", "depth"))
    envs = gymnasium.make_vec("embodied/HANNA-v0", num_envs=64, data="DIR")
    envs = gymnasium.make_vec("embodied/HANNA-v0", num_envs=8, data="DIR", vectorization_mode="async",
                              vector_kwargs={"context": "spawn"})

The first batch takes its steps in one process and shares what it holds (embodied.gym.vector_env); the second is
Gymnasium's AsyncVectorEnv, a process for each environment.

Without `data` a small furnished flat is generated and lit, which takes a minute or two once. What an
agent sees is chosen by `observations` (embodied.gym.sensors): by default a perspective view and the features
that the shipped encoder finds in the same pictures. An oracle is called an oracle.
"""

import functools
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from PIL import Image, ImageDraw, ImageOps

from embodied.envs.base import STEP_COST, ActionError, HelpEnv
from embodied.gym import sensors
from embodied.gym.playground import Playground, PlaygroundSettings, flat_playground, seen_features, split_playground
from embodied.gym.spaces import SpaceLayout, action_space, decode, encode, observation_space
from embodied.house.floor_plan import font, paint_plan
from embodied.house.house import House
from embodied.interface import FeatureSource, Observation, Place, Pose, Sight, Task, viewpoint
from embodied.kinds.metrics import PER_EPISODE
from embodied.kinds.task_kind import kind_named
from embodied.language.plain_language import detokenized
from embodied.navigation.doors import place_named
from embodied.scene.house_meshes import instance_classes
from embodied.seeds import checked_seed
from embodied.world import World

LAYOUT = SpaceLayout()
OWN = ("shaping", "strict", "patience", "needs_stop")
"""Options of HelpGymEnv that `make` and `make_vec` hand on."""
VIEW = (480, 640)
"""Height and width of the rendered view, pixels."""
PLAN = (480, 480)
"""Height and width that the plan is fitted into, pixels: whatever the house, pictures have one size."""
WORDS_HEIGHT = 64
"""Height of what is said, pixels."""
VIEW_ANGLE = np.radians(78.0)
"""Vertical field of view of what `render` shows, radians: wider than the agent's 60 degrees; people need it."""


class LiveEnv(gym.Env[dict[str, Any], Any]):
    """An environment that draws. Subclasses define `_picture`, what people are shown."""

    metadata = {"render_modes": ["rgb_array"]}

    def __init__(self, render_mode: str | None, opened: Iterable[World]) -> None:
        """
        Args:
          opened: worlds that `close` closes.

        Raises:
          ValueError: an unknown render mode.
        """
        check_options(render_mode)
        self.render_mode, self._opened = render_mode, opened

    def _picture(self) -> np.ndarray:
        """(*VIEW, 3) uint8: what its camera sees, larger."""
        raise NotImplementedError

    def render(self) -> np.ndarray | None:
        """Picture for people, (h, w, 3) uint8."""
        if self.render_mode is None:
            gym.logger.warn("render() needs render_mode='rgb_array' when the environment is made")
            return None
        return self._picture()

    def close(self) -> None:
        """Close what draws, and the files, of the worlds that were opened for this; a later use opens them again."""
        for world in self._opened:
            world.close()


class HelpGymEnv(LiveEnv):
    """A HelpEnv as a Gymnasium environment: numbers in, numbers out, text as text.

    Reward: 1 on success at the end, minus 0.01 per step and the price of a question (Ask-v0); HARI: minus the cost
    of the step. With `shaping`, minus the change of the distance to the nearest goal in metres / 10 (in HARI, in
    edges, Eq 4.20), which leaves the best policy as it is. The info of every step holds success, is_success (for
    Stable-Baselines3) and spl, as if the episode were cut short there: that is what Gymnasium's TimeLimit does. The
    last info of an episode that ends by itself has the other metrics of every task, too.

    An action that the mask forbids leaves everything as it was and is reported in info["invalid_action"]; after
    `patience` of them the episode is truncated. With `strict` it raises ActionError instead.

    Every info has the words of the moment: "request" (the task), "instruction" (the request, or what the
    assistant said last) and "candidates", one {"action", "heading", "text"} for each possible move.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 2}

    def __init__(
        self,
        make_env: Callable[[], HelpEnv],
        tasks: Sequence[Task],
        sensor: sensors.Sensor,
        *,
        layout: SpaceLayout = LAYOUT,
        shaping: bool = False,
        strict: bool = False,
        patience: int = 20,
        needs_stop: bool = False,
        render_mode: str | None = None,
        opened: Sequence[World] = (),
    ) -> None:
        """
        Args:
          tasks: what `reset` draws from; reset(options={"task": ID}) chooses one.
          sensor: what is seen of every place, of the target image too.
          needs_stop: an episode that runs out of steps near its goal is no success.
          opened: worlds that `close` closes.

        Raises:
          ValueError: no tasks, an unknown render mode, or patience below 1.
        """
        super().__init__(render_mode, opened)
        check_options(render_mode, patience=patience)
        if not tasks:
            raise ValueError("there are no tasks to play; choose another split or a larger scale")
        self._env, self._tasks, self._sensor = make_env(), tuple(tasks), sensor
        self.layout = layout
        """The sizes of the spaces."""
        self._shaping, self._strict, self._patience = shaping, strict, patience
        self._needs_stop = needs_stop
        self.action_space: gym.Space[Any] = action_space(layout)
        self.observation_space = observation_space(layout, sensor)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """A task drawn with this environment's generator, or options["task"]: an id, as in info, or a number.

        Raises:
          ValueError: there is no such task.
        """
        chosen = self.chosen(options)
        super().reset(seed=None if seed is None else checked_seed(seed))
        drawn = int(self.np_random.integers(len(self._tasks)))
        task = self._tasks[drawn if chosen is None else chosen]
        self.observed = self._env.reset(task, seed=int(self.np_random.integers(2**31)))
        """The last observation, before it became numbers."""
        self._invalid = 0
        return self._encoded(self.observed), {"task": task.id} | self._words()

    def chosen(self, options: Mapping[str, Any] | None) -> int | None:
        """The number of the task that options["task"] names; None where it names none.

        Raises:
          ValueError: there is no such task.
        """
        named = (options or {}).get("task")
        if named is None:
            return None
        if isinstance(named, str):
            numbers = [k for k, t in enumerate(self._tasks) if t.id == named]
        else:
            numbers = [int(named)] if isinstance(named, (int, np.integer)) and 0 <= named < len(self._tasks) else []
        if not numbers:
            raise ValueError(
                f"there is no task {named!r:.80}; name one by its id, such as {self._tasks[0].id!r}, or by a number "
                f"from 0 to {len(self._tasks) - 1}"
            )
        return numbers[0]

    def step(self, action: int) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        before = self._env.potential() if self._shaping else 0.0
        try:
            o = self._env.step(decode(action, self.layout))
        except ActionError as e:
            if self._strict or self._env.ended is not None:
                raise
            self._invalid += 1
            if over := self._invalid >= self._patience:
                self._env.cut_short()
            info = {"invalid_action": str(e)} | self._words() | self._judged()
            return self._encoded(self.observed), -STEP_COST, False, over, info
        ended = self._env.ended
        info = self._judged()
        reward = self._env.reward(0.0 if ended is None else info["success"])
        if self._shaping:
            reward += before - self._env.potential()
        self.observed = o if o is not None else self.observed
        info |= self._env.facts() | self._words()
        return self._encoded(self.observed), float(reward), ended == "stop", ended == "limit", info

    def _picture(self) -> np.ndarray:
        """(544, 1120, 3) uint8: the agent's view, the plan with its path, and what was said."""
        return picture(self._env, self.observed)

    @property
    def task(self) -> Task:
        """The task that is being played. Privileged, like what follows: to judge and to look, not for a policy."""
        return self._env.task

    @property
    def pose(self) -> Pose:
        """Pose of the agent: node, turn and tilt."""
        return self._env.pose

    @property
    def world(self) -> Place:
        """The world that the task is played in: `world.house`, `world.graph`."""
        return self._env.world

    @property
    def house(self) -> House:
        """The house that the task is played in."""
        return self._env.world.house

    @property
    def room(self) -> str:
        """Id of the room that the agent is in."""
        return self._env.world.graph.room_of_node[self._env.pose.node]

    @property
    def classes(self) -> tuple[str, ...]:
        """The class of each instance id: `classes[i]` is what pixels with id i of observation["ids"] show."""
        return instance_classes(self.house)

    def _words(self) -> dict[str, Any]:
        o = self.observed
        words = lambda k: {"action": k, "heading": float(o.candidates.bearing[k]), "text": direction_of(o, k)}
        candidates = tuple(words(int(k)) for k in np.flatnonzero(o.candidates.allowed))
        return {"request": self._env.task.request, "instruction": o.instruction, "candidates": candidates}

    def _encoded(self, o: Observation) -> dict[str, Any]:
        return encode(o, self._sensor, self.layout)

    def _judged(self) -> dict[str, Any]:
        """Success and SPL, and once the episode has ended all metrics of every task."""
        env, graph = self._env, self._env.world.graph
        away = min(graph.distance[env.pose.node, g] for g in env.task.goal_nodes)
        own = kind_named(env.task.kind).success is not None
        if env.ended is None and (self._needs_stop or (away > env.task.radius + 1e-6 and not own)):  # cheaper to find
            return {"success": 0.0, "spl": 0.0, "is_success": False}
        episode, names = env.so_far(), ("success", "spl") if env.ended is None else PER_EPISODE
        measures: dict[str, Any] = {name.replace(" ", "_"): PER_EPISODE[name](episode, graph) for name in names}
        if self._needs_stop and not measures["strict_success"]:
            measures |= {"success": 0.0, "spl": 0.0}
        return measures | {"is_success": measures["success"] > 0}


def check_options(render_mode: str | None, *, patience: int = 1, **others: bool) -> None:
    """Refuse options of HelpGymEnv before anything is opened.

    Raises:
      ValueError: says which.
    """
    if render_mode not in (None, *LiveEnv.metadata["render_modes"]):
        raise ValueError(f"render_mode should be 'rgb_array' or None, got {render_mode!r}")
    if not isinstance(patience, (int, np.integer)) or patience < 1:
        raise ValueError(f"patience should be a whole number of at least 1, got {patience!r}")


def direction_of(o: Observation, candidate: int) -> str:
    """A candidate in words: 'turn 60 degrees left', or VNLA's own word for it."""
    if o.candidates.words:
        return o.candidates.words[candidate]
    return _direction(round(float(np.degrees(o.candidates.bearing[candidate])) / 10) * 10)


@functools.cache
def _direction(degrees: int) -> str:
    """In steps of ten degrees, left positive."""
    if not degrees:
        return "straight ahead"
    return "turn back" if abs(degrees) >= 170 else f"turn {abs(degrees)} degrees {'left' if degrees > 0 else 'right'}"


def picture(env: HelpEnv, o: Observation) -> np.ndarray:
    """The view along the agent's heading, the plan beside it, the words below."""
    nodes = [env.task.start.node, *(s.next_pose.node for s in env._steps)]
    seen = place_named(env.worlds, env.seen_from(env.pose.node)) if isinstance(env.world, World) else env.world
    view = _view(seen, env.pose)
    here = env.world.house.room_by_id[env.world.graph.room_of_node[nodes[-1]]].storey
    how: dict[str, Any] = {"path": tuple(nodes), "facing": env.pose.yaw, "titles": False, "storey": here}
    plan = paint_plan(env.world.house, pixels_per_metre=28, graph=env.world.graph, **how)
    plan = ImageOps.pad(plan.convert("RGB"), PLAN[::-1], Image.Resampling.LANCZOS, "white")
    sheet = Image.new("RGB", (view.width + plan.width, VIEW[0] + WORDS_HEIGHT), "white")
    sheet.paste(view, (0, 0))
    sheet.paste(plan, (view.width, 0))
    pen = ImageDraw.Draw(sheet)
    who = "assistant" if o.mode.value == "sub" else "task"
    lines = textwrap.wrap(f"{who}: {detokenized(o.instruction)}", sheet.width // 9)[:2]
    pen.text((10, VIEW[0] + 8), "\n".join(lines), font=font(16), fill="black")
    return np.asarray(sheet)


def _view(world: Place, pose: Pose) -> Image.Image:
    if not isinstance(world, World):
        blank = Image.new("RGB", (VIEW[1], VIEW[0]), "lightgray")
        ImageDraw.Draw(blank).text((20, 20), "no pictures of this house", font=font(18), fill="black")
        return blank
    return Image.fromarray(world.panorama(pose.node).view_rgb(pose.yaw, pose.pitch, VIEW_ANGLE, size=VIEW))


def make(kind: str, *, render_mode: str | None = None, **options: Any) -> HelpGymEnv:
    """The environment of a kind of task over a data set, or over one generated and lit flat without `data`.

    Args:
      options: fields of EnvironmentSettings (data, split, seed, observations, view, pictures, ...) and of HelpGymEnv
        (shaping, strict, patience, needs_stop).

    Examples:
      >>> env = embodied.make_env('hanna', data='data/hanna', observations='oracle')
      >>> _, info = env.reset(seed=0)
      >>> action = info['candidates'][0]['action']
      >>> _, reward, terminated, truncated, info = env.step(action)
    """
    own = {name: options.pop(name) for name in OWN if name in options}
    check_options(render_mode, **own)
    return HelpGymEnv(**open_resources(kind, **options), render_mode=render_mode, **own)


@dataclass(frozen=True, eq=False)
class EnvironmentSettings(PlaygroundSettings):
    """Houses, tasks, senses and rules of the environments of a kind of task."""

    data: str | Path | None = None
    """Folder that `embodied dataset` built; without it a flat is generated from `seed` and lit."""
    split: str = "train"
    seed: int = 0
    observations: str | Sequence[str] = ("rgb", "features")
    """Some of embodied.gym.sensors.OBSERVATIONS: 'rgb', 'depth', 'ids', 'features', 'oracle'."""
    view: sensors.ViewSettings = sensors.ViewSettings()
    """How pixels are framed."""
    source: FeatureSource | None = None
    """The features; those of the installed default encoder where not given."""
    layout: SpaceLayout | None = None


def open_resources(kind: str, **settings: Any) -> dict[str, Any]:
    """Everything that environments of one batch share, as arguments of HelpGymEnv: houses, tasks, assistants, decoded
    panoramas; `settings` are fields of EnvironmentSettings.

    Raises:
      ValueError: unknown `observations`, or pixels where there are none.
    """
    wanted = EnvironmentSettings(**settings)
    checked_seed(wanted.seed)
    sensors.checked_observations(wanted.observations)
    data = wanted.data and Path(wanted.data)
    play = split_playground(kind, data, wanted.split, wanted) if data else flat_playground(kind, wanted.seed, wanted)
    layout = wanted.layout or SpaceLayout.of(kind_named(kind), wanted.rules)
    opened = () if wanted.worlds is not None else [w for w in play.worlds.values() if isinstance(w, World)]
    how = {"sensor": _sensor_of(play, wanted), "layout": layout, "opened": opened}
    return {"make_env": play.make_env, "tasks": play.tasks, **how}


def _sensor_of(play: Playground, wanted: EnvironmentSettings) -> sensors.Sensor:
    """Everything that is seen, over one store of decoded panoramas.

    Raises:
      ValueError: pixels are asked of places that nobody can draw.
    """
    parts: list[sensors.Sensor] = []
    seen = wanted.seen
    drawn = {name: w for name, w in play.worlds.items() if isinstance(w, World)}
    store, pixels = sensors.PanoramaStore(drawn), [name for name in sensors.PIXELS if name in seen]
    blind = sorted(set(play.worlds) - set(drawn))
    if blind and (pixels or ("features" in seen and wanted.source is None)):
        raise ValueError(
            f"there are no pictures of {blind[:3]}: only an embodied.World can be seen; choose observations='oracle'"
        )
    if pixels:
        parts.append(sensors.CameraSensor(store, pixels, wanted.view))
    if "features" in seen:
        source = wanted.source if wanted.source is not None else sensors.encoder_entry().load()(store)
        parts.append(sensors.FeatureSensor("features", source))
    if "oracle" in seen:
        parts.append(sensors.FeatureSensor("oracle", OracleFeatures(play.features, drawn)))
    return sensors.SensorSuite(parts)


class OracleFeatures:
    """A FeatureSource of the semantic features of some worlds; with other doors, made when they are first asked for."""

    def __init__(self, known: Mapping[str, np.ndarray], worlds: Mapping[str, World]) -> None:
        self._known, self._worlds, self.size = dict(known), worlds, next(iter(known.values())).shape[2]

    def features(self, sight: Sight) -> np.ndarray:
        """(36, D) float32, read-only by convention; raises KeyError for a place of another world."""
        at = viewpoint(sight)
        if at.world not in self._known:
            world = place_named(self._worlds, at.world)
            self._known[at.world] = seen_features(world, world.catalogue, world.cache)
        return self._known[at.world][at.node]

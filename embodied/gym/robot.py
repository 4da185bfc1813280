"""embodied/Robot-v0: a robot of any MJCF in lit houses, that reaches, finds, opens, picks up and brings things.

    env = gymnasium.make("embodied/Robot-v0", task="pick", robot="panda.xml", hand="gripper", data="DIR")

An action is the velocities of a rolling base and the arm's actuators ("base"), or all actuators, from -1 to 1; with
assisted grasps its last number, above 0.5, closes the hand.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from gymnasium import spaces

from embodied.envs.driven import FETCHER, RobotBody
from embodied.gym.drive import chosen_worlds
from embodied.gym.driving import POINTS, TEXT
from embodied.gym.env import VIEW, LiveEnv
from embodied.gym.sensors import LARGE, PIXELS, check_live, live_pixels, photographed, pixel_spaces
from embodied.gym.spaces import codes_of
from embodied.kinds.plugins import Registry
from embodied.navigation.floor_ways import FloorWays
from embodied.render.camera import camera_of
from embodied.render.photograph import check_camera
from embodied.scene.doors import openness
from embodied.scene.robots import place
from embodied.seeds import checked_seed
from embodied.tasks.ask import look_of
from embodied.world import SLACK, World, scene_spec

CONTROL, FASTEST_BASE = 0.1, (0.6, 0.6, 1.5)
"""Seconds that an action is held; metres and radians per second, ahead, to the left and around."""
NEAR, RAISED, FALLS, HIGHEST, OPENED, SHUT = 1.0, 0.05, 0.2, 1.4, 0.5, 0.1
"""Metres at which a thing is found, by which it is picked up, by which something fell, and above the floor at most of
what is wanted; openness from which something is open, and below which it is shut."""

ROBOSUITE_PIXELS = dict(zip(PIXELS, ("image", "depth", "segmentation_instance"), strict=True))


@dataclass(frozen=True)
class RobotSettings:
    """Robot, task, observations and end of an episode."""

    robot: str | Path | mujoco.MjSpec = FETCHER
    hand: str = "grip"
    """The robot, as of embodied.place, and its site or body with which it takes hold."""
    task: str = "pick"
    """A registered RobotTask: 'reach', 'find', 'open', 'pick', 'bring', or 'module:NAME' of your own."""
    actions: str = "base"
    """'base' or 'actuators'."""
    grasp: str = "assisted"
    """'contact': by the fingers' friction alone; 'assisted': a closed hand holds what is within 15 cm, as Habitat's."""
    cameras: tuple[str, ...] = ("head",)
    observations: tuple[str, ...] = ("rgb",)
    """Cameras of the robot's file, and some of embodied.gym.sensors.PIXELS of each; nothing for a blind robot."""
    size: tuple[int, int] = (128, 128)
    """Height and width, pixels."""
    names: str = "embodied"
    """'robosuite': robot0_joint_pos, robot0_eef_pos, agentview_image, ... instead of proprio and head_rgb."""
    camera: str = "ideal"
    device: int = 0
    """The kind of camera and which device of that kind, as of ViewSettings: lens, exposure and noise."""
    shadows: bool = True
    """Without, the robot is lit and throws no shadow in its pictures, which takes a third less time."""
    breaks: float = 100.0
    """Newtons with which the robot touches a thing that counts as broken from then on: info["broken"]."""
    seconds: float = 180.0
    """After which an episode is cut short, in the simulated world."""

    def __post_init__(self) -> None:
        check_live(self.observations, PIXELS, *self.size)
        check_camera(self.camera)
        robot_task(self.task)
        known = {"actions": ("base", "actuators"), "grasp": ("contact", "assisted"), "names": ("embodied", "robosuite")}
        for name, values in known.items():
            if getattr(self, name) not in values:
                raise ValueError(f"{name} is {getattr(self, name)!r}; use one of {values}")


@dataclass(frozen=True)
class RobotGoal:
    """Something to do in a house: with a thing, by placement id, or with a part that opens; '' for neither."""

    request: str
    thing: str
    part: str
    cells: np.ndarray
    """(n,) of the floor, near it."""


@dataclass(frozen=True)
class RobotTask:
    """A task of Robot-v0; yours is registered with `register_robot_task` under the name 'module:NAME'."""

    name: str
    words: str
    """Of a request; {} is the thing."""
    goals: Callable[[Any, np.random.Generator], RobotGoal | None]
    """(env, rng) -> a goal; None where the one that was drawn cannot be had."""
    succeeded: Callable[[Any], bool]
    """Of the env."""
    env: Callable[..., RobotEnv] | None = None
    """Its environment; RobotEnv where not given."""


ROBOT_TASKS = Registry(RobotTask, "embodied.gym", lambda: ("bring",))
register_robot_task, robot_task = ROBOT_TASKS.add, ROBOT_TASKS.named
"""Make a task known; and the task of a name."""


class RobotEnv(LiveEnv):
    """Errands of a robot as a Gymnasium environment.

    Reward: 1 on success, minus 0.001 an action. info: success, is_success, spl, metres, seconds, contacts (owners
    touched), force (the largest, N), fallen and broken (things), openness, grasp, held.
    """

    spoken: tuple[str, ...] = ()
    """Names of further numbers of an action, for subclasses."""
    text = TEXT
    """Characters of an instruction."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(self, worlds: Mapping[str, World], settings: RobotSettings, render_mode: str | None = None) -> None:
        super().__init__(render_mode, worlds.values())
        self.worlds, self.settings, self.task = dict(worlds), settings, robot_task(settings.task)
        self._bodies: dict[str, tuple[RobotBody, FloorWays]] = {}
        self._enter(min(self.worlds))
        body, model = self.body, self.body.model
        limits, limited = model.actuator_ctrlrange[body.arm], model.actuator_ctrllimited[body.arm].astype(bool)
        self.middle, self.half = np.where(limited, limits.mean(1), 0.0), np.where(limited, np.ptp(limits, 1) / 2, 1.0)
        rolling = ("ahead", "left", "turn") if settings.actions == "base" else ()
        hand = ("hold",) if settings.grasp == "assisted" else ()
        arm = (model.actuator(k).name for k in body.arm)
        self.commands = (*rolling, *arm, *hand, *self.spoken)  # an action's numbers
        self.action_space = spaces.Box(-1.0, 1.0, (len(self.commands),), np.float32)
        pixels = pixel_spaces(settings.size, settings.observations)
        seen = {self._picture_name(c, name): space for c in settings.cameras for name, space in pixels.items()}
        seen |= {name: spaces.Box(-LARGE, LARGE, value.shape, np.float32) for name, value in self._feels().items()}
        self.observation_space = spaces.Dict({**seen, "instruction": spaces.Box(0, 255, (self.text,), np.uint8)})

    def _enter(self, name: str) -> None:
        self.world, s = self.worlds[name], self.settings
        if name not in self._bodies:
            spec = scene_spec(self.world, None)
            placed = place(spec, s.robot, rolling=s.actions == "base")
            body = RobotBody(self.world.house, spec, placed, hand=s.hand, assisted=s.grasp == "assisted")
            self._bodies[name] = body, FloorWays(self.world.house, stairs=False)
        self.body, self.ground = self._bodies[name]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """A start and a goal drawn with this environment's generator; options["world"] chooses the house by name."""
        super().reset(seed=None if seed is None else checked_seed(seed))
        names, rng = sorted(self.worlds), self.np_random
        name = (options or {}).get("world") or names[int(rng.integers(len(names)))]
        if name not in self.worlds:
            raise ValueError(f"there is no house {name!r:.80}; choose one of {names[:8]}")
        self._enter(name)
        self.body.reset()
        self.time, self.ended, self.succeeded = 0.0, False, False
        start = self._begin(rng)
        self.body.stand(self.ground.xy[start], float(rng.uniform(-math.pi, math.pi)))
        self.body.step(0.4)
        self.body.metres, self._fallen, self._broken = 0.0, set[str](), set[str]()
        self.heights = {i: float(self.body.thing(i)[2]) for i in self.body.things}
        self._lowest = np.array([*self.heights.values()]) - FALLS
        return self._look(), {"world": name, **self._facts()}

    def _begin(self, rng: np.random.Generator) -> int:
        """Draw the goal; returns the cell at which the robot starts."""
        for _ in range(POINTS):
            start = int(rng.choice(np.flatnonzero(self.ground.room_of_cell != "")))
            goal = self.task.goals(self, rng)
            if goal is not None and len(goal.cells):
                self.goal, self.shortest = goal, max(float(self.ground.ways(goal.cells).metres[start]), 1e-9)
                return start
        raise ValueError(f"house {self.world.name!r} has no goal for {self.settings.task!r}; choose another house")

    def step(self, action: np.ndarray) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        a, body = np.asarray(action, float).reshape(-1), self.body
        if a.shape != self.action_space.shape or not np.isfinite(a).all():
            raise ValueError(f"an action should be {len(self.commands)} finite numbers from -1 to 1, got {action!r}")
        if self.ended:
            raise RuntimeError("the episode is over; reset before another step")
        named = dict(zip(self.commands, np.clip(a, -1.0, 1.0), strict=True))
        price, rolls = self._spoke(named), 3 * (self.settings.actions == "base")
        body.rolling = np.array([*named.values()][:rolls] or [0.0] * 3) * FASTEST_BASE
        body.data.ctrl[body.arm] = self.middle + self.half * [*named.values()][rolls : rolls + len(body.arm)]
        body.step(CONTROL, holding=named.get("hold", 0.0) > 0.5)
        self.time += CONTROL
        low = body.data.xipos[[*body.things.values()], 2] < self._lowest
        self._fallen |= {i for i, down in zip(body.things, low) if down and i != body.held}
        self._broken |= {i for i, force in body.met.items() if i in body.things and force > self.settings.breaks}
        self.succeeded = self.task.succeeded(self)
        late = self.time >= self.settings.seconds - 1e-9 and not self.succeeded
        self.ended = self.succeeded or late
        return self._look(), float(self.succeeded) - 0.001 - price, self.succeeded, late, self._facts()

    def _spoke(self, named: Mapping[str, float]) -> float:
        """Do what the numbers of `spoken` say, before the rest of an action; returns the price."""
        return 0.0

    def _facts(self) -> dict[str, Any]:
        body, success = self.body, float(self.succeeded)
        facts: dict[str, Any] = {
            "request": self.goal.request,
            "success": success,
            "is_success": self.succeeded,
            "metres": body.metres,
            "seconds": self.time,
        }
        facts |= {"spl": success * self.shortest / max(body.metres, self.shortest), "held": body.held or ""}
        facts |= {"contacts": tuple(sorted(body.met)), "force": max(body.met.values(), default=0.0)}
        facts |= {"fallen": tuple(sorted(self._fallen)), "broken": tuple(sorted(self._broken))}
        return {**facts, "grasp": self.settings.grasp, "openness": self.openness}

    @property
    def openness(self) -> dict[str, float]:
        """How far doors and furniture are open, 0 to 1, as World.openable names them."""
        return openness(self.body.model, self.body.data)

    def _look(self) -> dict[str, Any]:
        s, seen = self.settings, dict[str, Any]()
        if s.observations and self.world.pictures.quality is not None:
            self.world.follow(self.body.model, self.body.data, slack=3 * SLACK, shadows=s.shadows)
        for name in s.cameras if s.observations else ():
            camera = camera_of(self.body.model, self.body.data, f"robot/{name}")
            pixels = live_pixels(self.world, camera, s.size, s.observations)
            moment = [round(1000 * x) for x in (self.time, *camera.position)]
            pixels = photographed(self.world, camera, pixels, s.camera, s.device, self.world.name, name, *moment)
            seen |= {self._picture_name(name, k): v for k, v in pixels.items()}
        return {**seen, **self._feels(), "instruction": codes_of(self.heard, self.text).copy()}

    def _feels(self) -> dict[str, np.ndarray]:
        return self.body.robosuite() if self.settings.names == "robosuite" else {"proprio": self.body.proprioception()}

    def _picture_name(self, camera: str, channel: str) -> str:
        if self.settings.names != "robosuite":
            return f"{camera}_{channel}"
        others = {"hand": "robot0_eye_in_hand", self.settings.cameras[0]: "agentview"}
        return f"{others.get(camera, camera)}_{ROBOSUITE_PIXELS[channel]}"

    @property
    def heard(self) -> str:
        """The request, for subclasses with what was said since."""
        return self.goal.request

    def _picture(self) -> np.ndarray:
        camera = camera_of(self.body.model, self.body.data, f"robot/{self.settings.cameras[0]}")
        return self.world.renderer.rgb(camera, VIEW)

    def cells_near(self, point: np.ndarray | tuple[float, ...], room: str) -> np.ndarray:
        """(n,) cells of a room within NEAR of a point."""
        close = np.linalg.norm(self.ground.xy - point[:2], axis=1) <= NEAR
        return np.flatnonzero(close & (self.ground.room_of_cell == room))


def some_thing(env: RobotEnv, rng: np.random.Generator) -> RobotGoal | None:
    """Something that a hand can take."""
    of, names = env.world.house.placement_by_id, sorted(env.body.things)
    if not names or (p := of[names[int(rng.integers(len(names)))]]).position[2] > HIGHEST:
        return None
    name = " ".join([*look_of(env.world.catalogue)(p)[:1], p.object_class])
    request = env.task.words.format(name)[:TEXT]
    return RobotGoal(request, p.id, "", env.cells_near(p.position, p.room))


def shut_parts(env: RobotEnv) -> list[str]:
    """Doors and drawers of furniture that are shut, with handles that a hand can reach."""
    handles = {name: env.body.data.xipos[b][2] for name, b in env.body.handles.items()}
    shut = (n for n, x in env.openness.items() if "/" in n and x < SHUT)
    return sorted(n for n in shut if 0.15 <= handles[n.replace("/", "_")] <= HIGHEST and not n.endswith("lid"))


def some_part(env: RobotEnv, rng: np.random.Generator) -> RobotGoal | None:
    """Something shut."""
    if not (parts := shut_parts(env)):
        return None
    part = parts[int(rng.integers(len(parts)))]
    p, name = env.world.house.placement_by_id[part.partition("/")[0]], part.partition("/")[2].replace("_", " ")
    return RobotGoal(f"open the {name} of the {p.object_class}"[:TEXT], "", part, env.cells_near(p.position, p.room))


def picked(env: RobotEnv) -> bool:
    """True where the thing is raised and touches the robot."""
    name = env.goal.thing
    return bool(env.body.thing(name)[2] > env.heights[name] + RAISED) and name in (env.body.held, *env.body.met)


for _task in (
    RobotTask("reach", "touch the {}", some_thing, lambda env: env.goal.thing in (env.body.held, *env.body.met)),
    RobotTask("find", "go to the {}", some_thing, lambda env: env.ground.cell_at(env.body.position) in env.goal.cells),
    RobotTask("open", "open the {}", some_part, lambda env: env.openness[env.goal.part] >= OPENED),
    RobotTask("pick", "pick up the {}", some_thing, picked),
):
    register_robot_task(_task)


def make(*, render_mode: str | None = None, **options: Any) -> RobotEnv:
    """The environment; options as of `chosen_worlds`, and fields of RobotSettings."""
    worlds, others = chosen_worlds(**options)
    settings = RobotSettings(**others)
    return (robot_task(settings.task).env or RobotEnv)(worlds, settings, render_mode)

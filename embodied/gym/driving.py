"""Driving: a body on wheels in a lit house, driven by velocities, that sees what its camera sees at every command.

The rules behind embodied/Drive-v0 (embodied.gym.drive).
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces

from embodied.assistants.descriptions import word_number
from embodied.envs.continuous import PERSONAL
from embodied.envs.driven import CONTROL, FASTEST, TURNING, Driver
from embodied.geometry import wrap
from embodied.gym.sensors import LARGE, PIXELS, among, check_live, live_pixels
from embodied.gym.spaces import codes_of
from embodied.interface import SuccessRule, Trajectory
from embodied.kinds.plugins import Registry
from embodied.language.plain_language import with_article
from embodied.navigation.floor_ways import DrivingWays, FloorWays
from embodied.navigation.free_space import EYE
from embodied.people.errands import Walks
from embodied.people.strolls import Crowd, draw_strolls, walks_of, who_is_about
from embodied.render.camera import Camera, camera_at
from embodied.scene.doors import openness
from embodied.seeds import stream
from embodied.tasks.goals import NOT_OBJECTS, footprint_distance

if TYPE_CHECKING:
    from embodied.world import World

TEXT = 80
"""Most characters of a request."""
STEP_COST, COLLISION_COST, PER_METRE = 0.01, 0.05, 0.1
"""Of every command, of every collision; and what a metre nearer to the goal is worth."""
KEPT = 4
"""Houses whose physics and pictures are held ready, the last used."""
AHEAD = 3
"""Cells of its way that a guide looks ahead: 30 cm."""
POINTS = 50
"""Goals that are tried before a house counts as too small."""
SAID = 0.5
"""Above this the third number of an action says 'here it is'."""


@dataclass(frozen=True)
class DriveSettings:
    """Task, observations and end of an episode."""

    task: str = "reach"
    """A registered DrivenTask: 'reach', 'find', or 'module:NAME' of your own."""
    observations: tuple[str, ...] = ("rgb", "depth")
    """Some of embodied.gym.sensors.PIXELS; nothing for a blind body."""
    height: int = 128
    width: int = 128
    """Pixels."""
    vfov: float = math.radians(78.0)
    """Vertical field of view, radians."""
    control: float = 0.1
    """Seconds that a command is held."""
    seconds: float = 40.0
    """After which an episode is cut short, in the simulated world."""
    nearest: float = 1.5
    farthest: float = 8.0
    """Metres to drive from a start to its goal."""
    reached: float = 0.3
    """A point is reached within this many metres."""
    found: float = 1.0
    """An object is found within this many metres of its outline, in its room."""
    people: int = 0
    """Most people who walk about, at least one unless it is 0; touching somebody ends an episode."""
    polite: bool = True
    """They stand while the body is close before them, and then walk around it; otherwise they only look at it."""

    def __post_init__(self) -> None:
        driven_task(self.task)
        check_live(self.observations, PIXELS, self.height, self.width)
        if not 0 < self.vfov < math.pi:
            raise ValueError(f"vfov is {self.vfov} radians; a picture needs more than 0 and less than pi")
        if not (self.control >= CONTROL and self.seconds >= self.control and 0 <= self.nearest < self.farthest):
            raise ValueError(
                f"control is {self.control} s of {self.seconds} s, goals are {self.nearest} to {self.farthest} m away; "
                f"control needs at least {CONTROL} s, and the first of each pair to be the smaller"
            )

    @property
    def numbers(self) -> int:
        """Of an action: ahead, left, and for some tasks whether it is here; each from -1 to 1."""
        return 3 if driven_task(self.task).says else 2


@dataclass(frozen=True)
class DriveGoal:
    """Something to drive to in a house."""

    request: str
    cells: np.ndarray
    """(n,) of the floor, to which one drives."""
    radius: float = 0.0
    """Metres of `DrivenTask.distance` at which it is reached."""
    object_class: str = ""


@dataclass(frozen=True)
class DrivenTask:
    """A task of Drive-v0; yours is registered with `register_driven` under the name 'module:NAME'."""

    name: str
    goals: Callable[[World, FloorWays, DriveSettings, np.random.Generator], Iterator[DriveGoal]]
    """Drawn one by one, until one can be driven to."""
    distance: Callable[[Driving], float]
    """Metres to the goal from where the body is."""
    says: bool
    """The agent ends an episode by a third number of its action, that it is here; else arriving ends it."""
    extra_spaces: Mapping[str, Any]
    """The Boxes of what the observation adds, by name."""
    observation: Callable[[Driving], dict[str, np.ndarray]]


DRIVEN_TASKS = Registry(DrivenTask)
register_driven, driven_task = DRIVEN_TASKS.add, DRIVEN_TASKS.named
"""Make a task known; and the task of a name."""


class Driving:
    """Owns the physics and the pictures of some houses, and plays one episode at a time."""

    def __init__(self, worlds: Mapping[str, World], settings: DriveSettings) -> None:
        """
        Args:
          worlds: by House.name, lit or not; what draws them is opened when an episode plays there.

        Raises:
          ValueError: no worlds.
        """
        if not worlds:
            raise ValueError("there are no houses to drive in; choose another split")
        self.worlds, self.settings = dict(worlds), settings
        self._names = sorted(self.worlds)
        self._stages: OrderedDict[str, tuple[Driver, FloorWays, Walks | None, list[str]]] = OrderedDict()
        self.task = driven_task(settings.task)

    def reset(self, rng: np.random.Generator, world: str | None = None) -> None:
        """Put the body somewhere with something to do.

        Raises:
          KeyError: no such world.
          ValueError: the house has no goal as far away as the settings want.
        """
        name = self._names[int(rng.integers(len(self._names)))] if world is None else world
        self.world = self.worlds[name]
        if name not in self._stages:
            house = self.world.house
            who = who_is_about(house, self.settings.people, rng=stream(0, "visitors", name))
            walks = walks_of(house) if who else None
            driver = Driver(house, self.world.catalogue, who, [s.door for s in walks.swings] if walks else ())
            self._stages[name] = driver, FloorWays(house, stairs=False), walks, who
        self._stages.move_to_end(name)
        if len(self._stages) > KEPT:
            self.worlds[self._stages.popitem(last=False)[0]].close()
        self.driver, self._ground, walks, who = self._stages[name]
        start = self._draw(rng)
        x, y = self._ground.xy[start]
        height = self.world.house.storeys[0].elevation + EYE
        self.driver.place(np.array([x, y, height]), float(rng.uniform(-math.pi, math.pi)))
        self.shortest = max(self._ways.length(start) - self.goal.radius, 0.0)
        """Metres that the best driver needs."""
        self._left = self.left
        self.metres = self.seconds = 0.0
        self._distances, self._lengths = [self.task.distance(self)], [0.0]
        self.collisions: list[str] = []
        self.touched, self.respectful = False, list[bool]()
        about = [str(p) for p in rng.permutation(who)[: rng.integers(1, len(who) + 1)]] if who else []
        strolls = draw_strolls(walks, about, self._here, rng=rng) if walks else ()
        self.crowd = Crowd(strolls, walks, polite=self.settings.polite)
        self.driver.stand(self.crowd.moment)
        self.ended: str | None = None
        """'reached', 'said', 'contact' or 'limit'; None while it goes on."""
        self._wide: DrivingWays | None = None

    def step(self, action: Sequence[float] | np.ndarray) -> tuple[float, dict[str, float]]:
        """Hold a command: `settings.numbers` numbers from -1 to 1.

        Returns:
          The reward; and success, spl (as 4.17, of metres; docs/sources.md, S125), collisions, metres, seconds and
          distance_to_goal, since the episode began.

        Raises:
          ValueError: another number of numbers, or something that is none.
          RuntimeError: the episode is over.
        """
        command = np.asarray(action, dtype=np.float64).reshape(-1)
        if len(command) != self.settings.numbers or not np.isfinite(command).all():
            raise ValueError(f"an action should be {self.settings.numbers} finite numbers from -1 to 1, got {action!r}")
        if self.ended is not None:
            raise RuntimeError(f"the episode is over ({self.ended}); reset before another step")
        command = np.clip(command, -1.0, 1.0)
        periods = max(1, round(self.settings.control / CONTROL))
        self.crowd.go_on(periods * CONTROL, self._here, self._here)
        moment = self.crowd.moment
        rolled = self.driver.roll(FASTEST * command[0], TURNING * command[1], periods, moment)
        self.metres += rolled.metres
        self.seconds += periods * CONTROL
        self.collisions += rolled.collisions
        self.touched = rolled.touched
        before, self._left = self._left, self.left
        self._distances.append(self.task.distance(self))
        self._lengths.append(self.metres)
        apart, there = np.linalg.norm(self.crowd.places[:, :3] - self._here, axis=1), self.is_there
        self.respectful.append(bool((apart >= PERSONAL).all()))
        if contact := not moment.people.keys().isdisjoint(rolled.collisions):
            self.ended = "contact"
        elif command[2] > SAID if self.task.says else there:
            self.ended = "said" if self.task.says else "reached"
        elif self.seconds >= self.settings.seconds - 1e-9:
            self.ended = "limit"
        trajectory, price = self.trajectory(), STEP_COST + COLLISION_COST * len(rolled.collisions) + contact
        reward = trajectory.success - price + PER_METRE * (before - self._left)
        facts = {"success": trajectory.success, "spl": trajectory.spl}
        facts |= {"collisions": float(len(self.collisions)), "metres": self.metres, "seconds": self.seconds}
        if self.settings.people:
            facts |= {"human_collision": float(contact), "psc": float(np.mean(self.respectful))}
        return reward, {**facts, "distance_to_goal": self._left}

    def trajectory(self) -> Trajectory:
        """The way since the last reset, as it is judged."""
        rule, stopped = SuccessRule(self.goal.radius), self.ended in ("reached", "said")
        distances, lengths = np.array(self._distances), np.array(self._lengths)
        return Trajectory(rule=rule, distances=distances, lengths=lengths, shortest=self.shortest, stopped=stopped)

    @property
    def _here(self) -> np.ndarray:
        """(3,) the body's centre on the floor, metres, world."""
        return np.append(self.driver.position, self.world.house.storeys[0].elevation)

    @property
    def left(self) -> float:
        """Metres to drive to the nearest goal from here, over the grid."""
        return float(self._ways.metres[self._ground.cell_at(self.driver.position)])

    @property
    def is_there(self) -> bool:
        """True where the body should be, said or not."""
        return bool(SuccessRule(self.goal.radius).near(self.task.distance(self)))

    @property
    def offset(self) -> np.ndarray:
        """(2,) metres from the body to the first cell of the goal, world."""
        return self._ground.xy[self.goal.cells[0]] - self.driver.position

    def way(self) -> np.ndarray:
        """(n, 2) cells of a way to the goal that keeps away from things; for teachers, never for a policy."""
        self._wide = self._wide or self._ground.wide_ways(self.goal.cells)
        return self._ground.xy[self._wide.cells(self._ground.cell_at(self.driver.position))]

    def look(self) -> dict[str, np.ndarray]:
        """The observation: pixels, motion, touch and goal."""
        s = self.settings
        motion, touched = np.array(self.driver.motion, np.float32), np.array([self.touched], np.float32)
        pixels = live_pixels(self.seen, self.camera(), (s.height, s.width), s.observations, self.crowd.places)
        return {**pixels, "motion": motion, "touched": touched, **self.task.observation(self)}

    @property
    def seen(self) -> World:
        """The house with the doors that were pushed, to a tenth, and the people."""
        driver = self.driver
        ways = {d: round(x, 1) for d, x in openness(driver.model, driver.data).items()}
        return among(self.world, self.crowd, ways)

    def camera(self) -> Camera:
        """The body's eye as it is now, upright."""
        position, axes = self.driver.eye
        x, y, z = (float(v) for v in -axes[:, 2])
        return camera_at(position, math.atan2(y, x), math.asin(max(-1.0, min(1.0, z))), self.settings.vfov)

    def _draw(self, rng: np.random.Generator) -> int:
        """Choose goal and start, and the ways between; returns the start's cell."""
        s = self.settings
        for goal in self.task.goals(self.world, self._ground, s, rng):
            self.goal, self._ways = goal, self._ground.ways(goal.cells)
            far = self._ways.metres
            if len(starts := np.flatnonzero((far >= s.nearest) & (far <= s.farthest))):
                return int(rng.choice(starts))
        raise ValueError(
            f"house {self.world.name!r} has no goal for {s.task!r} that is {s.nearest} to {s.farthest} m to drive "
            "away; choose other distances"
        )


def points(world: World, ground: FloorWays, settings: DriveSettings, rng: np.random.Generator) -> Iterator[DriveGoal]:
    for cell in rng.integers(len(ground.xy), size=POINTS):
        yield DriveGoal("go there", np.array([cell]), settings.reached)


def direction(driving: Driving) -> dict[str, np.ndarray]:
    """'goal': metres as the crow flies, sine and cosine of where, left positive."""
    offset = driving.offset
    aside = float(wrap(math.atan2(offset[1], offset[0]) - driving.driver.yaw))
    return {"goal": np.array([np.linalg.norm(offset), math.sin(aside), math.cos(aside)], np.float32)}


def objects(world: World, ground: FloorWays, settings: DriveSettings, rng: np.random.Generator) -> Iterator[DriveGoal]:
    """Cells near all objects of a class, in their rooms; class by class in a drawn order."""
    things = world.house.placements
    classes = sorted({p.object_class for p in things} - NOT_OBJECTS)
    for k in rng.permutation(len(classes)):
        near = np.zeros(len(ground.xy), bool)
        for p in things:
            if p.object_class == classes[k]:
                near |= (footprint_distance(p, ground.xy) <= settings.found) & (ground.room_of_cell == p.room)
        if near.any():
            request = f"find {with_article(classes[k])}"[:TEXT]
            yield DriveGoal(request, np.flatnonzero(near), object_class=classes[k])


def wanted(driving: Driving) -> dict[str, np.ndarray]:
    """'object', its class as a word's number, and 'instruction', the request."""
    number = np.array([word_number(driving.goal.object_class)], np.float32)
    return {"object": number, "instruction": codes_of(driving.goal.request, TEXT).copy()}


GOAL_SPACES = {"goal": spaces.Box(np.array([0, -1, -1], np.float32), np.array([LARGE, 1, 1], np.float32))}
CLASS_SPACES = {"object": spaces.Box(0.0, LARGE, (1,)), "instruction": spaces.Box(0, 255, (TEXT,), np.uint8)}
"""Spaces of `direction` and `wanted`."""
register_driven(DrivenTask("reach", points, lambda d: float(np.linalg.norm(d.offset)), False, GOAL_SPACES, direction))
register_driven(DrivenTask("find", objects, lambda d: d.left, True, CLASS_SPACES, wanted))


def expert_action(driving: Driving) -> np.ndarray:
    """The command of somebody who knows the house and the goal: along a wide way, and 'here' when it is."""
    way, here = driving.way(), driving.driver.position
    to = way[min(AHEAD, len(way) - 1)] - here
    error = float(wrap(math.atan2(to[1], to[0]) - driving.driver.yaw))
    ahead = 0.0 if abs(error) > 0.4 else min(1.0, 0.2 + float(np.linalg.norm(way[-1] - here))) * math.cos(error) ** 4
    command = [ahead, float(np.clip(2.0 * error, -1.0, 1.0)), float(driving.is_there)]
    return np.array(command[: driving.settings.numbers], np.float32)

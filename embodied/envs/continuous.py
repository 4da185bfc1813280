"""Continuous navigation: a body that goes a step ahead, turns, looks up and down, and stops (VLN-CE, ObjectNav).

The rules are those of Habitat's tasks (Savva et al. 2019; Krantz et al. 2020): a step is straight, a body that touches
something stays or slides along it, an episode ends when the agent stops or after 500 actions. Where the body can be is
the floor of embodied.navigation.floor_ways. Nothing is drawn here; embodied.gym.continuous does that.
"""

import enum
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from embodied.house.house import House
from embodied.interface import Place, SuccessRule, Trajectory
from embodied.navigation.floor_ways import DrivingWays, FloorWays
from embodied.navigation.free_space import ajar_doors
from embodied.navigation.graph import AGENT_RADIUS
from embodied.people.strolls import PERSON_RADIUS, Crowd, Stroll, walks_of
from embodied.tasks.goals import NOT_OBJECTS, footprint_distance

PERSONAL, CONTACT, TIMELY = 1.0, AGENT_RADIUS + PERSON_RADIUS, 0.025
"""Metres between the middles of a person and the body that are respectful, and at which they touch; metres an action of
the fastest way, which STL compares with (Falcon, Gong et al. 2024)."""
FOLLOWS, FACING, FOLLOWED = (1.0, 2.0), 0.5, 400 / 1500
"""Metres from a person, cosine from straight ahead, and share of the steps of an episode that are following, as in
Habitat 3 (Puig et al. 2023)."""
PACE, SPIN = 1.0, 2.5
"""Metres a second of a step, and radians a second of a turn: how long they take where people walk."""
COLLIDED = 1e-3
"""A step that falls short by more than this, metres, is a collision."""
PUSHED = 0.6
"""Metres from the middle of a door that stands ajar at which a body has pushed it open."""
STEEPEST = 60
"""Most degrees that the camera is tilted up or down."""
Point = tuple[float, float, float]


class HabitatAction(enum.IntEnum):
    """Habitat's actions, by number."""

    STOP = 0
    FORWARD = 1
    LEFT = 2
    RIGHT = 3
    UP = 4
    DOWN = 5


@dataclass(frozen=True)
class Body:
    """How an agent moves and sees."""

    forward: float = 0.25
    """Metres of a step."""
    turn: int = 15
    """Degrees of a turn, which divide 360."""
    tilt: int = 30
    """Degrees of a look up or down."""
    looks: bool = False
    """It can look up and down."""
    sliding: bool = True
    """It slides along walls and things; otherwise it stops at them."""
    steps: int = 500
    """Most actions of an episode, STOP included."""
    eye: float = 1.25
    """Height of the camera above the floor, metres."""
    pitch: float = 0.0
    """Degrees that a level camera is mounted above the horizon."""
    polite: bool = False
    """People stand while the body is close before them, and then walk around it; otherwise they only look at it."""

    def __post_init__(self) -> None:
        if not (0 < self.forward <= 1 and 0 < self.turn <= 90 and 360 % self.turn == 0 and self.steps >= 1):
            raise ValueError(
                f"steps of {self.forward} m and turns of {self.turn} degrees, {self.steps} actions; expected "
                "up to 1 m, degrees that divide 360, and at least one action"
            )
        if not (0.1 <= self.eye <= 2.5 and abs(self.pitch) <= STEEPEST and 0 < self.tilt <= STEEPEST):
            raise ValueError(
                f"a camera {self.eye} m high, mounted at {self.pitch} degrees, tilted by {self.tilt}; expected 0.1 to "
                f"2.5 m and up to {STEEPEST} degrees"
            )

    @property
    def actions(self) -> int:
        return 6 if self.looks else 4


@dataclass(frozen=True)
class CameraConfig:
    """How the pictures that it sees are framed."""

    height: int = 256
    """Pixels."""
    width: int = 256
    hfov: float = 90.0
    """Horizontal field of view, degrees."""

    def __post_init__(self) -> None:
        if not 0 < self.hfov < 180:
            raise ValueError(f"hfov is {self.hfov} degrees; a picture needs more than 0 and less than 180")

    @property
    def vfov(self) -> float:
        """Vertical field of view, radians."""
        return 2 * math.atan(math.tan(math.radians(self.hfov) / 2) * self.height / self.width)


@dataclass(frozen=True)
class NavigationGoal:
    """One place that satisfies an episode."""

    position: Point
    """On the floor, metres, world; of an object, its own position."""
    views: tuple[Point, ...] = ()
    """Viewpoints from which the object counts as found; empty where the position itself is to be reached."""
    placement: str = ""
    """Id of the object."""

    @property
    def points(self) -> tuple[Point, ...]:
        """Places on the floor that satisfy the episode."""
        return self.views or (self.position,)


@dataclass(frozen=True)
class ContinuousEpisode:
    """An episode of Habitat's: where it begins, what is asked, where it should end."""

    id: str
    world: str
    """House.name."""
    start: Point
    """On the floor, metres, world."""
    yaw: float
    """Radians counter-clockwise from +x."""
    instruction: str
    goals: tuple[NavigationGoal, ...]
    radius: float = 3.0
    """An agent that stops nearer than this, along the floor in metres, succeeded."""
    reference: tuple[Point, ...] = ()
    """VLN-CE: the path that is described, start and end included."""
    expert: tuple[Point, ...] = ()
    """VLN-CE: where an expert was on its way, for nDTW; the reference where nothing is given."""
    object_class: str = ""
    """ObjectNav: what is sought."""
    trajectory: str = ""
    """VLN-CE: the path's id, which several instructions share."""
    people: tuple[Stroll, ...] = ()
    """Who walks about meanwhile; touching somebody ends the episode."""
    follows: bool = False
    """The first of the people is to be followed until the time is up."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ContinuousTrajectory(Trajectory):
    """An agent's way through an episode, of which the places after each action are judged."""

    episode: ContinuousEpisode
    positions: np.ndarray
    """(n + 1, 3) float64 metres, on the floor: before each action and after the last."""
    yaws: np.ndarray
    """(n + 1,) radians."""
    pitches: np.ndarray
    """(n + 1,) degrees, integers."""
    actions: tuple[int, ...]
    collisions: int
    people: np.ndarray
    """(n + 1, people, 3) metres, on the floor."""
    contact: bool
    """It ended by touching somebody."""


class NavMeshCache:
    """The floors of houses, made when they are first walked on."""

    def __init__(self) -> None:
        self._floors: dict[str, FloorWays] = {}

    def of(self, house: House) -> FloorWays:
        if house.digest not in self._floors:
            self._floors[house.digest] = FloorWays(house)
        return self._floors[house.digest]


class ContinuousEnv:
    """Owns the pose of a body in one episode after another."""

    def __init__(self, body: Body = Body(), navmeshes: NavMeshCache | None = None) -> None:
        self.body, self._grounds = body, navmeshes or NavMeshCache()

    def reset(self, episode: ContinuousEpisode, place: Place) -> None:
        """Put the body at the start; one that is not on the free floor is moved to the nearest point of it.

        Raises:
          ValueError: start or goals are not on the floor of the house, or no goal can be reached from the start.
        """
        self.episode, self.place = episode, place
        self.ground = self._grounds.of(place.house)
        check_on_floor(episode, place.house, self.ground, self.body.forward)
        self._ajar = {
            o.id: self.ground.plane(np.append(np.add(o.a, o.b) / 2, place.house.floor_height(o)))
            for o in place.house.openings
            if o.id in ajar_doors(place.house)
        }
        self.pushed = frozenset[str]()
        """Doors that stood ajar and were pushed open."""
        self.ways = self.ground.ways(goal_cells(episode, self.ground))
        self.position = self.ground.nearest_free(self.ground.plane(np.array(episode.start)))
        """(2,) metres, in the plane of `ground`."""
        self.yaw, self.tilt, self.collided, self.collisions, self.ended = episode.yaw, 0, False, 0, False
        walks, self.contact = walks_of(place.house) if episode.people else None, False
        self.crowd = Crowd(episode.people, walks, polite=self.body.polite, eye=self.body.eye)
        """The people, and whether the body touched one."""
        self._people = [self.crowd.places]
        self._actions: list[int] = []
        self._poses = [(*self.position, self.yaw, self.tilt)]
        self._distances = [self.ways.length_from(self.position)]
        if not math.isfinite(self._distances[0]):
            raise ValueError(f"no goal of episode {episode.id!r} can be reached in {episode.world!r}")

    def step(self, action: int) -> None:
        """One action of Move.

        Raises:
          ValueError: no such action.
          RuntimeError: the episode is over.
        """
        if not 0 <= action < self.body.actions:
            raise ValueError(f"an action should be a number from 0 to {self.body.actions - 1}, got {action!r}")
        if self.ended:
            raise RuntimeError("the episode is over; reset before another action")
        self.collided, before = False, self.ground.world(self.position)
        if action == HabitatAction.FORWARD:
            there = self.after(self.yaw)
            short = self.body.forward - float(np.linalg.norm(there - self.position))
            self.collided = short > COLLIDED
            self.collisions += self.collided
            self.position = there
            self.pushed |= {d for d, at in self._ajar.items() if np.linalg.norm(at - there) < PUSHED}
        elif action in (HabitatAction.LEFT, HabitatAction.RIGHT):
            self.yaw += math.radians(self.body.turn) * (1 if action == HabitatAction.LEFT else -1)
        elif action in (HabitatAction.UP, HabitatAction.DOWN):
            change = self.body.tilt * (1 if action == HabitatAction.UP else -1)
            self.tilt = max(-STEEPEST, min(STEEPEST, self.tilt + change))
        if self.episode.people and action != HabitatAction.STOP:
            steps = action == HabitatAction.FORWARD
            seconds = self.body.forward / PACE if steps else math.radians(self.body.turn) / SPIN
            self.contact = self.crowd.go_on(seconds, before, self.ground.world(self.position)) < CONTACT
        self._people.append(self.crowd.places)
        self._actions.append(int(action))
        self._poses.append((*self.position, self.yaw, self.tilt))
        moved = action == HabitatAction.FORWARD
        self._distances.append(self.ways.length_from(self.position) if moved else self._distances[-1])
        self.ended = action == HabitatAction.STOP or self.contact or len(self._actions) >= self.body.steps

    def after(self, yaw: float) -> np.ndarray:
        """(2,) where a step along `yaw` would end."""
        ahead = self.body.forward * np.array([math.cos(yaw), math.sin(yaw)])
        return self.ground.moved(self.position, self.position + ahead, sliding=self.body.sliding)

    @property
    def distance(self) -> float:
        """Metres along the floor to the nearest goal. Privileged."""
        return self._distances[-1]

    @property
    def floor(self) -> float:
        """Height of the floor, or of the stair, metres."""
        return float(self.ground.world(self.position)[2])

    @property
    def eye(self) -> Point:
        """Position of the camera, metres, world."""
        x, y, z = self.ground.world(self.position).tolist()
        return x, y, z + self.body.eye

    @property
    def pitch(self) -> float:
        """Of the camera, radians above the horizon."""
        return math.radians(max(-89.0, min(89.0, self.tilt + self.body.pitch)))

    @property
    def is_following(self) -> bool:
        """True where it faces the first of the people from the right distance."""
        here = self.ground.world(self.position[None])
        return bool(follows(here, np.array([self.yaw]), self.crowd.places[:1, :3])[0])

    @property
    def steps(self) -> int:
        """Actions taken."""
        return len(self._actions)

    def trajectory(self) -> ContinuousTrajectory:
        """The way since the last reset, in straight lines between consecutive positions."""
        poses, first = np.array(self._poses, float), min(1, self.steps)
        positions = self.ground.world(poses[:, :2])
        metres = np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))
        way: dict[str, Any] = {"positions": positions, "yaws": poses[:, 2], "pitches": poses[:, 3].astype(int)}
        way |= {"people": np.array(self._people)[..., :3], "contact": self.contact}
        return ContinuousTrajectory(
            rule=SuccessRule(self.episode.radius, strict=True),
            distances=np.array(self._distances[first:]),
            lengths=metres if self.steps else np.zeros(1),
            shortest=self._distances[0],
            stopped=self._actions[-1:] == [HabitatAction.STOP],
            **{**way, "actions": tuple(self._actions), "collisions": self.collisions, "episode": self.episode},
        )


def follows(positions: np.ndarray, yaws: np.ndarray, person: np.ndarray) -> np.ndarray:
    """(n,) bool: whether a body at (n, 3) faces a person at (n, 3) from a distance in FOLLOWS."""
    to = person - positions
    metres, ahead = np.linalg.norm(to, axis=1), to[:, 0] * np.cos(yaws) + to[:, 1] * np.sin(yaws)
    return (metres >= FOLLOWS[0]) & (metres <= FOLLOWS[1]) & (ahead > FACING * metres)


def social_measures(t: ContinuousTrajectory, steps: int) -> dict[str, float]:
    """Measures of an episode among people: those of Falcon's evaluator or, where somebody is followed, of Habitat 3's,
    whose distances are along the floor and not straight. Then success is to follow for a share FOLLOWED of `steps`."""
    metres = np.linalg.norm(t.people[1:] - t.positions[1:, None], axis=2)
    measures = {"human_collision": float(t.contact), "psc": float((metres >= PERSONAL).all(1).mean())}
    if not t.episode.follows:
        least = t.shortest / TIMELY
        return measures | {"stl": t.success * least / max(least, len(t.actions))}
    near = follows(t.positions[1:], t.yaws[1:], t.people[1:, 0])
    first = int(np.argmax(near)) if near.any() else len(near)
    measures |= {"found": float(near.any()), "steps_to_find": float(first + 1 if near.any() else steps)}
    once = near[first:].sum() / max(len(near) - first, 1)
    measures |= {"following": near.sum() / steps, "following_after_found": once}
    return measures | {"distance": metres[:, 0].mean(), "success": float(near.sum() >= FOLLOWED * steps), "spl": 0.0}


POSITION = ("ahead", "left", "sin", "cos", "tilt")
"""Odometry: metres from the start in its frame, the turn since then, radians of the camera's tilt."""


def odometry(episode: ContinuousEpisode, position: np.ndarray, yaw: float, pitch: float) -> np.ndarray:
    """(5,) float32, POSITION, at (x, y); yaw and pitch in radians."""
    dx, dy = np.asarray(position)[:2] - np.array(episode.start[:2])
    c, s, turned = math.cos(episode.yaw), math.sin(episode.yaw), yaw - episode.yaw
    return np.array([c * dx + s * dy, c * dy - s * dx, math.sin(turned), math.cos(turned), pitch], np.float32)


def check_on_floor(episode: ContinuousEpisode, house: House, ground: FloorWays, step: float) -> None:
    """Refuse an episode of another house or in another frame, whose start or goal is more than `step` metres from where
    the body can be.

    Raises:
      ValueError: says which point, and what was expected.
    """
    if not episode.goals:
        raise ValueError(f"episode {episode.id!r} has no goal; every episode needs one")
    places = {"start": (episode.start,), **{f"goal {k}": g.points for k, g in enumerate(episode.goals)}}
    for name, points in places.items():
        xyz = np.array(points, float)
        away = np.linalg.norm(xyz - ground.xyz[ground.cells_at(xyz)], axis=1)
        if not (away <= step).any():
            low, high = ground.xyz[:, :2].min(0).round(1).tolist(), ground.xyz[:, :2].max(0).round(1).tolist()
            floor = " or ".join(f"{s.elevation:g}" for s in house.storeys)
            raise ValueError(
                f"the {name} of episode {episode.id!r} is at {xyz[0].round(2).tolist()}, where nobody can stand in "
                f"house {house.name!r}: its floor goes from {low} to {high} at height {floor}; expected metres, z "
                "up, which in Habitat's files are [x, z, -y], y up"
            )


def goal_cells(episode: ContinuousEpisode, ground: FloorWays) -> np.ndarray:
    """Indices of the floor's cells at the goals."""
    return np.unique([ground.cell_at(np.array(p)) for goal in episode.goals for p in goal.points])


def seen_from(house: House, ground: FloorWays, object_class: str, reach: float) -> tuple[NavigationGoal, ...]:
    """The objects of a class that can be come near to, with the cells in their rooms within `reach` metres of them."""
    goals = []
    for p in house.placements:
        if p.object_class != object_class or object_class in NOT_OBJECTS:
            continue
        near = (footprint_distance(p, ground.xyz[:, :2]) <= reach) & (ground.room_of_cell == p.room)
        views = tuple((float(x), float(y), float(z)) for x, y, z in ground.xyz[near])
        if views:
            x, y, z = (float(v) for v in p.position)
            goals.append(NavigationGoal((x, y, z), views, p.id))
    return tuple(goals)


class ShortestPathFollower:
    """An expert that knows the house: along the described path, or straight to the nearest goal, then STOP.

    It has no memory but the part of the path that it has left behind, and answers at any pose that an agent comes to:
    that is what DAgger asks for.
    """

    def __init__(self, env: ContinuousEnv, *, along: bool = False) -> None:
        """
        Args:
          along: keep to the reference path, point by point.
        """
        self._env, self._near = env, min(0.3, 0.9 * env.episode.radius)
        points = env.episode.reference[1:-1] if along else ()
        cells = [np.array([env.ground.cell_at(np.array(p))]) for p in points]
        goals = tuple(replace(a, views=_middle(a)) for a in env.episode.goals)
        self._plan: list[tuple[np.ndarray, int]] = []
        last = goal_cells(replace(env.episode, goals=goals), env.ground)
        self._legs: list[DrivingWays] = [env.ground.wide_ways(c) for c in (*cells, last)]

    def action(self) -> int:
        """The expert's action here."""
        env = self._env
        while len(self._legs) > 1 and self._left() <= PASSED:
            self._legs.pop(0)
            self._plan = []
        if len(self._legs) == 1 and env.distance <= self._near:
            return HabitatAction.STOP
        turns = self._turns()
        if turns:
            return HabitatAction.LEFT if turns > 0 else HabitatAction.RIGHT
        if self._plan:
            self._plan.pop(0)
        return HabitatAction.FORWARD

    def _left(self) -> float:
        return self._legs[0].length_from(self._env.position)

    def _turns(self) -> int:
        """Turns to the left (negative: right) before the next step."""
        env, half = self._env, 180 // self._env.body.turn
        if self._plan and np.allclose(env.position, self._plan[0][0], atol=1e-6):
            wanted = self._plan[0][1]
        elif (direct := self._direct()) is not None:
            self._plan, wanted = [], direct
        else:
            self._plan = self._around()
            wanted = self._plan[0][1] if self._plan else 0
        return (wanted - self._heading + half) % (2 * half) - half

    @property
    def _heading(self) -> int:
        """Turns to the left that the body has made since the start."""
        return round((self._env.yaw - self._env.episode.yaw) / math.radians(self._env.body.turn))

    def _ends(self, here: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(headings, 2) where a step along each heading ends, from heading 0 on, and whether it touches nothing."""
        body, start = self._env.body, self._env.episode.yaw
        angles = start + np.arange(360 // body.turn) * math.radians(body.turn)
        ends = here + body.forward * np.stack([np.cos(angles), np.sin(angles)], 1)
        return ends, self._env.ground.is_free(here, ends)

    def _direct(self) -> int | None:
        """The heading whose step comes nearest to the farthest point of the way that is in sight; None where no step
        leads nearer to the goal."""
        env, ways, here = self._env, self._legs[0], self._env.position
        way = env.ground.xy[ways.cells(env.ground.cell_at(here))[: LOOK + 1]]
        free = np.flatnonzero(env.ground.is_free(here, way))
        target = way[int(free[-1])] if len(free) else way[0]
        ends, open_ = self._ends(here)
        turns = np.abs((np.arange(len(ends)) - self._heading + len(ends) // 2) % len(ends) - len(ends) // 2)
        cost = np.linalg.norm(ends - target, axis=1) + turns * TURN_COST
        cost[~open_] = np.inf
        best = int(np.argmin(cost))
        nearer = self._metres(ends[best][None])[0] < self._metres(here[None])[0] - LEAST
        return best if open_[best] and nearer else None

    def _metres(self, points: np.ndarray) -> np.ndarray:
        """(n,) of the way from the cells nearest to (n, 2) points."""
        return self._legs[0].metres[self._env.ground.cells_at(points)]

    def _around(self) -> list[tuple[np.ndarray, int]]:
        """Steps, (from where, heading), that lead nearer where no single step does: breadth first."""
        here = self._env.position
        wanted = self._metres(here[None])[0] - LEAST
        steps: list[tuple[int, np.ndarray, int]] = [(-1, here, -1)]
        seen, first = {_square(here)}, 0
        for _ in range(DEEPEST):
            last = len(steps)
            for k in range(first, last):
                ends, open_ = self._ends(steps[k][1])
                for heading in np.flatnonzero(open_):
                    if _square(ends[heading]) not in seen:
                        seen.add(_square(ends[heading]))
                        steps.append((k, ends[heading], int(heading)))
            if last == len(steps):
                return []
            metres = self._metres(np.array([end for _, end, _ in steps[last:]]))
            if metres.min() < wanted:
                plan, k = [], last + int(np.argmin(metres))
                while steps[k][0] >= 0:
                    before = steps[k][0]
                    plan.append((steps[before][1], steps[k][2]))
                    k = before
                return plan[::-1]
            first = last
        return []


def _square(point: np.ndarray) -> tuple[int, int]:
    """Which square of 5 cm a point lies in."""
    return int(point[0] // 0.05), int(point[1] // 0.05)


def _middle(goal: NavigationGoal) -> tuple[Point, ...]:
    """The half of an object's viewpoints that is nearest to it: a step towards them ends among the others."""
    near = sorted(goal.views, key=lambda v: math.dist(v[:2], goal.position[:2]))
    return tuple(near[: (len(near) + 1) // 2])


PASSED = 0.6
"""A point of the path is passed within this many metres."""
LEAST = 0.02
"""Metres of the way that a step has to gain."""
DEEPEST = 6
"""Most steps that are planned ahead where no single step leads nearer."""
LOOK = 15
"""Cells of its way that the expert looks ahead: 1.5 m."""
TURN_COST = 1e-3
"""Metres that a turn counts when headings are compared."""

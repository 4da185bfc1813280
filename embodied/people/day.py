"""A day of a household: who is where at which hour, doing what, and the walks between, through doors; or one errand.

One person walks at a time; the others wait until the way is free.
"""

from __future__ import annotations

import bisect
import dataclasses
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.affinity import translate

from embodied.assets.catalogue import Catalogue
from embodied.assets.json_file import read_toml
from embodied.assets.people import POSES, Person, Pose, people
from embodied.geometry import facing_of, rotation, yaw_facing
from embodied.house.house import House, Placement
from embodied.house.household import household_of
from embodied.house.moment import WIDEST, Moment, MovingPerson, RigidPose, Triple
from embodied.house.shapes import footprint, inward
from embodied.navigation.floor_ways import APART
from embodied.navigation.free_space import HEAD, LOW, leaves
from embodied.navigation.graph import AGENT_RADIUS
from embodied.people import errands
from embodied.people.errands import BODY_GAP, ErrandLeg, Walks, legs_along
from embodied.people.gait import Limbs, between, sitting, smooth, solved
from embodied.seeds import stream

LATE = 0.25
"""Hours by which people are before or behind their plan, at most."""
SETTLING, POSE_SECONDS = (0.0, 1.8, 4.4), 1.0
"""Seconds to stand, sit down and lie down, and to take up what one does."""
SPOT_REACH, LYING_BACK = 1.0, 0.11
"""Metres up to which one stands from where one sits or works, and of the pelvis above what one lies on."""
LEGS = ("pelvis", "thigh", "shin", "foot", "toes")
"""Ends of the names of joints that activities leave alone."""
TABLES: Any = read_toml(Path(__file__).with_name("day.toml"))
ACTIVITIES: Any = TABLES["activities"]
BEDS = ACTIVITIES["sleeping"]["at"]
SEATS = {kind for a in ("eating", "working", "watching", "reading", "sleeping") for kind in ACTIVITIES[a]["at"]}


@dataclass(frozen=True)
class DaySpot:
    """A place to do something at a thing: one stands there, facing a way, and may sit (the middle of the seat) or lie
    down (where the hips are) from there. `front` is the heading of the thing's front."""

    activity: str
    thing: str
    stand: Triple
    """On the floor, metres, world."""
    heading: float
    seat: Triple | None = None
    bed: Triple | None = None
    front: float = 0.0

    @property
    def settled(self) -> int:
        """0 standing, 1 sitting, 2 lying."""
        return 2 if self.bed else int(self.seat is not None)

    @property
    def places(self) -> list[np.ndarray]:
        """(3,) where the body of somebody here may be, on the floor, first where it stands up."""
        if self.bed or not self.seat:
            return [np.array(self.stand)]
        seat = np.array([*self.seat[:2], self.stand[2]])
        return [np.array(self.stand), seat, seat + 0.45 * np.array([math.cos(self.front), math.sin(self.front), 0.0])]


NOWHERE = DaySpot("out", "", (0.0, 0.0, 0.0), 0.0)


@dataclass(frozen=True, eq=False)
class Piece:
    """Part of the day of one person, seconds since midnight: at a spot or on the way there."""

    begin: float
    end: float
    spot: DaySpot
    settled: tuple[float, float] = (0.0, 0.0)
    """At the beginning and the end: 0 standing, 1 sitting, 2 lying."""
    leg: ErrandLeg | None = None


@dataclass(frozen=True, eq=False)
class Day:
    """The lives of a household from midnight to midnight.

    Examples:
      >>> day = embodied.day_of(house, catalogue, seed=7)
      >>> {piece.spot.activity for piece in day.now("3:00").values()}
      {'sleeping'}
    """

    house: House
    figures: Mapping[str, Person]
    """By name, 'adult_1'."""
    pieces: Mapping[str, Sequence[Piece]]
    doors: errands.Doors

    def at(self, time: str | float) -> Moment:
        """The house at a time, '18:30' or seconds since midnight: everybody in it, and the doors that they open."""
        now = seconds_of(time)
        home = {n: p for n, p in self.now(time).items() if p.spot.activity != "out" or p.leg}
        figures = {n: self._figure(self.figures[n], p, now) for n, p in home.items()}
        return Moment(openness=errands.openness(self.doors, now), people=figures)

    def since(self, time: float) -> float:
        """The first second from which on everybody is as at a time, in seconds; that time where somebody moves."""
        pieces = self.now(time).values()
        moves = any(p.leg or p.settled[0] != p.settled[1] or p.end - time < POSE_SECONDS for p in pieces)
        return time if moves else min(time, max(p.begin for p in pieces) + POSE_SECONDS)

    def now(self, time: str | float) -> dict[str, Piece]:
        """Everybody's piece of the day; its activity is 'out', and it has no leg, where they are not at home."""
        now = seconds_of(time)
        return {n: own[bisect.bisect(own, now, key=lambda p: p.begin) - 1] for n, own in self.pieces.items()}

    def _figure(self, person: Person, p: Piece, now: float) -> MovingPerson:
        limbs, spot = Limbs(person), p.spot
        done = min((now - p.begin) / max(p.end - p.begin, 1e-9), 1.0)
        settled = p.settled[0] + (p.settled[1] - p.settled[0]) * done
        b = p.leg.bearing(now) if p.leg else limbs.standing(np.array(spot.stand), spot.heading)
        if spot.seat is not None and settled > 0:
            b = sitting(limbs, b, np.array(spot.seat), spot.heading if spot.bed else spot.front, min(settled, 1.0))
        place, pose = solved(limbs, b)
        upper = POSES[ACTIVITIES[spot.activity]["pose"]].joints if spot.activity else {}
        if spot.bed is not None and settled > 1:
            hips = LYING_BACK - limbs.joints["pelvis"][2]
            lies = RigidPose.upright(spot.bed, yaw_facing(spot.front)), Pose(upper, hips)
            place, pose = between((place, pose), lies, smooth(settled - 1))
        elif p.leg is None and p.settled[0] == p.settled[1]:
            busy = {name: turn for name, turn in upper.items() if not name.endswith(LEGS)}
            since = smooth((now - p.begin) / POSE_SECONDS) * smooth((p.end - now) / POSE_SECONDS)
            place, pose = between((place, pose), (place, Pose({**pose.joints, **busy}, pose.lift)), since)
        return MovingPerson(person.id, place, pose)


def seconds_of(time: str | float) -> float:
    """Seconds since midnight of '18:30', or of seconds.

    Raises:
      ValueError: no time of a day.
    """
    if re.fullmatch(r"\d\d?:[0-5]\d", str(time)):
        hours, _, minutes = str(time).partition(":")
        time = 3600 * int(hours) + 60 * int(minutes)
    if isinstance(time, str) or not 0 <= time <= 86400:
        raise ValueError(f"a time should be like '18:30', or seconds since midnight, got {time!r}")
    return time


def day_of(house: House, catalogue: Catalogue, *, seed: int) -> Day:
    """The day of who lives in a house; the same seed gives the same day.

    Examples:
      >>> evening = embodied.day_of(house, catalogue, seed=7).at("18:30")
    """
    home, rng = household_of(house), stream(seed, "day", house.name)
    ages = {f"adult_{k + 1}": 40 for k in range(home.adults)}
    ages |= {f"child_{k + 1}": age for k, age in enumerate(home.children)}
    everybody = [*people().values()]
    figured = {p.asset.removeprefix("people/").partition("_")[0] for p in house.placements}  # who stands about
    left, figures = [everybody[i] for i in rng.permutation(len(everybody))], dict[str, Person]()
    for name, age in ages.items():
        family = next(iter(figures.values()), left[0]).family
        unlike = [max(abs(p.age - age), 3 if age < 18 else 20) + 5 * (p.family != family) for p in left]
        unlike = [u + 100 * (p.id in figured or (p.age < 18) != (age < 18)) for u, p in zip(unlike, left)]
        figures[name] = left.pop(int(np.argmin(unlike)))
    planner, wishes = _Planner(house, catalogue, figures, seed), []
    for name in ages:
        late, kind = rng.uniform(-LATE, LATE), "child" if name in [*ages][home.adults :] else "worker"
        kind = "homeworker" if name == "adult_1" and "works at home" in home.habits else kind
        beds = (spot for activity in ("sleeping", "reading", "out") for spot in planner.free(name, activity))
        planner.rest(name, next(beds, NOWHERE), 0.0)
        for row in TABLES["plans"][kind].split(", "):
            hour, _, activity = row.partition(" ")
            wishes.append((3600 * (float(hour) + late + rng.uniform(0, LATE)), name, activity))
    for when, name, activity in sorted(wishes):
        planner.go(name, activity, when)
    return Day(house, figures, planner.pieces, planner.doors)


def lived_in(house: House) -> House:
    """The house without its figures, who stand for the same people as those who live there."""
    alive = tuple(p for p in house.placements if p.object_class != "person")
    return dataclasses.replace(house, placements=alive)


def errand(
    house: House, person: Person, start: Sequence[float], goal: Sequence[float], seat: Sequence[float] | None = None
) -> Day:
    """The day of one person, by id, who goes from second 0 on between the free places nearest to (x, y) points of the
    ground floor or (x, y, z) of any, away from things where there is room, and onto a seat beside the goal: x, y and z
    of the middle of what is sat on, and the heading of its front."""
    walks = Walks(house)
    ground, free = walks.ground, np.flatnonzero(walks.clear)
    points = (p if len(p) < 3 else ground.plane(np.array(p)) for p in (start, goal))
    begin, end = (int(free[np.linalg.norm(ground.xy[free] - p, axis=1).argmin()]) for p in points)
    line = walks.line(ground.xy[ground.wide_ways(np.array([end])).cells(begin)])
    sits, front = (None, None) if seat is None else ((seat[0], seat[1], seat[2]), seat[3])
    legs, doors = legs_along(Limbs(person), line, walks.swings, walks.climbs, turned=(None, front))
    (x, y, z), heading = legs[-1].course.body(math.inf)
    spot = DaySpot("", "", (x, y, z), heading, sits, front=front or 0.0)
    pieces = [Piece(leg.begin, leg.end, spot, leg=leg) for leg in legs]
    pieces.append(Piece(legs[-1].end, legs[-1].end + SETTLING[spot.settled], spot, (0.0, spot.settled)))
    pieces.append(Piece(pieces[-1].end, 86400.0, spot, (spot.settled, spot.settled)))
    return Day(house, {person.id: person}, {person.id: pieces}, doors)


class _Planner:
    """Owns where everybody is while a day is made."""

    def __init__(self, house: House, catalogue: Catalogue, figures: Mapping[str, Person], seed: int) -> None:
        self.house, self.assets, self.figures, self.seed = house, catalogue.assets, figures, seed
        self.walks = Walks(house)
        self.ways, self.space = self.walks.ground, self.walks.ground.space
        self.floors = {r.id: (r.storey, house.storeys[r.storey].elevation) for r in house.rooms}
        floor = lambda p: self.floors[p.room][1]
        solid = [p for p in house.placements if floor(p) + LOW - p.size[2] < p.position[2] < floor(p) + HEAD]
        self.footprints = {p.id: translate(footprint(p), self.floors[p.room][0] * APART) for p in solid}
        self.spots = [s for p in house.placements for s in self._spots(p)]
        for o in (o for o in house.openings if o.kind == "front_door"):
            middle, into = (np.array(o.a) + o.b) / 2, inward(house, o)
            x, y = (middle - 0.75 * into).tolist()
            out = x, y, house.floor_height(o)
            self.spots.append(DaySpot("out", o.id, out, math.atan2(into[1], into[0])))
            leaf = shapely.union_all(leaves(house, dataclasses.replace(o, angle=WIDEST))).buffer(AGENT_RADIUS + 0.01)
            way = shapely.LineString([middle + 0.4 * into, (x, y)]).buffer(0.05)
            self.space = self.space.union(way).difference(leaf)
        self.at: dict[str, DaySpot] = {}
        self.pieces: dict[str, list[Piece]] = {name: [] for name in figures}
        self.doors: list[tuple[str, float, float]] = []
        self.free_from = 0.0

    def rest(self, name: str, spot: DaySpot, when: float) -> None:
        """Be at a spot from now on."""
        self.pieces[name].append(Piece(when, 86400.0, spot, (spot.settled, spot.settled)))
        self.at[name] = spot

    def free(self, name: str, activity: str) -> Iterator[DaySpot]:
        """Spots that nobody else is near, the best kinds first."""
        rng = stream(self.seed, "spot", self.house.name, name, len(self.pieces[name]))
        kinds, kind_of = ACTIVITIES[activity]["at"], {p.id: p.object_class for p in self.house.placements}
        taken = [place for s in self._others(name) for place in s.places]
        own = [self.spots[i] for i in rng.permutation(len(self.spots)) if self.spots[i].activity == activity]
        for spot in sorted(own, key=lambda s: kinds.index(kind_of.get(s.thing, kinds[0]))):
            if all(math.dist(a, b) > BODY_GAP for a in taken for b in spot.places):
                yield spot

    def go(self, name: str, activity: str, when: float) -> None:
        """Go to do something; stay where there is no way, or no place for it."""
        here, when = self.at[name], max(when, self.free_from)
        for there in self.free(name, activity):
            if there == here:
                return
            line = self._line(name, here, there)
            if line is not None:
                self._walk(name, here, there, line, when)
                return

    def _others(self, name: str) -> list[DaySpot]:
        return [s for n, s in self.at.items() if n != name and s.activity != "out"]

    def _spots(self, p: Placement) -> Iterator[DaySpot]:
        """Spots at or on a thing."""
        (width, depth, height), front, asset = p.size, facing_of(p.yaw), self.assets[p.asset]
        tops = [x.z * height / asset.size[2] for x in asset.surfaces if x.name in ("seat", "top")]
        high = tops[0] if tops else 0.46
        on = lambda x, y: (*_world(p, x, y), p.position[2] + high)
        for activity in (name for name, a in ACTIVITIES.items() if p.object_class in a["at"]):
            if activity == "sleeping" and 0.3 <= high <= 0.7:
                for side in (1, -1):
                    edge = on(side * (width / 2 - 0.18), 0.1 - depth / 8)
                    lies = on(side * width / 4 if width > 1.2 else 0.0, depth / 2 - 0.95)
                    if stand := self._stand(p, edge[:2], True):
                        yield DaySpot(activity, p.id, stand, p.yaw + (0 if side > 0 else math.pi), edge, lies, front)
            elif p.object_class in SEATS and 0.3 <= high <= 0.6:
                for x in (0.3, -0.3) if width > 1.4 else (0.0,):
                    seat = on(x, min(0.45, 0.2 + depth / 4) - depth / 2)
                    if stand := self._stand(p, seat[:2], True):
                        yield DaySpot(activity, p.id, stand, front, seat, front=front)
            elif p.object_class not in SEATS and (stand := self._stand(p, _world(p, 0.0, -depth / 2), False)):
                yield DaySpot(activity, p.id, stand, math.atan2(p.position[1] - stand[1], p.position[0] - stand[0]))

    def _stand(self, p: Placement, goal: tuple[float, float], sits: bool) -> Triple | None:
        """The nearest free place to a point of a thing, before it or beside it, with nothing between."""
        goal = goal[0] + self.floors[p.room][0] * APART, goal[1]
        away, front = self.ways.xy - goal, facing_of(p.yaw)
        far = np.linalg.norm(away, axis=1)
        before = away @ (math.cos(front), math.sin(front)) > -0.4 * far
        here = (far < SPOT_REACH) & (self.ways.room_of_cell == p.room) & self.walks.clear
        which = np.flatnonzero(here & (before | (p.object_class in BEDS)))
        point = shapely.Point(goal)
        others = [o for i, o in self.footprints.items() if i != p.id and not o.buffer(0.02).contains(point)]
        barred = shapely.union_all(others) if sits else shapely.Point()
        for cell in which[np.argsort(far[which], kind="stable")]:
            if not shapely.LineString([self.ways.xy[cell], goal]).dwithin(barred, 0.1):
                x, y, z = self.ways.xyz[cell].tolist()
                return x, y, z
        return None

    def _line(self, name: str, here: DaySpot, there: DaySpot) -> np.ndarray | None:
        """(m, 3) points of the way between two spots past everybody else; None where there is none."""
        places = [p for s in self._others(name) for p in s.places[s.seat is not None :]]
        others = shapely.MultiPoint(self.ways.plane(np.array(places).reshape(-1, 3)))
        shut = shapely.dwithin(shapely.points(self.ways.xy), others, BODY_GAP + errands.WAY_STEP)
        if "out" in (here.activity, there.activity):
            shut |= ~shapely.intersects_xy(self.space, *self.ways.xy.T)
        (start, before), (end, after) = self._ends(here), self._ends(there)
        ways = self.ways.wide_ways(np.array([end]), shut)
        if shut[end] or not np.isfinite(ways.metres[start]):
            return None
        way = np.concatenate([before[::-1], self.ways.xy[ways.cells(start)], after])
        return self.walks.line(way, self.space, others)

    def _ends(self, spot: DaySpot) -> tuple[int, np.ndarray]:
        """The cell that a way to a spot ends at, and (k, 2) points that it goes on to, out of the front door."""
        inside = np.array(spot.stand)
        if spot.activity == "out":
            inside += 1.15 * np.array([math.cos(spot.heading), math.sin(spot.heading), 0.0])
        after = self.ways.plane(np.array([inside, spot.stand])[spot.activity != "out" :])
        return self.ways.cell_at(inside), after

    def _walk(self, name: str, here: DaySpot, there: DaySpot, line: np.ndarray, when: float) -> None:
        """Get up, go along a line, through doors, and settle."""
        own = self.pieces[name]
        own[-1] = dataclasses.replace(own[-1], end=when)
        add = lambda end, *what: own.append(Piece(own[-1].end, end, *what))
        if here.settled:
            add(when + SETTLING[here.settled], here, (here.settled, 0.0))
        limbs, turned = Limbs(self.figures[name]), (here.heading, there.heading)
        swings = self.walks.swings + self.walks.fronts
        legs, doors = legs_along(limbs, line, swings, self.walks.climbs, own[-1].end, turned)
        for leg in legs[1:]:
            add(leg.end, there, (0.0, 0.0), leg)
        self.doors += doors
        if there.settled:
            add(own[-1].end + SETTLING[there.settled], there, (0.0, there.settled))
        self.rest(name, there, own[-1].end)
        self.free_from = own[-1].begin + errands.DOOR_SECONDS * bool(doors)


def _world(p: Placement, x: float, y: float) -> tuple[float, float]:
    a, b = (rotation(p.yaw) @ (x, y) + p.position[:2]).tolist()
    return a, b

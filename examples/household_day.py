"""A day of a household: who is where at which hour, doing what, and the walks between, through doors.

One person walks at a time; the others wait until the way is free. Days are on the ground floor.

    python examples/household_day.py --seed 7 --at 18:30

prints the day of a small flat, and draws who is there at a time (lit, `household_day.png`).
"""

from __future__ import annotations

import argparse
import bisect
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import numpy as np
import shapely
from scipy.ndimage import uniform_filter1d

import embodied
from embodied.assets.cache import default_cache
from embodied.assets.catalogue import Catalogue, load_catalogue
from embodied.assets.json_file import read_toml
from embodied.assets.people import POSES, Person, Pose, people
from embodied.generate import HouseConfig, generate_house
from embodied.generate.household import household_of
from embodied.geometry import facing_of, rotation, wrap, yaw_facing
from embodied.house.house import House, Placement
from embodied.house.moment import WIDEST, Moment, MovingPerson, RigidPose
from embodied.house.shapes import footprint, inward, room_at
from embodied.navigation.floor_ways import FloorWays
from embodied.navigation.free_space import HEAD, LOW, closed_doors, leaves, opened
from embodied.navigation.graph import AGENT_RADIUS, walkable
from embodied.people.errands import Swing
from embodied.people.gait import Course, Limbs, between, sitting, smooth, solved, turn, walk
from embodied.seeds import stream

LATE = 0.25
"""Hours by which people are before or behind their plan, at most."""
SETTLING, DOOR_SECONDS, POSE_SECONDS = (0.0, 1.8, 4.4), 1.4, 1.0
"""Seconds to stand, sit down and lie down, to open a door, and to take up what one does."""
ARM, NEAR, BACK = 0.85, 1.0, 0.11
"""Metres from which a hand goes to the handle of a door, up to which one stands from where one sits or works, and of
the pelvis above what one lies on."""
LINE_STEP, BODY = 0.05, 0.45
"""Metres between the points of a way, and between two people's middles at least."""
Triple: TypeAlias = tuple[float, float, float]
LEGS = ("pelvis", "thigh", "shin", "foot", "toes")
"""Ends of the names of joints that activities leave alone."""
TABLES: Any = read_toml(Path(__file__).with_name("household_day.toml"))
BEDS = TABLES["activities"]["sleeping"]["at"]
SEATS = {
    kind for a in ("eating", "working", "watching", "reading", "sleeping") for kind in TABLES["activities"][a]["at"]
}


@dataclass(frozen=True)
class Spot:
    """A place to do something at a thing: one stands there, facing a way, and may sit (the middle of the seat) or lie
    down (where the hips are) from there. `front` is the heading of the thing's front."""

    activity: str
    thing: str
    stand: tuple[float, float]
    heading: float
    seat: Triple | None = None
    bed: Triple | None = None
    front: float = 0.0


NOWHERE = Spot("out", "", (0.0, 0.0), 0.0)


@dataclass(frozen=True, eq=False)
class Piece:
    """Part of the day of one person, seconds since midnight: at a spot or on the way there."""

    begin: float
    end: float
    spot: Spot
    settled: tuple[float, float] = (0.0, 0.0)
    """At the beginning and the end: 0 standing, 1 sitting, 2 lying."""
    course: Course | None = None
    door: Swing | None = None
    """What the right hand opens."""


@dataclass(frozen=True, eq=False)
class Day:
    """The lives of a household from midnight to midnight."""

    house: House
    figures: Mapping[str, Person]
    """By name, 'adult_1'."""
    pieces: Mapping[str, Sequence[Piece]]
    doors: Sequence[tuple[str, float, float]]
    """Opening, and seconds at which it begins to open and to close."""

    def doing(self, time: str | float) -> dict[str, Spot]:
        """The spots that people are at or on their way to; activity 'out' where they are not at home.

        Args:
          time: '18:30', or hours from 0 to 24.
        """
        return {name: piece.spot for name, piece in self._now(seconds(time)).items()}

    def at(self, time: str | float) -> Moment:
        """The house at a time: everybody in it, and the doors that they open."""
        now, openness = seconds(time), {}
        for door, opens, closes in self.doors:
            if opens < now < closes + DOOR_SECONDS:
                openness[door] = smooth((now - opens) / DOOR_SECONDS) * (1 - smooth((now - closes) / DOOR_SECONDS))
        home = {n: p for n, p in self._now(now).items() if p.spot.activity != "out" or p.course}
        return Moment(openness=openness, people={n: self._figure(self.figures[n], p, now) for n, p in home.items()})

    def _now(self, now: float) -> dict[str, Piece]:
        return {n: own[bisect.bisect(own, now, key=lambda p: p.begin) - 1] for n, own in self.pieces.items()}

    def _figure(self, person: Person, p: Piece, now: float) -> MovingPerson:
        limbs, spot, floor = Limbs(person), p.spot, self.house.storeys[0].elevation
        done = min((now - p.begin) / max(p.end - p.begin, 1e-9), 1.0)
        settled = p.settled[0] + (p.settled[1] - p.settled[0]) * done
        b = p.course.at(now - p.begin) if p.course else limbs.standing(np.array([*spot.stand, floor]), spot.heading)
        if spot.seat is not None and settled > 0:
            b = sitting(limbs, b, np.array(spot.seat), spot.heading if spot.bed else spot.front, min(settled, 1.0))
        if p.door is not None:
            hand = p.door.handle(smooth(done), floor)
            b = replace(b, hands={"right": hand} if math.dist(hand[:2], b.position[:2]) < ARM else {}, look=hand)
        place, pose = solved(limbs, b)
        upper = POSES[TABLES["activities"][spot.activity]["pose"]].joints
        if spot.bed is not None and settled > 1:
            lies = RigidPose.upright(spot.bed, yaw_facing(spot.front)), Pose(upper, BACK - limbs.joints["pelvis"][2])
            place, pose = between((place, pose), lies, smooth(settled - 1))
        elif p.course is None and p.settled[0] == p.settled[1]:
            busy = {name: turn for name, turn in upper.items() if not name.endswith(LEGS)}
            since = smooth((now - p.begin) / POSE_SECONDS) * smooth((p.end - now) / POSE_SECONDS)
            place, pose = between((place, pose), (place, Pose({**pose.joints, **busy}, pose.lift)), since)
        return MovingPerson(person.id, place, pose)


def seconds(time: str | float) -> float:
    """Seconds since midnight of '18:30', or of hours.

    Raises:
      ValueError: no time of a day.
    """
    if (
        not re.fullmatch(r"[\d.]+(:[0-5]\d)?", str(time))
        or not 0 <= (hours := float(str(time).partition(":")[0])) <= 24
    ):
        raise ValueError(f"a time should be like '18:30', or hours from 0 to 24, got {time!r}")
    return 3600 * hours + 60 * float(str(time).partition(":")[2] or 0)


def day_of(house: House, catalogue: Catalogue, everybody: Sequence[Person], *, seed: int) -> Day:
    """The day of who lives in a house; the same seed gives the same day.

    Args:
      everybody: whom to choose from, by age and family.
    """
    home, rng = household_of(house), stream(seed, "day", house.name)
    ages = {f"adult_{k + 1}": 40 for k in range(home.adults)}
    ages |= {f"child_{k + 1}": age for k, age in enumerate(home.children)}
    left, figures = [everybody[i] for i in rng.permutation(len(everybody))], dict[str, Person]()
    for name, age in ages.items():
        family = next(iter(figures.values()), left[0]).family
        unlike = [max(abs(p.age - age), 3 if age < 18 else 20) + 5 * (p.family != family) for p in left]
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


class _Planner:
    """Owns where everybody is while a day is made."""

    def __init__(self, house: House, catalogue: Catalogue, figures: Mapping[str, Person], seed: int) -> None:
        self.house, self.assets, self.figures, self.seed = house, catalogue.assets, figures, seed
        rest = opened(house, closed_doors(house))
        self.ways, self.floor = FloorWays(rest, stairs=False), house.storeys[0].elevation
        rooms = {r.id for r in house.rooms if r.storey == 0}
        things = [p for p in house.placements if p.room in rooms]
        solid = [p for p in things if self.floor + LOW - p.size[2] < p.position[2] < self.floor + HEAD]
        self.footprints = {p.id: footprint(p) for p in solid}
        self.swings = [Swing(house, o) for o in house.openings if o.id in closed_doors(house) or o.kind == "front_door"]
        self.swept = shapely.union_all([s.area for s in self.swings])
        self.spots = [s for p in things for s in self._spots(p)]
        self.space = walkable(rest)
        for o in (s.opening for s in self.swings if s.opening.kind == "front_door"):
            middle, into = (np.array(o.a) + o.b) / 2, inward(house, o)
            x, y = (middle - 0.75 * into).tolist()
            self.spots.append(Spot("out", o.id, (x, y), math.atan2(into[1], into[0])))
            leaf = shapely.union_all(leaves(house, replace(o, angle=WIDEST))).buffer(AGENT_RADIUS + 0.01)
            self.space = self.space.union(shapely.LineString([middle + 0.4 * into, (x, y)]).buffer(0.05)).difference(
                leaf
            )
        self.at: dict[str, Spot] = {}
        self.pieces: dict[str, list[Piece]] = {name: [] for name in figures}
        self.doors: list[tuple[str, float, float]] = []
        self.free_from = 0.0

    def rest(self, name: str, spot: Spot, when: float) -> None:
        """Be at a spot from now on."""
        settled = 2.0 if spot.bed else 1.0 if spot.seat else 0.0
        self.pieces[name].append(Piece(when, 86400.0, spot, (settled, settled)))
        self.at[name] = spot

    def free(self, name: str, activity: str) -> Iterator[Spot]:
        """Spots that nobody else is near, the best kinds first."""
        rng, kinds = (
            stream(self.seed, "spot", self.house.name, name, len(self.pieces[name])),
            TABLES["activities"][activity]["at"],
        )
        taken = [p for other, s in self.at.items() if other != name and s.activity != "out" for p in _places(s)]
        own = [self.spots[i] for i in rng.permutation(len(self.spots)) if self.spots[i].activity == activity]
        kind_of = {p.id: p.object_class for p in self.house.placements}
        for spot in sorted(own, key=lambda s: kinds.index(kind_of.get(s.thing, kinds[0]))):
            if all(math.dist(a, b) > BODY for a in taken for b in _places(spot)):
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

    # ------------------------------------------------------------------ places

    def _spots(self, p: Placement) -> Iterator[Spot]:
        """What can be done at or on a thing."""
        (width, depth, height), front, asset = p.size, facing_of(p.yaw), self.assets[p.asset]
        tops = [x.z * height / asset.size[2] for x in asset.surfaces if x.name in ("seat", "top")]
        high = tops[0] if tops else 0.46
        on = lambda x, y: (*_world(p, x, y), p.position[2] + high)
        for activity in (name for name, a in TABLES["activities"].items() if p.object_class in a["at"]):
            if activity == "sleeping" and 0.3 <= high <= 0.7:
                for side in (1, -1):
                    edge = on(side * (width / 2 - 0.18), 0.1 - depth / 8)
                    lies = on(side * width / 4 if width > 1.2 else 0.0, depth / 2 - 0.95)
                    if stand := self._stand(p, edge[:2], True):
                        yield Spot(activity, p.id, stand, p.yaw + (0 if side > 0 else math.pi), edge, lies, front)
            elif p.object_class in SEATS and 0.3 <= high <= 0.6:
                for x in (0.3, -0.3) if width > 1.4 else (0.0,):
                    seat = on(x, min(0.45, 0.2 + depth / 4) - depth / 2)
                    if stand := self._stand(p, seat[:2], True):
                        yield Spot(activity, p.id, stand, front, seat, front=front)
            elif p.object_class not in SEATS and (stand := self._stand(p, _world(p, 0.0, -depth / 2), False)):
                yield Spot(activity, p.id, stand, math.atan2(p.position[1] - stand[1], p.position[0] - stand[0]))

    def _stand(self, p: Placement, goal: tuple[float, float], sits: bool) -> tuple[float, float] | None:
        """The nearest free place to a point of a thing, before it or beside it, with nothing between."""
        away, front = self.ways.xy - goal, facing_of(p.yaw)
        far = np.linalg.norm(away, axis=1)
        before = away @ (math.cos(front), math.sin(front)) > -0.4 * far
        which = np.flatnonzero((far < NEAR) & (self.ways.room_of_cell == p.room) & (before | (p.object_class in BEDS)))
        point = shapely.Point(goal)
        others = [o for i, o in self.footprints.items() if i != p.id and not o.buffer(0.02).contains(point)]
        barred = shapely.union_all(others) if sits else shapely.Point()
        for x, y in self.ways.xy[which[np.argsort(far[which], kind="stable")]].tolist():
            way = shapely.LineString([(x, y), goal])
            if not shapely.intersects_xy(self.swept, x, y) and not way.dwithin(barred, 0.1):
                return x, y
        return None

    # ------------------------------------------------------------------ ways

    def _line(self, name: str, here: Spot, there: Spot) -> np.ndarray | None:
        """(m, 2) points of the way between two spots past everybody else; None where there is none."""
        around = [_places(s)[s.seat is not None :] for n, s in self.at.items() if n != name and s.activity != "out"]
        others = shapely.MultiPoint([p for own in around for p in own])
        shut = shapely.dwithin(shapely.points(self.ways.xy), others, BODY + LINE_STEP)
        if "out" in (here.activity, there.activity):
            shut |= ~shapely.intersects_xy(self.space, *self.ways.xy.T)
        (start, before), (end, after) = self._ends(here), self._ends(there)
        ways = self.ways.wide_ways(np.array([end]), shut)
        if shut[end] or not np.isfinite(ways.metres[start]):
            return None
        corners = np.concatenate([before[::-1], self.ways.xy[ways.cells(start)], after])
        metres = np.cumsum([0.0, *np.linalg.norm(np.diff(corners, axis=0), axis=1)])
        every = np.linspace(0, metres[-1], max(2, int(metres[-1] / LINE_STEP) + 1))
        line = np.column_stack([np.interp(every, metres, c) for c in corners.T])
        for size in (17, 9, 5):
            bent = uniform_filter1d(line, size, axis=0, mode="nearest")
            bent[[0, -1]] = line[[0, -1]]
            way = shapely.LineString(bent)
            if not way.dwithin(others, BODY) and self.space.covers(way):
                return bent
        return line

    def _ends(self, spot: Spot) -> tuple[int, np.ndarray]:
        """The cell that a way to a spot ends at, and (k, 2) points that it goes on to, out of the front door."""
        inside = np.array(spot.stand)
        if spot.activity == "out":
            inside += 1.15 * np.array([math.cos(spot.heading), math.sin(spot.heading)])
        return self.ways.cell_at(inside), np.array([inside, spot.stand])[spot.activity != "out" :]

    def _walk(self, name: str, here: Spot, there: Spot, line: np.ndarray, when: float) -> None:
        """Get up, go along a line, through doors, and settle."""
        limbs, own, heading = Limbs(self.figures[name]), self.pieces[name], here.heading

        def add(seconds: float, spot: Spot = there, **what: Any) -> float:
            own.append(Piece(own[-1].end, own[-1].end + seconds, spot, **what))
            return own[-1].end

        def face(at: np.ndarray, towards: float) -> None:
            if abs(float(wrap(towards - heading))) > 0.1:
                course = turn(limbs, np.array([*at, self.floor]), heading, towards)
                add(course.seconds, course=course)

        own[-1] = replace(own[-1], end=when)
        if settled := own[-1].settled[1]:
            add(SETTLING[int(settled)], here, settled=(settled, 0.0))
        steps = np.diff(line, axis=0, append=2 * line[-1:] - line[-2:-1])
        ways = uniform_filter1d(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])), 11, mode="nearest")
        stops = sorted(((i, s) for s in self.swings if (i := s.stop(line)) is not None), key=lambda stop: stop[0])
        for (begin, swing), (end, _) in pairwise([(0, None), *stops, (len(line) - 1, None)]):
            face(line[begin], float(ways[begin]))
            course = walk(limbs, np.insert(line[begin : end + 1], 2, self.floor, axis=1), ways[begin : end + 1])
            if swing is not None:
                still = turn(limbs, np.array([*line[begin], self.floor]), ways[begin], ways[begin])
                opens = add(DOOR_SECONDS, course=still, door=swing) - DOOR_SECONDS
                through = np.arange(0, course.seconds, 0.1)
                at = np.array([course.body(course.walked(t))[0][:2] for t in through])
                past = through[shapely.intersects_xy(swing.area, *at.T)].max(initial=0.0)
                self.doors.append((swing.opening.id, opens, opens + DOOR_SECONDS + float(past) + 0.2))
            if end > begin:
                add(course.seconds, course=course)
            heading = float(ways[end])
        face(line[-1], there.heading)
        if settled := 2 * (there.bed is not None) or float(there.seat is not None):
            add(SETTLING[int(settled)], settled=(0.0, settled))
        self.rest(name, there, own[-1].end)
        self.free_from = own[-1].begin + DOOR_SECONDS * bool(stops)


def _places(s: Spot) -> list[np.ndarray]:
    """(2,) where the body of somebody at a spot may be, first where it stands up."""
    if s.bed or not s.seat:
        return [np.array(s.stand)]
    seat = np.array(s.seat[:2])
    return [np.array(s.stand), seat, seat + 0.45 * np.array([math.cos(s.front), math.sin(s.front)])]


def _world(p: Placement, x: float, y: float) -> tuple[float, float]:
    a, b = (rotation(p.yaw) @ (x, y) + p.position[:2]).tolist()
    return a, b


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--at", help="'18:30': draw the house then")
    args = parser.parse_args(arguments)
    house, catalogue = generate_house(args.seed, HouseConfig(area=(38, 46))), load_catalogue(default_cache())
    day = day_of(house, catalogue, [*people().values()], seed=args.seed)
    for name, pieces in day.pieces.items():
        print(f"{name} is {day.figures[name].id}, {day.figures[name].words}")
        for piece in pieces:
            if piece.course is None and piece.settled[0] == piece.settled[1] and piece.door is None:
                hour, minute = divmod(int(piece.begin) // 60, 60)
                print(f"  {hour:02d}:{minute:02d} {piece.spot.activity} {piece.spot.thing}")
    if args.at is not None:
        moment = day.at(args.at)
        with embodied.open_world(house, pictures="fast-matte") as world:
            world.show(moment)
            for name, person in moment.people.items():
                room = room_at(house, np.add(person.place.position, (0, 0, 0.5)))
                print(f"{args.at}: {name} is in {room}")
            at = next((np.array(p.place.position) for p in moment.people.values()), world.graph.positions[0])
            eyes, room = zip(world.graph.positions, world.graph.room_of_node), room_at(house, at + (0, 0, 0.5))
            eye = min(eyes, key=lambda e: (e[1] != room, abs(math.dist(e[0][:2], at[:2]) - 2.0)))[0]
            view = world.camera(eye, math.atan2(*(at - eye)[1::-1]), -0.35, 1.2, (480, 640))
            cv2.imwrite("household_day.png", view.rgb[..., ::-1])


if __name__ == "__main__":
    main()

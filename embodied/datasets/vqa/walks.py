"""Walks through a house for questions about it: where the camera goes, and how much of what each frame shows."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import shapely

from embodied.assets.cache import write_bytes
from embodied.assets.catalogue import Catalogue
from embodied.assets.decoding import read_picture
from embodied.assets.moving_parts import MovingPart, openness_of
from embodied.geometry import facing_of, rectangle, wrap
from embodied.house.house import House, Placement
from embodied.house.moment import RigidPose, apart
from embodied.navigation.graph import NavGraph
from embodied.records import RecordError
from embodied.render.camera import FAR_PLANE, camera_at
from embodied.world import World

LENS = math.radians(-12), math.radians(60), (360, 480)
"""Tilt and vertical field of view, radians; height and width of a frame, pixels."""
STRIDE, TURN = 0.7, math.radians(30)
"""Most metres and radians between two frames."""
CLEAR_SHARE, LARGE, WHOLE, GLIMPSE = 0.004, 0.04, 0.25, 0.0003
"""An object counts as seen if some frame gives it CLEAR_SHARE of its pixels and does not cut it off (or LARGE of them),
and at least WHOLE of the outline of its box shows it. With less than GLIMPSE in all frames it counts as unseen. No
question is about what lies between."""
EYES = 0.93
"""Height of people's eyes, of their height as they stand or sit."""
AJAR, STATE_SHARE, LOOK_IN, SHUT_SHOWN, FACING, OPEN_KINDS = 0.5, 0.005, 0.15, 0.7, 0.4, ("door", "flap", "drawer")
"""Openness from which a door or drawer stands open. A frame shows that furniture is open if it gives STATE_SHARE of its
pixels to the door or drawer, and as many, and LOOK_IN of these, to what it closes; that it is shut, if it gives so many
to all doors and drawers, and SHUT_SHOWN of their outlines, and is before them: a cosine to their front of FACING."""
TOLERANCE, BOARDS = 0.01, np.array([-0.02, 0.0, 0.01])
"""Metres from a box that still belong to it, and along x, y and z from the inside of a drawer, without its boards."""
Camera = tuple[np.ndarray, float]
"""(3,) position, metres, and yaw, radians."""


@dataclass(frozen=True)
class WalkFrame:
    """One picture: `shares` of its pixels by placement; `clear` are those that count as seen, `ajar` and `shut`
    furniture of which it shows that a door or drawer stands open, or that none does."""

    position: tuple[float, float, float]
    yaw: float
    shares: Mapping[str, float]
    clear: tuple[str, ...] = ()
    ajar: tuple[str, ...] = ()
    shut: tuple[str, ...] = ()


@dataclass(frozen=True)
class Walk:
    """walk.json: a walk through `rooms`, with a look around in each; or two looks around in one, between which `moved`
    were moved or taken away. `openness`: of furniture that stands open beyond what the house says; `inside`: what is
    seen in it, with its instance ids. `views` are what people in the house see: shares of a picture from their eyes."""

    name: str
    house: str
    rooms: tuple[str, ...]
    frames: tuple[WalkFrame, ...]
    moved: tuple[str, ...] = ()
    openness: Mapping[str, float] = field(default_factory=dict)
    inside: Mapping[str, int] = field(default_factory=dict)
    views: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def tour(house: House, graph: NavGraph, rooms: int, *, rng: np.random.Generator) -> tuple[list[int], list[int]]:
    """Nodes of a walk from a drawn room into up to so many rooms, the nearest first, and those to look around at."""
    middles: dict[str, int] = {}
    for room in sorted({*graph.room_of_node}):
        walls = shapely.Polygon(house.room_by_id[room].polygon).exterior
        nodes = [n for n, r in enumerate(graph.room_of_node) if r == room]
        middles[room] = max(nodes, key=lambda n: walls.distance(shapely.Point(graph.positions[n, :2])))
    path = [middles[sorted(middles)[int(rng.integers(len(middles)))]]]
    stops = [path[0]]
    while left := sorted({*middles} - {graph.room_of_node[n] for n in stops}) if len(stops) < rooms else ():
        room = min(left, key=lambda r: graph.distance[path[-1], middles[r]] + rng.uniform(0, 2))
        path += graph.path(path[-1], middles[room])[1:]
        stops.append(path[-1])
    return path, stops


def cameras(graph: NavGraph, path: Sequence[int], stops: Sequence[int], yaw: float) -> Iterator[Camera]:
    """The cameras of a walk that begins with a look along `yaw`; it looks all around at each stop."""
    todo, here = list(stops), graph.positions[path[0]]
    for k, node in enumerate(path):
        there = graph.positions[node]
        if k:
            ahead = math.atan2(*(there - here)[1::-1])
            turns = math.ceil(abs(float(wrap(ahead - yaw))) / TURN)
            yield from ((here, float(wrap(yaw + wrap(ahead - yaw) * i / turns))) for i in range(1, turns))
            steps, yaw = math.ceil(float(np.linalg.norm(there - here)) / STRIDE), ahead
            yield from ((here + (there - here) * i / steps, yaw) for i in range(1, steps))
        here, stays = there, node in todo[:1]
        todo = todo[stays:]
        yield from look_around(here, yaw) if stays else [(here, yaw)]


def look_around(position: np.ndarray, yaw: float) -> list[Camera]:
    """The cameras of a turn on the spot that begins at `yaw`."""
    return [(position, float(wrap(yaw + i * TURN))) for i in range(round(2 * math.pi / TURN))]


def view_of(world: World, person: Placement) -> dict[str, float]:
    """Shares of what somebody sees who looks ahead, of a picture 96 degrees wide; nothing if the own body is in it."""
    ahead = facing_of(person.yaw)
    reach, height = person.size[1] / 2 + 0.05, person.position[2] + EYES * person.size[2]
    eye = (person.position[0] + reach * math.cos(ahead), person.position[1] + reach * math.sin(ahead), height)
    view = world.camera(eye, ahead, math.radians(-12), math.radians(80), (120, 160))
    shares = shares_of(world, view.ids)
    return shares if person.id not in shares else {}


def film(world: World, track: Sequence[Camera], folder: Path, first: int = 0) -> Iterator[WalkFrame]:
    """Draw frames of a walk into `folder`, from number `first`: NNN.jpg, and NNN.png with instance ids of 16 bits."""
    things = {p.id: p for p in world.shown.placements}
    fronts = {o: movable for o, p in things.items() if (movable := fronts_of(p, world.catalogue))}
    for k, (position, yaw) in enumerate(track, first):
        view = world.camera(position, yaw, *LENS)
        pictures = {"jpg": view.rgb[..., ::-1], "png": view.ids.astype(np.uint16)}
        for kind, picture in pictures.items():
            how = [cv2.IMWRITE_JPEG_QUALITY, 88] if kind == "jpg" else []
            write_bytes(folder / f"{k:03d}.{kind}", cv2.imencode(f".{kind}", picture, how)[1].tobytes())
        shares = shares_of(world, view.ids)
        edge = np.unique(np.concatenate([view.ids[[0, -1]].ravel(), view.ids[:, [0, -1]].ravel()]))
        cut = {world.drawn[i - 1] for i in edge.tolist() if i}
        large = [o for o, share in shares.items() if share >= LARGE or (share >= CLEAR_SHARE and o not in cut)]
        clear = sorted(o for o in large if shares[o] >= WHOLE * outline(things[o], position, yaw))
        points = points_of(view.depth, position, yaw)
        states = {o: stands_open(things[o], fronts[o], points, position, yaw) for o in clear if o in fronts}
        ajar, shut = (tuple(o for o, is_open in states.items() if is_open is x) for x in (True, False))
        x, y, z = (round(float(c), 3) for c in position)
        yield WalkFrame((x, y, z), round(yaw, 4), shares, tuple(clear), ajar, shut)


def read_frame(path: Path, mode: int = cv2.IMREAD_COLOR) -> np.ndarray:
    """The picture of a file of a walk.

    Raises:
      RecordError: it is missing or damaged.
    """
    picture = read_picture(path, mode)
    if picture is None:
        raise RecordError(f"{path} is no whole picture; build the data set again")
    return picture


def shares_of(world: World, ids: np.ndarray) -> dict[str, float]:
    """Placements, and what lies in open furniture, to their shares of a picture of instance ids."""
    counts, there = np.bincount(ids.ravel(), minlength=1)[1:], {p.id for p in world.shown.placements}
    drawn = world.drawn
    shares = {drawn[i]: round(float(counts[i]) / ids.size, 5) for i in np.flatnonzero(counts)}
    return {name: share for name, share in shares.items() if name in there}


def outline(p: Placement, position: Sequence[float] | np.ndarray, yaw: float, edge: float = 1.0) -> float:
    """Area of the outline of a box, of a frame, up to its edge or farther; 0 where it reaches behind the camera."""
    flat = rectangle(*p.position[:2], *p.size[:2], p.yaw)
    corners = np.array([[x, y, p.position[2] + z] for x, y in flat for z in (0.0, p.size[2])])
    return float(cv2.contourArea(np.clip(hull(corners, position, yaw), -edge, edge))) / 4


def hull(corners: np.ndarray, position: Sequence[float] | np.ndarray, yaw: float) -> np.ndarray:
    """(k, 1, 2) float32 outline in a frame, -1 to 1 to the right and upwards, of points (n, 3), metres; a single point
    where they reach behind the camera."""
    pitch, vfov, (height, width) = LENS
    camera = camera_at(position, yaw, pitch, vfov)
    along = (corners := corners - camera.position) @ camera.forward
    plane = np.stack([corners @ camera.right * height / width, corners @ camera.up]) / along / math.tan(vfov / 2)
    return cv2.convexHull(plane.T.astype(np.float32)) if along.min() > 0.05 else np.zeros((1, 1, 2), np.float32)


def fronts_of(p: Placement, catalogue: Catalogue) -> list[MovingPart]:
    """The doors and drawers of furniture; none where they are of glass."""
    whole = None if "glass" in p.object_class else apart(catalogue.mesh, p)
    return [m for m in whole.moving if m.kind in OPEN_KINDS] if whole else []


def corners_of(m: MovingPart, openness: float = 0.0) -> np.ndarray:
    """(8, 3) of the box of a door or drawer that is open so far, metres in the frame of its thing."""
    turn, shift = m.turn(openness)
    return np.array(np.meshgrid(*m.box.T)).reshape(3, -1).T @ turn.T + shift


def points_of(depth: np.ndarray, position: Sequence[float] | np.ndarray, yaw: float) -> np.ndarray:
    """(n, 3) what every other pixel of every other row of a frame shows, metres in the world; from its depth."""
    pitch, vfov, (height, width) = LENS
    camera, half = camera_at(position, yaw, pitch, vfov), math.tan(vfov / 2)
    right, up = (half * (2 * np.arange(0.5, n, 2) / n - 1) for n in (width, height))
    rays = camera.forward + (right * width / height)[:, None] * camera.right - up[:, None, None] * camera.up
    return (camera.position + np.minimum(depth[::2, ::2, None], FAR_PLANE) * rays).reshape(-1, 3)


def stands_open(
    p: Placement, fronts: Sequence[MovingPart], points: np.ndarray, position: Sequence[float] | np.ndarray, yaw: float
) -> bool | None:
    """True if a frame, by its `points_of`, shows that a door or drawer of furniture stands open, False if it shows that
    none does; None if it shows neither."""
    pose, wide = RigidPose.upright(p.position, p.yaw), openness_of(p.params)
    within = lambda at, box, by=TOLERANCE: ((at > box[0] - by) & (at < box[1] + by)).all(1)
    local = pose.local(points)
    for m in fronts:
        if wide.get(m.name, 0.0) > AJAR:
            turn, shift = m.turn(wide[m.name])
            leaf = within(as_shut := (local - shift) @ turn, m.box)
            behind = within(as_shut, m.inside, BOARDS) if m.slides else within(local, m.inside)
            if (behind & ~leaf).mean() > max(STATE_SHARE, LOOK_IN * leaf.mean()) and leaf.mean() > STATE_SHARE:
                return True
    areas = [cv2.contourArea(hull(pose.points(corners_of(m)), position, yaw)) / 4 or math.inf for m in fronts]
    away = [np.array(m.box.mean(0) - pose.local(np.asarray(position)[None])[0]) for m in fronts]
    shown = sum(within(local, m.box).mean() for m in fronts) > max(SHUT_SHOWN * sum(areas), STATE_SHARE)
    return False if shown and not wide and min(d[1] / np.linalg.norm(d) for d in away) > FACING else None

"""Walks through a house for questions about it: where the camera goes, and how much of what each frame shows."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import shapely

from embodied.assets.cache import write_bytes
from embodied.assets.catalogue import Catalogue
from embodied.assets.decoding import read_picture
from embodied.assets.moving_parts import openness_of
from embodied.geometry import facing_of, rectangle, wrap
from embodied.house.house import House, Placement
from embodied.house.moment import RigidPose, apart
from embodied.navigation.graph import NavGraph
from embodied.records import RecordError
from embodied.render.camera import camera_at
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
AJAR, MOSTLY, BESIDES, OVERLAP, OPEN_SHARES, OPEN_KINDS = 0.5, 0.5, 1.3, 0.7, (0.006, 0.35), ("door", "flap", "drawer")
"""Openness from which a door or drawer stands open; the least share of its outline that shows it; how much of the thing
is seen for it; the most share of the outline that is where it is when shut; its least and most share of a frame."""
Camera = tuple[np.ndarray, float]
"""(3,) position, metres, and yaw, radians."""


@dataclass(frozen=True)
class WalkFrame:
    """One picture: `shares` of its pixels by placement; `clear` are those that count as seen,
    `ajar` furniture of which it shows a door or drawer that stands open."""

    position: tuple[float, float, float]
    yaw: float
    shares: Mapping[str, float]
    clear: tuple[str, ...] = ()
    ajar: tuple[str, ...] = ()


@dataclass(frozen=True)
class Walk:
    """walk.json: a walk through `rooms`, with a look around in each; or two looks around in one, between which `moved`
    were moved or taken away. `openness`: of furniture that stands open beyond what the house says. `views` are what
    people in the house see: shares of a picture from their eyes."""

    name: str
    house: str
    rooms: tuple[str, ...]
    frames: tuple[WalkFrame, ...]
    moved: tuple[str, ...] = ()
    openness: Mapping[str, float] = field(default_factory=dict)
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
    things = {p.id: p for p in world.moment.applied(world.house).placements}
    parts, number = [*ajar_parts(things.values(), world.catalogue)], {name: i for i, name in enumerate(world.owners, 1)}
    for k, (position, yaw) in enumerate(track, first):
        view, outlined = world.camera(position, yaw, *LENS), partial(hull, position=position, yaw=yaw)
        pictures = {"jpg": view.rgb[..., ::-1], "png": view.ids.astype(np.uint16)}
        for kind, picture in pictures.items():
            how = [cv2.IMWRITE_JPEG_QUALITY, 88] if kind == "jpg" else []
            write_bytes(folder / f"{k:03d}.{kind}", cv2.imencode(f".{kind}", picture, how)[1].tobytes())
        shares = shares_of(world, view.ids)
        edge = np.unique(np.concatenate([view.ids[[0, -1]].ravel(), view.ids[:, [0, -1]].ravel()]))
        cut = {world.owners[i - 1] for i in edge.tolist() if 0 < i <= len(things)}
        large = [o for o, share in shares.items() if share >= LARGE or (share >= CLEAR_SHARE and o not in cut)]
        clear = (o for o in large if shares[o] >= WHOLE * outline(things[o], position, yaw))
        x, y, z = (round(float(c), 3) for c in position)
        ajar = (o for o, *boxes in parts if o in shares and shows(view.ids, number[o], *map(outlined, boxes)))
        yield WalkFrame((x, y, z), round(yaw, 4), shares, tuple(sorted(clear)), tuple(sorted({*ajar})))


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
    """Placements to their shares of a picture of instance ids."""
    counts = np.bincount(ids.ravel(), minlength=len(world.house.placements) + 1)[1 : len(world.house.placements) + 1]
    return {world.owners[i]: round(float(counts[i]) / ids.size, 5) for i in np.flatnonzero(counts)}


def outline(p: Placement, position: Sequence[float] | np.ndarray, yaw: float) -> float:
    """Share of a frame inside the outline of a thing's box; 0 where it reaches behind the camera."""
    flat = rectangle(*p.position[:2], *p.size[:2], p.yaw)
    corners = np.array([[x, y, p.position[2] + z] for x, y in flat for z in (0.0, p.size[2])])
    return float(cv2.contourArea(np.clip(hull(corners, position, yaw), -1, 1))) / 4


def hull(corners: np.ndarray, position: Sequence[float] | np.ndarray, yaw: float) -> np.ndarray:
    """(k, 1, 2) float32 outline in a frame, -1 to 1 to the right and upwards, of points (n, 3), metres; a single point
    where they reach behind the camera."""
    pitch, vfov, (height, width) = LENS
    camera = camera_at(position, yaw, pitch, vfov)
    along = (corners := corners - camera.position) @ camera.forward
    plane = np.stack([corners @ camera.right * height / width, corners @ camera.up]) / along / math.tan(vfov / 2)
    return cv2.convexHull(plane.T.astype(np.float32)) if along.min() > 0.05 else np.zeros((1, 1, 2), np.float32)


def ajar_parts(things: Iterable[Placement], catalogue: Catalogue) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Furniture by id with the (8, 3) corners, metres, of each door and drawer that stands open, as it is and shut."""
    for p in things:
        whole, openness = apart(catalogue.mesh, p), openness_of(p.params)
        for m in whole.moving if whole else ():
            if m.kind in OPEN_KINDS and openness.get(m.name, 0.0) > AJAR:
                corners, pose = np.array(np.meshgrid(*m.box.T)).reshape(3, -1).T, RigidPose.upright(p.position, p.yaw)
                is_at = lambda turn, shift, box=corners, pose=pose: pose.points(box @ turn.T + shift)
                yield p.id, is_at(*m.turn(openness[m.name])), is_at(*m.turn(0.0))


def shows(ids: np.ndarray, number: int, outlined: np.ndarray, shut: np.ndarray) -> bool:
    """True if a frame holds an outline (of `hull`) whole, neither too small nor too large, and most of it shows a thing
    with this number; and if little enough of it is where the part is when it is shut."""
    height, width = ids.shape
    area, both = cv2.contourArea(outlined) / 4, cv2.intersectConvexConvex(outlined, shut)[0] / 4
    pixels = (outlined[:, 0] * (1, -1) + 1) / 2 * (width, height)
    inside = cv2.fillConvexPoly(np.zeros(ids.shape, np.uint8), pixels.astype(np.int32), 1) * (ids == number)
    seen = both < OVERLAP * area and np.abs(outlined).max() < 1 and OPEN_SHARES[0] < area < OPEN_SHARES[1]
    return bool(seen and inside.mean() > MOSTLY * area and (ids == number).sum() > BESIDES * inside.sum())

"""Checks that a data set fits together: files and their digests, a house and its graph, tasks and their house."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import shapely

from embodied.assets.cache import digest
from embodied.datasets.build import VERSION, DatasetConfig
from embodied.house.house import House
from embodied.interface import Episode, FindObject, FollowRoute, GoTo, Place, Route, Task
from embodied.navigation.graph import NavGraph
from embodied.records import RecordError, from_plain, read_json

T = TypeVar("T")
R = TypeVar("R", Route, Task)
Edges = set[tuple[int, int]]
ASTRAY = 1.0
"""Metres that a viewpoint may lie outside its room: on a threshold, on a stair."""
REBUILD = "delete {home} and run the command that built {folder} once more, it builds that house again"


class DatasetError(ValueError):
    """A folder that is not a whole data set of this version, or a split it does not have."""


@dataclass(frozen=True)
class SplitCounts:
    """One row of the table of splits."""

    houses: int
    tasks: int
    routes: int
    nodes: int


@dataclass(frozen=True)
class Index:
    """dataset.json: what a whole data set holds."""

    version: int
    config: DatasetConfig
    splits: Mapping[str, SplitCounts]
    digest: str
    """Of `files`; two data sets with one digest are the same."""
    files: Mapping[str, str]
    """'<house>/<file>' to the digest of its content, 16 letters."""


@dataclass(frozen=True)
class _Begun:
    """config.json: whose folder it is."""

    version: int
    config: DatasetConfig
    program: str = ""
    """The code that began it; data sets of the first days do not say."""


def read_config(folder: Path) -> DatasetConfig:
    """The settings of the data set in `folder`.

    Raises:
      DatasetError: none, of another version, or a damaged file.
    """
    path = folder / "config.json"
    if not path.exists():
        raise DatasetError(f"{folder} holds no data set; build one with `embodied dataset hanna --out {folder}`")
    return _read(_Begun, path, folder).config


def read_index(folder: Path, config: DatasetConfig) -> Index:
    """dataset.json of the data set in `folder`, whose settings are `config`.

    Raises:
      DatasetError: damaged, changed, or another data set's.
    """
    path = folder / "dataset.json"
    index = _read(Index, path, folder)
    if index.config != config:
        raise DatasetError(f"{path} is of another data set than {folder / 'config.json'}; build it again")
    if digest(dict(index.files)) != index.digest:
        raise DatasetError(f"{path}: its digest is not that of its files; somebody changed it, build it again")
    return index


def _read(kind: type[T], path: Path, folder: Path) -> T:
    try:
        body = read_json(path)
        if body.get("version") != VERSION:
            raise DatasetError(
                f"{path}: {folder} was built by version {body.get('version')!r:.40} of the format, this is {VERSION}; "
                "build it again"
            )
        return from_plain(kind, body, path.name)
    except RecordError as e:
        where = "" if str(e).startswith(str(path)) else f"{path}: "
        raise DatasetError(f"{where}{e}; build {folder} again") from e


def read_checked(folder: Path, name: str, file: str, files: Mapping[str, str]) -> bytes:
    """The content of one file of the house `name`, if it is the one that was written.

    Raises:
      DatasetError: it is missing, or not the one that dataset.json names.
    """
    home = folder / "houses" / name
    remedy = REBUILD.format(home=home, folder=folder)
    try:
        data = (home / file).read_bytes()
    except FileNotFoundError:
        raise DatasetError(f"{home} has lost its {file}; {remedy}") from None
    if digest(data)[:16] != files.get(f"{name}/{file}"):
        raise DatasetError(
            f"{home / file} was changed since it was written (dataset.json has another digest); {remedy}"
        )
    return data


def check_place(where: Path, house: House, graph: NavGraph, name: str) -> None:
    """Refuse a house of another name, and viewpoints that are not in their rooms.

    Raises:
      DatasetError: says which.
    """
    if house.name != name:
        raise DatasetError(f"{where} holds the house {house.name!r}, expected {name!r}; copy the right one")
    for node, room_id in enumerate(graph.room_of_node):
        room = house.room_by_id.get(room_id)
        if room is None:
            raise DatasetError(f"{where}: viewpoint {graph.ids[node]!r} is in the unknown room {room_id!r}")
        x, y, z = graph.positions[node]
        above = z - house.storey_of(room).elevation
        if shapely.Polygon(room.polygon).distance(shapely.Point(x, y)) > ASTRAY or not 0 <= above <= 20:
            raise DatasetError(f"{where}: viewpoint {graph.ids[node]!r} at {(x, y, z)} is not in its room {room_id!r}")


def check_routes(where: Path, routes: Sequence[Route], graph: NavGraph) -> None:
    """Refuse routes that share an id, or that do not go from viewpoint to neighbouring viewpoint.

    Raises:
      DatasetError: says which.
    """
    edges = _edges(graph)
    _each(where, routes, lambda route: _off_the_graph(route.path, graph, edges))


def check_tasks(where: Path, tasks: Sequence[Task], kind: str, house: House, graph: NavGraph) -> None:
    """Refuse tasks that cannot be done in their house.

    Raises:
      DatasetError: says which and why.
    """
    edges = _edges(graph)
    _each(where, tasks, lambda task: _wrong_task(task, kind, house, graph) or _wrong_goal(task, house, graph, edges))


def _each(where: Path, items: Sequence[R], wrong: Callable[[R], str | None]) -> None:
    seen: set[str] = set()
    for number, item in enumerate(items, 1):
        problem = "the id stands in an earlier line, too" if item.id in seen else wrong(item)
        if problem:
            raise DatasetError(f"{where}:{number}: {type(item).__name__.lower()} {item.id!r}: {problem}")
        seen.add(item.id)


def _wrong_task(task: Task, kind: str, house: House, graph: NavGraph) -> str | None:
    if (task.kind, task.world) != (kind, house.name):
        return f"it is a {task.kind!r} in {task.world!r}, expected a {kind!r} in {house.name!r}"
    return _no_node((task.start.node, *task.goal_nodes), graph)


def _wrong_goal(task: Task, house: House, graph: NavGraph, edges: Edges) -> str | None:
    if isinstance(task.goal, FindObject):
        return _wrong_object(task.goal, house)
    if isinstance(task.goal, GoTo):
        known = house.room_by_id.keys() | house.placement_by_id.keys()
        missing = [name for name in (*task.goal.rooms, *task.goal.placements) if name not in known]
        return f"the house has no {missing[0]!r}" if missing else None
    if not isinstance(task.goal, FollowRoute):
        return f"a data set holds no goals of kind {type(task.goal).__name__}"
    ends = (task.goal.path[0], (task.goal.path[-1],))
    if ends != (task.start.node, task.goal_nodes):
        return f"it starts at {task.start.node} and ends at {task.goal_nodes}, its route at {ends}"
    return _off_the_graph(task.goal.path, graph, edges)


def _wrong_object(goal: FindObject, house: House) -> str | None:
    if not goal.placements:
        return "its goal names no placements"
    for name in goal.placements:
        placed = house.placement_by_id.get(name)
        if placed is None or placed.object_class != goal.object_class:
            return f"the house has no {goal.object_class!r} called {name!r}"
        if goal.room_kind not in (None, house.room_by_id[placed.room].kind):
            return f"{name!r} is not in a {goal.room_kind!r}"
    return None


def _no_node(nodes: Iterable[int], graph: NavGraph) -> str | None:
    count = len(graph.ids)
    lost = [n for n in nodes if not 0 <= n < count]
    return f"the house has the viewpoints 0 to {count - 1}, not {lost[:3]}" if lost else None


def _off_the_graph(path: Sequence[int], graph: NavGraph, edges: Edges) -> str | None:
    steps = [(a, b) for a, b in zip(path, path[1:]) if (min(a, b), max(a, b)) not in edges]
    return _no_node(path, graph) or (f"viewpoints {steps[0]} are no neighbours" if steps else None)


def _edges(graph: NavGraph) -> Edges:
    """Pairs of neighbours, the smaller number first."""
    return {(min(a, b), max(a, b)) for a, b in graph.edges.tolist()}


def check_episode(episode: Episode, place: Place) -> None:
    """Refuse an episode that was played elsewhere.

    Raises:
      DatasetError: in another house of this name, or along nodes that this one does not have.
    """
    name, n = episode.task.id, len(place.graph.ids)
    if episode.house != place.house.digest[:16]:
        raise DatasetError(
            f"the episode of {name!r} was played in another house of the name {episode.task.world!r} (digest "
            f"{episode.house or 'unknown'}, this one has {place.house.digest[:16]}); give the data set that it was "
            "played in, or play it again here"
        )
    named = {*episode.nodes, *episode.task.goal_nodes}
    named.update(v for s in episode.steps for v in (s.pose.node, *s.targets, *s.candidate_nodes))
    if strange := sorted(v for v in named if v >= n):
        raise DatasetError(f"the episode of {name!r} names the nodes {strange[:5]}, its house has 0 to {n - 1}")

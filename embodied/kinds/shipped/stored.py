"""Stored: find a thing of a class that lies in furniture, which has to be opened (docs/doors.md)."""

import dataclasses
import functools
from typing import cast

import numpy as np

from embodied import interface
from embodied.action_spaces import PanoramicMoves, Reach, nearest_views
from embodied.assets.catalogue import load_catalogue
from embodied.envs.base import HelpEnv
from embodied.geometry import wrap
from embodied.house.contents import contents, part_of
from embodied.house.house import Placement
from embodied.kinds import task_kind
from embodied.navigation.graph import OPENING, NavGraph
from embodied.policies.doors import Fetch, Searcher
from embodied.tasks.goals import FindConfig, GoalClass, build_pool, find_task, footprint_distance

CONFIG = FindConfig(kind="stored", fewest_nodes=2, horizon=60)
SEEN = 4
"""Pixels, of Sighting.pixels, from which on a thing in an open part counts as seen."""
WITHIN_REACH, MOST_PARTS = 1.5, 8
"""Metres within which furniture in one's room can be opened from before it, and how many parts of it, the nearest."""


def stored_things(place: interface.Place) -> tuple[Placement, ...]:
    """All that lies in the furniture of a house."""
    return contents(place.house, getattr(place, "catalogue", None) or load_catalogue(), hidden=True)


class ReachingMoves(PanoramicMoves):
    """Those of the panoramic action space, and behind them, masked, the parts of furniture within reach."""

    def __init__(self) -> None:
        super().__init__()
        self._parts: dict[str, list[dict[str, np.ndarray]]] = {}

    def parts(self, place: interface.Place) -> list[dict[str, np.ndarray]]:
        """By node, the parts of furniture in which something lies that can be opened from there, the nearest first, and
        where it lies, (3,) metres."""
        if (name := place.house.name) not in self._parts:
            middles = {part_of(c.id): np.array(c.position) for c in stored_things(place)}
            eyes, near = np.asarray(place.graph.positions), [list[tuple[float, str]]() for _ in place.graph.ids]
            for part in middles:
                p = place.house.placement_by_id[part.partition("/")[0]]
                before = (eyes[:, :2] - p.position[:2]) @ [np.sin(p.yaw), -np.cos(p.yaw)] > p.size[1] / 2
                before &= np.array(place.graph.room_of_node) == p.room
                metres = np.where(before, footprint_distance(p, eyes), 9)
                for k in np.flatnonzero(metres <= WITHIN_REACH):
                    near[k].append((float(metres[k]), part))
            self._parts[name] = [{n: middles[n] for _, n in sorted(some)[:MOST_PARTS]} for some in near]
        return self._parts[name]

    def at(self, world: interface.Place, pose: interface.Pose) -> Reach:
        (moves, poses), parts = super().at(world, pose), self.parts(world)[pose.node]
        x, y, z = (np.array([*parts.values()]).reshape(-1, 3) - world.graph.positions[pose.node]).T
        yaw, slope = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
        views = nearest_views(yaw, slope)
        columns = (wrap(yaw - pose.yaw), slope, views, np.zeros(len(parts), bool))
        before = (moves.bearing, moves.slope, moves.view, moves.allowed)
        b, s, v, can = (np.concatenate([a, b]).astype(a.dtype) for a, b in zip(before, columns, strict=True))
        looks = (interface.Pose(pose.node, int(v) % interface.TURNS, int(v) // interface.TURNS - 1) for v in views)
        return interface.Candidates(b, s, v, can), (*poses, *looks)


class StoredEnv(HelpEnv):
    """Plain navigation with furniture that opens; all of it is closed at the start."""

    moves: ReachingMoves

    def _truth(self) -> dict[int, str]:
        """Parts within reach by candidate."""
        parts = self.moves.parts(self.world)[self.pose.node]
        return dict(enumerate(parts, len(self._reach[1]) - len(parts)))

    def _look(self) -> interface.Observation:
        o, here = super()._look(), self._truth()
        opens, closes = ([k for k, n in here.items() if (n in self.closed) is opened] for opened in (False, True))
        self.observation = dataclasses.replace(o, can_open=(*o.can_open, *opens), can_close=(*o.can_close, *closes))
        return self.observation

    def _moved_part(self, action: interface.Action) -> tuple[str, ...]:
        part = self._truth().get(action.candidate) if isinstance(action, interface.Open | interface.Close) else None
        return () if part is None else (part,)


def goals(place: interface.SeenPlace) -> tuple[GoalClass, ...]:
    """Classes of which all things in a house lie in furniture. A node is a goal where one is seen in every part
    within reach that holds some, once it is open."""
    reach, things, seen = ReachingMoves().parts(place), stored_things(place), set[tuple[str, int, str]]()
    for part in sorted(set().union(*reach)):
        now = place.with_doors({part: 1.0})
        for node in (k for k, parts in enumerate(reach) if part in parts):
            here = (x for x in now.sightings(node) if x.pixels >= SEEN and part_of(x.placement) == part)
            seen |= {(part, node, x.object_class) for x in here}
    classes = []
    for name in sorted({c.object_class for c in things} - {p.object_class for p in place.house.placements}):
        ids = tuple(c.id for c in things if c.object_class == name)
        held = [{*map(part_of, ids)}.intersection(parts) for parts in reach]
        nodes = tuple(n for n, some in enumerate(held) if some and all((p, n, name) in seen for p in some))
        classes += [GoalClass(name, None, ids, nodes)] if nodes else []
    return tuple(classes)


def tasks(inputs: task_kind.TaskInputs, parts: task_kind.Parts) -> task_kind.PartTasks:
    world = cast("interface.SeenPlace", inputs.world)
    pool = build_pool(world, goals(world), CONFIG, seed=inputs.seed)
    task = lambda i: find_task(pool, i, seed=inputs.seed, language=inputs.language, config=CONFIG)
    return task_kind.parts_of_pool(len(pool), task, parts)


def found(episode: interface.Episode, graph: NavGraph) -> float:
    """1 if the agent stopped where it sees what it seeks, in a part that it opened from there; else 0."""
    goal, end, steps = episode.task.goal, episode.nodes[-1], episode.steps
    assert isinstance(goal, interface.FindObject), "of this kind"
    last = {part: s.pose.node if isinstance(s.action, interface.Open) else None for s in steps for part in s.moved}
    here = any(last.get(part_of(p)) == end for p in goal.placements)
    return float(here and end in episode.task.goal_nodes and episode.ended == "stop")


def shortest(episode: interface.Episode, graph: NavGraph) -> float:
    """Metres to the nearest goal, and one part to open there."""
    return min(float(graph.distance[episode.task.start.node, g]) for g in episode.task.goal_nodes) + OPENING


STORED_KIND = task_kind.register_kind(
    task_kind.TaskKind(
        name="stored",
        title="Stored",
        tasks=tasks,
        environment=lambda inputs: functools.partial(StoredEnv, inputs.worlds, moves=ReachingMoves()),
        baselines={**task_kind.PLAIN_AGENTS, "shortest": Fetch, "searcher, blind": functools.partial(Searcher, None)},
        looking={"searcher": Searcher},
        success=found,
        shortest=shortest,
        needs_stop=True,
        metrics={"parts opened": task_kind.Metric(lambda e, _: sum(type(s.action) is interface.Open for s in e.steps))},
        columns=("success", "spl", "parts opened", "navigation error", "steps"),
        opens_doors=True,
        story=task_kind.StoryStyle(dialogue=False),
    )
)

"""Action spaces on the graph: the panoramic one of HANNA, VLN and HARI, and VNLA's monocular one.

Both answer the same question: from this pose, which poses can the next move reach, and what does
the agent know about each. Results depend on the graph and the pose only, never on the task, so
they are computed once per pose and shared by all episodes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np

from embodied import interface
from embodied.geometry import wrap

if TYPE_CHECKING:
    from embodied.navigation.graph import NavGraph

WORDS = ("forward", "left", "right", "up", "down")
"""VNLA's moves, in the order of its candidates; stopping is an action of its own."""
FIELD = math.radians(40)
"""Half the horizontal field in which 'forward' looks for a node: vfov 60 degrees times 640 / 480,
halved, the linear rule of the Matterport3D simulator (docs/sources.md, S1)."""

Reach = tuple[interface.Candidates, tuple[interface.Pose, ...]]
"""The agent's knowledge of its moves, and the privileged pose that each leads to."""


class Moves(Protocol):
    def at(self, world: interface.Place, pose: interface.Pose) -> Reach: ...


class KnownMoves:
    """Moves that are worked out once per pose, by `reach`."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, interface.Pose], Reach] = {}

    def at(self, world: interface.Place, pose: interface.Pose) -> Reach:
        key = world.house.name, pose
        if key not in self._known:
            self._known[key] = self.reach(world.graph, pose)
        return self._known[key]

    def reach(self, graph: NavGraph, pose: interface.Pose) -> Reach:
        raise NotImplementedError


class PanoramicMoves(KnownMoves):
    """Rotate towards a neighbouring node and go there (Fried et al. 2018, dissertation 4.2.2)."""

    def reach(self, graph: NavGraph, pose: interface.Pose) -> Reach:
        """Neighbours sorted by |bearing| from the agent's yaw (docs/sources.md, S2); the tilt does not matter."""
        nodes, yaw, pitch = directions(graph, pose.node)
        bearing = wrap(yaw - pose.yaw)
        order = bearing_order(bearing, nodes)
        view = nearest_views(yaw, pitch)[order]
        angles = (bearing[order].astype(np.float32), pitch[order].astype(np.float32))
        candidates = interface.Candidates(*angles, view, np.ones(len(nodes), dtype=bool))
        poses = tuple(
            interface.Pose(int(j), int(v) % interface.TURNS, int(v) // interface.TURNS - 1)
            for j, v in zip(nodes[order], view)
        )
        return candidates, poses


class MonocularMoves(KnownMoves):
    """Turn or tilt by 30 degrees, or go to the node nearest the middle of the view (VNLA).

    Differs from the authors' program, whose 'forward' prefers the next node of the optimal path
    even at test time (docs/sources.md, S44): here an action never depends on the goal.
    """

    def reach(self, graph: NavGraph, pose: interface.Pose) -> Reach:
        """The five moves of WORDS; 'forward' keeps the camera's angles."""
        ahead = node_ahead(graph, pose)
        forward = pose if ahead is None else interface.Pose(ahead, pose.turn, pose.tilt)
        up, down = min(pose.tilt + 1, 1), max(pose.tilt - 1, -1)
        poses = (
            forward,
            interface.Pose(pose.node, (pose.turn + 1) % interface.TURNS, pose.tilt),
            interface.Pose(pose.node, (pose.turn - 1) % interface.TURNS, pose.tilt),
            interface.Pose(pose.node, pose.turn, up),
            interface.Pose(pose.node, pose.turn, down),
        )
        candidates = interface.Candidates(
            np.array([0.0, interface.STEP, -interface.STEP, 0.0, 0.0], dtype=np.float32),
            np.array([p.pitch for p in poses], dtype=np.float32),
            np.array([p.view for p in poses]),
            np.array([ahead is not None, True, True, pose.tilt < 1, pose.tilt > -1]),
            WORDS,
        )
        return candidates, poses


def directions(graph: NavGraph, node: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Neighbours of `node`, ascending, and where they are seen: (n,) nodes, yaws and pitches in radians."""
    nodes = np.array(sorted(int(j) for j in graph.neighbours(node)), dtype=np.int64)
    offset = np.asarray(graph.positions)[nodes] - np.asarray(graph.positions)[node]
    yaw = np.arctan2(offset[:, 1], offset[:, 0])
    pitch = np.arctan2(offset[:, 2], np.hypot(offset[:, 0], offset[:, 1]))
    return nodes, yaw, pitch


def nearest_views(yaw: np.ndarray, pitch: np.ndarray) -> np.ndarray:
    """(n,) int64: the views whose centres are nearest in sqrt(dyaw^2 + dpitch^2) (docs/sources.md, S2)."""
    d_yaw = wrap(yaw[:, None] - interface.VIEW_YAWS)
    d_pitch = pitch[:, None] - interface.VIEW_PITCHES
    return np.argmin(np.round(d_yaw**2 + d_pitch**2, 9), axis=1)


def bearing_order(bearing: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """(n,) int64: candidates by |bearing|, those that differ by rounding alone by node; exported files keep it."""
    return np.lexsort((nodes, np.round(np.abs(bearing), 9)))


def node_ahead(graph: NavGraph, pose: interface.Pose) -> int | None:
    """The neighbour nearest the middle of the view among those within FIELD sideways, if any."""
    nodes, yaw, pitch = directions(graph, pose.node)
    bearing = wrap(yaw - pose.yaw)
    inside = np.abs(bearing) <= FIELD
    if not inside.any():
        return None
    offset = np.where(inside, np.round(np.hypot(bearing, pitch - pose.pitch), 9), np.inf)
    return int(nodes[int(np.argmin(offset))])


def doors_moved(step: interface.Step, graph: NavGraph, closed: frozenset[str]) -> frozenset[str]:
    """Doors, or parts of furniture, that a step opened or closed; a move opens those that it goes through.

    Args:
      closed: the doors that were closed before.
    """
    if not isinstance(step.action, interface.Move | interface.Open | interface.Close):
        return frozenset()
    if step.moved:
        return frozenset(step.moved)
    here, there = step.pose.node, step.candidate_nodes[step.action.candidate]
    if isinstance(step.action, interface.Close):
        return frozenset(graph.doors.get((min(here, there), max(here, there)), ())) - closed
    return frozenset(graph.barred(here, there, closed))


def doors_in(episode: interface.Episode, graph: NavGraph) -> list[tuple[frozenset[str], frozenset[str]]]:
    """For each step of an episode: the doors that were closed before it, and those that it opened or closed."""
    closed, doors = graph.closed.union(episode.task.closed), []
    for step in episode.steps:
        moved = doors_moved(step, graph, closed)
        doors.append((closed, moved))
        closed ^= moved
    return doors

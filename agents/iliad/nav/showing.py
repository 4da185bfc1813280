"""One episode of NAV in words, and as a record: what was asked, where it went, what was said, what it learned."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from embodied.agents.iliad.nav.student import NavStudent
from embodied.agents.iliad.nav.world import HORIZON, RADIUS, NavWalk, NavWorld, Trip
from embodied.agents.iliad.protocol import DescribingTeacher
from embodied.agents.iliad.showing import learned_from
from embodied.agents.iliad.showing import lines_of as learned_lines
from embodied.envs.base import HelpEnv
from embodied.interface import Episode, FollowRoute, Move, Reply, Stop, Task
from embodied.seeds import stream


@dataclass(frozen=True)
class NavTold:
    """An episode, and how it changes a student."""

    world: str
    request: str
    path: tuple[int, ...]
    """Nodes that were meant."""
    walk: tuple[int, ...]
    """Nodes that the student went to."""
    meant: tuple[str, ...]
    gone: tuple[str, ...]
    """Kinds of the rooms along both."""
    missed: float
    """Metres from its end to the intended one."""
    success: bool
    description: str | None
    """The teacher's description of it."""
    before: float | None
    after: float | None
    """Probability of the walk, given the description, before and after learning from this episode alone."""


def tell(
    student: NavStudent, teacher: DescribingTeacher, trip: Trip, *, seed: int, sample: bool = True
) -> tuple[NavTold, NavWalk]:
    """Play one episode; the student itself stays as it is.

    Args:
      sample: as in training; False takes the likeliest action.
    """
    rng = stream(seed, "nav", "shown", trip.world, *trip.path)
    request, world = trip.requests[0], NavWorld(student.eyes.places)
    (done,) = student.sample([trip], [request], rng=rng) if sample else student.greedy([trip], [request])
    (description,) = teacher.describe([trip], [done], rng=rng)
    before, after = learned_from(student, trip, description, done)
    missed = float(world.graph(trip).distance[done.nodes[-1], trip.path[-1]])
    shown = NavTold(
        trip.world, request, trip.path, done.nodes, rooms(world, trip, trip.path), rooms(world, trip, done.nodes),
        missed, world.success(trip, done), description, before, after,
    )  # fmt: skip
    return shown, done


def rooms(world: NavWorld, trip: Trip, nodes: Sequence[int]) -> tuple[str, ...]:
    """The rooms along a walk, each once while it stays there."""
    room_of = world.graph(trip).room_of_node
    return tuple(room for room, _ in groupby(str(room_of[n]).replace("_", " ") for n in nodes))


def lines_of(shown: NavTold) -> list[str]:
    """The episode for people to read."""
    lines = [
        f"house         {shown.world}",
        f"request       {shown.request}",
        f"meant         {' > '.join(shown.meant)}   ({len(shown.path) - 1} moves)",
        f"student       {' > '.join(shown.gone)}   ({len(shown.walk) - 1} moves)",
        f"fulfilled     {'yes' if shown.success else 'no'}, {shown.missed:.1f} m from the intended end",
    ]
    return [*lines, *learned_lines(shown.description, shown.before, shown.after)]


def episode_of(student: NavStudent, trip: Trip, walk: NavWalk, description: str | None) -> Episode:
    """The walk as a record of play; what the teacher said of it is the reply to the last action."""
    request = trip.requests[0]
    goal = FollowRoute("shown", trip.path)
    task = Task(
        f"{trip.world}/vln/shown", "vln", trip.world, trip.start, goal, trip.path[-1:], request, RADIUS, HORIZON
    )
    env = HelpEnv(student.eyes.places)
    env.reset(task)
    for node in walk.steps:
        here = env.situation
        env.step(Stop() if node == here.pose.node else Move(here.candidate_nodes.index(node)))
    if env.ended is None:
        env.step(Stop())
    episode = env.episode("student")
    last = dataclasses.replace(episode.steps[-1], reply=Reply(description or "(nothing to say)"))
    return dataclasses.replace(episode, steps=(*episode.steps[:-1], last))

"""VLN: follow a route instruction to its end (Room-to-Room; the navigation problem of ILIAD, 3.2.4.2)."""

from __future__ import annotations

from embodied.interface import FollowRoute, Pose, Route, Task

RADIUS = 3.0
"""Metres from the intended end, inclusive (3.2.4.2); Room-to-Room itself says strictly less."""
HORIZON = 20


def vln_task(world: str, route: Route) -> Task:
    """The task of following `route` of the house `world`."""
    return Task(
        f"{world}/vln/{route.id}",
        "vln",
        world,
        Pose(route.path[0], route.turn, route.tilt),
        FollowRoute(route.id, route.path),
        (route.path[-1],),
        route.instruction,
        RADIUS,
        HORIZON,
    )

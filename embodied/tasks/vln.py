"""VLN: follow a route instruction to its end (Room-to-Room; the navigation problem of ILIAD, 3.2.4.2)."""

from __future__ import annotations

from embodied.interface import FollowRoute, Pose, Route, Task

VLN_RADIUS = 3.0
"""Metres from the intended end, inclusive (3.2.4.2); Room-to-Room itself says strictly less."""
VLN_HORIZON = 20


def vln_task(world: str, route: Route) -> Task:
    """The task of following `route` of the house `world`."""
    return Task(
        id=f"{world}/vln/{route.id}",
        kind="vln",
        world=world,
        start=Pose(route.path[0], route.turn, route.tilt),
        goal=FollowRoute(route.id, route.path),
        goal_nodes=(route.path[-1],),
        request=route.instruction,
        radius=VLN_RADIUS,
        horizon=VLN_HORIZON,
    )

"""The first release of the simulator, which VNLA is written for: one agent, `init`, states that stay as they were."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from embodied.mattersim import arguments as take
from embodied.mattersim import simulator
from embodied.mattersim.chance import Engine
from embodied.mattersim.graphs import load_graphs
from embodied.mattersim.pictures import Skyboxes
from embodied.mattersim.sight import ViewPoint

KEPT = 200
"""Decoded skyboxes held in memory."""


class FirstViewPoint(NamedTuple):
    """A viewpoint as the agent sees it. Metres and radians, heading clockwise from +y."""

    viewpointId: str
    ix: int
    point: list[float]
    """[x, y, z], metres, world."""
    rel_heading: float
    rel_elevation: float
    rel_distance: float


class FirstSimState(NamedTuple):
    """State of the agent, as it was when `getState` was called."""

    scanId: str
    step: int
    rgb: np.ndarray | None
    """(H, W, 3) uint8, blue, green, red; None without rendering."""
    location: FirstViewPoint
    heading: float
    elevation: float
    viewIndex: int
    navigableLocations: list[FirstViewPoint]


class _One(simulator.Simulator):
    """The batched simulator with one agent, which reads the graph of a scan when it enters it."""

    def initialize(self) -> None:
        self._scans, self._ready = [""], True

    def enter(self, scan: str) -> None:
        if self._motion is None or self._scans != [scan]:
            self._graphs = load_graphs(self._graph_path, (scan,))
            self._motion = self._new_motion()

    def snapshot(self) -> FirstSimState:
        motion = self._motion
        if motion is None:
            raise ValueError("MatterSim: call newEpisode before getState")
        return FirstSimState(
            self._scans[0],
            self._step,
            self._picture(0, depth=False) if self._rendering else None,
            _pointed(motion.here(0)),
            motion.heading(0),
            motion.elevation(0),
            motion.view(0),
            [_pointed(v) for v in motion.locations(0)],
        )


def _pointed(seen: ViewPoint) -> FirstViewPoint:
    return FirstViewPoint(seen[0], seen[1], [seen[2], seen[3], seen[4]], seen[5], seen[6], seen[7])


class FirstSimulator:
    """One agent; with discretized angles the sign of a change turns or tilts by 30 degrees.

    Differs from the first release in: without `setSeed` random viewpoints follow from seed 1, not from the clock.
    """

    def __init__(self) -> None:
        self._one = _One()
        self._one._engine = Engine()
        self.setDatasetPath("./data")

    def setDatasetPath(self, path: str, /) -> None:
        """Folder above `v1/scans/<scan>/matterport_skybox_images`."""
        self._one._skyboxes = Skyboxes(f"{take.text(path, 'setDatasetPath')}/v1/scans", KEPT, apart=True)

    def setNavGraphPath(self, path: str, /) -> None:
        """Folder of `<scan>_connectivity.json`; there need not be a scans.txt."""
        self._one._graph_path = take.text(path, "setNavGraphPath")

    def setCameraResolution(self, width: int, height: int, /) -> None:
        self._one.setCameraResolution(width, height)

    def setCameraVFOV(self, vfov: float, /) -> None:
        self._one.setCameraVFOV(vfov)

    def setRenderingEnabled(self, value: bool, /) -> None:
        self._one.setRenderingEnabled(value)

    def setDiscretizedViewingAngles(self, value: bool, /) -> None:
        self._one.setDiscretizedViewingAngles(value)

    def setElevationLimits(self, low: float, high: float, /) -> bool:
        return self._one.setElevationLimits(low, high)

    def setSeed(self, seed: int, /) -> None:
        self._one._engine = Engine(take.integer(seed, "setSeed"))

    def init(self) -> None:
        self._one.initialize()

    def newEpisode(self, scanId: str, viewpointId: str, heading: float, elevation: float, /) -> None:
        """Put the agent somewhere; an empty viewpoint id is a random one.

        Raises:
          ValueError: no graph of this scan, an unknown or an excluded viewpoint.
        """
        scan, viewpoint = take.text(scanId, "newEpisode: scanId"), take.text(viewpointId, "newEpisode: viewpointId")
        turn, tilt = take.number(heading, "newEpisode: heading"), take.number(elevation, "newEpisode: elevation")
        if not self._one._ready:
            self.init()
        self._one.enter(scan)
        self._one.newEpisode([scan], [viewpoint or self._one._random_viewpoint(scan)], [turn], [tilt])

    def getState(self) -> FirstSimState:
        return self._one.snapshot()

    def makeAction(self, index: int, heading: float, elevation: float, /) -> None:
        """Move to a location of the list (0 stays), then turn and tilt.

        Raises:
          ValueError: an index that is not in the list, or no episode yet.
        """
        move = take.index(index, "makeAction: index")
        turn, tilt = take.number(heading, "makeAction: heading"), take.number(elevation, "makeAction: elevation")
        if self._one._motion is None:
            raise ValueError(f"MatterSim: Invalid action index: {index}; call newEpisode first")
        self._one.makeAction([move], [turn], [tilt])

    def close(self) -> None:
        self._one.close()

"""The first release of the simulator, which VNLA is written for: one agent, `init`, states that stay as they were."""

from __future__ import annotations

import operator
from typing import NamedTuple

import numpy as np

from embodied.mattersim import simulator
from embodied.mattersim.graphs import load_graphs
from embodied.mattersim.pictures import Skyboxes
from embodied.mattersim.sight import ViewPoint
from embodied.seeds import stream

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


def _pointed(seen: ViewPoint) -> FirstViewPoint:
    return FirstViewPoint(seen[0], seen[1], [seen[2], seen[3], seen[4]], seen[5], seen[6], seen[7])


class FirstSimulator(simulator.Simulator):
    """One agent; with discretized angles the sign of a change turns or tilts by 30 degrees.

    Differs from the first release in: without `setSeed` random viewpoints follow from seed 1, not from the clock; it
    has the methods of the batched simulator, too.
    """

    def __init__(self) -> None:
        super().__init__()
        self.setSeed(1)
        self.setDatasetPath("./data")

    def setDatasetPath(self, path: str, /) -> None:
        """Folder above `v1/scans/<scan>/matterport_skybox_images`."""
        self._skyboxes = Skyboxes(f"{path}/v1/scans", KEPT, apart=True)

    def setNavGraphPath(self, path: str, /) -> None:
        """Folder of `<scan>_connectivity.json`; there need not be a scans.txt."""
        self._graph_path = str(path)

    def setSeed(self, seed: int, /) -> None:
        self._rng = stream(operator.index(seed), "MatterSim")

    def initialize(self) -> None:
        """Nothing is read: the graph of a scan is when an episode begins there."""
        self._scans, self._ready = [""], True

    init = initialize

    def newEpisode(self, scanId: str, viewpointId: str, heading: float, elevation: float, /) -> None:  # type: ignore[override]
        """Put the agent somewhere; an empty viewpoint id is a random one.

        Raises:
          ValueError: no graph of this scan, an unknown or an excluded viewpoint.
        """
        self._ready = True
        if self._motion is None or self._scans != [scanId]:
            self._graphs = load_graphs(self._graph_path, (scanId,))
            self._motion = self._new_motion()
        super().newEpisode([scanId], [viewpointId or self._random_viewpoint(scanId)], [heading], [elevation])

    def getState(self) -> FirstSimState:  # type: ignore[override]
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

    def makeAction(self, index: int, heading: float, elevation: float, /) -> None:  # type: ignore[override]
        """Move to a location of the list (0 stays), then turn and tilt.

        Raises:
          ValueError: an index that is not in the list, or no episode yet.
        """
        if self._motion is None:
            raise ValueError(f"MatterSim: Invalid action index: {index}; call newEpisode first")
        super().makeAction([index], [heading], [elevation])

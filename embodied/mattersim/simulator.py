"""The batched simulator (upstream, and the fork of HANNA and ILIAD): `Simulator`, `SimState`, `ViewPoint`.

Names, defaults and errors are those of the C++ module (Anderson et al. 2018). Angles are radians, headings clockwise
from +y, elevations up; positions metres. Settings are ignored once `initialize` was called, but for the camera's
resolution and its field of view, as there.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from embodied.mattersim.graphs import (
    DiscreteViews,
    Graphs,
    NavigableLocations,
    ViewPoint,
    listed_scans,
    load_graphs,
    lookout,
)
from embodied.mattersim.pictures import Skyboxes
from embodied.seeds import stream

Draw = Callable[[str, str, float, float, float, tuple[int, int]], np.ndarray]
"""(scan, viewpoint, heading, elevation, vertical field of view, (height, width)) -> picture."""


class SimState:
    """State of one agent of a batch. It is alive: after the next action it shows the new state."""

    __slots__ = ("_agent", "_motion", "_simulator")

    def __init__(self, simulator: Simulator, motion: DiscreteViews, agent: int) -> None:
        self._simulator, self._motion, self._agent = simulator, motion, agent

    @property
    def scanId(self) -> str:
        return self._simulator._scans[self._agent]

    @property
    def step(self) -> int:
        """Actions since the episode began."""
        return self._simulator._step

    @property
    def rgb(self) -> np.ndarray:
        """(H, W, 3) uint8, blue, green, red; row 0 is on top. Black without rendering."""
        return self._simulator._picture(self._agent, depth=False)

    @property
    def depth(self) -> np.ndarray:
        """(H, W, 1) uint16, quarters of a millimetre along the optical axis. 0 without depth."""
        return self._simulator._picture(self._agent, depth=True)

    @property
    def location(self) -> ViewPoint | None:
        """None before the first episode."""
        return self._motion.locations(self._agent)[0] if self._motion.started else None

    @property
    def heading(self) -> float:
        """In [0, 2 pi)."""
        return self._motion.heading(self._agent) if self._motion.started else 0.0

    @property
    def elevation(self) -> float:
        return self._motion.elevation(self._agent) if self._motion.started else 0.0

    @property
    def viewIndex(self) -> int:
        """0..35 when angles are discretized (0..11 look down), else 0."""
        return self._motion.view(self._agent) if self._motion.started else 0

    @property
    def navigableLocations(self) -> list[ViewPoint]:
        """Its own location first, then the others from the middle of the view outwards."""
        return list(self._motion.locations(self._agent)) if self._motion.started else []


def _setting(name: str, of: Callable[[Any], object]) -> Callable[[Any, Any], None]:
    """A method that sets `name` to of(value), and changes nothing once `initialize` was called."""

    def change(simulator: Any, value: Any, /) -> None:
        new = of(value)
        if not simulator._ready:
            setattr(simulator, name, new)

    return change


class Simulator:
    """Upstream: with discretized angles the sign of a change turns or tilts by 30 degrees."""

    _steps: Callable[[float], float] = staticmethod(lambda change: int(change > 0) - int(change < 0))

    def __init__(self) -> None:
        self._graph_path, self._dataset_path = "./connectivity", "./data/v1/scans/"
        self._width, self._height, self._vfov = 320, 240, 0.8
        self._rendering, self._discrete, self._restricted, self._depth = True, False, True, False
        self._batch, self._cache, self._seed = 1, 200, 1
        self._ready = False
        self._forget()

    def _forget(self) -> None:
        self._states: list[SimState] = []
        self._scans: list[str] = []
        self._step = 0
        self._motion: DiscreteViews | None = None  # until `initialize`
        self._drawn: dict[tuple[int, bool], np.ndarray] = {}

    setDatasetPath = _setting("_dataset_path", str)
    """Folder of `<scan>/matterport_skybox_images`."""
    setNavGraphPath = _setting("_graph_path", str)
    """Folder of scans.txt and of `<scan>_connectivity.json`."""
    setRenderingEnabled = _setting("_rendering", bool)
    setDiscretizedViewingAngles = _setting("_discrete", bool)
    setRestrictedNavigation = _setting("_restricted", bool)
    setPreloadingEnabled = _setting("_preloading", bool)
    """Changes nothing: skyboxes are read when they are looked at; no more than setCacheSize are kept."""
    setDepthEnabled = _setting("_depth", bool)
    setBatchSize = _setting("_batch", operator.index)
    setCacheSize = _setting("_cache", operator.index)
    """How many decoded skyboxes are kept; one of 512 pixels takes 6 MB, and 6 more with depth."""
    setSeed = _setting("_seed", operator.index)
    """Of newRandomEpisode, whose draws are our own."""

    def setCameraResolution(self, width: int, height: int, /) -> None:
        """Pixels; enters the navigable field of view even without rendering."""
        self._width = operator.index(width)
        self._height = operator.index(height)
        self._watch()

    def setCameraVFOV(self, vfov: float, /) -> None:
        """Vertical field of view, radians."""
        self._vfov = float(vfov)
        self._watch()

    def setElevationLimits(self, low: float, high: float, /) -> bool:
        """True where the limits lie within a right angle on either side of the horizon; discretized elevations have
        their own."""
        return -math.pi / 2 < float(low) < 0.0 < float(high) < math.pi / 2

    def initialize(self) -> None:
        """Read the graphs.

        Raises:
          ValueError: no scans.txt, a scan of it has no graph, or angles are not discretized.
        """
        self._graphs: Graphs = load_graphs(self._graph_path, listed_scans(self._graph_path))
        self._rng = stream(self._seed, "MatterSim")
        self._skyboxes = Skyboxes(self._dataset_path, self._cache)
        if not self._discrete:
            raise ValueError("MatterSim: angles are discretized here; call setDiscretizedViewingAngles(True)")
        self._motion = DiscreteViews(self._lookout(), self._steps)
        self._states = [SimState(self, self._motion, agent) for agent in range(self._batch)]
        self._scans = [""] * self._batch
        self._ready = True

    def newEpisode(
        self,
        scanIds: Sequence[str],
        viewpointIds: Sequence[str],
        headings: Sequence[float],
        elevations: Sequence[float],
        /,
    ) -> None:
        """Put every agent of the batch somewhere.

        Raises:
          IndexError: an unknown scan, or fewer values than agents.
          TypeError: no lists, or of other things.
          ValueError: an unknown or an excluded viewpoint.
        """
        if not self._ready:
            self.initialize()
        scans, viewpoints = self._each(scanIds, str), self._each(viewpointIds, str)
        rows = [self._graphs.row(s, v) for s, v in zip(scans, viewpoints, strict=True)]
        self._moving.start(rows, self._each(headings, float), self._each(elevations, float))
        self._scans, self._step = scans, 0
        self._drawn = {}

    def newRandomEpisode(self, scanIds: Sequence[str], /) -> None:
        """Put every agent at a random viewpoint of its scan, level, along a random heading."""
        if not self._ready:
            self.initialize()
        scans = self._each(scanIds, str)
        viewpoints = [self._random_viewpoint(scan) for scan in scans]
        headings = self._rng.uniform(0, 2 * math.pi, len(scans)).tolist()
        self.newEpisode(scans, viewpoints, headings, [0.0] * len(scans))

    def getState(self) -> list[SimState]:
        """One state per agent: the same objects every time, which show what is now."""
        return list(self._states)

    def makeAction(self, index: Sequence[int], heading: Sequence[float], elevation: Sequence[float], /) -> None:
        """Let every agent move to a location of its list, then turn and tilt.

        Args:
          index: into each agent's navigableLocations; 0 stays.
          heading: changes in radians, right is positive; see the class for discretized angles.
          elevation: likewise, up is positive.

        Raises:
          RuntimeError: before `initialize`.
          ValueError: an index that is not in an agent's list; nobody has moved.
          IndexError: fewer values than agents.
          TypeError: no lists, or of other things: floats are no indices.
        """
        if not self._ready:
            raise RuntimeError("MatterSim: newEpisode must be called before makeAction")
        if not self._moving.started:
            raise ValueError("MatterSim: Invalid action index: there are no locations before newEpisode")
        moves, turns = self._each(index, operator.index), self._each(heading, float)
        self._moving.act(moves, turns, self._each(elevation, float))
        self._step += 1
        self._drawn = {}

    def close(self) -> None:
        """Forget the episode and the pictures; settings may be changed again."""
        self._ready = False
        self._forget()

    @property
    def _moving(self) -> DiscreteViews:
        """The poses of the batch, after `initialize`."""
        assert self._motion is not None, "initialize makes it"
        return self._motion

    def _each(self, values: Any, convert: Callable[[Any], Any]) -> list[Any]:
        """A value per agent; more are ignored, as there."""
        if isinstance(values, (str, bytes)) or not isinstance(values, (Sequence, np.ndarray)):
            raise TypeError(f"MatterSim: expected a list, one value for each agent of the batch, got {values!r:.80}")
        if len(values) < self._batch:
            raise IndexError(f"MatterSim: {len(values)} values for {self._batch} agents")
        return [convert(v) for v in values[: self._batch]]

    def _lookout(self) -> NavigableLocations:
        return lookout(self._graphs, self._vfov * self._width / self._height / 2 if self._restricted else None)

    def _watch(self) -> None:
        """Apply a changed camera from the next action on."""
        if self._motion is not None:
            self._motion.lookout = self._lookout()

    def _random_viewpoint(self, scan: str) -> str:
        graphs = self._graphs
        if scan not in graphs.first:
            raise IndexError(f"MatterSim: there is no scan {scan!r}; scans.txt names {len(graphs.first)} others")
        rows = graphs.first[scan] + np.arange(graphs.size[scan])
        return graphs.ids[int(self._rng.choice(rows[graphs.included[rows]]))]

    def _picture(self, agent: int, *, depth: bool) -> np.ndarray:
        if not self._rendering or not self._moving.started or (depth and not self._depth):
            return np.zeros((self._height, self._width, 1 if depth else 3), np.uint16 if depth else np.uint8)
        if (agent, depth) not in self._drawn:
            self._drawn[agent, depth] = self._draw(agent, self._skyboxes.metres if depth else self._skyboxes.rgb)
        return self._drawn[agent, depth]

    def _draw(self, agent: int, draw: Draw) -> np.ndarray:
        motion, row = self._moving, self._moving.row(agent)
        if self._graphs.turned[row]:
            raise ValueError(
                f"MatterSim: the camera of viewpoint {self._graphs.ids[row]} is turned; pictures are drawn of the "
                "upright skyboxes of `embodied export` only; call setRenderingEnabled(False)"
            )
        place, size = (self._graphs.scans[row], self._graphs.ids[row]), (self._height, self._width)
        return draw(*place, motion.heading(agent), motion.elevation(agent), self._vfov, size)


class ForkSimulator(Simulator):
    """HANNA and ILIAD: with discretized angles a change counts steps of 30 degrees; navigation is always restricted."""

    _steps = staticmethod(lambda change: change)
    setRestrictedNavigation = property()  # the fork has no such method


__all__ = ["ForkSimulator", "SimState", "Simulator", "ViewPoint"]

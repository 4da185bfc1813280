"""The numbers of VLN-CE's and ObjectNav's evaluators, over walks (Krantz et al. 2020; Anderson et al. 2018).

Success is strictly nearer than the radius, after STOP. SPL and path length count straight lines between consecutive
positions, nDTW and SDTW straight lines between positions and the expert's (exact dynamic time warping, where the
published program may approximate it).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from embodied.envs.continuous import Excursion, Move, Walk
from embodied.metrics import warping

WARPING = 3.0
"""Metres that nDTW is normalised by (Magalhaes et al. 2019)."""


def distance_to_goal(walk: Walk) -> float:
    """Metres along the floor at the end."""
    return float(walk.distances[-1])


def success(walk: Walk) -> float:
    """1 after STOP strictly nearer than the radius."""
    return float(walk.stopped and walk.distances[-1] < walk.excursion.radius)


def lengths(walk: Walk) -> np.ndarray:
    """(n + 1,) metres gone before each position."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(walk.positions, axis=0), axis=1))])


def path_length(walk: Walk) -> float:
    return float(lengths(walk)[-1])


def spl(walk: Walk) -> float:
    """Success weighted by path length; the shortest way is that of the floor from the start."""
    return success(walk) * _share(float(walk.distances[0]), path_length(walk))


def oracle_success(walk: Walk) -> float:
    """1 if any position after the first action was strictly nearer than the radius."""
    return float((walk.distances[1:] < walk.excursion.radius).any())


def oracle_navigation_error(walk: Walk) -> float:
    return float(walk.distances[1:].min()) if len(walk.actions) else float("inf")


def oracle_spl(walk: Walk) -> float:
    """SPL at the first position that is near enough."""
    near = np.flatnonzero(walk.distances[1:] < walk.excursion.radius)
    return _share(float(walk.distances[0]), float(lengths(walk)[near[0] + 1])) if len(near) else 0.0


def ndtw(walk: Walk) -> float:
    """exp(-DTW / (3 m |expert|)) of the positions after each action, without repeats; the episode needs a path."""
    reference = expert_path(walk.excursion)
    after = walk.positions[1:] if len(walk.actions) else walk.positions
    kept = np.concatenate([[True], (np.diff(after, axis=0) != 0).any(1)])
    metres = np.linalg.norm(after[kept][:, None] - reference[None], axis=2)
    return float(np.exp(-warping(metres) / (len(reference) * WARPING)))


def sdtw(walk: Walk) -> float:
    """nDTW of a success, else 0."""
    return ndtw(walk) * success(walk)


def steps_taken(walk: Walk) -> float:
    """Actions, STOP included."""
    return float(len(walk.actions))


def collisions(walk: Walk) -> float:
    """Share of the steps ahead that touched something (collision rate)."""
    steps = sum(a == Move.FORWARD for a in walk.actions)
    return walk.collisions / steps if steps else 0.0


MEASURES: dict[str, Callable[[Walk], float]] = {
    "success": success,
    "spl": spl,
    "ndtw": ndtw,
    "sdtw": sdtw,
    "oracle_success": oracle_success,
    "oracle_spl": oracle_spl,
    "distance_to_goal": distance_to_goal,
    "oracle_navigation_error": oracle_navigation_error,
    "path_length": path_length,
    "steps_taken": steps_taken,
    "collisions": collisions,
}
"""By the names of the published programs."""


def judged(walk: Walk) -> dict[str, float]:
    """Every measure of one walk; of nDTW and SDTW, those of an episode with a path."""
    pathless = () if len(expert_path(walk.excursion)) else ("ndtw", "sdtw")
    return {name: measure(walk) for name, measure in MEASURES.items() if name not in pathless}


def expert_path(excursion: Excursion) -> np.ndarray:
    """(m, 3) metres that nDTW compares with; (0, 3) without."""
    return np.array(excursion.expert or excursion.reference, float).reshape(-1, 3)


def _share(shortest: float, walked: float) -> float:
    longest = max(shortest, walked)
    return shortest / longest if longest > 0 else 1.0

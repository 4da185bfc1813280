"""The numbers of VLN-CE's and ObjectNav's evaluators, over walks (Krantz et al. 2020; Anderson et al. 2018).

Success is strictly nearer than the radius, after STOP. SPL and path length count straight lines between consecutive
positions, nDTW and SDTW straight lines between positions and the expert's (exact dynamic time warping, where the
published program may approximate it).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from embodied.envs.continuous import ContinuousEpisode, HabitatAction, Trajectory
from embodied.kinds.metrics import warping, weighted_by_path, within

WARPING = 3.0
"""Metres that nDTW is normalised by (Magalhaes et al. 2019)."""


def distance_to_goal(trajectory: Trajectory) -> float:
    """Metres along the floor at the end."""
    return float(trajectory.distances[-1])


def success(trajectory: Trajectory) -> float:
    """1 after STOP strictly nearer than the radius."""
    return float(trajectory.stopped and within(trajectory.distances[-1], trajectory.episode.radius, strict=True))


def lengths(trajectory: Trajectory) -> np.ndarray:
    """(n + 1,) metres gone before each position."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(trajectory.positions, axis=0), axis=1))])


def path_length(trajectory: Trajectory) -> float:
    return float(lengths(trajectory)[-1])


def spl(trajectory: Trajectory) -> float:
    """Success weighted by path length; the shortest way is that of the floor from the start."""
    return weighted_by_path(success(trajectory), float(trajectory.distances[0]), path_length(trajectory))


def oracle_success(trajectory: Trajectory) -> float:
    """1 if any position after the first action was strictly nearer than the radius."""
    return float(within(trajectory.distances[1:].min(initial=np.inf), trajectory.episode.radius, strict=True))


def oracle_navigation_error(trajectory: Trajectory) -> float:
    return float(trajectory.distances[1:].min()) if len(trajectory.actions) else float("inf")


def oracle_spl(trajectory: Trajectory) -> float:
    """SPL at the first position that is near enough."""
    near = np.flatnonzero(within(trajectory.distances[1:], trajectory.episode.radius, strict=True))
    if not len(near):
        return 0.0
    return weighted_by_path(1.0, float(trajectory.distances[0]), float(lengths(trajectory)[near[0] + 1]))


def ndtw(trajectory: Trajectory) -> float:
    """exp(-DTW / (3 m |expert|)) of the positions after each action, without repeats; the episode needs a path."""
    reference = expert_path(trajectory.episode)
    after = trajectory.positions[1:] if len(trajectory.actions) else trajectory.positions
    kept = np.concatenate([[True], (np.diff(after, axis=0) != 0).any(1)])
    metres = np.linalg.norm(after[kept][:, None] - reference[None], axis=2)
    return float(np.exp(-warping(metres) / (len(reference) * WARPING)))


def sdtw(trajectory: Trajectory) -> float:
    """nDTW of a success, else 0."""
    return ndtw(trajectory) * success(trajectory)


def steps_taken(trajectory: Trajectory) -> float:
    """Actions, STOP included."""
    return float(len(trajectory.actions))


def collisions(trajectory: Trajectory) -> float:
    """Share of the steps ahead that touched something (collision rate)."""
    steps = sum(a == HabitatAction.FORWARD for a in trajectory.actions)
    return trajectory.collisions / steps if steps else 0.0


_SUCCESSES = (success, spl, ndtw, sdtw, oracle_success, oracle_spl)
_QUANTITIES = (distance_to_goal, oracle_navigation_error, path_length, steps_taken, collisions)
MEASURES: dict[str, Callable[[Trajectory], float]] = {f.__name__: f for f in (*_SUCCESSES, *_QUANTITIES)}
"""By the names of the published programs."""


def judged(trajectory: Trajectory) -> dict[str, float]:
    """Every measure of one walk; of nDTW and SDTW, those of an episode with a path."""
    pathless = () if len(expert_path(trajectory.episode)) else ("ndtw", "sdtw")
    return {name: measure(trajectory) for name, measure in MEASURES.items() if name not in pathless}


def expert_path(episode: ContinuousEpisode) -> np.ndarray:
    """(m, 3) metres that nDTW compares with; (0, 3) without."""
    return np.array(episode.expert or episode.reference, float).reshape(-1, 3)

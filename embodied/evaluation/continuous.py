"""The numbers of VLN-CE's and ObjectNav's evaluators, over walks (Krantz et al. 2020; Anderson et al. 2018).

Success is strictly nearer than the radius, after STOP. SPL and path length count straight lines between consecutive
positions, nDTW and SDTW straight lines between positions and the expert's (exact dynamic time warping, where the
published program may approximate it).
"""

from __future__ import annotations

import numpy as np

from embodied.envs.continuous import ContinuousEpisode, ContinuousTrajectory, HabitatAction
from embodied.kinds.metrics import warping

WARPING = 3.0
"""Metres that nDTW is normalised by (Magalhaes et al. 2019)."""


def ndtw(trajectory: ContinuousTrajectory) -> float:
    """exp(-DTW / (3 m |expert|)) of the positions after each action, without repeats; the episode needs a path."""
    reference = expert_path(trajectory.episode)
    after = trajectory.positions[1:] if len(trajectory.actions) else trajectory.positions
    kept = np.concatenate([[True], (np.diff(after, axis=0) != 0).any(1)])
    metres = np.linalg.norm(after[kept][:, None] - reference[None], axis=2)
    return float(np.exp(-warping(metres) / (len(reference) * WARPING)))


def judged(trajectory: ContinuousTrajectory) -> dict[str, float]:
    """Every measure of one walk, by the names of the published programs; nDTW and SDTW where its episode has a path."""
    t, steps = trajectory, sum(a == HabitatAction.FORWARD for a in trajectory.actions)
    numbers = {"success": t.success, "spl": t.spl}
    if len(expert_path(t.episode)):
        numbers |= {"ndtw": (alike := ndtw(t)), "sdtw": alike * t.success}
    numbers |= {"oracle_success": t.oracle_success, "oracle_spl": t.oracle_spl}
    numbers |= {"distance_to_goal": float(t.distances[-1]), "oracle_navigation_error": float(t.distances.min())}
    numbers |= {"path_length": float(t.lengths[-1]), "steps_taken": float(len(t.actions))}
    return {**numbers, "collisions": t.collisions / steps if steps else 0.0}  # of the steps ahead, those that touched


def expert_path(episode: ContinuousEpisode) -> np.ndarray:
    """(m, 3) metres that nDTW compares with; (0, 3) without."""
    return np.array(episode.expert or episode.reference, float).reshape(-1, 3)

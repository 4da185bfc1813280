"""Inputs of the networks in one step: a Percept of tensors, and the features of appendix D.1 that need no learning.

Row k of a view set is the view of the Matterport convention: band k // 12 looks 30 degrees down,
level, 30 degrees up; column k % 12 turns clockwise in steps of 30 degrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from embodied.agents.common.rows import Rows
from embodied.interface import Move, Observation, Open, Stop

VIEWS = 36
HEADINGS = 12
SLOTS = VIEWS + 1
"""Static places of the navigation distribution: one per view relative to the agent, and stop (last)."""
COPIES = 32
"""How often each of the four orientation features is repeated."""
DO_NOTHING, REQUEST, START = 0, 1, 2
"""Help-request actions; START stands for 'no step before this one'."""


@dataclass(frozen=True, eq=False)
class Percept(Rows):
    """Inputs of one step for B agents; A is the largest number of navigation actions among them."""

    tokens: Tensor
    """(B, L) int64 current instruction, 0 is padding."""
    new_task: Tensor
    """(B,) bool, the instruction changed in the step before (or this is the first step)."""
    current: Tensor
    """(B, 36, D) features of the current panorama."""
    target: Tensor
    """(B, 36, D) features of the target's panorama, zero where there is no target image."""
    actions: Tensor
    """(B, A, E) embeddings of the navigation actions; 0 is stop, a zero vector."""
    action_mask: Tensor
    """(B, A) bool, which of them exist."""
    action_slots: Tensor
    """(B, A) int64 in 0..36: the view relative to the agent in which the action lies; stop has 36."""
    previous_action: Tensor
    """(B, E) embedding of the last navigation action, zero after stop, after a request and at first."""
    previous_ask: Tensor
    """(B,) int64: DO_NOTHING, REQUEST or START."""


def action_size(feature_size: int) -> int:
    """E, length of a navigation action's embedding (D.1)."""
    return feature_size + 4 * COPIES


def target_similarity(current: Tensor, target: Tensor) -> Tensor:
    """delta_t of D.1: for each current view the cosine of the target view most like it.

    Args:
      current, target: (B, 36, D).

    Returns:
      (B, 36); all ones where the panoramas are equal, zero where the target is missing.
    """
    cosines = F.normalize(current, dim=-1, eps=1e-6) @ F.normalize(target, dim=-1, eps=1e-6).transpose(1, 2)
    return cosines.amax(-1)  # rows of C are current views


def orientation(heading: Tensor, elevation: Tensor, copies: int) -> Tensor:
    """(..., 4 * copies) orientation features [sin dpsi; cos dpsi; sin domega; cos domega] of D.1.

    Each is repeated `copies` times (32 in Speaker-Follower and in the authors' program), so that
    four numbers weigh something beside hundreds of visual features.
    """
    parts = (heading.sin(), heading.cos(), elevation.sin(), elevation.cos())
    return torch.cat([p[..., None].expand(*p.shape, copies) for p in parts], -1)


def slot_distribution(logits: Tensor, slots: Tensor) -> Tensor:
    """P_t^nav on static indices (D.1): probabilities of actions that share a view add up.

    Args:
      logits: (B, A), -inf where there is no action.
      slots: (B, A) int64 in 0..36.

    Returns:
      (B, 37).
    """
    probabilities = logits.softmax(-1)
    return torch.zeros(*logits.shape[:-1], SLOTS, dtype=logits.dtype, device=logits.device).scatter_add(
        -1, slots, probabilities
    )


def candidate_rows(observations: Sequence[Observation]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The actions of k agents, 0 is stop: (k, A) int64 views, (2, k, A) float32 bearings and slopes, (k, A) bool which
    of them are allowed."""
    shape = len(observations), 1 + max(len(o.candidates) for o in observations)
    views, angles, mask = np.zeros(shape, np.int64), np.zeros((2, *shape), np.float32), np.zeros(shape, bool)
    mask[:, 0] = True
    for row, o in enumerate(observations):
        c, some = o.candidates, slice(1, 1 + len(o.candidates))
        views[row, some], angles[0, row, some], angles[1, row, some] = c.view, c.bearing, c.slope
        mask[row, some] = c.allowed
    return views, angles, mask


def action_index(action: Move | Open | Stop) -> int:
    """Place of a navigation action in the networks' scores: stop is 0; opening a door is that of going through it."""
    return 0 if isinstance(action, Stop) else action.candidate + 1

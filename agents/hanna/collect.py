"""What the teacher says of training episodes, as tensors.

The retrospective mode of 4.2.3: the learner acts alone until its episodes end, sampling from its
own policies; then the teacher, who can now see each step's future, labels all steps at once. What
the networks said while acting is kept with its gradients, so each step is computed once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from agents.common.losses import IGNORE
from agents.hanna.losses import help_loss, navigation_loss
from agents.hanna.policy import Moment
from embodied.interface import Episode, Label, Move, Place, Stop, Teacher


@dataclass(frozen=True, eq=False)
class Targets:
    """Labels of the N steps of a batch of episodes, in the order in which they were taken."""

    moves: Tensor
    """(N,) int64 index of the reference action (0 is stop), IGNORE without one."""
    negatives: Tensor
    """(N, A) bool, past mistakes (4.12)."""
    asks: Tensor
    """(N,) int64, IGNORE where nobody could be asked."""
    reasons: Tensor
    """(N, 3) float32."""


@dataclass(frozen=True, eq=False)
class Said:
    """What the networks said in the same N steps."""

    moves: Tensor
    """(N, A) logits."""
    asks: Tensor
    """(N, 2) logits."""
    reasons: Tensor | None
    """(N, 3) logits."""


@dataclass(frozen=True, eq=False)
class Experience:
    """A batch of finished episodes, ready to be learned from."""

    said: Said
    targets: Targets


def labelled(
    episodes: Sequence[Episode], moments: Sequence[Moment], teacher: Teacher, worlds: Mapping[str, Place]
) -> Experience:
    """What the networks said in some episodes, beside what the teacher says of them."""
    labels = [teacher.relabel(e, worlds[e.task.world]) for e in episodes]
    return Experience(join(moments), targets(moments, labels))


def join(moments: Sequence[Moment]) -> Said:
    """All steps below each other; A is the most actions of any step."""
    most = max(m.scores.navigation.shape[1] for m in moments)
    moves = [F.pad(m.scores.navigation, (0, most - m.scores.navigation.shape[1]), value=-torch.inf) for m in moments]
    reasons = [m.scores.reasons for m in moments if m.scores.reasons is not None]
    asks = torch.cat([m.scores.ask for m in moments])
    return Said(torch.cat(moves), asks, torch.cat(reasons) if reasons else None)


def targets(moments: Sequence[Moment], labels: Sequence[Sequence[Label]]) -> Targets:
    """The labels in the order of `join`: labels[position][step] belongs to moment `step`."""
    rows = [labels[position][t] for t, m in enumerate(moments) for position in m.positions]
    most = max(m.scores.navigation.shape[1] for m in moments)
    negatives = np.zeros((len(rows), most), dtype=bool)
    for i, label in enumerate(rows):
        for action in label.negatives:
            negatives[i, action_index(action)] = True
    moves = [IGNORE if r.move is None else action_index(r.move) for r in rows]
    asks = [IGNORE if r.ask is None else int(r.ask) for r in rows]
    reasons = np.array([r.reasons or (False, False, False) for r in rows], dtype=np.float32)
    device = moments[0].scores.navigation.device
    return Targets(
        torch.tensor(moves, device=device),
        torch.from_numpy(negatives).to(device),
        torch.tensor(asks, device=device),
        torch.from_numpy(reasons).to(device),
    )


def action_index(action: Move | Stop) -> int:
    """Place of a navigation action in the networks' scores: stop is 0."""
    return 0 if isinstance(action, Stop) else action.candidate + 1


def imitation_loss(
    said: Said, wanted: Targets, alpha: float, episodes: int, floor: float = 0.0, price: float = 1.0
) -> tuple[Tensor, Tensor]:
    """Eqs 4.9 and 4.10: navigation and help-request losses, summed over steps, averaged over episodes.

    `floor` as in losses.curiosity, `price` as in losses.help_loss.
    """
    navigation = navigation_loss(said.moves, wanted.moves, wanted.negatives, alpha, floor).sum() / episodes
    asking = help_loss(said.asks, wanted.asks, said.reasons, wanted.reasons, price).sum() / episodes
    return navigation, asking

"""The training of a follower: imitation of the shortest path, in the loop of agents.common.imitation.

episodes = play tasks, actions of teacher or follower (FORCING)                                  (policy)
loss = - log pi(a*) + progress_weight (left - left*)^2 - room_weight log p(room*)                (`losses_of`)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import torch
import torch.nn.functional as F
from torch import Tensor

from agents.common import imitation
from agents.common.choosing import choose_sampled
from agents.common.losses import IGNORE, negative_log_likelihood
from agents.vision.bank import FeatureBank
from agents.vln.config import FollowerSettings
from agents.vln.policy import SupervisedVln, VlnMoment
from embodied.interface import Agent, Episode, Place, Task

LONGEST = 12
"""Steps of an episode of training: described paths have at most six, and who is lost learns little more."""


class VlnLearner(imitation.Learner):
    """A follower in training."""

    optimizer_kind = torch.optim.AdamW

    def training_task(self, task: Task) -> Task:
        return dataclasses.replace(task, horizon=min(task.horizon, LONGEST))

    def player(self, update: int, bank: FeatureBank) -> Agent:
        dropout, share = self.config.environment_dropout, teacher_share(self.config, update)
        policy = dataclasses.replace(self.agent.policy(bank), choose=choose_sampled, environment_dropout=dropout)
        return SupervisedVln(policy, lambda _, rng: bool(rng.random() < share))

    def loss_of(self, episodes: Sequence[Episode], experience: Sequence[VlnMoment]) -> imitation.BatchLoss:
        c = self.config
        moves, left, rooms = losses_of(experience, c.batch)
        loss = moves + c.progress_weight * left + c.room_weight * rooms
        numbers = numbers_of(episodes, experience, self.training.worlds)
        return imitation.BatchLoss((moves, torch.zeros(())), loss, numbers)


def teacher_share(config: FollowerSettings, update: int) -> float:
    """Share of the steps in which the teacher acts; of 'dagger' it falls to the least over the first half."""
    if config.forcing == "dagger":
        return max(config.least_teacher, 1.0 - 2.0 * update / config.iterations)
    return float(config.forcing == "teacher")


def losses_of(moments: Sequence[VlnMoment], episodes: int) -> tuple[Tensor, Tensor, Tensor]:
    """Of actions, of the way that is left and of rooms, each summed over steps and averaged over episodes."""
    moves = sum(negative_log_likelihood(m.said.moves, m.moves).sum() for m in moments)
    left = sum(F.mse_loss(m.said.left, m.left, reduction="sum") for m in moments)
    rooms = sum(_rooms(m) for m in moments)
    return tuple(torch.as_tensor(x) / episodes for x in (moves, left, rooms))  # type: ignore[return-value]


def _rooms(m: VlnMoment) -> Tensor:
    """-log p of the kinds of rooms, averaged over the actions of a step."""
    lost = negative_log_likelihood(m.said.rooms.flatten(0, 1), m.rooms.flatten()).view(m.rooms.shape)
    return (lost.sum(1) / (m.rooms != IGNORE).sum(1)).sum()


def numbers_of(
    episodes: Sequence[Episode], moments: Sequence[VlnMoment], worlds: Mapping[str, Place]
) -> dict[str, float]:
    """What a researcher wants to know about one update, besides its losses."""
    right = torch.cat([m.said.moves.argmax(-1) == m.moves for m in moments])
    known = torch.cat([m.rooms.flatten() for m in moments])
    guessed = torch.cat([m.said.rooms.argmax(-1).flatten() for m in moments])
    return {
        "right moves": float(right.float().mean()),
        "right rooms": float((guessed == known)[known != IGNORE].float().mean()),
        **imitation.played(episodes, worlds),
    }

"""The training of a follower: imitation of the shortest path, in the loop of agents.common.imitation.

episodes = play tasks, actions of teacher or follower (FORCING)                                  (policy)
loss = - log pi(a*) + progress_weight (left - left*)^2 - room_weight log p(room*)                (`losses_of`)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from agents.common import imitation, parallel
from agents.common.choosing import choose_sampled
from agents.common.losses import IGNORE, negative_log_likelihood
from agents.common.playing import play_with_memory
from agents.common.session import Clock, episode_seed, tasks_of_update
from agents.vln.config import FollowerSettings
from agents.vln.policy import SupervisedVln, VlnMoment
from embodied.evaluation import metrics
from embodied.interface import Episode, Place
from embodied.seeds import stream

LONGEST = 12
"""Steps of an episode of training: described paths have at most six, and who is lost learns little more."""


class VlnLearner(imitation.Learner):
    """A follower in training."""

    optimizer_kind = torch.optim.AdamW

    def learn(self, update: int, clock: Clock) -> dict[str, float]:
        config, training = self.config, self.training
        chosen = parallel.share(tasks_of_update(training.tasks, update, config.batch, config.seed))
        tasks = [dataclasses.replace(t, horizon=min(t.horizon, LONGEST)) for t in chosen]
        policy = self.agent.policy(training.bank.relit(stream(config.seed, "lightings", update)))
        policy = dataclasses.replace(policy, choose=choose_sampled, environment_dropout=config.environment_dropout)
        share = teacher_share(config, update)
        player = SupervisedVln(policy, lambda _, rng: bool(rng.random() < share))

        def played() -> tuple[VlnExperience, float]:
            seed = episode_seed(config.seed, update)
            episodes, memory, seconds = play_with_memory(training.make_env, player, tasks, seed=seed)
            return VlnExperience(episodes, memory.moments), seconds

        def loss_of(experience: VlnExperience) -> imitation.BatchLoss:
            moves, left, rooms = losses_of(experience.moments, config.batch)
            loss = moves + config.progress_weight * left + config.room_weight * rooms
            return imitation.BatchLoss((moves, torch.zeros(())), loss, numbers_of(experience, training.worlds))

        return imitation.train_step(self.network, self.optimizer, config, update, clock, played, loss_of)


def teacher_share(config: FollowerSettings, update: int) -> float:
    """Share of the steps in which the teacher acts; of 'dagger' it falls to the least over the first half."""
    if config.forcing == "dagger":
        return max(config.least_teacher, 1.0 - 2.0 * update / config.iterations)
    return float(config.forcing == "teacher")


@dataclass(frozen=True, eq=False)
class VlnExperience:
    """A batch of finished episodes, ready to be learned from."""

    episodes: tuple[Episode, ...]
    moments: tuple[VlnMoment, ...]


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


def numbers_of(experience: VlnExperience, worlds: Mapping[str, Place]) -> dict[str, float]:
    """What a researcher wants to know about one update, besides its losses."""
    episodes, moments = experience.episodes, experience.moments
    right = torch.cat([m.said.moves.argmax(-1) == m.moves for m in moments])
    known = torch.cat([m.rooms.flatten() for m in moments])
    guessed = torch.cat([m.said.rooms.argmax(-1).flatten() for m in moments])
    return {
        "right moves": float(right.float().mean()),
        "right rooms": float((guessed == known)[known != IGNORE].float().mean()),
        "steps": float(sum(len(e.steps) for e in episodes)),
        "success": sum(metrics.success(e, worlds[e.task.world].graph) for e in episodes) / len(episodes),
    }

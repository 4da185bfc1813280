"""The training of VNLA: imitation by two cross-entropies (Eq 4.2 and 4.3), in the loop of agents.common.imitation.

episodes = play tasks: moves are sampled, questions are the asking teacher's, and where an advisor acts in the
           learner's place it learns from what is done all the same                              (policy)
loss = - log pi_main(a*) - log pi_ask(a*), summed over steps, averaged over episodes              (`losses_of`)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from agents.common import imitation
from agents.common.losses import negative_log_likelihood
from agents.vision.bank import FeatureBank
from agents.vision.lessons import Split
from agents.vnla.agent import VnlaAgent, rules_of
from agents.vnla.config import TRAINED_UNDER
from agents.vnla.policy import VnlaMoment, for_training
from embodied.envs.vnla import teacher_of
from embodied.interface import Agent, Episode, Place


class VnlaLearner(imitation.Learner):
    """A VNLA agent in training."""

    def __init__(self, agent: VnlaAgent, training: Split) -> None:
        super().__init__(agent, training)
        config = self.config
        teacher = teacher_of(TRAINED_UNDER[config.rules], rules_of(config))
        self._player = for_training(agent.policy(training.bank), teacher, config.environment_dropout)

    def player(self, update: int, bank: FeatureBank) -> Agent:
        return dataclasses.replace(self._player, policy=dataclasses.replace(self._player.policy, bank=bank))

    def loss_of(self, episodes: Sequence[Episode], experience: Sequence[VnlaMoment]) -> imitation.BatchLoss:
        losses = losses_of(experience, self.config.batch)
        loss = losses[0] + losses[1] if self.config.asker == "learned" else losses[0]
        return imitation.BatchLoss(losses, loss, numbers_of(episodes, experience, self.training.worlds))

    def evaluated_agent(self, split: Split) -> Agent:
        return self.agent.player(split.bank)


def losses_of(moments: Sequence[VnlaMoment], episodes: int) -> tuple[Tensor, Tensor]:
    """Eq 4.3: navigation and asking, summed over steps, averaged over episodes (docs/sources.md, S114)."""
    moves, asks = (torch.cat([getattr(m, n) for m in moments]) for n in ("moves", "asks"))
    wanted, wished = (torch.cat([getattr(m, n) for m in moments]) for n in ("move_labels", "ask_labels"))
    navigation = negative_log_likelihood(moves, wanted).sum() / episodes
    return navigation, negative_log_likelihood(asks, wished).sum() / episodes


def numbers_of(
    episodes: Sequence[Episode], moments: Sequence[VnlaMoment], worlds: Mapping[str, Place]
) -> dict[str, float]:
    """What a researcher wants to know about one update, besides its losses."""
    right = torch.cat([m.moves.argmax(-1) == m.move_labels for m in moments])
    asks, wished = torch.cat([m.asks for m in moments]), torch.cat([m.ask_labels for m in moments])
    return {
        "right moves": float(right.float().mean()),
        **imitation.played(episodes, worlds),
        **imitation.asked(episodes, asks, wished),
    }

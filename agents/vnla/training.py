"""The training of VNLA: imitation by two cross-entropies (Eq 4.2 and 4.3), in the loop of agents.common.imitation.

episodes = play tasks: moves are sampled, questions are the asking teacher's, and where an advisor acts in the
           learner's place it learns from what is done all the same                              (policy)
loss = - log pi_main(a*) - log pi_ask(a*), summed over steps, averaged over episodes              (`losses_of`)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from agents.common import imitation, parallel
from agents.common.losses import negative_log_likelihood
from agents.common.playing import play_with_memory
from agents.common.session import Clock, episode_seed, tasks_of_update
from agents.vision.lessons import Split
from agents.vnla.agent import VnlaAgent, rules_of
from agents.vnla.config import TRAINED_UNDER
from agents.vnla.policy import VnlaMoment, for_training
from embodied.envs.vnla import teacher_of
from embodied.evaluation import metrics
from embodied.interface import Agent, Episode, Place
from embodied.seeds import stream


class VnlaLearner(imitation.Learner):
    """A VNLA agent in training."""

    def __init__(self, agent: VnlaAgent, training: Split) -> None:
        super().__init__(agent, training)
        config = self.config
        teacher = teacher_of(TRAINED_UNDER[config.rules], rules_of(config))
        self._player = for_training(agent.policy(training.bank), teacher, config.environment_dropout)

    def learn(self, update: int, clock: Clock) -> dict[str, float]:
        config, training = self.config, self.training
        tasks = parallel.share(tasks_of_update(training.tasks, update, config.batch, config.seed))
        bank = training.bank.relit(stream(config.seed, "lightings", update))
        player = dataclasses.replace(self._player, policy=dataclasses.replace(self._player.policy, bank=bank))

        def played() -> tuple[VnlaExperience, float]:
            seed = episode_seed(config.seed, update)
            episodes, memory, seconds = play_with_memory(training.make_env, player, tasks, seed=seed)
            return VnlaExperience(episodes, memory.moments), seconds

        def loss_of(experience: VnlaExperience) -> imitation.BatchLoss:
            losses = losses_of(experience.moments, config.batch)
            loss = losses[0] + losses[1] if config.asker == "learned" else losses[0]
            return imitation.BatchLoss(losses, loss, numbers_of(experience, training.worlds))

        return imitation.train_step(self.network, self.optimizer, config, update, clock, played, loss_of)

    def evaluated_agent(self, split: Split) -> Agent:
        return self.agent.player(split.bank)


@dataclass(frozen=True, eq=False)
class VnlaExperience:
    """A batch of finished episodes, ready to be learned from."""

    episodes: tuple[Episode, ...]
    moments: tuple[VnlaMoment, ...]


def losses_of(moments: Sequence[VnlaMoment], episodes: int) -> tuple[Tensor, Tensor]:
    """Eq 4.3: navigation and asking, summed over steps, averaged over episodes (docs/sources.md, S114)."""
    moves, asks = (torch.cat([getattr(m, n) for m in moments]) for n in ("moves", "asks"))
    wanted, wished = (torch.cat([getattr(m, n) for m in moments]) for n in ("move_labels", "ask_labels"))
    navigation = negative_log_likelihood(moves, wanted).sum() / episodes
    return navigation, negative_log_likelihood(asks, wished).sum() / episodes


def numbers_of(experience: VnlaExperience, worlds: Mapping[str, Place]) -> dict[str, float]:
    """What a researcher wants to know about one update, besides its losses."""
    episodes, moments = experience.episodes, experience.moments
    moves, wanted = torch.cat([m.moves for m in moments]), torch.cat([m.move_labels for m in moments])
    asks, wished = torch.cat([m.asks for m in moments]), torch.cat([m.ask_labels for m in moments])
    numbers = {
        "right moves": float((moves.argmax(-1) == wanted).float().mean()),
        "steps": float(sum(len(e.steps) for e in episodes)),
        "success": sum(metrics.success(e, worlds[e.task.world].graph) for e in episodes) / len(episodes),
        "requests": sum(e.requests for e in episodes) / len(episodes),
    }
    if len(wished):
        numbers["should ask"] = float(wished.float().mean())
        numbers["right asks"] = float((asks.argmax(-1) == wished).float().mean())
    return numbers

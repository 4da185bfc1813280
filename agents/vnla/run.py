"""The training of VNLA: imitation by two cross-entropies (Eq 4.2 and 4.3), in the loop of agents.common.imitation; and
what its commands do: a data set with features becomes an agent.

episodes = play tasks: moves are sampled, questions are the asking teacher's, and where an advisor acts in the
           learner's place it learns from what is done all the same                              (policy)
loss = - log pi_main(a*) - log pi_ask(a*), summed over steps, averaged over episodes              (`losses_of`)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Unpack

import torch
from torch import Tensor

from embodied.action_spaces import WORDS
from embodied.agents.common import imitation
from embodied.agents.common.session import Progress, descend, seeded_dropout, set_learning_rate
from embodied.agents.common.settings import EvaluationSettings
from embodied.agents.common.tensors import negative_log_likelihood
from embodied.agents.common.vocabulary import Vocabulary, build_vocabulary
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vision.sighted_study import Split, TrainingData
from embodied.agents.vnla.agent import VnlaAbout, VnlaAgent
from embodied.agents.vnla.config import TRAINED_UNDER, VnlaSettings
from embodied.agents.vnla.looking import lessons_of, reading_loss
from embodied.agents.vnla.policy import VnlaMoment, for_training
from embodied.assistants.advisor import HELP_STEPS
from embodied.datasets.store import Dataset
from embodied.interface import Agent, Episode
from embodied.language.plain_language import PlainLanguage
from embodied.records import identity_of
from embodied.seeds import stream
from embodied.teachers.vnla import VnlaTeacher


class VnlaLearner(imitation.ImitationLearner):
    """A VNLA agent in training."""

    optimizer_kind = torch.optim.AdamW

    def __init__(self, agent: VnlaAgent, training: Split) -> None:
        super().__init__(agent, training)
        self._player = for_training(agent.policy(training.bank), VnlaTeacher())
        shown = dataclasses.replace(training, bank=self._player.policy.bank)
        self._lessons = lessons_of(shown, agent.vocabulary)

    def learn(self, update: int) -> Mapping[str, float]:
        c = self.config
        if update >= c.looking:
            return super().learn(update)
        self.network.train()
        with seeded_dropout(c.seed, update):
            set_learning_rate(self.optimizer, c.learning_rate, update, c.looking, c.cooldown)
            loss = reading_loss(self.network.looker, self._lessons, stream(c.seed, "looks", update))
            return {"reading": float(loss.detach()), "gradient": descend(loss, self.optimizer, f"update {update}")}

    def player(self, update: int, bank: FeatureBank) -> Agent:
        return self._player

    def loss_of(self, episodes: Sequence[Episode], experience: Sequence[VnlaMoment]) -> imitation.BatchLoss:
        losses = losses_of(experience, self.config.batch)
        right = torch.cat([m.moves.argmax(-1) == m.move_labels for m in experience])
        asks, wished = torch.cat([m.asks for m in experience]), torch.cat([m.ask_labels for m in experience])
        numbers = {
            "right moves": float(right.float().mean()),
            **imitation.played(episodes, self.training.worlds),
            **imitation.asked(episodes, asks, wished),
        }
        loss = losses[0] + losses[1] if self.config.asker == "learned" else losses[0]
        return imitation.BatchLoss(losses, loss, numbers)

    def evaluated_agent(self, split: Split) -> Agent:
        return self.agent.player(split.bank)


def losses_of(moments: Sequence[VnlaMoment], episodes: int) -> tuple[Tensor, Tensor]:
    """Eq 4.3: navigation and asking, summed over steps, averaged over episodes (docs/sources.md, S114)."""
    moves, asks = (torch.cat([getattr(m, n) for m in moments]) for n in ("moves", "asks"))
    wanted, wished = (torch.cat([getattr(m, n) for m in moments]) for n in ("move_labels", "ask_labels"))
    navigation = negative_log_likelihood(moves, wanted).sum() / episodes
    return navigation, negative_log_likelihood(asks, wished).sum() / episodes


def vocabulary_of(data: Dataset, houses: int | None = None) -> Vocabulary:
    """Words of the requests in the training split's first `houses` houses, and of all that the advisor can say."""
    names = data.names("train")[:houses]
    requests = [t.request for t in data.tasks("train") if t.world in names]
    answers = [PlainLanguage().subgoal([w] * n + ["stop"]) for w in WORDS for n in range(1, HELP_STEPS + 1)]
    return build_vocabulary([*requests, *answers, *(s.text for s in data.utterances(names))])


def train_agent(
    source: TrainingData,
    config: VnlaSettings,
    evaluation: EvaluationSettings,
    folder: Path,
    **options: Unpack[imitation.Options],
) -> Progress:
    """Train, or go on training, the agent of a run folder; other arguments as in agents.common.imitation.train."""
    houses = config.training_houses or None
    training = source.split("train", houses=houses, rules=TRAINED_UNDER[config.rules])
    validation = source.split("val_unseen", limit=config.validation_tasks, rules=config.rules)
    words = vocabulary_of(source.data, houses)
    agent = VnlaAgent.new(source.about(VnlaAbout, config, evaluation, words))
    agent.network.to(source.device)
    identity = identity_of("embodied.agents.vnla.run", settings=config, **source.identity())
    return imitation.train(VnlaLearner(agent, training), validation, folder, identity, **options)

"""The training of HANNA: retrospective DAgger with the losses of 4.2.3, in the loop of agents.common.imitation; and
what its commands do: a data set with features becomes a split, a split an agent.

episodes = play tasks with the sampling policies
labels = teacher.relabel(episodes)                        (losses)
loss = L_main + L_ask  (4.9, 4.10, 4.13, 4.14)            (losses)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Unpack

from embodied.agents.common import imitation
from embodied.agents.common.losses import IGNORE
from embodied.agents.common.session import Progress
from embodied.agents.common.vocabulary import Vocabulary, build_vocabulary
from embodied.agents.hanna.agent import HannaAbout, HannaAgent
from embodied.agents.hanna.asking import RULES
from embodied.agents.hanna.losses import Experience, imitation_loss, labelled
from embodied.agents.hanna.policy import HannaMemory, for_training
from embodied.agents.hanna.training_config import HannaEvaluation, TrainingConfig
from embodied.agents.vision.bank import FeatureBank
from embodied.agents.vision.training_data import Split, TrainingData
from embodied.datasets.store import Dataset
from embodied.interface import Agent, Episode, Task, Teacher
from embodied.records import identity_of
from embodied.teachers.shortest import HannaTeacher


class HannaLearner(imitation.ImitationLearner):
    """A HANNA agent in training."""

    def __init__(self, agent: HannaAgent, training: Split, teacher: Teacher) -> None:
        super().__init__(agent, training)
        config, self._teacher = agent.about.config, teacher
        guided = config.guided_asking if config.ask_rule == "learned" else 0.0
        self._player = for_training(
            agent.policy(training.bank).policy, RULES[config.ask_rule][0], config.environment_dropout, guided
        )

    def training_task(self, task: Task) -> Task:
        return dataclasses.replace(task, horizon=self.config.training_steps)

    def evaluation_task(self, task: Task) -> Task:
        return dataclasses.replace(task, horizon=self.evaluation.evaluation_steps)

    def player(self, update: int, bank: FeatureBank) -> Agent:
        return dataclasses.replace(self._player, bank=bank)

    def experience(self, episodes: Sequence[Episode], memory: HannaMemory) -> Experience:
        return labelled(episodes, memory.moments, self._teacher, self.training.worlds)

    def loss_of(self, episodes: Sequence[Episode], experience: Experience) -> imitation.BatchLoss:
        c, x = self.config, experience
        losses = imitation_loss(x, c.alpha, c.batch, c.curiosity_floor)
        known, askable = x.right_moves != IGNORE, x.right_asks != IGNORE
        numbers = {
            "right moves": float((x.moves.argmax(-1) == x.right_moves)[known].float().mean()),
            **imitation.played(episodes, self.training.worlds),
            **imitation.asked(episodes, x.asks[askable], x.right_asks[askable]),
        }
        return imitation.BatchLoss(losses, losses[0] + losses[1] if c.ask_rule == "learned" else losses[0], numbers)


def vocabulary_of(data: Dataset, houses: int | None = None) -> Vocabulary:
    """Words of the training split's first `houses` houses: requests and the routes that training hears."""
    names = data.names("train")[:houses]
    routes = [r.instruction for n in names for r in data.routes(n) if r.split == "train_seen"]
    return build_vocabulary([*(t.request for t in data.tasks("train") if t.world in names), *routes], 2)


def train_agent(
    source: TrainingData,
    config: TrainingConfig,
    evaluation: HannaEvaluation,
    folder: Path,
    **options: Unpack[imitation.Options],
) -> Progress:
    """Train, or go on training, the agent of a run folder; other arguments as in agents.common.imitation.train."""
    houses = config.training_houses or None
    training = source.split("train", houses=houses)
    validation = source.split("val_unseen", limit=config.validation_tasks)
    words = vocabulary_of(source.data, houses)
    agent = HannaAgent.new(source.about(HannaAbout, config, evaluation, words))
    agent.network.to(source.device)
    identity = identity_of("embodied.agents.hanna.run", settings=config, **source.identity())
    return imitation.train(HannaLearner(agent, training, HannaTeacher()), validation, folder, identity, **options)

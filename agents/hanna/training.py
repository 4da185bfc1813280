"""The training of HANNA: retrospective DAgger with the losses of 4.2.3, in the loop of agents.common.imitation.

episodes = play tasks with the sampling policies
labels = teacher.relabel(episodes)                        (collect)
loss = L_main + L_ask  (4.9, 4.10, 4.13, 4.14)            (losses)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

from agents.common import imitation
from agents.common.losses import IGNORE
from agents.hanna.agent import HannaAgent
from agents.hanna.asking import RULES
from agents.hanna.collect import Experience, imitation_loss, labelled
from agents.hanna.policy import HannaMemory, for_training
from agents.vision.bank import FeatureBank
from agents.vision.lessons import Split
from embodied.interface import Agent, Episode, Place, Task, Teacher


class HannaLearner(imitation.Learner):
    """A HANNA agent in training."""

    def __init__(self, agent: HannaAgent, training: Split, teacher: Teacher) -> None:
        super().__init__(agent, training)
        config, self._teacher = agent.about.config, teacher
        guided = config.guided_asking if config.ask_rule == "learned" else 0.0
        self._player = for_training(
            agent.policy(training.bank), RULES[config.ask_rule][0], config.environment_dropout, guided
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
        c = self.config
        losses = imitation_loss(experience.said, experience.targets, c.alpha, c.batch, c.curiosity_floor, c.ask_price)
        loss = losses[0] + losses[1] if c.ask_rule == "learned" else losses[0]
        return imitation.BatchLoss(losses, loss, numbers_of(episodes, experience, self.training.worlds))


def numbers_of(episodes: Sequence[Episode], experience: Experience, worlds: Mapping[str, Place]) -> dict[str, float]:
    """What a researcher wants to know about one update, besides its losses."""
    said, wanted = experience.said, experience.targets
    moves, asks = wanted.moves != IGNORE, wanted.asks != IGNORE
    right = (said.moves.argmax(-1) == wanted.moves)[moves].float().mean()
    return {
        "right moves": float(right),
        **imitation.played(episodes, worlds),
        **imitation.asked(episodes, said.asks[asks], wanted.asks[asks]),
    }

"""The training of HANNA: retrospective DAgger with the losses of 4.2.3, in the loop of agents.common.imitation.

episodes = play tasks with the sampling policies          (collect)
labels = teacher.relabel(episodes)                        (collect)
loss = L_main + L_ask  (4.9, 4.10, 4.13, 4.14)            (losses)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import torch

from agents.common import imitation, parallel
from agents.common.losses import IGNORE
from agents.common.session import Clock, episode_seed, tasks_of_update
from agents.hanna.agent import HannaAgent
from agents.hanna.asking import RULES
from agents.hanna.collect import Experience, collect, imitation_loss
from agents.hanna.policy import HannaPolicy, for_training
from agents.vision.lessons import Split
from embodied.evaluation import metrics
from embodied.interface import Place, Task, Teacher
from embodied.seeds import stream


class HannaLearner(imitation.Learner):
    """A HANNA agent in training."""

    def __init__(self, agent: HannaAgent, training: Split, teacher: Teacher) -> None:
        super().__init__(agent, training)
        config, self._teacher = agent.about.config, teacher
        guided = config.guided_asking if config.ask_rule == "learned" else 0.0
        self._player = for_training(
            agent.policy(training.bank), RULES[config.ask_rule][0], config.environment_dropout, guided
        )

    def learn(self, update: int, clock: Clock) -> dict[str, float]:
        bank = self.training.bank.relit(stream(self.config.seed, "lightings", update))
        player = dataclasses.replace(self._player, bank=bank)
        return train_step(self.agent, self.optimizer, player, self.training, self._teacher, update, clock)

    def evaluation_task(self, task: Task) -> Task:
        return dataclasses.replace(task, horizon=self.evaluation.evaluation_steps)


def train_step(
    agent: HannaAgent,
    optimizer: torch.optim.Optimizer,
    learner: HannaPolicy,
    training: Split,
    teacher: Teacher,
    update: int,
    clock: Clock,
) -> dict[str, float]:
    """One update; returns the numbers to report.

    Raises:
      DivergedError: the loss or a gradient is not finite (weights are as before).
      UnableError: memory ran out.
    """
    config = agent.config
    tasks = parallel.share(tasks_of_update(training.tasks, update, config.batch, config.seed))
    tasks = [dataclasses.replace(t, horizon=config.training_steps) for t in tasks]

    def played() -> tuple[Experience, float]:
        seed = episode_seed(config.seed, update)
        experience = collect(training.make_env, learner, tasks, teacher, training.worlds, seed=seed)
        return experience, experience.thinking

    def loss_of(experience: Experience) -> imitation.BatchLoss:
        losses = imitation_loss(
            experience.said, experience.targets, config.alpha, config.batch, config.curiosity_floor, config.ask_price
        )
        loss = losses[0] + losses[1] if config.ask_rule == "learned" else losses[0]
        return imitation.BatchLoss(losses, loss, numbers_of(experience, training.worlds))

    return imitation.train_step(agent.network, optimizer, config, update, clock, played, loss_of)


def numbers_of(experience: Experience, worlds: Mapping[str, Place]) -> dict[str, float]:
    """What a researcher wants to know about one update, besides its losses."""
    said, wanted, episodes = experience.said, experience.targets, experience.episodes
    moves, asks = wanted.moves != IGNORE, wanted.asks != IGNORE
    right = (said.moves.argmax(-1) == wanted.moves)[moves].float().mean()
    numbers = {
        "right moves": float(right),
        "steps": float(sum(len(e.steps) for e in episodes)),
        "success": sum(metrics.success(e, worlds[e.task.world].graph) for e in episodes) / len(episodes),
        "requests": sum(e.requests for e in episodes) / len(episodes),
    }
    if asks.any():
        wished = wanted.asks[asks] == 1
        numbers["should ask"] = float(wished.float().mean())
        numbers["right asks"] = float(((said.asks.argmax(-1)[asks] == 1) == wished).float().mean())
    return numbers

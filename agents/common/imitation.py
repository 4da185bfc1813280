"""Agents that see features and learn by imitation: what stands beside the weights, and their file; and their training
loop: play, label, update; validate; keep the best (agents.common.session).

for update in session:
    learner.learn(update)           # play tasks, have them labelled, take a gradient step
    every so often: validate        # as in evaluation; keep the agent if it is as good as the best

Training episodes are played by a policy that is shown the situations, and whose last memory, which holds all outputs,
is wanted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Self, Unpack

import torch
from torch import Tensor, nn

from embodied.agents.common import session as sessions
from embodied.agents.common.settings import EvaluationSettings, ImitationSettings
from embodied.agents.common.vocabulary import Vocabulary
from embodied.agents.common.weights import half_precision, load_into, load_weights, save_weights, seeded
from embodied.datasets.store import TaskSet
from embodied.envs.base import HelpEnv
from embodied.errors import UnableError
from embodied.evaluation.evaluate import play, rollout
from embodied.interface import Actions, Agent, Ask, Episode, Observations, Place, Rngs, Situations, Task
from embodied.kinds import metrics
from embodied.records import Identity


@dataclass(frozen=True, kw_only=True)
class About:
    """Metadata beside the weights in an agent's file; learners name the types of their settings."""

    config: ImitationSettings
    evaluation: EvaluationSettings = EvaluationSettings()
    """How it is judged, if nobody says otherwise."""
    encoder: str
    """Digest of the encoder whose features it learned from; others mean nothing to it."""
    feature_size: int
    words: tuple[str, ...]
    pictures: str = ""
    """How the pictures were drawn that it learned from: 'fast_256', 'unlit_192'."""


@dataclass(frozen=True, eq=False)
class SightedAgent:
    """A network with all that is needed to act again. A learner says `kind`, `about`, `network_of` and `policy`."""

    about: Any
    network: Any
    vocabulary: Vocabulary

    kind: ClassVar[str]
    """Of its file."""
    about_kind: ClassVar[type[About]]

    @staticmethod
    def network_of(about: Any) -> nn.Module:
        """With random weights."""
        raise NotImplementedError

    def policy(self, bank: Any) -> Any:
        """The agent as it is judged, with features that it sees.

        Raises:
          ValueError: features of another encoder.
        """
        raise NotImplementedError

    @property
    def config(self) -> Any:
        return self.about.config

    @classmethod
    def new(cls, about: About) -> Self:
        """An untrained agent; its weights follow from the seed."""
        with seeded(about.config.seed):
            return cls(about, cls.network_of(about), Vocabulary(about.words))

    def save(self, path: Path, identity: Identity | None = None) -> None:
        """Write weights in half precision, with settings, words and what it was trained with, atomically."""
        save_weights(path, self.kind, half_precision(self.network), self.about, identity)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read what `save` wrote, ready to act.

        Raises:
          FileNotFoundError, OSError.
          ValueError: truncated, changed, or of another format.
        """
        tensors, about = load_weights(path, cls.kind, cls.about_kind, "train the agent again with `embodied train`")
        agent = cls.new(about)
        load_into(agent.network, tensors, path)
        agent.network.eval()
        return agent


@dataclass(frozen=True, eq=False)
class Supervised:
    """A policy while a teacher watches: its `play` is given the situations."""

    policy: Any
    how: Mapping[str, Any] = field(default_factory=dict)
    """Further arguments of `play`."""

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Rngs
    ) -> tuple[Actions, Any]:
        """See embodied.interface.PrivilegedPolicy."""
        return self.policy.play(observations, situations, memory, rngs=rngs, **self.how)


def play_with_memory(
    make_env: Callable[[], HelpEnv], agent: Agent, tasks: Sequence[Task], *, seed: int
) -> tuple[tuple[Episode, ...], Any]:
    """Play `tasks` side by side; their episodes and the agent's last memory."""
    done, memory = {}, None
    for frame in rollout(make_env, agent, tasks, seed=seed, batch=len(tasks)):
        memory = frame.memory
        if frame.episode is not None:
            done[frame.index] = frame.episode
    return tuple(done[i] for i in range(len(tasks))), memory


VALIDATION_BATCH = 32
"""Episodes evaluated in parallel; changes speed, not results."""


@dataclass(frozen=True, eq=False)
class BatchLoss:
    """The losses of one batch of episodes, and what else is reported."""

    losses: tuple[Tensor, Tensor]
    """Of navigation and of asking, summed over steps and averaged over episodes."""
    loss: Tensor
    """The number whose gradient is taken: their sum, or navigation's alone where asking is not learned."""
    numbers: Mapping[str, float]
    """Numbers reported besides the losses and the gradient."""


class ImitationLearner:
    """An agent in training; who derives from it says `player` and `loss_of`, or `learn` as a whole."""

    optimizer_kind: ClassVar[type[torch.optim.Adam]] = torch.optim.Adam
    _player: Agent
    """Who plays, where that is always the same."""

    def __init__(self, agent: Any, training: Any) -> None:
        """
        Args:
          agent: a SightedAgent.
          training: a TaskSet with features.
        """
        self.agent, self.training, self.network = agent, training, agent.network
        self.config, self.evaluation = agent.about.config, agent.about.evaluation
        self.optimizer = self.optimizer_kind(
            agent.network.parameters(), self.config.learning_rate, weight_decay=self.config.weight_decay
        )

    def player(self, update: int) -> Agent:
        """Who plays the batch of an update."""
        return self._player

    def loss_of(self, episodes: Sequence[Episode], memory: Any) -> BatchLoss:
        """The losses of a batch of finished episodes, by the player's last memory, and what is reported of it."""
        raise NotImplementedError

    def timed(self, task: Task, training: bool) -> Task:
        """A task with its horizon in training, or in evaluation."""
        return task

    def learn(self, update: int) -> Mapping[str, float]:
        """One update: play a batch, compute its loss, take a gradient step; the numbers to report.

        Raises:
          DivergedError: the loss or a gradient is not finite (weights are as before).
          UnableError: memory ran out.
        """
        config, training = self.config, self.training
        chosen = sessions.tasks_of_update(training.tasks, update, config.batch, config.seed)
        tasks, seed = [self.timed(t, training=True) for t in chosen], sessions.episode_seed(config.seed, update)
        player = self.player(update)
        try:
            with sessions.seeded_dropout(config.seed, update):
                self.network.train()
                episodes, memory = play_with_memory(training.make_env, player, tasks, seed=seed)
                batch_loss = self.loss_of(episodes, memory)
                rate = config.learning_rate
                sessions.set_learning_rate(self.optimizer, rate, update, config.iterations, config.cooldown)
                norm = sessions.descend(batch_loss.loss, self.optimizer, f"update {update}")
        except torch.OutOfMemoryError as e:
            raise UnableError(f"out of memory at update {update}: use a smaller batch than {config.batch}") from e
        losses = [float(x.detach()) for x in batch_loss.losses]
        return {"loss navigation": losses[0], "loss asking": losses[1], "gradient": norm, **batch_loss.numbers}


def train(
    learner: ImitationLearner,
    validation: TaskSet,
    folder: Path,
    identity: Identity,
    **options: Unpack[sessions.Options],
) -> sessions.Progress:
    """Train in place, from `folder`'s checkpoint if there is one (agents.common.session.run); one process at a time.

    Writes best.safetensors (see `validate`) and what embodied.agents.common.session writes into `folder`.
    """
    tasks, about = learner.training.tasks, learner.agent.about
    size = sum(p.numel() for p in learner.network.parameters())
    options.get("note", print)(
        f"{len(tasks)} tasks in {len({t.world for t in tasks})} houses, {len(about.words)} words, {size:,} parameters, "
        f"pictures: {about.pictures}"
    )
    parts: dict[str, Any] = {"network": learner.network, "optimizer": learner.optimizer}
    judge = lambda session: validate(learner, validation, session)
    done = sessions.run(folder, identity, parts, learner.config, learner.learn, judge, **options)
    learner.network.eval()
    return done


def played(episodes: Sequence[Episode], worlds: Mapping[str, Place]) -> dict[str, float]:
    """Numbers reported of the episodes of a batch."""
    success = sum(metrics.success(e, worlds[e.task.world].graph) for e in episodes) / len(episodes)
    return {"steps": float(sum(len(e.steps) for e in episodes)), "success": success}


def asked(episodes: Sequence[Episode], logits: Tensor, labels: Tensor) -> dict[str, float]:
    """Numbers reported of asking: requests of an episode and, of the decisions with a label, how many should be to ask
    and how many are as they should be.

    Args:
      logits: (m, 2) of not asking and of asking.
      labels: (m,) int64.
    """
    numbers = {"requests": sum(e.requests for e in episodes) / len(episodes)}
    if len(labels):
        numbers["should ask"] = float(labels.float().mean())
        numbers["right asks"] = float((logits.argmax(-1) == labels).float().mean())
    return numbers


def validate(learner: ImitationLearner, split: Any, session: sessions.Session) -> Sequence[Episode]:
    """Play validation tasks as in evaluation; keep the agent if it is as good as the best so far."""
    config = learner.config
    tasks = [learner.timed(t, training=False) for t in split.tasks[: config.validation_tasks]]
    learner.network.eval()
    with torch.inference_mode():
        player = learner.agent.policy(split.bank)
        episodes = play(split.make_env, player, tasks, seed=config.seed, batch=VALIDATION_BATCH)
    values = {
        name: sum(f(e, split.worlds[e.task.world].graph) for e in episodes) / len(episodes)
        for name, f in metrics.PER_EPISODE.items()
    }
    values["request share"] = sum(isinstance(s.action, Ask) for e in episodes for s in e.steps) / max(
        1, sum(len(e.steps) for e in episodes)
    )
    session.record({"episodes": len(episodes), **values})
    if session.improved(values["success"], episodes=len(episodes)):
        learner.agent.save(session.folder / "best.safetensors", session.identity)
    return episodes

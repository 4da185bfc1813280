"""The training loop of imitation learners: play, label, update; validate; keep the best (agents.common.session).

for update in session:
    learner.learn(update)           # play tasks, have them labelled, take a gradient step (see `train_step`)
    every so often: validate        # as in evaluation; keep the agent if it is as good as the best
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, TypedDict, TypeVar, Unpack

import torch
from torch import Tensor, nn

from agents.common import parallel
from agents.common.playing import TaskSet
from agents.common.session import (
    Clock,
    Note,
    Progress,
    Session,
    descend,
    scheduled_rate,
    seeded_dropout,
    set_learning_rate,
)
from agents.common.settings import MAY_CHANGE, ImitationSettings
from embodied.errors import UnableError
from embodied.evaluation import metrics
from embodied.evaluation.rollout import play
from embodied.identity import Identity
from embodied.interface import Agent, Ask, Episode, Task

X = TypeVar("X")
OnValidation = Callable[[int, Sequence[Episode]], None]


class Learner:
    """An agent in training; who derives from it says `learn`."""

    optimizer_kind: ClassVar[type[torch.optim.Adam]] = torch.optim.Adam

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

    def learn(self, update: int, clock: Clock) -> Mapping[str, float]:
        """One update; the numbers to report, those of REPORTED."""
        raise NotImplementedError

    def evaluated_agent(self, split: Any) -> Agent:
        """The agent as it is evaluated, with the features of `split`."""
        return self.agent.policy(split.bank)

    def evaluation_task(self, task: Task) -> Task:
        """A task as it is in evaluation, with its horizon."""
        return task


class Options(TypedDict, total=False):
    """Of a session of training."""

    minutes: float | None
    """Stop after this long, as if interrupted."""
    note: Note
    on_validation: OnValidation | None
    """Called with the update and the validation episodes, e.g. to record them."""


def train(
    learner: Learner, validation: TaskSet, folder: Path, identity: Identity, **options: Unpack[Options]
) -> Progress:
    """Train in place, from `folder`'s checkpoint if there is one; one process at a time.

    Writes best.safetensors (see `validate`) and what agents.common.session writes into `folder`.

    Args:
      identity: all that the run depends on.

    Raises:
      DivergedError: a loss or gradient is not a number any more.
      UnableError: memory ran out.
      KeyboardInterrupt: after Ctrl-C, once the update at hand is done and saved.
      LockedError: another process trains in `folder`.
      CheckpointError, OSError.
    """
    config, on_validation = learner.config, options.get("on_validation")
    note = parallel.rank_zero(options.get("note", print))
    tasks, about = learner.training.tasks, learner.agent.about
    size = sum(p.numel() for p in learner.network.parameters())
    note(
        f"{len(tasks)} tasks in {len({t.world for t in tasks})} houses, {len(about.words)} words, {size:,} parameters, "
        f"pictures: {about.pictures}"
    )
    with Session(
        folder,
        identity,
        {"network": learner.network, "optimizer": learner.optimizer},
        config.iterations,
        may_change=MAY_CHANGE,
        minutes=options.get("minutes"),
        checkpoint_minutes=config.checkpoint_minutes,
        note=note,
    ) as session:
        for update in session:
            session.add(learner.learn(update, session.clock))
            if session.due(config.validate_every) and parallel.rank() == 0:
                with session.clock.on("validation"):
                    episodes = validate(learner, validation, session)
                if on_validation is not None:
                    on_validation(session.done, episodes)
    learner.network.eval()
    return session.progress


@dataclass(frozen=True, eq=False)
class BatchLoss:
    """The losses of one batch of episodes, and what else is reported."""

    losses: tuple[Tensor, Tensor]
    """Of navigation and of asking, summed over steps and averaged over episodes; for the backward pass."""
    loss: Tensor
    """What the gradient is taken of: their sum, or navigation's alone where asking is not learned."""
    numbers: Mapping[str, float]
    """What is reported besides the losses and the gradient."""


def train_step(
    network: nn.Module,
    optimizer: torch.optim.Optimizer,
    config: ImitationSettings,
    update: int,
    clock: Clock,
    played: Callable[[], tuple[X, float]],
    loss_of: Callable[[X], BatchLoss],
) -> dict[str, float]:
    """One update: play a batch, compute its loss, take a gradient step; returns the numbers to report.

    Args:
      played: plays the batch; what came of it, and the seconds of it that the policy took.
      loss_of: its losses.

    Raises:
      DivergedError: the loss or a gradient is not finite (weights are as before).
      UnableError: memory ran out.
    """
    try:
        with seeded_dropout(config.seed + parallel.rank(), update):
            network.train()
            with clock.on("environment"):
                experience, thinking = played()
            clock.move(thinking, "environment", "network")
            with clock.on("backward"):
                batch_loss = loss_of(experience)
                set_learning_rate(
                    optimizer, scheduled_rate(config.learning_rate, update, config.iterations, config.cooldown)
                )
                norm = descend(batch_loss.loss, optimizer, f"update {update}")
    except torch.OutOfMemoryError as e:
        raise UnableError(f"out of memory at update {update}: use a smaller batch than {config.batch}") from e
    losses = [float(x.detach()) for x in batch_loss.losses]
    numbers = {"loss navigation": losses[0], "loss asking": losses[1], "gradient": norm, **batch_loss.numbers}
    return parallel.reduce_metrics(numbers, REPORTED, SUMMED, batch_loss.loss.device)


REPORTED = (
    "loss navigation",
    "loss asking",
    "gradient",
    "right moves",
    "steps",
    "success",
    "requests",
    "should ask",
    "right asks",
)
"""What is reported of an update; the last two only where help could be asked for."""
SUMMED: Collection[str] = ("loss navigation", "loss asking", "steps")
"""Those that are sums over the batch, of which every process has a share."""


def validate(learner: Learner, split: TaskSet, session: Session) -> Sequence[Episode]:
    """Play validation tasks as in evaluation; keep the agent if it is as good as the best so far."""
    config = learner.config
    tasks = [learner.evaluation_task(t) for t in split.tasks[: config.validation_tasks]]
    learner.network.eval()
    with torch.inference_mode():
        batch = learner.evaluation.evaluation_batch
        episodes = play(split.make_env, learner.evaluated_agent(split), tasks, seed=config.seed, batch=batch)
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

"""The training loop that learners by imitation share: play, be corrected, learn; validate; keep the best.

    for update in ...:
        learner.learn(update)           # play tasks, have them labelled, descend (see `learn_once`)
        every so often: validate        # as the agent is judged; keep it if it is as good as the best
        every few minutes: checkpoint

Every random draw is named by (seed, update), so a run that was stopped goes on exactly as if it
had not been, and a run folder is continued by calling `train` on it again.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import math
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

import torch
from torch import Tensor, nn

from agents.common import parallel
from agents.common.lessons import Split
from agents.common.session import Clock, Note, Progress, TrainingError, as_good, dropout_of, falling_rate, stop_signal
from assets.cache import write_json
from embodied.evaluation import metrics
from embodied.evaluation.rollout import play
from embodied.interface import Agent, Ask, Episode, Task
from embodied.locks import locked

X = TypeVar("X")
OnValidation = Callable[[int, Sequence[Episode]], None]


class LoopSettings(Protocol):
    """What the loop reads of a learner's settings."""

    @property
    def iterations(self) -> int: ...
    @property
    def learning_rate(self) -> float: ...
    @property
    def cooldown(self) -> float: ...
    @property
    def batch(self) -> int: ...
    @property
    def seed(self) -> int: ...
    @property
    def validate_every(self) -> int: ...
    @property
    def validation_tasks(self) -> int: ...
    @property
    def evaluation_batch(self) -> int: ...
    @property
    def checkpoint_minutes(self) -> float: ...
    def to_json(self) -> str: ...


class Learner(Protocol):
    """An agent in training."""

    @property
    def config(self) -> LoopSettings: ...
    @property
    def network(self) -> nn.Module: ...

    def learn(self, update: int, clock: Clock) -> Mapping[str, float]:
        """One update; the numbers to report: NUMBERS and, where help could be asked for, ASKING."""
        ...

    def judged(self, split: Split) -> Agent:
        """The agent as it is judged, with the features of `split`."""
        ...

    def task(self, task: Task) -> Task:
        """A validation task as it is judged."""
        ...

    def keep(self, path: Path) -> None:
        """Write the agent, atomically."""
        ...

    def save(self, path: Path, progress: Progress) -> None:
        """Write a checkpoint, atomically."""
        ...

    def load(self, path: Path) -> Progress:
        """Put a run back and say where it was. Raises CheckpointError."""
        ...


def train(
    learner: Learner,
    validation: Split,
    folder: Path,
    *,
    minutes: float | None = None,
    note: Note = print,
    on_validation: OnValidation | None = None,
) -> Progress:
    """Train in place, from `folder`'s checkpoint if there is one; one process at a time.

    Writes checkpoint.pt (last state), best.safetensors (see `validate`), settings.json,
    validation.jsonl and TensorBoard scalars into `folder`.

    Args:
      minutes: stop after this long in this session, as if interrupted.
      on_validation: called with the update and the validation episodes, e.g. to record them.

    Raises:
      TrainingError: a loss or gradient is not a number any more, or memory ran out.
      KeyboardInterrupt: after Ctrl-C, once the update at hand is done and saved.
      LockedError: another process trains in `folder`.
      CheckpointError, OSError.
    """
    note = parallel.one_voice(note)
    with locked(folder) if parallel.rank() == 0 else contextlib.nullcontext():
        return _train(learner, validation, Path(folder), minutes, note, on_validation)


def _train(
    learner: Learner,
    validation: Split,
    folder: Path,
    minutes: float | None,
    note: Note,
    on_validation: OnValidation | None,
) -> Progress:
    """See `train`; nobody else writes into `folder`."""
    config = learner.config
    checkpoint = folder / "checkpoint.pt"
    progress = learner.load(checkpoint) if checkpoint.exists() else Progress(processor=0.0)
    if progress.update:
        note(f"continuing after update {progress.update}")
    if parallel.rank() == 0:
        write_json(folder / "settings.json", json.loads(config.to_json()), indent=1)
    report = TrainingLog(folder, config.iterations, progress, note)
    began, saved, before = time.monotonic(), time.monotonic(), progress
    used = time.process_time()

    def now() -> Progress:
        return dataclasses.replace(
            progress,
            seconds=before.seconds + time.monotonic() - began,
            processor=None if before.processor is None else before.processor + time.process_time() - used,
        )

    with stop_signal() as stop:
        try:
            while progress.update < config.iterations:
                numbers = learner.learn(progress.update, report.clock)
                progress = dataclasses.replace(progress, update=progress.update + 1)
                report.add(progress.update, numbers, now().seconds)
                last = progress.update == config.iterations
                if parallel.rank() == 0 and (progress.update % config.validate_every == 0 or last):
                    with report.clock.on("validation"):
                        progress = validate(learner, validation, progress, folder, report, now().seconds, on_validation)
                device = next(learner.network.parameters()).device
                late = parallel.any_of_us(minutes is not None and time.monotonic() - began > 60 * minutes, device)
                stopped = parallel.any_of_us(stop.is_set(), device)
                due = time.monotonic() - saved > 60 * config.checkpoint_minutes
                if parallel.rank() == 0 and (due or last or late or stopped):
                    learner.save(checkpoint, now())
                    saved = time.monotonic()
                if stopped:
                    note(f"stopped after update {progress.update}; the same command goes on from there")
                    raise KeyboardInterrupt
                if late and not last:
                    note(f"time is up after update {progress.update}; the same command goes on from there")
                    break
        finally:
            report.close()
    learner.network.eval()
    return now()


@dataclass(frozen=True, eq=False)
class Lesson:
    """What came of playing one batch."""

    losses: tuple[Tensor, Tensor]
    """Of navigation and of asking, summed over steps and averaged over episodes; for the backward pass."""
    learned: Tensor
    """What is descended: their sum, or navigation's alone where asking is not learned."""
    numbers: Mapping[str, float]
    """What is reported besides the losses and the gradient."""


def learn_once(
    network: nn.Module,
    optimizer: torch.optim.Optimizer,
    config: LoopSettings,
    update: int,
    clock: Clock,
    played: Callable[[], tuple[X, float]],
    lesson_of: Callable[[X], Lesson],
) -> dict[str, float]:
    """One update: play a batch, be corrected, descend; returns the numbers to report.

    Args:
      played: plays the batch; what came of it, and the seconds of it that the policy took.
      lesson_of: what is to be learned from it.

    Raises:
      TrainingError: the loss or a gradient is not finite (weights are as before), or memory ran out.
    """
    try:
        with dropout_of(config.seed + parallel.rank(), update):
            network.train()
            with clock.on("environment"):
                experience, thinking = played()
            clock.move(thinking, "environment", "network")
            with clock.on("backward"):
                lesson = lesson_of(experience)
                for group in optimizer.param_groups:
                    group["lr"] = falling_rate(config.learning_rate, update, config.iterations, config.cooldown)
                optimizer.zero_grad(set_to_none=True)
                lesson.learned.backward()
                parallel.add_gradients(network.parameters())
    except torch.OutOfMemoryError as e:
        raise TrainingError(f"out of memory at update {update}: use a smaller batch than {config.batch}") from e
    norm = torch.nn.utils.get_total_norm([p.grad for p in network.parameters() if p.grad is not None])
    losses = [float(x.detach()) for x in lesson.losses]
    if not all(math.isfinite(x) for x in (*losses, float(norm))):
        raise TrainingError(
            f"update {update}: loss {losses[0]:.3g} + {losses[1]:.3g}, gradient {float(norm):.3g}, not finite; the "
            "last checkpoint is intact, lower the learning rate or alpha and begin from it"
        )
    with clock.on("backward"):
        optimizer.step()
    numbers = {"loss navigation": losses[0], "loss asking": losses[1], "gradient": float(norm), **lesson.numbers}
    return parallel.whole(numbers, NUMBERS, ADDED, norm.device)


NUMBERS = (
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
ADDED: Collection[str] = ("loss navigation", "loss asking", "steps")
"""Those that are sums over the batch, of which every process has a share."""


def validate(
    learner: Learner,
    split: Split,
    progress: Progress,
    folder: Path,
    report: TrainingLog,
    seconds: float,
    on_validation: OnValidation | None,
) -> Progress:
    """Play validation tasks as in evaluation; keep the agent if it is as good as the best so far.

    Of agents that a few hundred tasks cannot tell apart, the one that learned longest is kept, and
    not the luckiest.
    """
    config = learner.config
    tasks = [learner.task(t) for t in split.tasks[: config.validation_tasks]]
    learner.network.eval()
    with torch.inference_mode():
        episodes = play(split.make_env, learner.judged(split), tasks, seed=config.seed, batch=config.evaluation_batch)
    values = {
        name: sum(f(e, split.worlds[e.task.world].graph) for e in episodes) / len(episodes)
        for name, f in metrics.PER_EPISODE.items()
    }
    values["request share"] = sum(isinstance(s.action, Ask) for e in episodes for s in e.steps) / max(
        1, sum(len(e.steps) for e in episodes)
    )
    best = max(progress.best, values["success"])
    kept = as_good(values["success"], best, len(episodes))
    report.validated(progress.update, values, len(episodes), seconds, kept)
    if on_validation is not None:
        on_validation(progress.update, episodes)
    if kept:
        progress = dataclasses.replace(progress, best=best, best_update=progress.update)
        learner.keep(folder / "best.safetensors")
    return progress


class TrainingLog:
    """Owns the progress line, validation.jsonl and TensorBoard's scalars of one session."""

    EVERY = 20
    """Updates per progress line."""

    def __init__(self, folder: Path, iterations: int, progress: Progress, note: Note) -> None:
        from torch.utils.tensorboard import SummaryWriter  # slow to import, wanted by training only

        self.folder, self.iterations, self.note = folder, iterations, note
        self.clock = Clock()
        where = folder if parallel.rank() == 0 else folder / f"process_{parallel.rank()}"
        self._writer = SummaryWriter(str(where), purge_step=progress.update + 1)
        self._sums: dict[str, float] = {}
        self._counts: dict[str, int] = {}
        self._since = time.monotonic()

    def add(self, update: int, numbers: Mapping[str, float], seconds: float) -> None:
        """Count one update in; say how it goes every EVERY updates."""
        for name, value in numbers.items():
            self._sums[name] = self._sums.get(name, 0.0) + value
            self._counts[name] = self._counts.get(name, 0) + 1
        if update % self.EVERY and update != self.iterations:
            return
        mean = {name: total / self._counts[name] for name, total in self._sums.items()}
        for name, value in mean.items():
            self._writer.add_scalar(f"train/{name}", value, update)
        for what, seconds_spent in self.clock.spent.items():
            self._writer.add_scalar(f"seconds/{what}", seconds_spent, update)
        passed = time.monotonic() - self._since
        pace = self._sums["steps"] / passed
        shares = ", ".join(f"{what} {100 * s / passed:.0f} %" for what, s in sorted(self.clock.spent.items()))
        self._writer.add_scalar("train/steps per second", pace, update)
        done = self._counts["steps"]
        left = (self.iterations - update) * passed / done / 60
        self.note(
            f"{update}/{self.iterations}  loss {mean['loss navigation']:.2f} + {mean['loss asking']:.2f}  right moves "
            f"{100 * mean['right moves']:.0f} %  asks {100 * mean.get('right asks', math.nan):.0f} %  success "
            f"{100 * mean['success']:.0f} %  requests {mean['requests']:.1f}  |  {pace:.0f} steps/s ({shares})  "
            f"{seconds / 60:.1f} min, {left:.0f} to go"
        )
        self._sums, self._counts, self.clock.spent = {}, {}, {}
        self._since = time.monotonic()

    def validated(self, update: int, values: Mapping[str, float], episodes: int, seconds: float, kept: bool) -> None:
        """Write a validation down."""
        for name, value in values.items():
            self._writer.add_scalar(f"validation/{name}", value, update)
        line = {"update": update, "minutes": round(seconds / 60, 2), "episodes": episodes, **values}
        with open(self.folder / "validation.jsonl", "a") as f:
            f.write(json.dumps(line) + "\n")
        self.note(
            f"validation on {episodes} unseen tasks after {update} updates: success {100 * values['success']:.1f} %, "
            f"SPL {100 * values['spl']:.1f} %, {values['requests']:.1f} requests, {values['steps']:.1f} steps, ends "
            f"{values['navigation error']:.1f} m away" + ("; kept" if kept else "")
        )

    def close(self) -> None:
        self._writer.close()

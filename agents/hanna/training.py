"""The training loop of HANNA: play, be corrected, learn; validate on unseen houses; keep the best.

    for update in ...:
        episodes = play tasks with the sampling policies          (collect)
        labels = teacher.relabel(episodes)                        (collect)
        loss = L_main + L_ask  (4.9, 4.10, 4.13, 4.14)            (losses)
        Adam step

Every random draw is named by (seed, update), so a run that was stopped goes on exactly as if it
had not been, and a run folder is continued by calling `train` on it again.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from agents.hanna.agent import HannaAgent, save_agent
from agents.hanna.asking import RULES
from agents.hanna.checkpoint import load_checkpoint, save_checkpoint
from agents.hanna.collect import Experience, collect, imitation_loss
from agents.hanna.losses import IGNORE
from agents.hanna.policy import for_training
from agents.imitation import parallel
from agents.imitation.loop import (
    Clock,
    Note,
    Progress,
    TrainingError,
    as_good,
    dropout_of,
    falling_rate,
    seed_of,
    stop_signal,
    tasks_of_update,
)
from agents.vision.bank import FeatureBank
from assets.cache import write_json
from embodied.envs.base import HelpEnv
from embodied.evaluation import metrics
from embodied.evaluation.rollout import play
from embodied.interface import Ask, Episode, Place, Task, Teacher
from embodied.locks import locked


@dataclass(frozen=True, eq=False)
class Split:
    """Tasks of some houses and the environment they are played in."""

    worlds: Mapping[str, Place]
    tasks: Sequence[Task]
    make_env: Callable[[], HelpEnv]
    bank: FeatureBank


def train(
    agent: HannaAgent,
    training: Split,
    validation: Split,
    teacher: Teacher,
    folder: Path,
    *,
    minutes: float | None = None,
    note: Note = print,
    on_validation: Callable[[int, Sequence[Episode]], None] | None = None,
) -> Progress:
    """Train `agent` in place, from `folder`'s checkpoint if there is one; one process at a time.

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
        return _train(agent, training, validation, teacher, Path(folder), minutes, note, on_validation)


def _train(
    agent: HannaAgent,
    training: Split,
    validation: Split,
    teacher: Teacher,
    folder: Path,
    minutes: float | None,
    note: Note,
    on_validation: Callable[[int, Sequence[Episode]], None] | None,
) -> Progress:
    """See `train`; nobody else writes into `folder`."""
    config = agent.config
    optimizer = torch.optim.Adam(agent.network.parameters(), config.learning_rate, weight_decay=config.weight_decay)
    checkpoint = folder / "checkpoint.pt"
    progress = load_checkpoint(checkpoint, agent, optimizer) if checkpoint.exists() else Progress()
    if progress.update:
        note(f"continuing after update {progress.update}")
    if parallel.rank() == 0:
        write_json(folder / "settings.json", json.loads(config.to_json()), indent=1)
    guided = config.guided_asking if config.ask_rule == "learned" else 0.0
    learner = for_training(agent.policy(training.bank), RULES[config.ask_rule][0], config.environment_dropout, guided)
    report = TrainingLog(folder, config.iterations, progress, note)
    began, saved, before = time.monotonic(), time.monotonic(), progress.seconds

    def now() -> Progress:
        return dataclasses.replace(progress, seconds=before + time.monotonic() - began)

    with stop_signal() as stop:
        try:
            while progress.update < config.iterations:
                numbers = learn_once(agent, optimizer, learner, training, teacher, progress.update, report.clock)
                progress = dataclasses.replace(progress, update=progress.update + 1)
                report.add(progress.update, numbers, now().seconds)
                last = progress.update == config.iterations
                if parallel.rank() == 0 and (progress.update % config.validate_every == 0 or last):
                    with report.clock.on("validation"):
                        progress = validate(agent, validation, progress, folder, report, now().seconds, on_validation)
                device = next(agent.network.parameters()).device
                late = parallel.any_of_us(minutes is not None and time.monotonic() - began > 60 * minutes, device)
                stopped = parallel.any_of_us(stop.is_set(), device)
                due = time.monotonic() - saved > 60 * config.checkpoint_minutes
                if parallel.rank() == 0 and (due or last or late or stopped):
                    save_checkpoint(checkpoint, agent, optimizer, now())
                    saved = time.monotonic()
                if stopped:
                    note(f"stopped after update {progress.update}; the same command goes on from there")
                    raise KeyboardInterrupt
                if late and not last:
                    note(f"time is up after update {progress.update}; the same command goes on from there")
                    break
        finally:
            report.close()
    agent.network.eval()
    return now()


def learn_once(
    agent: HannaAgent,
    optimizer: torch.optim.Optimizer,
    learner: Any,
    training: Split,
    teacher: Teacher,
    update: int,
    clock: Clock,
) -> dict[str, float]:
    """One update; returns the numbers to report.

    Raises:
      TrainingError: the loss or a gradient is not finite (weights are as before), or memory ran out.
    """
    config = agent.config
    tasks = parallel.share(tasks_of_update(training.tasks, update, config.batch, config.seed))
    tasks = [dataclasses.replace(t, horizon=config.training_steps) for t in tasks]
    try:
        with dropout_of(config.seed + parallel.rank(), update):
            agent.network.train()
            with clock.on("environment"):
                experience = collect(
                    training.make_env, learner, tasks, teacher, training.worlds, seed=seed_of(config.seed, update)
                )
            clock.move(experience.thinking, "environment", "network")
            with clock.on("backward"):
                losses = imitation_loss(
                    experience.said, experience.targets, config.alpha, config.batch, config.curiosity_floor
                )
                for group in optimizer.param_groups:
                    group["lr"] = falling_rate(config.learning_rate, update, config.iterations, config.cooldown)
                optimizer.zero_grad(set_to_none=True)
                (losses[0] + losses[1] if config.ask_rule == "learned" else losses[0]).backward()
                parallel.add_gradients(agent.network.parameters())
    except torch.OutOfMemoryError as e:
        raise TrainingError(f"out of memory at update {update}: use a smaller batch than {config.batch}") from e
    norm = torch.nn.utils.get_total_norm([p.grad for p in agent.network.parameters() if p.grad is not None])
    if not all(math.isfinite(float(x.detach())) for x in (*losses, norm)):
        raise TrainingError(
            f"update {update}: loss {float(losses[0].detach()):.3g} + {float(losses[1].detach()):.3g}, gradient "
            f"{float(norm):.3g}, not finite; the last checkpoint is intact, lower the learning rate or alpha and "
            "begin from it"
        )
    with clock.on("backward"):
        optimizer.step()
    numbers = numbers_of(experience, losses, float(norm), training.worlds)
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
ADDED = ("loss navigation", "loss asking", "steps")
"""Those that are sums over the batch, of which every process has a share."""


def numbers_of(
    experience: Experience, losses: Sequence[torch.Tensor], norm: float, worlds: Mapping[str, Place]
) -> dict[str, float]:
    """What a researcher wants to know about one update."""
    said, wanted, episodes = experience.said, experience.targets, experience.episodes
    moves, asks = wanted.moves != IGNORE, wanted.asks != IGNORE
    right = (said.moves.argmax(-1) == wanted.moves)[moves].float().mean()
    numbers = {
        "loss navigation": float(losses[0].detach()),
        "loss asking": float(losses[1].detach()),
        "gradient": norm,
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


def validate(
    agent: HannaAgent,
    split: Split,
    progress: Progress,
    folder: Path,
    report: TrainingLog,
    seconds: float,
    on_validation: Callable[[int, Sequence[Episode]], None] | None,
) -> Progress:
    """Play validation tasks as in evaluation; keep the agent if it is as good as the best so far.

    Of agents that a few hundred tasks cannot tell apart, the one that learned longest is kept, and
    not the luckiest.
    """
    config = agent.config
    tasks = [dataclasses.replace(t, horizon=config.evaluation_steps) for t in split.tasks[: config.validation_tasks]]
    agent.network.eval()
    with torch.inference_mode():
        episodes = play(
            split.make_env, agent.policy(split.bank), tasks, seed=config.seed, batch=config.evaluation_batch
        )
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
        save_agent(agent, folder / "best.safetensors")
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

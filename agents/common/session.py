"""The one training session: where a run is, what it finds, and how it is saved, stopped and gone on with.

Every random draw is named by (seed, update), so a run that was stopped goes on exactly as if it had not been. A run
folder holds checkpoint.pt, settings.json, and TensorBoard's files.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import signal
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypedDict, TypeVar, Unpack

import torch

from embodied.agents.common.weights import Stateful, restore, write_checkpoint
from embodied.assets.cache import write_json
from embodied.errors import UnableError
from embodied.interface import Episode
from embodied.locks import locked
from embodied.records import Identity
from embodied.seeds import stream

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter

Note = Callable[[str], None]
T = TypeVar("T")
EVERY = 20
"""Updates per progress line."""
MAY_CHANGE = ("iterations", "cooldown", "checkpoint_minutes", "validate_every", "validation_tasks")
"""Of the settings of a run, those that may differ on resuming without changing what was learned so far."""


class DivergedError(UnableError):
    """A loss or a gradient is not a number any more; the last checkpoint is intact."""


@dataclass(frozen=True)
class Progress:
    """Position of a run. Randomness needs no state: every draw is named by seed and update."""

    update: int = 0
    """Updates done."""
    seconds: float = 0.0
    """Spent so far, over all sessions."""
    best: float = -math.inf
    """Best validation so far."""
    best_update: int = 0
    """After which best.safetensors was kept."""
    processor: float = 0.0
    """Seconds of processor time spent so far, of all threads."""


class Session:
    """One session of a resumable run: owns its folder, counts updates and seconds, saves when due, ends when told.

        with Session(folder, identity, {"network": network, "adam": optimizer}, total, note=note) as session:
            for update in session:                              # counts from 0
                session.add({"loss": ...})
                if session.due(every):
                    session.record({"success": ...})            # what a validation found
                    if session.improved(success): keep(...)

    What the body did with an update counts, and is saved, when the next one is asked for.
    """

    def __init__(
        self,
        folder: Path,
        identity: Identity,
        parts: Mapping[str, Stateful],
        total: int,
        *,
        may_change: Collection[str] = (),
        minutes: float | None = None,
        checkpoint_minutes: float = 3.0,
        every: int = EVERY,
        note: Note = print,
    ) -> None:
        """
        Args:
          identity: all that the run depends on; one with other settings is refused, and leaves the folder as it is.
          parts: networks, optimizers and schedules, by name; they are given the state of the checkpoint.
          total: updates of the whole run.
          may_change: names of settings that may differ on resuming.
          minutes: stop after this long, as if interrupted.
          checkpoint_minutes: how often to save besides.
          every: updates per progress line.
        """
        self.folder, self.identity, self.parts, self.total = Path(folder), identity, parts, total
        self.progress = Progress()
        self.sums: dict[str, float] = {}
        """Of what is being counted, such as a pass; the caller empties it."""
        self.history: list[dict[str, float]] = []
        """Results so far, such as one entry per validation."""
        self._note = note
        self._may_change, self._minutes, self._saved_every, self._every = may_change, minutes, checkpoint_minutes, every
        self._means: dict[str, list[float]] = {}
        self._writer: SummaryWriter | None = None
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> Self:
        """
        Raises:
          LockedError: another process trains in the folder.
          CheckpointError: damaged, or of a run with another identity.
        """
        with contextlib.ExitStack() as stack:
            stack.enter_context(locked(self.folder))
            if self.path.exists():
                body = restore(self.path, self.identity, self.parts, self._may_change)
                self.progress = Progress(**body["progress"])
                self.sums, self.history = body["sums"], body["history"]
                self._note(f"continuing after update {self.progress.update}")
            write_json(self.folder / "settings.json", dict(self.identity), indent=1)
            self._stop = stack.enter_context(stop_signal())
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *error: Any) -> None:
        if self._writer is not None:
            self._writer.close()
        self._stack.close()

    @property
    def path(self) -> Path:
        return self.folder / "checkpoint.pt"

    @property
    def done(self) -> int:
        """Updates done, the one at hand included."""
        return self.progress.update + 1

    def due(self, every: int) -> bool:
        """True if the update at hand is an `every`-th one, or the last."""
        return self.done % every == 0 or self.done == self.total

    def add(self, numbers: Mapping[str, float]) -> None:
        """Count an update's numbers in: into `sums`, and into the means of the progress line."""
        for name, value in numbers.items():
            self.sums[name] = self.sums.get(name, 0.0) + value
            self._means.setdefault(name, []).append(value)

    def record(self, validation: Mapping[str, float]) -> None:
        """Keep what a validation, or a pass, found."""
        entry = {"update": float(self.done), **validation}
        self.history.append(entry)
        self._log("validation", validation)
        self._note(f"after {self.done} updates: " + ", ".join(f"{k} {v:.4g}" for k, v in validation.items()))

    def improved(self, score: float, *, episodes: int | None = None) -> bool:
        """True if the weights at hand are to be kept: they are the best so far or, of `episodes` tasks, as good as it.

        Of agents that a few hundred tasks cannot tell apart, the one that learned longest is kept, not the luckiest.
        """
        best = max(self.progress.best, score)
        kept = score >= best if episodes is None else within_standard_error(score, best, episodes)
        if kept:
            self.progress = dataclasses.replace(self.progress, best=best, best_update=self.done)
        return kept

    def save(self) -> None:
        """Write the checkpoint, atomically."""
        states = {k: p.state_dict() for k, p in self.parts.items()}
        body = {
            "identity": self.identity,
            "progress": vars(self.progress),
            "sums": self.sums,
            "history": self.history,
            "parts": states,
        }
        write_checkpoint(self.path, body)

    def __iter__(self) -> Iterator[int]:
        """The updates that are left.

        Raises:
          KeyboardInterrupt: after Ctrl-C, once the update at hand is done and saved.
        """
        began = saved = self._since = time.monotonic()
        used, before = time.process_time(), self.progress
        while self.progress.update < self.total:
            yield self.progress.update
            now = time.monotonic()
            self.progress = dataclasses.replace(
                self.progress,
                update=self.progress.update + 1,
                seconds=before.seconds + now - began,
                processor=before.processor + time.process_time() - used,
            )
            last = self.progress.update == self.total
            if self._means and (self.progress.update % self._every == 0 or last):
                self._report()
            stopped = self._stop.is_set()
            late = self._minutes is not None and now - began > 60 * self._minutes
            if last or stopped or late or now - saved > 60 * self._saved_every:
                self.save()
                saved = now
            if stopped or (late and not last):
                why = "stopped" if stopped else "time is up"
                self._note(f"{why} after update {self.progress.update}; the same command goes on from there")
                if stopped:
                    raise KeyboardInterrupt
                return

    def _report(self) -> None:
        """Say, and log, the means of what was counted since the last report."""
        update, p = self.progress.update, self.progress
        means = {name: math.fsum(values) / len(values) for name, values in self._means.items()}
        done, passed = max(map(len, self._means.values())), time.monotonic() - self._since
        self._log("train", means, self.progress.update)
        line = "  ".join(f"{k} {v:.3g}" for k, v in means.items())
        left = (self.total - update) * passed / done / 60
        self._note(f"{update}/{self.total}  {line}  {p.seconds / 60:.1f} min, {left:.0f} to go")
        self._means, self._since = {}, time.monotonic()

    def _log(self, kind: str, numbers: Mapping[str, float], update: int | None = None) -> None:
        if not numbers:
            return
        at = self.done if update is None else update
        if self._writer is None:
            from torch.utils.tensorboard import SummaryWriter  # slow to import, wanted by training only

            self._writer = SummaryWriter(str(self.folder), purge_step=at)
        for name, value in numbers.items():
            self._writer.add_scalar(f"{kind}/{name}", value, at)


class Options(TypedDict, total=False):
    """Of a session of training."""

    minutes: float | None
    """Stop after this long, as if interrupted."""
    note: Note
    on_validation: Callable[[int, Sequence[Episode]], None] | None
    """Called with the update and the validation episodes, e.g. to record them."""


def run(
    folder: Path,
    identity: Identity,
    parts: Mapping[str, Stateful],
    config: Any,
    step: Callable[[int], Mapping[str, float]],
    validate: Callable[[Session], Sequence[Episode]],
    **options: Unpack[Options],
) -> Progress:
    """Train `parts` in place, from `folder`'s checkpoint if there is one.

    Args:
      identity: all that the run depends on.
      config: settings over ValidatedRunSettings.
      step: does an update, and returns the numbers to report.
      validate: evaluates, keeps the weights if they are the best, and returns the episodes.

    Raises:
      DivergedError: a loss or gradient is not finite; the last checkpoint is intact.
      UnableError: memory ran out.
      LockedError: another process trains in `folder`.
      CheckpointError, OSError: the folder's run has other settings, or is damaged.
      KeyboardInterrupt: after Ctrl-C, once the update at hand is done and saved.
    """
    how: dict[str, Any] = {"minutes": options.get("minutes"), "note": options.get("note", print)}
    how |= {"may_change": MAY_CHANGE, "checkpoint_minutes": config.checkpoint_minutes}
    with Session(folder, identity, parts, config.iterations, **how) as session:
        for update in session:
            session.add(step(update))
            if session.due(config.validate_every):
                episodes, watch = validate(session), options.get("on_validation")
                if watch is not None:
                    watch(session.done, episodes)
    return session.progress


@contextmanager
def stop_signal() -> Iterator[threading.Event]:
    """An event that the first Ctrl-C sets, so that the update at hand can end; the second interrupts at once."""
    event = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield event
        return

    def once(number: int, frame: Any) -> None:
        event.set()
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, once)
    try:
        yield event
    finally:
        signal.signal(signal.SIGINT, before)


def tasks_of_update(tasks: Sequence[T], update: int, batch: int, seed: int) -> list[T]:
    """The tasks (or sentences, or whatever is learned from) of one update: each once per pass, each pass in its own
    random order."""
    chosen = [divmod(k, len(tasks)) for k in range(update * batch, (update + 1) * batch)]
    orders = {turn: stream(seed, "tasks", turn).permutation(len(tasks)) for turn in dict.fromkeys(t for t, _ in chosen)}
    return [tasks[int(orders[turn][place])] for turn, place in chosen]


def episode_seed(seed: int, update: int) -> int:
    """The seed of the episodes of one update."""
    return int(stream(seed, "update", update).integers(2**31))


@contextmanager
def seeded_dropout(seed: int, update: int) -> Iterator[None]:
    """PyTorch's own draws (dropout) follow from (seed, update) inside, and are as before outside."""
    devices = list(range(torch.cuda.device_count()))
    with torch.random.fork_rng(devices=devices):
        torch.manual_seed(int(stream(seed, "dropout", update).integers(2**31)))
        yield


def within_standard_error(success: float, best: float, episodes: int) -> bool:
    """True if a success rate on `episodes` tasks is within one standard error of the best one (Breiman's rule)."""
    return success >= best - math.sqrt(best * (1 - best) / episodes)


def descend(loss: torch.Tensor, optimizer: torch.optim.Optimizer, what: str, clip: float = math.inf) -> float:
    """One step of `optimizer` down `loss`, the norm of gradients cut to `clip`; returns the norm before.

    Args:
      what: names the update, for messages.

    Raises:
      DivergedError: the loss or a gradient is not finite; no weight was changed.
    """
    optimizer.zero_grad(set_to_none=True)
    loss.backward()
    parameters = [p for group in optimizer.param_groups for p in group["params"]]
    if clip < math.inf:
        norm = torch.nn.utils.clip_grad_norm_(parameters, clip)
    else:
        norm = torch.nn.utils.get_total_norm([p.grad for p in parameters if p.grad is not None])
    if not (torch.isfinite(loss) and torch.isfinite(norm)):
        raise DivergedError(
            f"{what}: loss {float(loss.detach()):.3g}, gradient {float(norm):.3g}, not finite; the last checkpoint is "
            "intact, lower the learning rate and begin anew or from it"
        )
    optimizer.step()
    return float(norm)


def set_learning_rate(
    optimizer: torch.optim.Optimizer, rate: float, update: int, updates: int, cooldown: float
) -> None:
    """Let an optimizer learn at a rate that falls linearly over the last share `cooldown` of the updates; never 0."""
    falling = round(cooldown * updates)
    for group in optimizer.param_groups:
        group["lr"] = rate * min(1.0, (updates - update) / (falling + 1))

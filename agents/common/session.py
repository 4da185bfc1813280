"""What every learner's training loop needs: where a run is, whose time it takes, how it is stopped and what it draws.

Every random draw is named by (seed, update), so a run that was stopped goes on exactly as if it had
not been.
"""

from __future__ import annotations

import dataclasses
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Self, TypeVar

import torch

from embodied.errors import UnableError
from embodied.seeds import stream

Note = Callable[[str], None]
T = TypeVar("T")


class TrainingError(UnableError):
    """Training cannot go on; the last checkpoint is intact."""


@dataclass(frozen=True)
class Progress:
    """Where a run is. Randomness needs no state: every draw is named by seed and update."""

    update: int = 0
    """Updates done."""
    seconds: float = 0.0
    """Spent so far, over all sessions."""
    best: float = -1.0
    """Best validation success so far."""
    best_update: int = 0
    """After which best.safetensors was kept."""
    processor: float | None = None
    """Seconds of processor time spent so far, of all threads; None by runs that began before this was counted, and by
    learners that do not count it."""


@dataclass
class Clock:
    """Seconds spent on each kind of work since the last report."""

    spent: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def on(self, what: str) -> Iterator[None]:
        began = time.perf_counter()
        try:
            yield
        finally:
            self.spent[what] = self.spent.get(what, 0.0) + time.perf_counter() - began

    def move(self, seconds: float, source: str, to: str) -> None:
        """Count some of the seconds spent on one kind of work as another's."""
        self.spent[source] -= seconds
        self.spent[to] = self.spent.get(to, 0.0) + seconds


def tasks_of_update(tasks: Sequence[T], update: int, batch: int, seed: int) -> list[T]:
    """The tasks (or sentences, or whatever is learned from) of one update: each once per pass, each pass in its own
    random order."""
    chosen = []
    for k in range(update * batch, (update + 1) * batch):
        turn, place = divmod(k, len(tasks))
        chosen.append((turn, place))
    orders = {turn: stream(seed, "tasks", turn).permutation(len(tasks)) for turn in sorted({t for t, _ in chosen})}
    return [tasks[int(orders[turn][place])] for turn, place in chosen]


def seed_of(seed: int, update: int) -> int:
    """The seed of the episodes of one update."""
    return int(stream(seed, "update", update).integers(2**31))


@contextmanager
def dropout_of(seed: int, update: int) -> Iterator[None]:
    """PyTorch's own draws (dropout) follow from (seed, update) inside, and are as before outside."""
    devices = list(range(torch.cuda.device_count()))
    with torch.random.fork_rng(devices=devices):
        torch.manual_seed(int(stream(seed, "dropout", update).integers(2**31)))
        yield


def as_good(success: float, best: float, episodes: int) -> bool:
    """Whether a success rate on `episodes` tasks is within one standard error of the best one (Breiman's rule)."""
    return success >= best - math.sqrt(best * (1 - best) / episodes)


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


class Session:
    """One session of a resumable run: counts updates and seconds, saves when due, and ends when told.

        with Session(progress, total, save, minutes=30, note=note) as session:
            for update in session:
                ...                                             # update counts from 0
                session.progress = dataclasses.replace(session.progress, best=...)

    What the body did with an update counts, and is saved, when the next one is asked for.
    """

    def __init__(
        self,
        progress: Progress,
        total: int,
        save: Callable[[Progress], None],
        *,
        minutes: float | None = None,
        checkpoint_minutes: float = 3.0,
        note: Note = print,
    ) -> None:
        """
        Args:
          total: updates of the whole run.
          save: writes a checkpoint.
          minutes: stop after this long, as if interrupted.
          checkpoint_minutes: how often to save besides.
        """
        self.progress, self.total, self._save, self._note = progress, total, save, note
        self._minutes, self._every = minutes, checkpoint_minutes
        self._signals = stop_signal()

    def __enter__(self) -> Self:
        self._stop = self._signals.__enter__()
        if self.progress.update:
            self._note(f"continuing after update {self.progress.update}")
        return self

    def __exit__(self, *error: Any) -> None:
        self._signals.__exit__(*error)

    def __iter__(self) -> Iterator[int]:
        """The updates that are left.

        Raises:
          KeyboardInterrupt: after Ctrl-C, once the update at hand is done and saved.
        """
        began = saved = time.monotonic()
        before = self.progress.seconds
        while self.progress.update < self.total:
            yield self.progress.update
            now = time.monotonic()
            self.progress = dataclasses.replace(
                self.progress, update=self.progress.update + 1, seconds=before + now - began
            )
            last, stopped = self.progress.update == self.total, self._stop.is_set()
            late = self._minutes is not None and now - began > 60 * self._minutes
            if last or stopped or late or now - saved > 60 * self._every:
                self._save(self.progress)
                saved = now
            if stopped or (late and not last):
                why = "stopped" if stopped else "time is up"
                self._note(f"{why} after update {self.progress.update}; the same command goes on from there")
                if stopped:
                    raise KeyboardInterrupt
                return


def falling_rate(rate: float, update: int, updates: int, cooldown: float) -> float:
    """A learning rate that falls linearly over the last share `cooldown` of the updates; never zero."""
    falling = round(cooldown * updates)
    return rate * min(1.0, (updates - update) / (falling + 1))


def refuse_divergence(update: int, loss: torch.Tensor, norm: torch.Tensor) -> None:
    """Called before weights change.

    Raises:
      TrainingError: the loss or the gradient's norm is not finite.
    """
    if not (torch.isfinite(loss) and torch.isfinite(norm)):
        raise TrainingError(
            f"update {update}: loss {float(loss.detach()):.3g}, gradient {float(norm):.3g}, not finite; the last "
            "checkpoint is intact, lower the learning rate and begin from it"
        )

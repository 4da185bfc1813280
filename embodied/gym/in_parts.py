"""InParts: a batch of environments whose slots are split among processes, each of which plays its part (InStep).

    envs = gymnasium.make_vec("embodied/HANNA-v0", num_envs=64, data="DIR", workers=4)

Play is Python, which uses one core per process. Every process holds the houses, the encoder and up to half a
gibibyte of decoded panoramas; observations come back through memory that all share. Processes are spawned, so a
script that makes such a batch needs `if __name__ == "__main__":`.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import traceback
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection
from multiprocessing.shared_memory import SharedMemory
from typing import Any

import cv2
import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from gymnasium.vector.utils import batch_space

from embodied.gym.eyes import Arrays
from embodied.gym.in_step import InStep, mask_of, refuse_too_many, seeds_of

Maker = Callable[[int, int], InStep]
"""Makes so many environments, which so many threads look for; can be pickled."""
ALIGNED = 64
"""Bytes: where arrays begin in shared memory."""
PATIENCE = 10.0
"""Seconds that a process has to end by itself."""


class InParts(VectorEnv[dict[str, Any], Any, np.ndarray]):
    """A batch that gives what one InStep of all its slots would give, from several processes.

    Observations are new arrays each time. A slot that has ended is reset by the next step.
    """

    def __init__(self, make_part: Maker, num_envs: int, workers: int) -> None:
        """The first process makes its part before the others start: what is generated and lit is so only once.

        Raises:
          ValueError: fewer than one process, more slots than memory has room for, or what `make_part` raises.
        """
        if workers < 1:
            raise ValueError(f"workers should be at least 1, got {workers}")
        workers = min(workers, num_envs)
        bounds = [k * num_envs // workers for k in range(workers + 1)]
        self._slots = [slice(a, b) for a, b in zip(bounds, bounds[1:], strict=False)]
        threads = max(1, len(os.sched_getaffinity(0)) // workers)
        self.num_envs = num_envs
        self._parts: list[_Part] = []
        self._board: SharedArrays | None = None
        try:
            for k, s in enumerate(self._slots):
                self._parts.append(_Part(make_part, s.stop - s.start, threads))
                if k == 0:
                    self._board = self._described(*self._parts[0].answer())
            for part in self._parts[1:]:
                part.answer()
            for part, s in zip(self._parts, self._slots, strict=True):
                part.ask("share", self._shared.memory.name, self.single_observation_space, num_envs, s)
            self._answers()
        except BaseException:
            self.close()
            raise

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        seeds, wanted = seeds_of(seed, self.num_envs), dict(options or {})
        mask = mask_of(wanted, self.num_envs)
        asked = [k for k, s in enumerate(self._slots) if mask[s].any()]
        for k in asked:
            own = self._slots[k]
            part_options = wanted if mask.all() else {**wanted, "reset_mask": mask[own]}
            self._parts[k].ask("reset", seeds[own], part_options or None)
        infos: list[dict[str, Any]] = [{} for _ in self._parts]
        for k, (info,) in zip(asked, self._answers([self._parts[k] for k in asked]), strict=True):
            infos[k] = info
        return self._seen(), self._merged(infos)

    def step(self, actions: Any) -> tuple[dict[str, Any], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        for part, s in zip(self._parts, self._slots, strict=True):
            part.ask("step", np.asarray(actions)[s])
        rewards, terminated, truncated, infos = zip(*self._answers(), strict=True)
        whole = [np.concatenate(arrays) for arrays in (rewards, terminated, truncated)]
        return self._seen(), whole[0], whole[1], whole[2], self._merged(infos)

    def render(self) -> tuple[Any, ...] | None:
        pictures = self._everywhere("render")
        return None if None in pictures else sum(pictures, ())

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """What a method of every slot returns, or an attribute of each; it is pickled."""
        return sum(self._everywhere("call", name, args, kwargs), ())

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of every slot; it is pickled."""
        return self.call(name)

    def close_extras(self, **kwargs: Any) -> None:
        for part in self._parts:
            part.close()
        if self._board is not None:
            self._board.close(unlink=True)

    @property
    def _shared(self) -> SharedArrays:
        assert self._board is not None, "made with the first part"
        return self._board

    def _described(
        self, space: gym.spaces.Dict, action_space: gym.Space[Any], metadata: dict[str, Any], mode: str | None
    ) -> SharedArrays:
        """Takes over what the first part says of itself."""
        refuse_too_many(self.num_envs, space)
        self.metadata, self.render_mode = metadata, mode
        self.single_action_space, self.action_space = action_space, batch_space(action_space, self.num_envs)
        self.single_observation_space, self.observation_space = space, batch_space(space, self.num_envs)
        return SharedArrays(space, self.num_envs)

    def _seen(self) -> Arrays:
        return {name: array.copy() for name, array in self._shared.arrays.items()}

    def _everywhere(self, name: str, *args: Any) -> list[Any]:
        for part in self._parts:
            part.ask(name, *args)
        return [answer for (answer,) in self._answers()]

    def _answers(self, parts: Sequence[_Part] | None = None) -> list[tuple[Any, ...]]:
        """One of each part, or of some; all are read before an error is raised: the next question finds silence."""
        found: list[tuple[Any, ...]] = []
        errors: list[Exception] = []
        for part in self._parts if parts is None else parts:
            try:
                found.append(part.answer())
            except Exception as e:
                errors.append(e)
        if errors:
            raise errors[0]
        return found

    def _merged(self, infos: Sequence[dict[str, Any]]) -> dict[str, Any]:
        """The parts' infos as those of one batch: zero, False or None where a slot has none."""
        whole: dict[str, Any] = {}
        for key in dict.fromkeys(key for info in infos for key in info):
            having = [(info[key], s) for info, s in zip(infos, self._slots, strict=True) if key in info]
            if isinstance(having[0][0], dict):
                whole[key] = self._merged([info.get(key, {}) for info in infos])
                continue
            first = having[0][0]
            empty = None if first.dtype == object else 0
            whole[key] = np.full((self.num_envs, *first.shape[1:]), empty, first.dtype)
            for array, s in having:
                whole[key][s] = array
        return whole


class SharedArrays:
    """The arrays of a batch of observations in memory that processes share."""

    def __init__(self, space: gym.spaces.Dict, num_envs: int, name: str | None = None) -> None:
        """
        Args:
          name: of memory that another process has made; new memory without.
        """
        shapes = {k: ((num_envs, *(s.shape or ())), np.dtype(s.dtype)) for k, s in space.spaces.items()}
        begins, size = {}, 0
        for key, (shape, dtype) in shapes.items():
            begins[key], size = size, size + -(-int(np.prod(shape)) * dtype.itemsize // ALIGNED) * ALIGNED
        self.memory = SharedMemory(name, create=name is None, size=max(size, 1))
        self.arrays: Arrays = {
            key: np.ndarray(shape, dtype, self.memory.buf, begins[key]) for key, (shape, dtype) in shapes.items()
        }

    def close(self, *, unlink: bool = False) -> None:
        self.arrays.clear()
        with contextlib.suppress(BufferError):  # somebody still looks
            self.memory.close()
        if unlink:
            with contextlib.suppress(FileNotFoundError):  # closed before
                self.memory.unlink()


class _Part:
    """One process, and the line to it."""

    def __init__(self, make_part: Maker, num_envs: int, threads: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._line, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, make_part, num_envs, threads), daemon=True)
        self._process.start()
        theirs.close()

    def ask(self, name: str, *args: Any) -> None:
        with contextlib.suppress(BrokenPipeError):  # `answer` says what happened
            self._line.send((name, args))

    def answer(self) -> tuple[Any, ...]:
        try:
            error, answer = self._line.recv()
        except (EOFError, ConnectionError):
            self._process.join(PATIENCE)
            raise RuntimeError(
                f"a process of this batch of environments ended (exit code {self._process.exitcode}); its slots are "
                "lost: make the batch anew, with fewer `workers` or environments if memory was short"
            ) from None
        if error is not None:
            raise error
        return answer

    def close(self) -> None:
        self.ask("close")
        self._process.join(PATIENCE)
        if self._process.is_alive():
            self._process.kill()
        self._line.close()


def _serve(line: Connection, make_part: Maker, num_envs: int, threads: int) -> None:
    """Makes a part and answers questions about it until it is told to close, or nobody is there any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever interrupts the batch closes it
    cv2.setNumThreads(threads)
    served = _questions(line)
    envs: InStep | None = None
    board: SharedArrays | None = None
    try:
        envs = make_part(num_envs, threads)
        _send(line, envs.single_observation_space, envs.single_action_space, envs.metadata, envs.render_mode)
    except Exception as e:
        _send_error(line, e)
        return
    for name, args in served:
        try:
            if name == "share":
                block, space, whole, own = args
                board = SharedArrays(space, whole, block)
                envs.write_into({key: array[own] for key, array in board.arrays.items()})
                _send(line)
            elif name in ("reset", "step"):
                _, *rest = envs.reset(seed=args[0], options=args[1]) if name == "reset" else envs.step(*args)
                _send(line, *rest)
            elif name == "render":
                _send(line, envs.render())
            else:
                method, positional, named = args
                _send(line, envs.call(method, *positional, **named))
        except Exception as e:
            _send_error(line, e)
    envs.close()
    if board is not None:
        board.close()


def _questions(line: Connection) -> Iterator[tuple[str, tuple[Any, ...]]]:
    while True:
        try:
            name, args = line.recv()
        except (EOFError, ConnectionError):
            return
        if name == "close":
            return
        yield name, args


def _send(line: Connection, *answer: Any) -> None:
    line.send((None, answer))


def _send_error(line: Connection, error: Exception) -> None:
    """As itself, with where it came from; as text where it cannot be pickled."""
    where = traceback.format_exc()
    with contextlib.suppress(BrokenPipeError):
        try:
            error.add_note(where)
            line.send((error, ()))
        except (TypeError, AttributeError, ValueError):
            line.send((RuntimeError(where), ()))

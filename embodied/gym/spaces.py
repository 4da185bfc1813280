"""Gymnasium spaces of an observation and of an action, and how records become arrays."""

from __future__ import annotations

import functools
import operator
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from gymnasium import spaces

from embodied.envs.base import ActionError
from embodied.gym.sensors import LARGE, Sensor
from embodied.interface import TURNS, VIEWS, Action, Ask, Close, Intention, Mode, Move, Observation, Open, Stop
from embodied.kinds.task_kind import INTENTIONS, ArraySpec, TaskKind, kind_named

LONG, MANY = 100.0, 10.0
"""Steps and requests that are 1 in 'clock'."""


@dataclass(frozen=True)
class SpaceLayout:
    """Sizes of the spaces; what does not fit is an error, not a silent cut (text apart)."""

    candidates: int = 16
    """Most moves at one pose; real and generated graphs stay below 14."""
    text: int = 1000
    """Most characters of an instruction; longer ones are cut."""
    intentions: tuple[Intention, ...] = INTENTIONS
    """Questions, in the order of the actions."""
    extras: Mapping[str, ArraySpec] = field(default_factory=dict)
    """Arrays of the kind's own part of the observation, by name."""
    kind: str = ""
    """Name of the kind, which fills them."""
    doors: bool = False
    """Doors can be opened and closed."""

    @classmethod
    def of(cls, kind: TaskKind, rules: Any = None, *, candidates: int = 16) -> SpaceLayout:
        """The layout of a kind of task under its rules of play."""
        own = dict[str, Any](intentions=kind.intentions, doors=kind.opens_doors)
        if kind.extras is not None:
            own |= {"extras": kind.extras.specs(candidates, kind.checked_rules(rules)), "kind": kind.name}
        return cls(candidates, **own)

    @property
    def actions(self) -> int:
        """Moves, then stop, then one request per intention, then, with doors, opening those on the way to each
        candidate, and closing them."""
        return self.first_door + 2 * self.candidates * self.doors

    @property
    def first_door(self) -> int:
        """The number of opening what is on the way to the first candidate."""
        return self.candidates + 1 + len(self.intentions)


def action_space(layout: SpaceLayout) -> spaces.Discrete:
    return spaces.Discrete(layout.actions)


def observation_space(layout: SpaceLayout, sensor: Sensor) -> spaces.Dict:
    """Everything an Observation holds, padded with zeros, and what the sensor sees."""
    whole: dict[str, Any] = {
        **sensor.spaces(),
        "has_target": spaces.Discrete(2),
        "instruction": spaces.Box(0, 255, (layout.text,), np.uint8),
        "candidates": spaces.Box(-1.0, 1.0, (layout.candidates, 4), np.float32),
        "candidate_views": spaces.MultiDiscrete([VIEWS + 1] * layout.candidates),
        "action_mask": spaces.MultiBinary(layout.actions),
        "pose": spaces.MultiDiscrete([TURNS, 3]),
        "mode": spaces.Discrete(2),
        "clock": spaces.Box(-1.0, LARGE, (3,), np.float32),
    }
    whole |= {name: _space(spec) for name, spec in layout.extras.items()}
    return spaces.Dict(whole)


def _space(spec: ArraySpec) -> spaces.Space[Any]:
    if spec.shape == () and np.issubdtype(spec.dtype, np.integer):
        return spaces.Discrete(int(spec.high) + 1)
    return spaces.Box(spec.low, spec.high, spec.shape, np.dtype(spec.dtype).type)


def encode(o: Observation, sensor: Sensor, layout: SpaceLayout) -> dict[str, Any]:
    """An Observation as a member of `observation_space`.

    'candidates' holds sin and cos of bearing and of slope; 'candidate_views' the view of each plus
    one (0 is padding); 'clock' is time and time on task in hundreds of steps, and requests left in tens (-1 when
    there is no budget). What a kind of task adds is said where it is defined.

    Raises:
      ValueError: more candidates than the layout has room for.
    """
    n = len(o.candidates)
    if n > layout.candidates:
        raise ValueError(
            f"{n} candidates at one pose, the layout holds {layout.candidates}; enlarge SpaceLayout.candidates"
        )
    candidates = np.zeros((layout.candidates, 4), dtype=np.float32)
    c = o.candidates
    for k, (wave, angle) in enumerate(((np.sin, c.bearing), (np.cos, c.bearing), (np.sin, c.slope), (np.cos, c.slope))):
        wave(angle, out=candidates[:n, k])
    views = np.zeros(layout.candidates, dtype=np.int64)
    views[:n] = c.view + 1
    left = -1.0 if o.requests_left is None else o.requests_left / MANY
    whole: dict[str, Any] = {
        **sensor.look(o)(),
        "has_target": np.int64(o.target is not None),
        "instruction": codes_of(o.instruction, layout.text).copy(),
        "candidates": candidates,
        "candidate_views": views,
        "action_mask": action_mask(o, layout),
        "pose": np.array([o.turn, o.tilt + 1], dtype=np.int64),
        "mode": np.int64(o.mode is Mode.SUB),
        "clock": np.array([o.time / LONG, o.time_on_task / LONG, left], dtype=np.float32),
    }
    if layout.extras and (own := kind_named(layout.kind).extras):
        whole |= own.encode(o, layout.extras)
    return whole


@functools.lru_cache(maxsize=4096)
def codes_of(text: str, length: int) -> np.ndarray:
    """(length,) uint8, not to be written to: the text as ASCII codes, cut or padded with zeros.

    Not a gymnasium Text space, because AsyncVectorEnv (Gymnasium 1.4) does not refresh texts that lie in shared memory.
    """
    codes = np.frombuffer(text.encode("ascii", "replace")[:length], dtype=np.uint8)
    padded = np.concatenate([codes, np.zeros(length - len(codes), dtype=np.uint8)])
    padded.flags.writeable = False
    return padded


def text_of(codes: np.ndarray) -> str:
    """The text behind `codes_of`."""
    return bytes(np.asarray(codes, dtype=np.uint8)).rstrip(b"\0").decode("ascii", "replace")


def action_mask(o: Observation, layout: SpaceLayout) -> np.ndarray:
    """(actions,) int8: 1 where the action is possible."""
    mask = np.zeros(layout.actions, dtype=np.int8)
    mask[: len(o.candidates)] = o.candidates.allowed
    mask[layout.candidates] = 1
    for intention in o.can_ask:
        mask[layout.candidates + 1 + layout.intentions.index(intention)] = 1
    if layout.doors:
        mask[[layout.first_door + k for k in o.can_open]] = 1
        mask[[layout.first_door + layout.candidates + k for k in o.can_close]] = 1
    return mask


def whole(action: Any) -> int:
    """A whole number of any library.

    Raises:
      TypeError: no whole number.
    """
    try:
        return operator.index(action)
    except TypeError:
        raise TypeError(f"an action is a whole number, got {action!r:.60} ({type(action).__name__})") from None


def decode(action: int, layout: SpaceLayout) -> Action:
    """The record behind an action's number.

    Raises:
      ActionError: no such number.
      TypeError: no whole number.
    """
    action = whole(action)
    if not 0 <= action < layout.actions:
        raise ActionError(
            f"action {action} does not exist; use 0 to {layout.actions - 1}: "
            f"{layout.candidates} candidates, stop, the {len(layout.intentions)} ways to ask, and doors, if any"
        )
    if action < layout.candidates:
        return Move(action)
    if action == layout.candidates:
        return Stop()
    if action >= layout.first_door:
        closes, candidate = divmod(action - layout.first_door, layout.candidates)
        return Close(candidate) if closes else Open(candidate)
    return Ask(layout.intentions[action - layout.candidates - 1])


def number(action: Action, layout: SpaceLayout) -> int:
    """The number of an action; inverse of `decode`."""
    if isinstance(action, Move):
        return action.candidate
    if isinstance(action, Stop):
        return layout.candidates
    if isinstance(action, Open | Close):
        return layout.first_door + layout.candidates * isinstance(action, Close) + action.candidate
    return layout.candidates + 1 + layout.intentions.index(action.intention)

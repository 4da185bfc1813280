"""Gymnasium spaces of an observation and of an action, and how records become arrays."""

from __future__ import annotations

import bisect
import functools
import operator
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from embodied.assets.catalogue import load_catalogue
from embodied.assets.records import ROOM_KINDS
from embodied.envs.base import ActionError
from embodied.gym.eyes import LARGE, Sensor
from embodied.interface import TURNS, VIEWS, Action, Ask, Description, Intention, Mode, Move, Observation, Stop

INTENTIONS = (Intention.HELP, Intention.CUR, Intention.GOAL, Intention.SUB)
"""What may be asked where the layout does not say otherwise."""
KINDS = ("object", "room", "action")
ACTION_WORDS = ("go", "stop")
"""Names of HARI's features of kind 'action'."""
OWN_WORDS = 4096
"""Numbers for object classes of people's own."""
LONG, MANY = 100.0, 10.0
"""Steps and requests that are 1 in 'clock'."""


@dataclass(frozen=True)
class SpaceLayout:
    """Sizes of the spaces; what does not fit is an error, not a silent cut (text apart)."""

    candidates: int = 16
    """Most moves at one pose; real and generated graphs stay below 14."""
    text: int = 1000
    """Most characters of an instruction; longer ones are cut."""
    features: int = 21
    """HARI: most feature sets of a description (a room and 20 objects)."""
    stack: int = 3
    """HARI: most goals on the stack."""
    descriptions: bool = False
    """HARI and Ask-v0: whether descriptions are part of the observation."""
    intentions: tuple[Intention, ...] = INTENTIONS
    """What may be asked, in the order of the actions."""
    detections: int = 0
    """Ask-v0: most detections of an observation; 0 leaves them out."""

    @property
    def actions(self) -> int:
        """Moves, then stop, then one request per intention."""
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
    if layout.detections:
        whole["detections"] = spaces.Box(-1.0, LARGE, (layout.detections, 4), np.float32)
        whole["advised"] = spaces.Discrete(layout.candidates + 2)
    if layout.descriptions:
        whole["state"] = spaces.Box(0, LARGE, (layout.features, 5), np.float32)
        whole["goals"] = spaces.Box(0, LARGE, (layout.stack, layout.features, 5), np.float32)
    return spaces.Dict(whole)


def encode(o: Observation, sensor: Sensor, layout: SpaceLayout) -> dict[str, Any]:
    """An Observation as a member of `observation_space`.

    'candidates' holds sin and cos of bearing and of slope; 'candidate_views' the view of each plus
    one (0 is padding); 'clock' is time and time on task in hundreds of steps, and requests left in tens (-1 when
    there is no budget); 'detections' sin and cos of bearing, metres and score; 'advised' the number of an action
    plus one, 0 for none. Words of descriptions are numbered by `word_number`.

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
    if layout.detections:
        rows = np.zeros((layout.detections, 4), dtype=np.float32)
        for i, seen in enumerate(o.detections[: layout.detections]):
            rows[i] = np.sin(seen.bearing), np.cos(seen.bearing), seen.distance, seen.score
        whole["detections"] = rows
        whole["advised"] = np.int64(0 if o.advised is None else 1 + number(o.advised, layout))
    if layout.descriptions:
        whole["state"] = _description(o.state_description, layout)
        goals = np.zeros((layout.stack, layout.features, 5), dtype=np.float32)
        for i, d in enumerate(o.goal_descriptions):
            goals[i] = _description(d, layout)
        whole["goals"] = goals
    return whole


@functools.lru_cache(maxsize=4096)
def codes_of(text: str, length: int) -> np.ndarray:
    """(length,) uint8, not to be written to: the text as ASCII codes, cut or padded with zeros.

    Not a gymnasium Text space, because AsyncVectorEnv (Gymnasium 1.4) does not refresh texts that
    lie in shared memory.
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
    return mask


def decode(action: int, layout: SpaceLayout) -> Action:
    """The record behind an action's number.

    Raises:
      ActionError: no such number.
      TypeError: no whole number.
    """
    try:
        action = operator.index(action)
    except TypeError:
        raise TypeError(f"an action is a whole number, got {action!r:.60} ({type(action).__name__})") from None
    if not 0 <= action < layout.actions:
        raise ActionError(
            f"action {action} does not exist; use 0 to {layout.actions - 1}: "
            f"{layout.candidates} candidates, stop, and the {len(layout.intentions)} ways to ask"
        )
    if action < layout.candidates:
        return Move(action)
    if action == layout.candidates:
        return Stop()
    return Ask(layout.intentions[action - layout.candidates - 1])


def number(action: Action, layout: SpaceLayout) -> int:
    """The number of an action; inverse of `decode`."""
    if isinstance(action, Move):
        return action.candidate
    if isinstance(action, Stop):
        return layout.candidates
    return layout.candidates + 1 + layout.intentions.index(action.intention)


def _stable(word: str) -> int:
    total = 0
    for c in word:
        total = (total * 131 + ord(c)) % 2_147_483_647
    return total


@functools.cache
def words() -> tuple[str, ...]:
    """The words of HARI's descriptions, sorted: actions, room kinds and the catalogue's object classes."""
    return tuple(sorted({*ACTION_WORDS, *ROOM_KINDS, *load_catalogue().classes}))


@functools.cache
def word_number(word: str) -> int:
    """The number of a word, from 1, the same in every process.

    Object classes of people's own models are not in the catalogue; they get a number above all
    others, which two of them may share.
    """
    known = words()
    place = bisect.bisect_left(known, word)
    if place < len(known) and known[place] == word:
        return place + 1
    return len(known) + 1 + _stable(word) % OWN_WORDS


def _description(description: Description, layout: SpaceLayout) -> np.ndarray:
    """(features, 5): kind + 1 (0 is padding), name, horizontal, vertical + 1, distance."""
    rows = np.zeros((layout.features, 5), dtype=np.float32)
    for i, f in enumerate(description[: layout.features]):
        rows[i] = KINDS.index(f.kind) + 1, word_number(f.name), f.horizontal, f.vertical + 1, f.distance
    return rows

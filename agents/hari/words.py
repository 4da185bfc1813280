"""Descriptions and moves as numbers: one row of five indices per feature set (appendix E).

A feature set is summed up from five embeddings: name, type, horizontal and vertical direction,
distance. Index 0 of each table is silent; of the names, 1 stands for all that are not known.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from embodied.agents.common.tensors import padded
from embodied.interface import STEP, TURNS, Candidates, Description, Feature

TYPES = ("object", "room", "action", "state", "goal")
"""Of feature sets; the last two mark what is described, as the first token of a description."""
NAMELESS, UNKNOWN = 0, 1
SIZES = (1 + len(TYPES), 1 + TURNS, 1 + 3, 1 + 5)
"""Sizes of the tables of types, horizontal and vertical directions and distances."""
GO, STOP = Feature("action", "go"), Feature("action", "stop")


@dataclass(frozen=True)
class FeatureWords:
    """The names that a policy knows, sorted; written with its weights, so that indices mean the same for ever."""

    names: tuple[str, ...]
    """'object/mug', 'room/kitchen', 'action/go'."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "_index", {name: i + UNKNOWN + 1 for i, name in enumerate(self.names)})

    def __len__(self) -> int:
        """Size of the table of names."""
        return len(self.names) + UNKNOWN + 1

    def row(self, feature: Feature) -> tuple[int, int, int, int, int]:
        """The five indices of a feature set; of a room or of stopping only name and type."""
        index: dict[str, int] = self._index  # type: ignore[attr-defined]  # set in __post_init__
        name = index.get(f"{feature.kind}/{feature.name}", UNKNOWN)
        kind = 1 + TYPES.index(feature.kind)
        if feature.kind == "room" or feature.name == "stop":
            return name, kind, 0, 0, 0
        return name, kind, 1 + feature.horizontal, 2 + feature.vertical, 1 + feature.distance

    def rows(self, description: Description, what: str) -> np.ndarray:
        """(1 + M, 5) int64 of a description of M feature sets; the first row is a marker.

        Args:
          what: 'state' or 'goal'; a description may be empty, so the marker says that there is one at all.
        """
        marker = (NAMELESS, 1 + TYPES.index(what), 0, 0, 0)
        return np.array([marker, *map(self.row, description)], dtype=np.int64)


def feature_words(descriptions: Iterable[Description]) -> FeatureWords:
    """The names that occur in some (training) descriptions, and the two of actions."""
    names = {f"{f.kind}/{f.name}" for d in descriptions for f in d} | {f"{f.kind}/{f.name}" for f in (GO, STOP)}
    return FeatureWords(tuple(sorted(names)))


def move_rows(words: FeatureWords, candidates: Candidates) -> np.ndarray:
    """(n + 1, 5) int64: what an agent may do next as feature sets, like an assistant's "go there"; stopping last.

    Directions are absolute, as those of descriptions; distances are not known before one has walked.
    """
    moves = [words.row(Feature("action", "go", int(v) % TURNS, int(v) // TURNS - 1)) for v in candidates.view]
    return np.array([(*m[:4], 0) for m in moves] + [words.row(STOP)], dtype=np.int64)


def move_angles(candidates: Candidates, turn: int) -> np.ndarray:
    """(n + 1, 4) float32: sine and cosine of the exact absolute direction and slope of each move; zeros for stopping.

    The 30-degree steps of `move_rows` may be alike for two neighbours.
    """
    yaw, slope = candidates.bearing + turn * STEP, candidates.slope
    angles = np.stack([np.sin(yaw), np.cos(yaw), np.sin(slope), np.cos(slope)], axis=1)
    return np.concatenate([angles, np.zeros((1, 4))]).astype(np.float32)


@dataclass(frozen=True, eq=False)
class PerceptRows:
    """The descriptions of one agent, or B agents side by side, whose padding rows are zeros."""

    state: np.ndarray
    """(S, 5) or (B, S, 5) int64: d^s."""
    goal: np.ndarray
    """(G, 5) or (B, G, 5) int64: d^g."""
    moves: np.ndarray
    """(C + 1, 5) or (B, C + 1, 5) int64: the candidates and, always last, stopping."""
    angles: np.ndarray
    """(C + 1, 4) or (B, C + 1, 4) float32."""
    allowed: np.ndarray
    """(C + 1) or (B, C + 1) bool."""


@dataclass(frozen=True, eq=False)
class Inputs(PerceptRows):
    """Inputs of the execution policy for B agents at one step."""

    state_shared: np.ndarray
    """(B, S) int64: 1 where a feature set's name stands in the other description, too, 2 where the whole set does."""
    goal_shared: np.ndarray
    """(B, G) int64, likewise."""


def percept(words: FeatureWords, state: np.ndarray, goal: np.ndarray, candidates: Candidates, turn: int) -> PerceptRows:
    """One agent's moves as rows beside those of its descriptions."""
    moves, angles = move_rows(words, candidates), move_angles(candidates, turn)
    return PerceptRows(state, goal, moves, angles, np.append(candidates.allowed, True))


def collate(percepts: Sequence[PerceptRows]) -> Inputs:
    """Percepts of B agents side by side, padded; stopping moves to the last column of all."""
    most = max(len(p.moves) for p in percepts)
    state, goal = padded([p.state for p in percepts]).numpy(), padded([p.goal for p in percepts]).numpy()
    named = (state[:, :, None, 0] == goal[:, None, :, 0]) & (goal[:, None, :, 0] > UNKNOWN)  # (B, S, G)
    same = named.astype(np.int64) + (named & (state[:, :, None] == goal[:, None]).all(-1))
    stacked = lambda name: np.stack([_stop_last(getattr(p, name), most) for p in percepts])
    return Inputs(state, goal, stacked("moves"), stacked("angles"), stacked("allowed"), same.max(2), same.max(1))


def _stop_last(rows: np.ndarray, most: int) -> np.ndarray:
    out = np.zeros((most, *rows.shape[1:]), dtype=rows.dtype)
    out[: len(rows) - 1], out[-1] = rows[:-1], rows[-1]
    return out

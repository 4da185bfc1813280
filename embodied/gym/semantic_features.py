"""Feature sources without a CNN: what objects are in which view, and which room one is in."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from embodied.geometry import wrap
from embodied.interface import VIEW_PITCHES, VIEW_YAWS, VIEWS, SeenPlace, Sight

HALF_WIDTH, HALF_HEIGHT = math.radians(37.6), math.radians(30)
"""Half the field of one of the 36 views: 60 degrees high, 4 : 3."""


class FeatureTable:
    """A FeatureSource over arrays that are already there; feature sources may look inside a Sight."""

    def __init__(self, arrays: Mapping[str, np.ndarray]) -> None:
        """`arrays`: (nodes, 36, D) float32 by world name, one D for all.

        Raises:
          ValueError: another shape.
        """
        shapes = {name: a.shape for name, a in arrays.items()}
        sizes = {s[2] for s in shapes.values() if len(s) == 3 and s[1] == VIEWS}
        if len(sizes) != 1 or any(len(s) != 3 for s in shapes.values()):
            raise ValueError(f"features should be (nodes, {VIEWS}, D) arrays with one D, got {shapes}")
        self._arrays = {name: np.asarray(a, dtype=np.float32) for name, a in arrays.items()}
        self.size = sizes.pop()

    def features(self, sight: Sight) -> np.ndarray:
        """(36, D) float32, read-only by convention.

        Raises:
          KeyError: a place of another world.
        """
        array = self._arrays.get(sight._world)
        if array is None or not 0 <= sight._node < len(array):
            raise KeyError(f"no features of this sight; the table knows the worlds {sorted(self._arrays)[:8]}")
        return array[sight._node]


def semantic_features(world: SeenPlace, classes: Sequence[str], room_kinds: Sequence[str]) -> np.ndarray:
    """(nodes, 36, len(classes) + len(room_kinds)) float32 in [0, 1]: an oracle's eyes, for tests and quick studies.

    A class has exp(-distance / 4 m) of its nearest visible object in every view that shows the
    object's middle; the room one stands in is one-hot in all views.
    """
    column = {name: k for k, name in enumerate(classes)}
    rooms = {kind: len(classes) + k for k, kind in enumerate(room_kinds)}
    table = np.zeros((len(world.graph.ids), VIEWS, len(classes) + len(room_kinds)), dtype=np.float32)
    for node, room in enumerate(world.graph.room_of_node):
        kind = world.house.room_by_id[room].kind
        if kind in rooms:
            table[node, :, rooms[kind]] = 1.0
        for s in world.sightings(node):
            k = column.get(s.object_class)
            if k is None:
                continue
            shown = (np.abs(wrap(VIEW_YAWS - s.yaw)) <= HALF_WIDTH) & (np.abs(VIEW_PITCHES - s.pitch) <= HALF_HEIGHT)
            table[node, shown, k] = np.maximum(table[node, shown, k], math.exp(-s.distance / 4.0))
    return table

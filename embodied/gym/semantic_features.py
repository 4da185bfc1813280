"""Feature sources without a CNN: what objects are in which view, and which room one is in."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from embodied.geometry import wrap
from embodied.interface import VIEW_PITCHES, VIEW_YAWS, VIEWS, SeenPlace, Sight, viewpoint

HALF_WIDTH, HALF_HEIGHT = math.radians(37.6), math.radians(30)
"""Half the field of one of the 36 views: 60 degrees high, 4 : 3."""


class SightRows:
    """Which row of a table of many worlds' features belongs to a Sight."""

    def __init__(self, worlds: Mapping[str, np.ndarray]) -> None:
        """`worlds`: (nodes, 36, D) features by world name, one D for all; their rows follow in the order of the names.

        Raises:
          ValueError: another shape, or no world.
        """
        shapes = {name: worlds[name].shape for name in sorted(worlds)}
        sizes = {s[1:] for s in shapes.values()}
        if len(sizes) != 1 or any(len(s) != 3 or s[1] != VIEWS for s in shapes.values()):
            raise ValueError(f"features must all be (nodes, {VIEWS}, D) with one D, got {shapes}")
        self.size: int = sizes.pop()[1]
        """D."""
        self.spans: dict[str, tuple[int, int]] = {}
        """World to its first row and the one after its last."""
        self.count = 0
        for name, shape in shapes.items():
            self.spans[name] = (self.count, self.count + shape[0])
            self.count += shape[0]

    def row(self, sight: Sight) -> int:
        """The row of a sight.

        Raises:
          KeyError: a place of another world.
        """
        at = viewpoint(sight)
        first, end = self.spans.get(at.world, (0, 0))
        if not 0 <= at.node < end - first:
            raise KeyError(f"no features of node {at.node} of world {at.world!r}; make them with `embodied features`")
        return first + at.node

    def filled(self, worlds: Mapping[str, np.ndarray]) -> np.ndarray:
        """(count, 36, D) float32 of all worlds below each other."""
        table = np.zeros((self.count, VIEWS, self.size), dtype=np.float32)
        for name, (first, end) in self.spans.items():
            table[first:end] = worlds[name]
        return table


class FeatureTable:
    """A FeatureSource over arrays that are already there."""

    def __init__(self, worlds: Mapping[str, np.ndarray], with_doors: Callable[[str], np.ndarray] | None = None) -> None:
        """
        Args:
          worlds: (nodes, 36, D) features by world name.
          with_doors: makes those of a world with other doors closed, by the name of what is seen there.

        Raises:
          ValueError: another shape.
        """
        self._with_doors, self._behind = with_doors, dict[str, np.ndarray]()
        self._rows = SightRows(worlds)
        self._table = self._rows.filled(worlds)
        self.size = self._rows.size

    def features(self, sight: Sight) -> np.ndarray:
        """(36, D) float32, read-only by convention; raises KeyError for a place of another world."""
        at = viewpoint(sight)
        if self._with_doors and at.world not in self._rows.spans:
            if at.world not in self._behind:
                self._behind[at.world] = self._with_doors(at.world)
            return self._behind[at.world][at.node]
        return self._table[self._rows.row(sight)]


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

"""Features without a CNN: what objects are in which view, and which room one is in."""

import math
from collections.abc import Sequence

import numpy as np

from embodied.geometry import wrap
from embodied.interface import VIEW_PITCHES, VIEW_YAWS, VIEWS, SeenPlace

HALF_WIDTH, HALF_HEIGHT = math.radians(37.6), math.radians(30)
"""Half the field of one of the 36 views: 60 degrees high, 4 : 3."""


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

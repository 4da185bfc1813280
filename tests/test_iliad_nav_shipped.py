"""The NAV student that ships: it loads, walks along the graph, and turns as it is told."""

from __future__ import annotations

import numpy as np
import pytest
from hand_worlds import grid_world

from embodied.action_spaces import PanoramicMoves
from embodied.agents.common.settings import SHIPPED_ENCODER, SHIPPED_WALKER
from embodied.agents.common.vocabulary import build_vocabulary
from embodied.agents.iliad.nav.run import load_follower
from embodied.agents.iliad.nav.student import NavEyes, NavStudent
from embodied.agents.iliad.nav.world import MOVES, Trip, walk_along
from embodied.agents.vision.encoder import load_encoder
from embodied.agents.vision.features import FeatureBank
from embodied.interface import Pose

WORLD = grid_world()


@pytest.fixture(scope="module")
def student() -> NavStudent:
    """In a house by hand whose pictures tell nothing: all it knows are directions and words."""
    encoder = load_encoder(SHIPPED_ENCODER)
    blank = FeatureBank({"grid": np.zeros((len(WORLD.graph.ids), 36, encoder.size))}, encoder.digest)
    return load_follower(SHIPPED_WALKER, NavEyes({"grid": WORLD}, blank, build_vocabulary([])))


def test_it_is_small_and_knows_the_words_of_routes(student):
    assert SHIPPED_WALKER.stat().st_size < 2e6
    assert {"turn", "left", "right", "kitchen", "walk", "stop"} <= set(student.eyes.vocabulary.words)


def test_it_walks_along_edges_and_ends(student):
    trips = [Trip("grid", Pose(node, 3), (node,), ("walk out of the kitchen and turn left .",)) for node in range(8)]
    for trip, walk in zip(trips, student.greedy(trips, [t.requests[0] for t in trips]), strict=True):
        assert walk.nodes[0] == trip.start.node and len(walk.nodes) <= MOVES + 1
        assert all(b in WORLD.graph.neighbours(a) for a, b in zip(walk.nodes, walk.nodes[1:], strict=False))


def test_left_is_not_right(student):
    """Of all first moves, 'turn left' makes those to the left likelier than 'turn right' does, and the other way."""
    gained = []
    for node in range(len(WORLD.graph.ids)):
        pose = Pose(node, 0)
        candidates, poses = PanoramicMoves().at(WORLD, pose)
        for bearing, there in zip(candidates.bearing, poses, strict=True):
            aside = float(np.sin(bearing))
            if abs(aside) < 0.5:
                continue
            walk, trip = walk_along((node, there.node)), Trip("grid", pose, (node,), ("",))
            told = [f"turn {way} and walk straight ahead ." for way in ("left", "right")]
            log = [float(student.scores([trip], [t], [walk]).log_probabilities[0, 0].detach()) for t in told]
            gained.append(aside * (log[0] - log[1]))
    assert len(gained) > 20 and np.mean(gained) > 0

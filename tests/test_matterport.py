"""Exported files say, in Matterport's conventions, what our records say in ours."""

from __future__ import annotations

import numpy as np
import pytest
from hand_data import read_features
from hand_worlds import line_world

from embodied.geometry import heading_of_yaw
from embodied.interface import Pose
from embodied.mattersim.pictures import action_list, in_matterport_order, tokenised, view_index, write_features


def test_views_agree_about_where_they_look():
    for view in range(36):
        index = view_index(view)
        assert np.isclose(np.cos(index % 12 * np.pi / 6), np.cos(heading_of_yaw(view % 12 * np.pi / 6)))
        assert np.isclose(np.sin(index % 12 * np.pi / 6), np.sin(heading_of_yaw(view % 12 * np.pi / 6)))
        assert index // 12 == view // 12 and view_index(index) == view
    assert view_index(Pose(0, 3, 0).view) == 12, "our turn 3 looks along +y, Matterport's heading 0"


def test_the_action_list_of_a_node_on_the_line():
    """Facing +y (bin 0) at node 1: east is 90 degrees to the right, west to the left."""
    stop, *others = action_list(line_world().graph, 1, 0)
    assert stop == {"relViewIndex": -1, "absViewIndex": 0, "nextViewpointId": "n1"}
    east, west = (next(a for a in others if a["nextViewpointId"] == n) for n in ("n2", "n0"))
    assert east["rel_heading"] == pytest.approx(np.pi / 2) and (east["absViewIndex"], east["relViewIndex"]) == (15, 15)
    assert west["rel_heading"] == pytest.approx(-np.pi / 2) and west["absViewIndex"] == 21
    turned = action_list(line_world().graph, 1, 3)[1]
    assert (turned["nextViewpointId"], turned["relViewIndex"], turned["absViewIndex"]) == ("n2", 12, 15), (
        "straight ahead"
    )


def test_feature_files_survive(tmp_path):
    features = np.random.default_rng(0).normal(size=(36, 5)).astype(np.float32)
    write_features(tmp_path / "f.tsv", [("test_0001", "v000", features)])
    ((key, again),) = read_features(tmp_path / "f.tsv").items()
    assert key == ("test0001", "v000") and (again == features).all()
    assert (in_matterport_order(features)[12] == features[15]).all(), "viewIndex 12 looks along +y, our view 15"
    assert (in_matterport_order(features)[15] == features[12]).all(), "heading 90 degrees looks along +x"
    assert (in_matterport_order(features)[0] == features[3]).all(), "below viewIndex 12"


def test_tokens_are_lower_case_and_apart():
    assert tokenised("Go straight, then turn left.") == "go straight , then turn left ."

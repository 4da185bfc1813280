"""Exported files say, in Matterport's conventions, what our records say in ours."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from hand_data import built, read_features
from hand_worlds import line_world

from embodied.datasets.folders import export_folder
from embodied.datasets.matterport import action_list, in_matterport_order, tokenised, view_index, write_features
from embodied.geometry import heading_of_yaw
from embodied.interface import Pose
from embodied.navigation.connectivity import from_matterport


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


@pytest.mark.slow
def test_hannas_files_hold_together(tmp_path):
    data = built(tmp_path / "d")
    export_folder("hanna", data, tmp_path)
    items = json.loads((tmp_path / "data/hanna/hanna_train.json").read_text())
    spaces = json.loads((tmp_path / "data/hanna/panoramic_action_space.json").read_text())
    routes = json.loads((tmp_path / "data/hanna/routes.json").read_text())
    tasks = data.tasks("train")
    assert len(items) == len(tasks) and len({i["path_id"] for i in items}) == len(items)
    for item, task in zip(items, tasks, strict=True):
        graph = data.place(task.world).graph
        assert [p[-1] for p in item["paths"]] == [graph.ids[g] for g in task.goal_nodes]
        for path in item["paths"]:
            for a, b in itertools.pairwise(path):
                assert any(x["nextViewpointId"] == b for x in spaces[f"{item['scan']}_{a}_0"])
    for scan, some in routes.items():
        splits = {r["split"] for r in some}
        assert splits == ({"train_seen", "train_unseen"} if scan.startswith("train") else {scan[:-4]})
        assert all(isinstance(r["path_id"], str) and "_" not in r["path_id"] and 0 <= r["view_id"] < 36 for r in some)
    scans = (tmp_path / "data/connectivity/scans.txt").read_text().split()
    assert sorted(scans) == sorted(routes)
    graph = from_matterport(tmp_path / "data/connectivity" / f"{scans[0]}_connectivity.json")
    assert np.allclose(graph.positions, data.place("test_0000").graph.positions)
    vocabulary = (tmp_path / "data/hanna/vocab.txt").read_text().split("\n")
    assert vocabulary[:3] == ["<PAD>", "<UNK>", "<EOS>"] and "find" in vocabulary


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

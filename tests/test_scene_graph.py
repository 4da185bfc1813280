"""Scene graphs and semantic maps say what the house says."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from conftest import two_rooms
from handmade import furnished

from embodied.cli import main
from embodied.datasets.scene_graph import scene_graph, write_spark_dsg
from embodied.navigation.graph import build_graph

HOUSE = furnished(two_rooms())


def facts():
    return scene_graph(HOUSE, build_graph(HOUSE))


def test_a_scene_graph_holds_rooms_things_and_how_they_are_joined():
    graph = facts()
    nodes = {n["id"]: n for n in graph["nodes"]}
    assert len(nodes) == len(graph["nodes"])
    edges = {(e["from"], e["to"]): e for e in graph["edges"]}
    assert edges["mug_1", "table_1"]["relation"] == "on" and nodes["mug_1"]["layer"] == "object"
    assert edges["living_room_1", "table_1"]["relation"] == "contains"
    door = edges["bedroom_1", "living_room_1"]
    assert door["relation"] == "door" and door["opening"] == "door_1" and 0.8 < door["openness"] <= 1
    assert nodes["table_1"]["position"][2] == pytest.approx(0.375)
    assert all(e["from"] in nodes and e["to"] in nodes for e in graph["edges"])
    assert {n for a, n in edges if a == "living_room_1"} >= {
        p.id for p in HOUSE.placements if p.room == "living_room_1" and not p.parent
    }


def test_the_command_writes_maps_whose_pixels_are_what_stands_there(tmp_path):
    HOUSE.save(tmp_path / "house.json")
    assert main(["export", "semantic-map", "--house", str(tmp_path), "--out", str(tmp_path / "maps")]) in (0, None)
    about = json.loads((tmp_path / "maps/map_0.json").read_text())
    picture = cv2.imread(str(tmp_path / "maps/map_0.png"), cv2.IMREAD_UNCHANGED)[::-1]

    def at(x: float, y: float) -> str:
        column, row = ((np.array([x, y]) - about["origin"]) / about["step"]).astype(int)
        return about["classes"][picture[row, column]]

    assert (
        at(4.4, 2.6) == "red box" and at(1.3, 1.0) == "mug" and at(8.0, 1.0) == "bedroom" and at(-0.4, 2.0) == "outside"
    )
    assert main(["export", "scene-graph", "--house", str(tmp_path), "--out", str(tmp_path / "g.json")]) in (0, None)
    assert json.loads((tmp_path / "g.json").read_text())["digest"] == HOUSE.digest


def test_spark_dsg_opens_what_is_written_for_it(tmp_path):
    dsg = pytest.importorskip("spark_dsg")
    write_spark_dsg(facts(), tmp_path / "graph.json")
    graph = dsg.DynamicSceneGraph.load(str(tmp_path / "graph.json"))
    names = {node.attributes.name for node in graph.get_layer(dsg.DsgLayers.OBJECTS).nodes}
    assert names == {p.id for p in HOUSE.placements}
    room = next(n for n in graph.get_layer(dsg.DsgLayers.ROOMS).nodes if n.attributes.name == "living_room_1")
    assert room.has_parent() and len(list(room.children())) > 3

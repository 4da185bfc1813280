"""Truths about navigation graphs: who can walk where, how far it is, and the files other programs read."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import json
import math

import numpy as np
import pytest
import shapely
from conftest import two_rooms
from hand_worlds import generated

from embodied.assets.catalogue import load_catalogue
from embodied.generate import STAGES, HouseConfig, generate_house
from embodied.house.house import HouseError, Placement
from embodied.mattersim.graphs import load_graphs
from embodied.navigation.connectivity import from_matterport, to_matterport
from embodied.navigation.free_space import EYE, free_floor, leaves, sight_floor
from embodied.navigation.graph import AGENT_RADIUS, build_graph, graph_of, sight_lines

BARE = {name: stage for name, stage in STAGES.items() if name not in ("furnish", "clear")}


BARE_SEEDS, FURNISHED_SEEDS = range(6), range(100, 106)
FEW = (0, 1, 100)
"""Seeds of the houses that `-m "not slow"` looks at; the whole suite looks at the others, too."""


@functools.cache
def pair_of(seed: int):
    """(house, graph): a bare or a furnished one."""
    bare = seed in BARE_SEEDS
    house = generate_house(seed, HouseConfig(storeys=1), stages=BARE) if bare else generated(seed)
    return house, build_graph(house)


def pairs():
    return tuple(pair_of(seed) for seed in (*BARE_SEEDS, *FURNISHED_SEEDS))


@pytest.fixture(scope="module", params=["few", pytest.param("more", marks=pytest.mark.slow)])
def some(request):
    others = sorted({*BARE_SEEDS, *FURNISHED_SEEDS} - {*FEW})
    return tuple(pair_of(seed) for seed in (FEW if request.param == "few" else others))


def line() -> tuple:
    """Four nodes on a line, 1, 2 and 3 m apart."""
    x = np.array([0.0, 1.0, 3.0, 6.0])
    positions = np.stack([x, 0 * x, 0 * x + 1.5], axis=1)
    return graph_of(positions, np.array([[0, 1], [2, 1], [2, 3]]), ("a", "b", "c", "d"), ("living_room_1",) * 4)


def test_distances_and_hops_on_a_line_by_hand():
    graph = line()
    assert graph.distance[0].tolist() == [0, 1, 3, 6]
    assert graph.path(3, 0) == (3, 2, 1, 0) and graph.path(2, 2) == (2,)
    assert graph.neighbours(1) == (0, 2)
    assert graph.next_hop[0].tolist() == [0, 1, 1, 1]


def test_a_graph_in_two_pieces_is_refused():
    with pytest.raises(HouseError, match="not connected"):
        graph_of(np.zeros((3, 3)) + np.arange(3)[:, None], np.array([[0, 1]]), ("a", "b", "c"), ("r",) * 3)


def test_two_rooms_are_joined_through_their_door():
    graph = build_graph(two_rooms())
    assert set(graph.room_of_node) == {"living_room_1", "bedroom_1"}
    assert np.allclose(graph.positions[:, 2], EYE)


@pytest.mark.slow
def test_every_room_has_a_node_in_it(some):
    for house, graph in some:
        assert set(graph.room_of_node) == {r.id for r in house.rooms}
        for p, room in zip(graph.positions, graph.room_of_node):
            assert shapely.Polygon(house.room_by_id[room].polygon).distance(shapely.Point(p[:2])) < 1e-6


def test_distance_is_a_metric(some):
    for _, graph in some:
        d = graph.distance
        assert np.isfinite(d).all() and (d == d.T).all() and (np.diag(d) == 0).all()
        for k in range(len(d)):
            assert (d <= d[:, [k]] + d[[k], :] + 1e-9).all()


def test_every_hop_is_an_edge_and_hops_add_up_to_the_distance(some):
    for _, graph in some:
        lengths = {tuple(e): x for e, x in zip(graph.edges.tolist(), graph.lengths.tolist())}
        n = len(graph.ids)
        for i in range(0, n, 3):
            for j in range(0, n, 5):
                path = graph.path(i, j)
                total = sum(lengths[min(a, b), max(a, b)] for a, b in itertools.pairwise(path))
                assert total == pytest.approx(graph.distance[i, j])


def test_each_edge_is_walkable_for_the_agents_radius_and_sees_its_other_end(some):
    for house, graph in some:
        floors = [(free_floor(house, k), sight_floor(house, k)) for k in range(len(house.storeys))]
        storeys = [house.room_by_id[r].storey for r in graph.room_of_node]
        eyes = graph.positions[:, 2] - [house.storeys[k].elevation for k in storeys]
        for i, j in graph.edges:
            way = shapely.LineString(graph.positions[[i, j], :2])
            if np.ptp([eyes[i], eyes[j], eyes.min()]) > 1e-6:
                continue  # on stairs: tests/test_storeys.py
            floor, sight = floors[storeys[i]]
            assert floor.covers(way.buffer(AGENT_RADIUS - 1e-3)), (house.seed, i, j)
            assert sight.covers(way), (house.seed, i, j)


@pytest.mark.slow
def test_edge_lengths_are_those_of_matterport3d():
    """Mean 2.27 m, median 2.06 m over the 90 public graphs (docs/sources.md, S8)."""
    lengths = np.concatenate([graph.lengths for _, graph in pairs()])
    assert 1.85 < lengths.mean() < 2.5
    assert np.quantile(lengths, 0.95) < 5.0


@pytest.mark.slow
def test_viewpoints_have_choices():
    """A tree has degree 2; Matterport3D's graphs have about 4, ours lie between because rooms are smaller."""
    for _, graph in pairs():
        assert len(graph.edges) > len(graph.ids), "at least two ways around"
    assert np.mean([2 * len(graph.edges) / len(graph.ids) for _, graph in pairs()]) > 2.7


@pytest.mark.slow
def test_a_large_house_has_about_125_nodes():
    house = generate_house(500, HouseConfig(area=(400, 440)), load_catalogue())
    assert 100 <= len(build_graph(house).ids) <= 155
    assert len(house.placements) >= 250


def test_the_graph_is_the_same_every_time():
    house, graph = pair_of(100)
    again = build_graph(house)
    assert (again.positions == graph.positions).all() and (again.edges == graph.edges).all()


def test_a_wall_of_wardrobes_keeps_the_agent_out_and_a_rug_does_not():
    house = two_rooms()
    wall = Placement("wardrobe_1", "a/b", "wardrobe", "bedroom_1", (5.7, 2.0, 0.0), 0.0, (0.6, 4.0, 2.0))
    rug = dataclasses.replace(wall, id="rug_2", size=(0.6, 4.0, 0.01))
    shelf = dataclasses.replace(wall, id="shelf_1", position=(5.7, 2.0, 1.85))
    with pytest.raises(HouseError, match="cannot be entered on foot"):
        build_graph(dataclasses.replace(house, placements=(wall,)))
    assert len(build_graph(dataclasses.replace(house, placements=(rug, shelf))).ids) >= 3


def test_an_open_leaf_stands_in_the_first_room_of_its_door():
    house = two_rooms()
    door = house.openings[0]
    leaf = leaves(house, door)[0]
    assert leaf.centroid.x > 5.0  # opens into the bedroom, its first room
    assert leaf.length == pytest.approx(2 * (0.9 - 0.06) + 2 * 0.05, abs=0.01)
    assert math.isclose(door.angle, 1.4)


def test_connectivity_files_survive_the_round_trip(tmp_path):
    house, graph = pair_of(0)
    to_matterport(graph, house, tmp_path / "house_connectivity.json")
    items = json.loads((tmp_path / "house_connectivity.json").read_text())
    assert set(items[0]) >= {"image_id", "pose", "included", "visible", "unobstructed", "height"}
    assert len(items[0]["pose"]) == 16 and items[0]["pose"][11] == graph.positions[0, 2]
    again = from_matterport(tmp_path / "house_connectivity.json")
    assert again.ids == graph.ids and again.room_of_node == graph.room_of_node
    assert (again.edges == graph.edges).all() and np.allclose(again.distance, graph.distance)


def test_visible_is_a_line_of_sight_over_furniture_and_through_doors_not_through_walls():
    table = Placement("table_1", "hand/table", "table", "living_room_1", (2.5, 2.0, 0.0), 0.0, (1.0, 3.6, 0.75))
    cupboard = Placement("cupboard_1", "hand/cupboard", "cupboard", "bedroom_1", (7.5, 2.6, 0.0), 0.0, (1.0, 2.6, 2.0))
    house = dataclasses.replace(two_rooms(), placements=(table, cupboard))
    xy = np.array([[1.0, 1.05], [4.0, 1.05], [6.0, 1.05], [8.5, 1.05], [8.5, 3.5], [6.0, 3.5]])
    rooms = ("living_room_1",) * 2 + ("bedroom_1",) * 4
    edges = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [2, 5]])
    graph = graph_of(np.c_[xy, np.full(6, 1.5)], edges, tuple("abcdef"), rooms)
    seen = sight_lines(graph, house)
    assert seen[0, 1] and seen[0, 3], "over the table, and on through the door"
    assert not seen[1, 5], "a wall is between"
    assert not seen[4, 5], "the cupboard is higher than the eye"
    assert (seen == seen.T).all() and not seen.diagonal().any()


def test_one_sees_wherever_one_walks_and_further(some, tmp_path):
    for number, (house, graph) in enumerate(some):
        path = tmp_path / f"{number}_connectivity.json"
        to_matterport(graph, house, path)
        items = json.loads(path.read_text())
        visible, open_ = (np.array([i[key] for i in items]) for key in ("visible", "unobstructed"))
        assert (visible >= open_).all() and (visible == visible.T).all()
        assert visible.sum() > open_.sum() and not visible.diagonal().any()


def test_excluded_viewpoints_are_left_out_and_ways_in_one_direction_refused(tmp_path):
    path = tmp_path / "scan_connectivity.json"
    to_matterport(line(), two_rooms(), path)
    items = json.loads(path.read_text())
    items[3]["included"] = False
    path.write_text(json.dumps(items))
    assert from_matterport(path).ids == ("a", "b", "c")
    items[0]["unobstructed"][1] = False
    path.write_text(json.dumps(items))
    with pytest.raises(HouseError, match="symmetric.*'a' to 'b'"):
        from_matterport(path)


def real(tmp_path, **changes):
    """A connectivity file as Matterport's: without rooms; `changes` are of its last viewpoint."""
    path = tmp_path / "scan_connectivity.json"
    to_matterport(line(), two_rooms(), path)
    items = [{k: v for k, v in i.items() if k != "room"} for i in json.loads(path.read_text())]
    items[-1] |= changes
    path.write_text(json.dumps(items))
    return path, items


def test_of_a_real_scan_in_pieces_the_largest_is_taken_and_the_rest_is_named(tmp_path, caplog):
    path, items = real(tmp_path)
    for i in items:
        i["unobstructed"][-1] = False
    items[-1]["unobstructed"] = [False] * len(items)
    path.write_text(json.dumps(items))
    graph = from_matterport(path)
    assert graph.ids == ("a", "b", "c") and np.isfinite(graph.distance).all()
    assert "scan_connectivity.json is in 2 pieces" in caplog.text and "left out: d" in caplog.text
    path.write_text(json.dumps([i | {"room": "living_room_1"} for i in items]))
    with pytest.raises(HouseError, match="scan_connectivity.json: no edge leads from 'd'.*export the house again"):
        from_matterport(path)


@pytest.mark.parametrize("changes", [{"pose": [float("nan")] * 16}, {"included": None}, {"unobstructed": [True]}])
def test_a_viewpoint_that_is_none_is_named_with_its_file_by_both_readers(tmp_path, changes):
    """For what else may be damaged see test_damaged_files.py."""
    path, _ = real(tmp_path, **changes)
    for read in (lambda: from_matterport(path), lambda: load_graphs(str(tmp_path), ("scan",))):
        with pytest.raises(ValueError, match=r"scan_connectivity\.json.*(viewpoint 3|is no JSON).*write one with"):
            read()
    load_graphs.cache_clear()

"""Houses of several storeys: stairs that one can climb, that nothing stands on, and from which nobody falls."""

from __future__ import annotations

import dataclasses
import functools
import json
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import shapely
from PIL import Image, ImageChops

from embodied.assets.catalogue import load_catalogue
from embodied.assistants.descriptions import Describer, described
from embodied.datasets.scene_graph import write_semantic_maps
from embodied.envs.continuous import ContinuousEnv, ContinuousEpisode, NavigationGoal, ShortestPathFollower
from embodied.generate import STAGES, HouseConfig, generate_house
from embodied.generate.plan_file import house_of_plan, load_plan
from embodied.generate.program import ROOM_TABLE, draw_storeys_of
from embodied.generate.stairwell import fitting
from embodied.house.floor_plan import paint_plan
from embodied.house.house import House, HouseError
from embodied.house.shapes import footprint, open_floor, opening_of, room_at, slope_over, well_of
from embodied.language.clauses import DOWN, UP, Climb
from embodied.language.grammar import Phrase, parse, say
from embodied.language.lexicon import lexicon_of
from embodied.language.route_clauses import legs_of
from embodied.language.templates import SPEAKERS
from embodied.navigation.connectivity import from_matterport, to_matterport
from embodied.navigation.floor_ways import FloorWays, FreePoses
from embodied.navigation.free_space import EYE
from embodied.navigation.graph import build_graph, stair_ends
from embodied.scene.model import COLLISION, VISUAL, build_spec
from embodied.scene.stairs import flights_of, railings
from embodied.seeds import stream

SEEDS = (0, 1)
BARE = {name: stage for name, stage in STAGES.items() if name not in ("furnish", "clear")}
OWN = """{"rooms": [
 {"kind": "hall", "polygon": [[0, 0], [2.4, 0], [2.4, 4], [0, 4]]},
 {"kind": "stairwell", "polygon": [[0, 4], [2.4, 4], [2.4, 8.4], [0, 8.4]]},
 {"kind": "living_room", "polygon": [[2.4, 0], [8, 0], [8, 8.4], [2.4, 8.4]]},
 {"kind": "stairwell", "polygon": [[0, 4], [2.4, 4], [2.4, 8.4], [0, 8.4]], "storey": 1},
 {"kind": "corridor", "polygon": [[0, 2.6], [8, 2.6], [8, 4], [0, 4]], "storey": 1},
 {"kind": "main_bedroom", "polygon": [[2.4, 4], [8, 4], [8, 8.4], [2.4, 8.4]], "storey": 1},
 {"kind": "bathroom", "polygon": [[0, 0], [8, 0], [8, 2.6], [0, 2.6]], "storey": 1}]}"""


@functools.cache
def house_of(seed: int, storeys: int = 2, *, bare: bool = False) -> House:
    return generate_house(seed, HouseConfig(storeys=storeys), stages=BARE if bare else STAGES)


@pytest.fixture(params=SEEDS)
def house(request) -> House:
    return house_of(request.param)


def test_some_houses_above_110_square_metres_have_storeys_and_none_below():
    number = lambda seed, area: draw_storeys_of(area, HouseConfig(), rng=stream(seed, "house", "storeys"))
    assert {number(s, 105.0) for s in range(60)} == {1} and {number(s, 150.0) for s in range(60)} == {1, 2}
    assert 0.2 < np.mean([number(s, 150.0) == 2 for s in range(200)]) < 0.5
    assert {number(s, 300.0) for s in range(60)} == {1, 2, 3}
    assert draw_storeys_of(160.0, HouseConfig(shape="U"), rng=stream(2, "house", "storeys")) == 1, "too small for a U"


def test_rooms_of_three_storeys_are_not_stretched():
    for seed in (2, 8):
        for r in house_of(seed, 3, bare=True).rooms:
            most = 1.4 * ROOM_TABLE[r.kind].area[1]
            assert r.kind in ("hall", "corridor") or shapely.Polygon(r.polygon).area < most, r.id


def test_a_stairwell_with_a_gallery_is_open_to_the_storey_above_and_railed_all_around(tmp_path):
    config = HouseConfig(area=(200, 280), storeys=2, special=("gallery", "L", "bay"))
    house = generate_house(1, config, stages=BARE)
    (stair,), void = house.stairs, shapely.Polygon(house.stairs[0].void)
    low, high = (house.room_by_id[r] for r in stair.rooms)
    assert void.area > 2 and open_floor(house, low).contains(void)
    assert open_floor(house, high).intersection(void).area < 1e-6
    rails = shapely.union_all([shapely.LineString([a[:2], b[:2]]).buffer(0.1) for a, b in railings(house, stair)])
    head = shapely.Point(stair.path[-1][:2]).buffer(stair.width / 2 + 0.1)
    assert void.exterior.difference(shapely.union_all([rails, head, well_of(stair).buffer(0.1)])).length < 0.1
    write_semantic_maps(house, tmp_path)
    low_corner = json.loads((tmp_path / "map_1.json").read_text())["origin"]
    x, y = ((np.array(void.centroid.coords[0]) - low_corner) / 0.05).astype(int).tolist()
    drawn = np.asarray(Image.open(tmp_path / "map_1.png"))[::-1]
    assert drawn[y, x] == 0 and drawn.any(), "no floor in the opening"
    living = next(r for r in house.rooms if r.kind == "living_room")
    assert len(living.polygon) > 4
    assert {*build_graph(house).room_of_node} == {r.id for r in house.rooms}
    assert House.from_json(house.to_json()) == house
    assert generate_house(1, HouseConfig(area=(200, 280), special=()), stages=BARE).stairs == ()


def test_a_plan_of_ones_own_has_a_room_in_the_shape_of_an_l(tmp_path):
    plan, file = json.loads(OWN), tmp_path / "plan.json"
    plan["rooms"] = [r for r in plan["rooms"] if r["kind"] != "stairwell" and not r.get("storey")]
    plan["rooms"][1]["polygon"] = [[0, 4], [2.4, 4], [2.4, 0], [8, 0], [8, 8.4], [0, 8.4]]
    file.write_text(json.dumps(plan))
    house = house_of_plan(load_plan(file), seed=3)
    (living,) = (r for r in house.rooms if r.kind == "living_room")
    assert len(living.polygon) == 6 and shapely.Polygon(living.polygon).area == pytest.approx(8 * 8.4 - 2.4 * 4)
    assert {living.id} == {r for o in house.openings for r in o.rooms if r and r.startswith("living")}
    plan["rooms"][1]["polygon"][0] = [0.5, 4]
    file.write_text(json.dumps(plan))
    with pytest.raises(HouseError, match="a rectangle or an L"):
        load_plan(file)


ATTIC = HouseConfig(area=(50, 60), special=("attic",))


def test_ceilings_under_the_roof_slope_and_nothing_is_in_the_way_of_light_through_their_windows():
    house, hit = generate_house(7, ATTIC, stages=BARE), np.zeros(1, np.int32)
    model = build_spec(house, load_catalogue()).compile()
    mujoco.mj_forward(model, data := mujoco.MjData(model))

    def up(group: int, at: np.ndarray) -> float:
        only = (np.arange(6) == group).astype(np.uint8)
        return mujoco.mj_ray(model, data, np.append(at, 1.5), np.array([0, 0, 1.0]), only, 1, -1, hit)

    assert [o.kind for o in house.openings].count("roof_window") > 2
    for o in (o for o in house.openings if o.kind == "roof_window"):
        (_, way, knee), beside = slope_over(house.room_by_id[o.rooms[0]], o), 0.1 * np.subtract(o.a, o.b)
        for deep in (0.6, 0.9):
            high, at = knee + deep - 1.5, np.mean([o.a, o.b], 0) + deep * way + 0.05 * beside
            assert up(COLLISION, np.add(o.a, beside) + deep * way) == pytest.approx(high, abs=1e-3)
            assert up(VISUAL, np.add(o.a, beside) + deep * way) == pytest.approx(high, abs=1e-3)
            assert up(COLLISION, at) == pytest.approx(high, abs=1e-3) and up(VISUAL, at) > high + 0.05


def test_under_the_roof_nothing_sticks_through_the_slope_and_nobody_stoops():
    house = generate_house(7, ATTIC)
    assert House.from_json(house.to_json()) == house and any(r.slopes for r in house.rooms)
    for p in house.placements:
        room = house.room_by_id[p.room]
        corners = np.asarray(footprint(p).exterior.coords)
        assert room.clear_height(house.storeys[0].height, corners).min() > p.position[2] + p.size[2] - 0.01, p.id
    graph = build_graph(house)
    for name, eye in zip(graph.room_of_node, graph.positions):
        assert house.room_by_id[name].clear_height(2.7, eye[:2]) >= 2.0
    assert {*graph.room_of_node} == {r.id for r in house.rooms}


@pytest.mark.parametrize("storeys", [2, 3])
def test_each_storey_has_a_bath_bedrooms_lie_upstairs_and_walls_stand_on_those_below(storeys):
    house = house_of(2, storeys, bare=True)
    assert len(house.storeys) == storeys and house.digest == House.from_json(house.to_json()).digest
    outlines = []
    for k in range(storeys):
        rooms = [r for r in house.rooms if r.storey == k]
        assert {"bathroom", "toilet"} & {r.kind for r in rooms}
        assert k or not any(r.kind in ("main_bedroom", "kids_room") for r in rooms)
        outlines.append(shapely.union_all([shapely.Polygon(r.polygon) for r in rooms]).buffer(0.01))
    assert all(above.difference(below).area < 0.05 for below, above in zip(outlines, outlines[1:]))


@pytest.mark.parametrize("wide, deep, bends", [(2.2, 4.2, 2), (3.8, 4.4, 1), (6.4, 4.4, 0)])
def test_flights_are_straight_turn_once_or_double_back(wide, deep, bends):
    flights = fitting(wide, deep, 1.2)
    assert flights is not None and sum(a[2] == b[2] for a, b in zip(flights.path, flights.path[1:])) - bends in (0, 1)
    assert fitting(1.8, deep, 1.2) is None


def test_steps_are_of_usual_size_and_nothing_is_above_them(house):
    (stair,) = house.stairs
    for f in flights_of(stair):
        assert 0.25 <= f.going <= 0.32 and 0.16 <= f.rise <= 0.19
        beside = [f.at(0, 0)[:2], f.at(f.length, 0)[:2]]
        assert well_of(stair).buffer(0.02).covers(shapely.LineString(beside).buffer(f.width / 2, cap_style="flat"))


def test_nothing_stands_on_stairs_or_where_one_comes_to_them(house):
    (stair,) = house.stairs
    for room, end in zip(stair.rooms, stair_ends(stair)):
        storey = house.storey_of(house.room_by_id[room])
        free = well_of(stair).union(shapely.Point(end[:2]).buffer(0.4)).buffer(-0.02)
        low = [p for p in house.placements if p.room == room and p.position[2] < storey.elevation + 2.0]
        assert not [p.id for p in low if footprint(p).intersects(free) and p.size[2] > 0.04]
        assert room_at(house, [*end[:2], storey.elevation + 0.1]) == room
    for o in house.openings:
        if o.kind in ("door", "passage") and {*o.rooms} & {*stair.rooms}:
            assert shapely.LineString([o.a, o.b]).distance(well_of(stair)) > 0.05, "it opens over treads"


def test_one_stands_on_every_tread_and_nobody_falls_from_an_edge(house):
    (stair,), rng = house.stairs, np.random.default_rng(0)
    model = build_spec(house, load_catalogue()).compile()
    data, hit = mujoco.MjData(model), np.zeros(1, np.int32)
    mujoco.mj_forward(model, data)
    groups = np.arange(6) == COLLISION
    ray = lambda a, d: mujoco.mj_ray(model, data, a, d, groups.astype(np.uint8), 1, -1, hit)
    for f in flights_of(stair):
        for k in range(f.risers - 1):
            tread = f.at((k + 0.5) * f.going, 0.0, (k + 1) * f.rise)
            assert ray(tread + [0, 0, 1.9], np.array([0, 0, -1.0])) == pytest.approx(1.9, abs=1e-3)
    upper = house.room_by_id[stair.rooms[1]]
    z, well = house.storey_of(upper).elevation, opening_of(stair)
    head = shapely.Point(stair.path[-1][:2]).buffer(stair.width / 2 + 0.1)
    edge = well.exterior.intersection(house.floor(upper).buffer(-0.1)).difference(head)
    for s in rng.uniform(0, edge.length, 40) if edge.length else ():
        p = np.array(edge.interpolate(s).coords[0]) if edge.geom_type == "LineString" else None
        if p is not None:
            inward = np.array(well.centroid.coords[0]) - p
            inward = np.append(inward / np.linalg.norm(inward), 0.0)
            assert 0 <= ray(np.append(p, z + 0.5) - 0.3 * inward, inward) < 0.6, "an edge without a railing"


def test_the_plan_of_an_upper_floor_shows_its_furniture(house):
    bare = dataclasses.replace(house, placements=())
    assert ImageChops.difference(paint_plan(house, storey=1), paint_plan(bare, storey=1)).getbbox()


def test_viewpoints_lie_on_the_stairs_and_come_back_from_matterports_file(house, tmp_path):
    graph = build_graph(house)
    floors = graph.positions[:, 2] - EYE
    on_stairs = np.abs(floors[:, None] - [s.elevation for s in house.storeys]).min(1) > 0.1
    assert on_stairs.any() and {*graph.room_of_node} == {r.id for r in house.rooms}
    slopes = np.ptp(graph.positions[graph.edges][..., 2], axis=1) > 0.1
    assert on_stairs[graph.edges[slopes]].any(1).all()
    to_matterport(graph, house, tmp_path / "x_connectivity.json")
    again = from_matterport(tmp_path / "x_connectivity.json")
    assert np.allclose(again.positions, graph.positions) and np.array_equal(again.edges, graph.edges)


def test_a_body_of_vlnce_climbs_in_ordinary_steps(house):
    graph, env = build_graph(house), ContinuousEnv()
    heights = graph.positions[:, 2]
    for a, b in ((int(heights.argmin()), int(heights.argmax())), (int(heights.argmax()), int(heights.argmin()))):
        path = tuple(tuple((graph.positions[n] - [0, 0, EYE]).tolist()) for n in graph.path(a, b))
        goal = (NavigationGoal(path[-1]),)
        place = SimpleNamespace(house=house, graph=graph)
        env.reset(ContinuousEpisode("1", house.name, path[0], 0.0, "", goal, 1.0, path), place)
        expert = ShortestPathFollower(env, along=True)
        while not env.ended:
            env.step(expert.action())
        walked = env.trajectory()
        assert walked.success and np.abs(np.diff(walked.positions[:, 2])).max() < 0.3
        assert 0.7 * graph.distance[a, b] < walked.shortest <= graph.distance[a, b] + 0.5


def test_a_person_stands_on_stairs_at_their_height_and_wheels_stay_below(house):
    (stair,), graph = house.stairs, build_graph(house)
    poses = FreePoses(house, graph)
    for f in flights_of(stair):
        middle = f.at(f.length / 2, 0.0, f.risers / 2 * f.rise)
        assert poses.is_free(middle + [0, 0, EYE]) and not poses.is_free(middle + [0, 0, EYE + 1])
    wheels = FloorWays(house, stairs=False)
    assert np.ptp(wheels.xyz[:, 2]) == 0 and not shapely.intersects_xy(well_of(stair), *wheels.xyz[:, :2].T).any()
    place, say = SimpleNamespace(house=house, graph=graph), Describer(())
    rooms = [say.sparse(place, n, goal=True) for n in range(len(graph.ids))]
    upstairs = [house.room_by_id[r].storey > 0 for r in graph.room_of_node]
    assert ["upstairs" in described(r) for r in rooms] == upstairs


def test_stairs_are_spoken_of_as_one_stretch_and_read_back():
    house, lexicon = house_of(1), lexicon_of(load_catalogue())
    graph = build_graph(house)
    a, b = (int(graph.positions[:, 2].argmin()), int(graph.positions[:, 2].argmax()))
    for path, way in ((graph.path(a, b), UP), (graph.path(b, a), DOWN)):
        legs = legs_of(SimpleNamespace(house=house, graph=graph), path, 0.0)
        assert [leg.climb for leg in legs if leg.climb] == [way]
        assert [n for leg in legs for n in leg.nodes[1:]] == list(path[1:])
    rng = np.random.default_rng(0)
    for clause in (Climb(UP), Climb(DOWN), Climb(UP, half=True)):
        for speaker in SPEAKERS:
            assert parse(say([Phrase(clause)], speaker, rng=rng), lexicon).clauses == (clause,)


def test_a_plan_of_ones_own_has_stairs_where_two_storeys_have_the_same_stairwell(tmp_path):
    file = tmp_path / "plan.json"
    file.write_text(OWN)
    house = house_of_plan(load_plan(file), seed=3)
    assert len(house.storeys) == 2 and house.stairs[0].rooms == ("stairwell_1", "stairwell_2")
    build_graph(house)
    plan = json.loads(OWN)
    plan["rooms"][5]["attic"] = True
    file.write_text(json.dumps(plan))
    (low,) = (r for r in house_of_plan(load_plan(file), seed=3).rooms if r.slopes)
    assert low.kind == "main_bedroom" and [k for k, _ in low.slopes] == [1]
    plan["rooms"][3]["attic"] = True
    file.write_text(json.dumps(plan))
    with pytest.raises(HouseError, match="1 can have a slope"):
        load_plan(file)
    plan = json.loads(OWN)
    plan["rooms"][3]["polygon"] = [[0, 4], [2.4, 4], [2.4, 8.2], [0, 8.2]]
    file.write_text(json.dumps(plan))
    with pytest.raises(HouseError, match="needs one room of kind 'stairwell'"):
        load_plan(file)
    plan["rooms"][1]["polygon"] = plan["rooms"][3]["polygon"] = [[0, 4], [2.4, 4], [2.4, 6], [0, 6]]
    file.write_text(json.dumps(plan))
    with pytest.raises(HouseError, match="no stair fits"):
        load_plan(file)

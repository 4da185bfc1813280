"""Truths about furnished houses, over generated drafts and hand-made rooms of every kind."""

from __future__ import annotations

import dataclasses
import functools
import math
import os
import subprocess
import sys

import numpy as np
import pytest
import shapely
from conftest import FINISHES, two_rooms

from embodied.assets.catalogue import load_catalogue
from embodied.assets.records import ROOM_KINDS
from embodied.generate import STAGES, HouseConfig, generate_house, stages
from embodied.generate.config import RETRIES
from embodied.generate.furnish import furnish
from embodied.generate.furnish.space import box, overlap, room_space
from embodied.generate.furnish.tables import tables
from embodied.generate.stages import missing_requirements
from embodied.geometry import facing_of, rectangle, wrap
from embodied.house.house import DOORS, House, HouseError, Opening, Room, Storey, check
from embodied.house.validation import STYLES

BARE = {name: stage for name, stage in STAGES.items() if name not in ("furnish", "check")}
TOUCH = 2e-3
"""Overlap of two boxes that is still a touch, metres: rounding of positions and yaws."""

SIZES = {
    **dict.fromkeys(("living_room", "library", "playroom", "gym", "garage", "family_room", "workshop"), (5.4, 4.4)),
    **dict.fromkeys(("kitchen", "dining_room", "main_bedroom", "sun_room"), (4.4, 3.4)),
    **dict.fromkeys(("bedroom", "kids_room", "guest_room", "study"), (3.8, 3.2)),
    **dict.fromkeys(("bathroom", "hall", "laundry_room", "closet", "stairwell"), (3.0, 2.4)),
    "toilet": (1.2, 2.0),
    "corridor": (6.0, 1.3),
    "pantry": (2.0, 1.6),
}
"""Usual inner widths and depths of rooms, metres."""


@functools.cache
def catalogue():
    return load_catalogue()


@functools.cache
def furnished(seed: int, area: tuple[float, float]) -> House:
    draft = generate_house(seed, HouseConfig(area=area), stages=BARE)
    return furnish(draft, catalogue(), seed=seed)


BEDS = tables().classes("something to sleep in")
AREAS = ((45, 55), (70, 90), (110, 130), (160, 200), (240, 280), (350, 400))
FEW = 3
"""Of the houses that are looked at in the whole suite, those that `-m "not slow"` looks at, too."""


def houses() -> list[House]:
    return [furnished(s, a) for s, a in enumerate(AREAS)]


@pytest.fixture(scope="module", params=["few", pytest.param("more", marks=pytest.mark.slow)])
def some(request) -> list[House]:
    """The smaller houses, and in the whole suite the others, too."""
    chosen = range(FEW) if request.param == "few" else range(FEW, len(AREAS))
    return [furnished(s, AREAS[s]) for s in chosen]


@functools.cache
def one_room(kind: str, seed: int = 0) -> House:
    """A single room of `kind` with a door to the outdoors in one wall and a window opposite."""
    w, d = SIZES[kind]
    room = Room(f"{kind}_1", kind, ((0.0, 0.0), (w, 0.0), (w, d), (0.0, d)), **FINISHES)
    side = min(0.9, w - 0.4)
    openings = [Opening("door_1", "door", (room.id, None), (0.2, 0.0), (0.2 + side, 0.0), 0.0, 2.05, "paint_white/0")]
    if w > 2.2:
        a, b = (w / 2 + 0.6, d), (w / 2 - 0.6, d)
        openings.append(Opening("window_1", "window", (room.id, None), a, b, 0.95, 2.1, "paint_white/0"))
    draft = House(seed, kind, (Storey(0.0, 2.6),), (room,), tuple(openings), (), ())
    return furnish(draft, catalogue(), seed=seed)


def box_of(p):
    return box(*p.position[:2], p.size[0], p.size[1], p.yaw, p.position[2], p.position[2] + p.size[2])


def of_class(house: House, *names: str):
    return [p for p in house.placements if p.object_class in names]


BASINS = ("washbasin", "wall washbasin", "bathroom vanity", "double vanity")


@pytest.mark.slow
def test_every_house_is_a_valid_house_that_survives_json(some):
    for house in some:
        check(house)
        assert House.from_json(house.to_json()).digest == house.digest


def test_what_has_a_parent_lies_exactly_on_one_of_its_surfaces(some):
    for house in some:
        for p in house.placements:
            if p.parent is None:
                continue
            parent = house.placement_by_id[p.parent]
            asset = catalogue().assets[parent.asset]
            surface = next(s for s in asset.surfaces if s.name == p.surface)
            z = parent.position[2] + surface.z * parent.size[2] / asset.size[2]
            assert p.position[2] == pytest.approx(z, abs=5e-4), p.id
            c, s = math.cos(parent.yaw), math.sin(parent.yaw)
            dx, dy = np.subtract(p.position[:2], parent.position[:2])
            u, v = c * dx + s * dy, -s * dx + c * dy
            kx, ky = parent.size[0] / asset.size[0], parent.size[1] / asset.size[1]
            assert surface.x0 * kx - 0.01 <= u <= surface.x1 * kx + 0.01, p.id
            assert surface.y0 * ky - 0.01 <= v <= surface.y1 * ky + 0.01, p.id


def test_what_has_no_parent_stands_on_the_floor_hangs_on_a_wall_or_under_the_ceiling(some):
    for house in some:
        for p in house.placements:
            if p.parent is not None:
                continue
            room = house.room_by_id[p.room]
            storey = house.storey_of(room)
            z = p.position[2] - storey.elevation
            if abs(z) < 1e-3 or abs(z + p.size[2] - storey.height) < 2e-3:
                continue
            rugs = [f for f in house.placements if f.room == p.room and f.size[2] < 0.03]
            if any(f.position[2] + f.size[2] == pytest.approx(p.position[2], abs=1e-3) for f in rugs):
                continue  # a toy on a rug
            back = np.array(p.position[:2]) + np.array([-math.sin(p.yaw), math.cos(p.yaw)]) * p.size[1] / 2
            gap = house.floor(room).exterior.distance(shapely.Point(back))
            assert gap < 0.03, f"{p.id} floats {gap:.3f} m from the wall"


def test_objects_do_not_interpenetrate(some):
    chairs_under = {"dining table", "bistro table", "desk", "office table", "child table", "kitchen island"}
    chairs_under |= {"dressing table", "drafting table", "bar table"}
    for house in some:
        for room in house.rooms:
            things = [p for p in house.placements if p.room == room.id and not (p.size[2] <= 0.03 and not p.parent)]
            boxes = [box_of(p) for p in things]
            for i, (p, b) in enumerate(zip(things, boxes)):
                for q, c in zip(things[:i], boxes[:i]):
                    if p.parent == q.id or q.parent == p.id or not overlap(b, c, -TOUCH):
                        continue
                    tucked = p.group == q.group and (p.object_class in chairs_under or q.object_class in chairs_under)
                    assert tucked, f"{p.id} meets {q.id} in {house.seed} {room.id}"


def test_objects_stay_between_the_walls_of_their_room(some):
    for house in some:
        for p in house.placements:
            room = house.room_by_id[p.room]
            storey = house.storey_of(room)
            floor = house.floor(room).buffer(5e-3)
            assert floor.covers(shapely.Polygon(rectangle(*p.position[:2], p.size[0], p.size[1], p.yaw))), p.id
            assert p.position[2] + p.size[2] <= storey.elevation + storey.height + 2e-3, p.id


def test_nothing_stands_in_a_doorway_or_before_a_window(some):
    for house in some:
        for room in house.rooms:
            for wall in room_space(house, room).walls:
                for s0, s1, o in wall.openings:
                    depth, z0 = (0.35, 0.0) if o.kind in DOORS else (0.1, o.sill)
                    x, y = wall.point((s0 + s1) / 2, depth / 2)
                    free = box(x, y, s1 - s0, depth, wall.yaw, z0 + 0.05, o.head - 0.05)
                    curtains = ("curtain", "window blind", "roller blind")
                    for p in house.placements:
                        if p.room == room.id and p.parent is None and p.object_class not in curtains:
                            assert not overlap(free, box_of(p)), f"{p.id} blocks {o.id} in {house.seed}"


def test_one_walks_from_every_door_of_a_room_to_every_other(some):
    """A raster of its own: free floor eroded by 0.2 m, furniture as it was placed."""
    from scipy import ndimage

    for house in some:
        for room in house.rooms:
            floor = house.floor(room)
            blocked = [
                shapely.Polygon(rectangle(*p.position[:2], p.size[0], p.size[1], p.yaw)).buffer(0.2)
                for p in house.placements
                if p.room == room.id and p.position[2] < 1.7 and p.position[2] + p.size[2] > 0.06
            ]
            free = floor.buffer(-0.2).difference(shapely.union_all(blocked))
            doors = [
                wall.point((s0 + s1) / 2, 0.32)
                for wall in room_space(house, room).walls
                for s0, s1, o in wall.openings
                if o.kind in DOORS
            ]
            x0, y0, x1, y1 = floor.bounds
            xs, ys = np.meshgrid(np.arange(x0, x1, 0.05), np.arange(y0, y1, 0.05))
            labels, _ = ndimage.label(shapely.contains_xy(free, xs, ys))
            seen = set()
            for x, y in doors:
                near = labels[np.hypot(xs - x, ys - y) < 0.16]
                seen.add(int(near.max(initial=0)))
            assert 0 not in seen and len(seen) <= 1, f"{room.id} of house {house.seed} is cut apart"


@pytest.mark.slow
def test_radiators_and_curtains_hang_only_where_one_still_walks_past_them():
    """A dining table ends 0.5 m from a window of the first house, an armchair stands 0.6 m from one of the second."""
    houses = [generate_house(s, HouseConfig(area=a), catalogue()) for s, a in ((12188, (130, 160)), (9142, (240, 280)))]
    test_one_walks_from_every_door_of_a_room_to_every_other(houses)
    room = next(r for r in houses[1].rooms if r.id == "sun_room_1")
    space = room_space(houses[1], room)
    x0, y0, x1, y1 = space.polygon.bounds
    low, high = space.bottom, space.bottom + 2
    assert len(space.entries) > 1 and space.leaves_a_way_past(box(x0, y0, 0.1, 0.1, 0.0, low, high))
    everywhere = box((x0 + x1) / 2, (y0 + y1) / 2, x1 - x0, y1 - y0, 0.0, low, high)
    assert not space.leaves_a_way_past(everywhere)
    assert space.leaves_a_way_past(dataclasses.replace(everywhere, bottom=low + 1.95))  # one walks below it


@pytest.mark.slow
@pytest.mark.parametrize("kind", ROOM_KINDS)
def test_a_room_of_every_kind_gets_furniture_and_a_ceiling_lamp(kind):
    for seed in range(3):
        house = one_room(kind, seed)
        lamps = [p for p in house.placements if p.object_class in tables().lumens and p.position[2] + p.size[2] > 2.59]
        assert lamps, f"{kind} has no ceiling lamp"
        assert {light.placement for light in house.lights} >= {p.id for p in lamps}
        assert len(house.placements) >= (3 if kind in ("corridor", "stairwell", "toilet", "pantry") else 7)


def test_a_kitchen_has_sink_cooker_and_fridge_and_a_bathroom_toilet_and_basin():
    for seed in range(6):
        kitchen = one_room("kitchen", seed)
        assert all(of_class(kitchen, *some) for some in (("kitchen sink",), ("cooker", "cooktop"), ("fridge",)))
        bathroom = one_room("bathroom", seed)
        assert of_class(bathroom, "toilet") and of_class(bathroom, *BASINS)
        assert of_class(bathroom, "bathtub", "shower", "corner bathtub")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1434163573, 1583581038])
def test_rooms_are_drawn_anew_until_nothing_is_lacking(seed):
    """Houses whose first plan left no room for a sink and a cooker, for a fridge and a bed."""
    house = generate_house(seed, HouseConfig(area=(90.0, 200.0)), catalogue())
    assert missing_requirements(house) == ()
    assert house.seed == seed
    beds = tuple(p for p in house.placements if p.object_class in BEDS)
    robbed = dataclasses.replace(house, placements=tuple(p for p in house.placements if p.room != beds[0].room))
    assert f"{beds[0].room}: bed" in missing_requirements(robbed)


@pytest.mark.slow
def test_of_houses_that_all_lack_something_the_one_that_lacks_least_is_kept(monkeypatch):
    short = iter([("a", "b"), ("a",), ("a", "b", "c"), ("a",), ("a",)])
    monkeypatch.setattr(stages, "missing_requirements", lambda *_: next(short))
    monkeypatch.setattr(stages, "RETRIES", dataclasses.replace(RETRIES, house=5))
    drawn = []
    room = {**STAGES, "rooms": lambda draft: (drawn.append(draft.attempt), STAGES["rooms"](draft))[1]}
    house = generate_house(7, HouseConfig(area=(38.0, 46.0)), catalogue(), stages=room)
    assert drawn == [0, 1, 2, 3, 4]
    monkeypatch.setattr(stages, "missing_requirements", lambda *_: ())
    second = {**STAGES, "rooms": lambda draft: STAGES["rooms"](dataclasses.replace(draft, attempt=1))}
    assert house.digest == generate_house(7, HouseConfig(area=(38.0, 46.0)), catalogue(), stages=second).digest


def test_worktops_of_all_kitchens_are_in_use(some):
    worktops = ("base cabinet", "drawer cabinet", "kitchen sink", "cooker", "kitchen island")
    for house in some:
        for room in house.rooms:
            if room.kind == "kitchen":
                carriers = {p.id for p in house.placements if p.room == room.id and p.object_class in worktops}
                things = {p.object_class for p in house.placements if p.parent in carriers}
                assert len(things) >= 4, (house.seed, room.id, things)


@pytest.mark.slow
def test_a_small_kitchen_has_a_worktop_besides_sink_and_cooker():
    house = furnished(7406, (40.0, 55.0))
    (kitchen,) = [r.id for r in house.rooms if r.kind == "kitchen"]
    assert any(p.room == kitchen for p in of_class(house, "base cabinet", "drawer cabinet"))


def test_no_picture_hangs_twice_while_there_are_others(some):
    """The framed print and the poster of one image are the same picture."""
    for house in some:
        pictures = of_class(house, "picture", "painting", "poster")
        hung = [p.asset.rsplit("/", 1)[-1].removeprefix("paper_") for p in pictures]
        rooms = [p.room for p in pictures]
        assert len(set(zip(rooms, hung))) == len(hung), house.seed
        assert max(map(hung.count, hung)) == 1 or len(hung) > 60, house.seed


@pytest.mark.slow
def test_beds_have_their_head_at_a_wall():
    found = 0
    for house in houses():
        for p in of_class(house, *BEDS):
            back = np.array(p.position[:2]) + np.array([-math.sin(p.yaw), math.cos(p.yaw)]) * p.size[1] / 2
            assert house.floor(house.room_by_id[p.room]).exterior.distance(shapely.Point(back)) < 0.06, p.id
            found += 1
    assert found >= 15


@pytest.mark.slow
def test_a_sofa_that_shares_a_group_with_a_television_faces_it():
    found = 0
    for house in [*houses(), *(one_room("living_room", s) for s in range(6))]:
        screens = of_class(house, "television", "fireplace", "wall television", "tv stand", "media cabinet")
        for sofa in of_class(house, "sofa"):
            for screen in screens:
                if screen.group == sofa.group:
                    dx, dy = np.subtract(screen.position[:2], sofa.position[:2])
                    assert abs(wrap(math.atan2(dy, dx) - facing_of(sofa.yaw))) < math.radians(30), sofa.id
                    found += 1
    assert found >= 8


def test_chairs_look_at_their_table(some):
    for house in some:
        for chair in of_class(house, "dining chair"):
            tables = [p for p in of_class(house, "dining table", "bistro table") if p.group == chair.group]
            for table in tables:
                corners = rectangle(*table.position[:2], table.size[0], table.size[1], table.yaw)
                near = shapely.Polygon(corners).exterior
                ahead = np.array(chair.position[:2]) + 0.6 * np.array([math.sin(chair.yaw), -math.cos(chair.yaw)])
                behind = np.array(chair.position[:2]) - 0.6 * np.array([math.sin(chair.yaw), -math.cos(chair.yaw)])
                solid = shapely.Polygon(near)
                assert solid.distance(shapely.Point(ahead)) < solid.distance(shapely.Point(behind)), chair.id


def test_every_style_prefers_some_furniture_and_no_other_is_taken_for_one():
    assert tuple(tables().styles) == STYLES
    with pytest.raises(HouseError, match="unknown style 'rococo'"):
        furnish(dataclasses.replace(two_rooms(), style="rococo"), catalogue(), seed=1)


def test_rooms_of_one_kind_are_furnished_differently():
    looks = {tuple(sorted(p.asset for p in one_room("living_room", s).placements)) for s in range(5)}
    assert len(looks) == 5


@pytest.mark.slow
def test_the_same_seed_gives_the_same_house_in_another_process():
    code = "from embodied.generate import *; print(generate_house(7, HouseConfig(area=(38, 46))).digest)"
    command, env = [sys.executable, "-c", code], {"PYTHONHASHSEED": "7", "HOME": os.environ["HOME"]}
    there = subprocess.run(command, capture_output=True, text=True, check=True, env=env).stdout.strip()
    assert there == generate_house(7, HouseConfig(area=(38, 46))).digest

"""Truths about generated houses before the furniture: what an architect would check on the plan."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from embodied.assets.catalogue import load_catalogue
from embodied.assets.materials import MATERIALS
from embodied.assets.records import ROOM_KINDS
from embodied.generate import STAGES, HouseConfig, generate_house, stages
from embodied.generate.config import RETRIES
from embodied.generate.novelty import STYLE_FINISHES
from embodied.generate.program import BEDROOMS, FURTHER, ROOM_TABLE, Extra
from embodied.generate.stages import Draft
from embodied.generate.walkways import remove_blocking_objects
from embodied.house.house import DOORS, House, HouseError, Placement, Room, check
from embodied.house.shapes import inward
from embodied.house.validation import STYLES
from embodied.navigation.graph import unreachable_rooms

SEEDS, FEW = 24, 6
BARE = {name: stage for name, stage in STAGES.items() if name not in ("furnish", "clear")}
PRIVATE = (*BEDROOMS, "bathroom", "toilet", "closet", "pantry")


@functools.cache
def house_of(seed: int) -> House:
    return generate_house(seed, HouseConfig(storeys=1), stages=BARE)


def houses() -> tuple[House, ...]:
    return tuple(house_of(seed) for seed in range(SEEDS))


@pytest.fixture(scope="module", params=["few", pytest.param("more", marks=pytest.mark.slow)])
def some(request) -> tuple[House, ...]:
    """The first houses, and in the whole suite the others, too."""
    return tuple(house_of(seed) for seed in (range(FEW) if request.param == "few" else range(FEW, SEEDS)))


def polygon(room: Room) -> shapely.Polygon:
    return shapely.Polygon(room.polygon)


def doors_of(house: House) -> dict[str, set[str]]:
    ways: dict[str, set[str]] = {r.id: set() for r in house.rooms}
    for o in house.openings:
        if o.kind in DOORS and o.rooms[1] is not None:
            ways[o.rooms[0]].add(o.rooms[1])
            ways[o.rooms[1]].add(o.rooms[0])
    return ways


@pytest.mark.slow
def test_every_house_passes_check_and_survives_json(some):
    for house in some:
        check(house)
        assert House.from_json(house.to_json()) == house


def test_rooms_tile_the_footprint_without_gaps_on_the_tenth_of_a_metre(some):
    for house in some:
        corners = np.concatenate([r.polygon for r in house.rooms])
        assert np.allclose(corners * 10, np.round(corners * 10), atol=1e-6)
        union = shapely.union_all([polygon(r) for r in house.rooms])
        assert union.geom_type == "Polygon" and not union.interiors
        assert union.area == pytest.approx(sum(polygon(r).area for r in house.rooms), abs=1e-6)


@pytest.mark.slow
def test_every_room_can_be_entered_on_foot_past_the_open_leaves(some):
    for house in some:
        assert unreachable_rooms(house) == ()


def test_nobody_crosses_a_bedroom_or_a_bath_to_reach_another_room(some):
    """Take away a private room: only rooms it owns (an ensuite, a closet) may be cut off with it."""
    for house in some:
        ways = doors_of(house)
        start = next(r.id for r in house.rooms if r.kind == "hall")
        kinds = {r.id: r.kind for r in house.rooms}
        for gone in (r.id for r in house.rooms if r.kind in PRIVATE):
            reached, todo = {start, gone}, [start]
            while todo:
                new = [n for n in sorted(ways[todo.pop()]) if n not in reached]
                reached.update(new)
                todo += new
            cut = {kinds[r.id] for r in house.rooms if r.id not in reached}
            assert cut <= ({"bathroom", "closet"} if kinds[gone] in BEDROOMS else set()), (house.seed, gone, cut)


def test_there_is_one_front_door_and_it_opens_into_the_hall(some):
    for house in some:
        front = [o for o in house.openings if o.kind == "front_door"]
        assert len(front) == 1 and house.room_by_id[front[0].rooms[0]].kind == "hall"


def test_windows_keep_clear_of_the_ends_of_inner_walls(some):
    for house in some:
        corners = np.concatenate([r.polygon for r in house.rooms])
        for o in house.openings:
            if o.kind in ("window", "french_window"):
                window = shapely.LineString([o.a, o.b])
                assert min(window.distance(shapely.Point(c)) for c in corners) > house.inner_wall / 2


@pytest.mark.slow
def test_rooms_to_live_in_have_daylight():
    dark = total = 0
    for house in houses():
        lit = {o.rooms[0] for o in house.openings if o.kind in ("window", "french_window")}
        for r in house.rooms:
            if r.kind in (*BEDROOMS, "living_room", "kitchen", "dining_room", "study"):
                total += 1
                dark += r.id not in lit
    assert dark <= 0.01 * total


def test_bedrooms_open_off_halls_and_corridors_except_in_flats(some):
    for house in some:
        ways = doors_of(house)
        kinds = {r.id: r.kind for r in house.rooms}
        for r in house.rooms:
            if r.kind in BEDROOMS and house.area > 75:
                assert any(kinds[n] in ("hall", "corridor") for n in ways[r.id]), (house.seed, r.id)


@pytest.mark.slow
def test_rooms_have_the_proportions_of_rooms_and_corridors_their_width():
    ratios = []
    for house in houses():
        for r in house.rooms:
            x0, y0, x1, y1 = polygon(r).bounds
            long, short = max(x1 - x0, y1 - y0), min(x1 - x0, y1 - y0)
            if r.kind == "corridor":
                assert 1.0 <= short - house.inner_wall <= 1.6 or long < 1.6, (house.seed, r.id)
                assert long <= 10.0
            elif r.kind not in ("hall", "toilet", "pantry", "closet"):
                ratios.append(long / short)
    assert np.median(ratios) < 1.5
    assert np.quantile(ratios, 0.95) < 2.2


@pytest.mark.slow
def test_circulation_takes_a_tenth_to_a_sixth_of_most_houses():
    shares = [sum(polygon(r).area for r in h.rooms if r.kind in ("hall", "corridor")) / h.area for h in houses()]
    assert 0.07 < np.median(shares) < 0.16


@pytest.mark.slow
def test_sizes_fit_the_table_of_usual_rooms():
    areas: dict[str, list[float]] = {}
    for house in houses():
        for r in house.rooms:
            areas.setdefault(r.kind, []).append(polygon(r).area)
    for kind, low, high in (
        ("living_room", 14, 40),
        ("kitchen", 6, 18),
        ("main_bedroom", 10, 22),
        ("bedroom", 8, 15),
        ("bathroom", 3.8, 9),
        ("toilet", 1.4, 3.6),
    ):
        assert low < np.median(areas[kind]) < high, kind


@pytest.mark.slow
def test_houses_differ_in_kinds_of_rooms_and_in_outline():
    kinds = {r.kind for house in houses() for r in house.rooms}
    assert len(kinds) >= 16 and kinds <= set(ROOM_KINDS) and len({h.digest for h in houses()}) == SEEDS
    outlines = [shapely.union_all([polygon(r) for r in h.rooms]).simplify(1e-6).exterior for h in houses()]
    assert {4, 6, 8} <= {len(o.coords) - 1 for o in outlines}


@pytest.mark.slow
@pytest.mark.parametrize("shape, corners", [("rectangle", 4), ("L", 6), ("T", 8), ("U", 8), ("cross", 12)])
def test_an_asked_shape_is_built(shape, corners):
    house = generate_house(5, HouseConfig(area=(210, 230), shape=shape), stages=BARE)
    outline = shapely.union_all([polygon(r) for r in house.rooms]).simplify(1e-6)
    assert len(outline.exterior.coords) - 1 == corners


@pytest.mark.slow
@pytest.mark.parametrize("area", [35, 60, 120, 260, 600])
def test_an_asked_area_is_met_from_flat_to_mansion(area):
    house = generate_house(3, HouseConfig(area=(area, area)), stages=BARE)
    assert house.area == pytest.approx(area, rel=0.06)


@pytest.mark.slow
def test_asked_rooms_are_counted_as_in_advertisements():
    minor = ("kitchen", "bathroom", "toilet", "hall", "corridor", "laundry_room", "pantry", "closet", "garage")
    for rooms, area in ((2, (38, 44)), (4, (100, 110)), (20, (590, 610))):
        house = generate_house(11, HouseConfig(rooms=rooms, area=area), stages=BARE)
        assert sum(r.kind not in minor for r in house.rooms) == rooms
    house = generate_house(12, HouseConfig(bedrooms=4), stages=BARE)
    assert sum(r.kind in BEDROOMS for r in house.rooms) == 4


@pytest.mark.slow
def test_living_rooms_mostly_look_south():
    south = 0
    for house in houses():
        glass = [o for o in house.openings if o.rooms[1] is None and o.rooms[0].startswith("living_room")]
        widest = max(glass, key=lambda o: math.dist(o.a, o.b) * (o.head - o.sill))
        south += float(np.dot(-inward(house, widest), [-math.cos(house.sky.north), -math.sin(house.sky.north)])) > 0
    assert south > 0.75 * SEEDS


def test_palettes_use_known_materials_and_one_style_per_house(some):
    assert tuple(STYLE_FINISHES) == STYLES
    for house in some:
        assert house.style in STYLES
        for r in house.rooms:
            keys = [r.floor_finish, r.wall_finish, r.ceiling_finish, r.skirting_finish]
            keys += [r.accent_finish] if r.accent_finish else []
            assert all(k in MATERIALS for k in keys), (r.id, keys)
        assert all(o.leaf_finish is None or o.leaf_finish in MATERIALS for o in house.openings)
        floors = {r.floor_finish for r in house.rooms if r.kind in ("living_room", "dining_room", "family_room")}
        assert len(floors) == 1


def test_an_accent_wall_has_neither_door_nor_window(some):
    for house in some:
        for r in house.rooms:
            if r.accent_wall is not None:
                corners = [*r.polygon, r.polygon[0]]
                wall = shapely.LineString(corners[r.accent_wall : r.accent_wall + 2])
                middles = [shapely.Point(np.add(o.a, o.b) / 2) for o in house.openings if r.id in o.rooms]
                assert all(wall.distance(middle) > 0.1 for middle in middles)


@pytest.mark.slow
def test_fixed_sky_and_disorder_are_kept():
    house = generate_house(1, HouseConfig(hour=7.5, weather="overcast", disorder=0.9, style="classic"), stages=BARE)
    assert (house.sky.hour, house.sky.weather, house.disorder, house.style) == (7.5, "overcast", 0.9, "classic")


@pytest.mark.parametrize(
    "options, message",
    [
        ({"area": (10, 20)}, "area"),
        ({"rooms": 30}, "rooms"),
        ({"shape": "star"}, "shape"),
        ({"storeys": 4}, "storeys"),
        ({"hour": 25.0}, "hour"),
        ({"weather": "snow"}, "weather"),
        ({"disorder": 2.0}, "disorder"),
        ({"style": "rococo"}, "style"),
        ({"rooms": 3, "bedrooms": 3}, "bedrooms"),
        ({"rooms": 20, "bedrooms": 2}, "to invent"),
        ({"rooms": 12, "area": (40, 60)}, "need at least"),
        ({"rooms": 2, "area": (400, 500)}, "fill at most"),
        ({"area": (200, 100)}, "area"),
        ({"shape": "U", "area": (40, 60)}, "U"),
    ],
)
def test_impossible_wishes_are_refused_at_once(options, message):
    with pytest.raises(HouseError, match=message):
        HouseConfig(**options)


@pytest.mark.slow
def test_a_replaced_stage_is_asked_on_every_retry(monkeypatch):
    """No doors please at the first plan: it is drawn again by the stage that was given."""
    asked, refused = [], iter(["hall_1"] * RETRIES.doors)
    monkeypatch.setattr(stages, "unreachable_rooms", lambda house: next(refused, ()))

    def mine(draft: Draft) -> Draft:
        asked.append(draft.attempt)
        return STAGES["rooms"](draft)

    house = generate_house(2, stages={**BARE, "rooms": mine})
    assert asked == [0, 1]
    second = generate_house(2, stages={**BARE, "rooms": lambda d: STAGES["rooms"](replace(d, attempt=1))})
    assert [r.polygon for r in house.rooms] == [r.polygon for r in second.rooms]


def test_a_stage_that_was_left_out_is_named():
    with pytest.raises(HouseError, match="'rooms' makes"):
        generate_house(2, stages={name: stage for name, stage in BARE.items() if name != "rooms"})


@pytest.mark.slow
def test_a_new_kind_of_room_is_an_entry_in_each_of_two_tables(tmp_path, monkeypatch):
    """As docs/houses.md promises: its name, how architects think of it, and its furniture."""
    monkeypatch.setattr("embodied.house.house.ROOM_KINDS", (*ROOM_KINDS, "music_room"))
    often = Extra(house=0.0, size=14.0, likely=1e6)
    monkeypatch.setitem(ROOM_TABLE, "music_room", replace(ROOM_TABLE["library"], extra=often))
    monkeypatch.setitem(FURTHER, "music_room", often)
    (tmp_path / "groups.toml").write_text(
        '[rooms.music_room]\nrules = [{ group = "piece", role = "upright piano" }, { group = "greenery" }]'
    )
    house = generate_house(4, HouseConfig(rooms=6, bedrooms=2, storeys=1), load_catalogue(own=tmp_path))
    rooms = {r.id for r in house.rooms if r.kind == "music_room"}
    assert rooms and {p.room for p in house.placements if p.object_class == "upright piano"} >= rooms


def test_every_kind_of_room_that_is_drawn_stands_in_the_table_of_kinds():
    assert set(ROOM_TABLE) == set(ROOM_KINDS)


@pytest.mark.slow
def test_a_wardrobe_in_the_doorway_is_cleared_away_with_what_lies_on_it():
    house = house_of(1)
    door = next(o for o in house.openings if o.kind == "door" and house.room_by_id[o.rooms[0]].kind in BEDROOMS)
    x, y = (np.add(door.a, door.b) / 2).tolist()
    block = Placement("wardrobe_1", "a/b", "wardrobe", door.rooms[0], (x, y, 0.0), 0.0, (1.2, 1.2, 2.0))
    box = Placement("box_1", "a/c", "box", door.rooms[0], (x, y, 2.0), 0.0, (0.3, 0.3, 0.3), parent="wardrobe_1")
    rug = Placement("rug_1", "a/d", "rug", door.rooms[0], (x, y, 0.0), 0.3, (1.2, 1.2, 0.01))
    blocked = replace(house, placements=(block, box, rug))
    assert door.rooms[0] in unreachable_rooms(blocked)
    assert [p.id for p in remove_blocking_objects(blocked).placements] == ["rug_1"]

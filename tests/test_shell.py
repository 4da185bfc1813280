"""The shell is closed, has the area it should have, and everything in it has an owner."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import FINISHES, two_rooms

from embodied.assets.built import BUILT_ASSETS
from embodied.assets.materials import MATERIALS
from embodied.assets.records import Finish
from embodied.house.house import House, Opening, Room, Stair, Storey
from embodied.house.shapes import room_union
from embodied.scene.house_meshes import house_parts, owners
from embodied.scene.model import compile_scene
from embodied.scene.walls import floor_turn, inset

CATALOGUE = SimpleNamespace(
    finish=lambda key: Finish(tile=MATERIALS[key].tile),
    mesh=lambda key, size, params=(): BUILT_ASSETS[key].make(size, params, lambda k: Finish(tile=MATERIALS[k].tile)),
)


def ell_house() -> House:
    """An L-shaped room around a small one, with every kind of opening, and a second storey over the small one."""
    ell = Room(
        "living_room_1",
        "living_room",
        ((0, 0), (7, 0), (7, 3), (4, 3), (4, 6), (0, 6)),
        **FINISHES,
        accent_wall=0,
        accent_finish="paint_teal/0",
    )
    bath = Room(
        "bathroom_1", "bathroom", ((4, 3), (7, 3), (7, 6), (4, 6)), **{**FINISHES, "floor_finish": "hex_tiles/0"}
    )
    loft = Room("bedroom_1", "bedroom", ((0, 0), (7, 0), (7, 3), (0, 3)), **FINISHES, storey=1)
    living, bath_id, bed, white = "living_room_1", "bathroom_1", "bedroom_1", "paint_white/0"
    openings = (
        ("door_1", "door", (bath_id, living), (4.8, 3.0), (5.6, 3.0), 0.0, 2.05, "oak/0", "b", 1.2),
        ("passage_1", "passage", (living, bath_id), (4.0, 4.0), (4.0, 5.4), 0.0, 2.2),
        ("front_door_1", "front_door", (living, None), (0.0, 5.0), (0.0, 4.0), 0.0, 2.1, "lacquer_black/0"),
        ("french_window_1", "french_window", (living, None), (1.0, 0.0), (2.8, 0.0), 0.0, 2.2, white),
        ("garage_door_1", "garage_door", (living, None), (3.5, 0.0), (6.0, 0.0), 0.0, 2.2, white),
        ("window_1", "window", (bath_id, None), (7.0, 4.0), (7.0, 5.0), 1.3, 2.1, white),
        ("back_door_1", "back_door", (bed, None), (7.0, 1.0), (7.0, 2.0), 0.0, 2.1, white),
        ("window_2", "window", (bed, None), (0.5, 3.0), (2.0, 3.0), 0.9, 2.1),
    )
    stair = Stair("stair_1", ("living_room_1", "bedroom_1"), ((0.6, 0.6, 0.0), (4.4, 0.6, 2.9)), 0.9, 16)
    doors = tuple(Opening(*opening) for opening in openings)
    return House(3, "ell", (Storey(0.0, 2.6), Storey(2.9, 2.5)), (ell, bath, loft), doors, (), (), (stair,))


HOUSES = ("two rooms", "ell")


@pytest.fixture(scope="module")
def houses():
    made = {"two rooms": two_rooms(), "ell": ell_house()}
    return {name: (h, house_parts(h, CATALOGUE)) for name, h in made.items()}


def world_triangles(part) -> np.ndarray:
    """(m, 3, 3) corners of a part, metres, world."""
    c, s = np.cos(part.yaw), np.sin(part.yaw)
    v = part.mesh.vertices.astype(float) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + part.position
    return v[part.mesh.faces]


def area(part) -> float:
    t = world_triangles(part)
    return float(np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum() / 2)


def first_hits(triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance (n,) to the first triangle along each ray (inf if none), and its index."""
    a, e, f = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    best, which = np.full(len(origins), np.inf), np.full(len(origins), -1)
    for k, (o, d) in enumerate(zip(origins, directions, strict=True)):
        p = np.cross(d, f)
        det = (e * p).sum(1)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = ((o - a) * p).sum(1) / det
            q = np.cross(o - a, e)
            v = (q @ d) / det
            t = (f * q).sum(1) / det
            ok = (np.abs(det) > 1e-14) & (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 1e-6)
        if ok.any():
            t = np.where(ok, t, np.inf)
            which[k], best[k] = int(t.argmin()), float(t.min())
    return best, which


@pytest.mark.parametrize("name", HOUSES)
def test_every_part_has_an_owner_and_equal_keys_mean_equal_meshes(houses, name):
    house, parts = houses[name]
    known = owners(house)
    assert len(set(known)) == len(known) and {p.owner for p in parts} <= set(known)
    by_key = {}
    for p in parts:
        assert p.kind in ("object", "wall", "floor", "ceiling", "opening", "outdoor")
        assert p.room in house.room_by_id or (p.room == "" and p.kind == "outdoor")
        other = by_key.setdefault(p.mesh_key, p.mesh)
        assert np.array_equal(other.vertices, p.mesh.vertices) and np.array_equal(other.faces, p.mesh.faces), p.mesh_key
        assert np.isfinite(p.mesh.vertices).all() and len(p.mesh.faces) > 0
    assert [p.owner for p in parts] == [p.owner for p in house_parts(house, CATALOGUE)]


@pytest.mark.parametrize("name", HOUSES)
def test_faces_agree_with_their_normals(houses, name):
    for p in houses[name][1]:
        t = p.mesh.vertices[p.mesh.faces].astype(float)
        n = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        assert ((n * p.mesh.normals[p.mesh.faces].mean(1)).sum(1) > -1e-7).all(), p.owner


@pytest.mark.parametrize("name", HOUSES)
def test_wall_area_is_perimeter_times_height_less_the_holes(houses, name):
    house, parts = houses[name]
    for room in house.rooms:
        height = house.storey_of(room).height
        walls = sum(area(p) for p in parts if p.owner.startswith(f"{room.id}/wall_"))
        holes = sum(
            np.hypot(o.b[0] - o.a[0], o.b[1] - o.a[1]) * (o.head - o.sill) for o in house.openings if room.id in o.rooms
        )
        assert walls == pytest.approx(house.floor(room).length * height - holes, abs=1e-4)


@pytest.mark.parametrize("name", HOUSES)
def test_floors_and_ceilings_have_the_area_of_the_room_less_the_stair_well(houses, name):
    house, parts = houses[name]
    well = 3.8 * (0.9 + 0.04)
    for room in house.rooms:
        for piece, missing in (
            ("floor", name == "ell" and room.storey == 1),
            ("ceiling", name == "ell" and room.id == "living_room_1"),
        ):
            got = sum(area(p) for p in parts if p.owner == f"{room.id}/{piece}")
            assert got == pytest.approx(house.floor(room).area - missing * well, abs=1e-4), (room.id, piece)


def rim_rays(opening: Opening, floor: float, eye: np.ndarray, *, rng: np.random.Generator, n: int = 60) -> np.ndarray:
    """Directions (n, 3) from the eye to points on the rim of an opening's hole, in the middle of the wall."""
    a, b = np.array(opening.a), np.array(opening.b)
    t, level = rng.random(n), rng.random(n)
    side = rng.integers(4, size=n)
    t, level = (
        np.where(side == 0, 0.0, np.where(side == 1, 1.0, t)),
        np.where(side == 2, 0.0, np.where(side == 3, 1.0, level)),
    )
    at = a + t[:, None] * (b - a)
    d = np.column_stack([at, floor + opening.sill + level * (opening.head - opening.sill)]) - eye
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@pytest.mark.slow
@pytest.mark.parametrize("name", HOUSES)
def test_no_ray_from_inside_a_room_leaves_the_house_but_through_a_pane(houses, name):
    house, parts = houses[name]
    solid = [p for p in parts if p.kind != "outdoor"]
    triangles = np.concatenate([world_triangles(p) for p in solid])
    owner = np.repeat([p.owner for p in solid], [len(p.mesh.faces) for p in solid])
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    rng = np.random.default_rng(0)
    for room in house.rooms:
        d = rng.normal(size=(250, 3))
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        corners = np.array(house.floor(room).exterior.coords)[:-1]
        z = house.storey_of(room)
        # A third of the rays aims at edges and corners, where leaks hide.
        eye = np.array([*house.floor(room).representative_point().coords[0], z.elevation + 1.3])
        aim = corners[rng.integers(len(corners), size=80)]
        target = np.column_stack([aim, z.elevation + rng.choice([0.0, z.height], 80)]) + rng.normal(0, 0.004, (80, 3))
        d[:80] = (target - eye) / np.linalg.norm(target - eye, axis=1, keepdims=True)
        d = np.concatenate([d, *[rim_rays(o, z.elevation, eye, rng=rng) for o in house.openings if room.id in o.rooms]])
        hit, which = first_hits(triangles, np.tile(eye, (len(d), 1)), d)
        assert np.isfinite(hit).all(), f"{room.id}: {np.isinf(hit).sum()} rays leave the house"
        backs = ((normals[which] * d).sum(1) > 1e-9) & ~np.char.endswith(owner[which], "/glass")
        assert not backs.any(), f"{room.id}: one looks into {sorted(set(owner[which[backs]]))} from behind"


def test_an_open_leaf_stands_in_the_room_it_swings_into(houses):
    house, parts = houses["ell"]
    leaf = next(p for p in parts if p.owner == "door_1/leaf")
    y = world_triangles(leaf)[..., 1]
    assert y.max() > 3.5 and y.min() > 2.95, "the bathroom lies north of its door"
    closed = dataclasses.replace(house, openings=tuple(dataclasses.replace(o, angle=0.0) for o in house.openings))
    shut = next(p for p in house_parts(closed, CATALOGUE) if p.owner == "door_1/leaf")
    span = world_triangles(shut).reshape(-1, 3)
    assert np.ptp(span[:, 0]) == pytest.approx(0.8 - 2 * 0.025 - 0.006, abs=1e-6) and np.ptp(span[:, 1]) < 0.05


def test_stairs_climb_from_floor_to_floor_in_equal_steps(houses):
    _, parts = houses["ell"]
    treads = next(p for p in parts if p.mesh_key == "stair_1/stairs")
    up = world_triangles(treads)[(treads.mesh.normals[treads.mesh.faces].mean(1)[:, 2] > 0.99)]
    levels = np.unique(np.round(up[..., 2].max(1), 4))
    assert len(levels) == 15 and np.allclose(np.diff(levels), 2.9 / 16, atol=1e-4)


def test_a_corner_on_a_straight_wall_moves_straight_in():
    assert np.allclose(inset(((0, 0), (2, 0), (4, 0), (4, 3), (0, 3)), 0.1)[1], (2.0, 0.1))


def test_floors_of_one_finish_run_on_through_the_door(houses):
    _, parts = houses["two rooms"]
    for owner in ("living_room_1/floor", "door_1/threshold", "bedroom_1/floor"):
        p = next(q for q in parts if q.owner == owner)
        assert np.allclose(p.mesh.uv * MATERIALS["oak_planks/0"].tile, p.mesh.vertices[:, :2], atol=1e-5)


def test_the_facade_stands_one_outer_wall_outside_the_inner_faces(houses):
    house, parts = houses["ell"]
    facade = next(p for p in parts if p.owner == "outdoor/facade").mesh.vertices
    grow = house.outer_wall - house.inner_wall / 2
    assert facade[:, 0].min() == pytest.approx(-grow, abs=1e-4) and facade[:, 1].max() == pytest.approx(
        6 + grow, abs=1e-4
    )
    assert facade[:, 2].max() == pytest.approx(2.9 + 2.5 + 0.25)
    assert room_union(house, 0).area == pytest.approx(42.0, abs=1e-3)
    assert floor_turn(house) is False


def test_mujoco_takes_every_mesh(houses):
    house, parts = houses["ell"]
    compiled = compile_scene(house, CATALOGUE, collisions=False)
    assert {p.owner for p in parts} <= set(compiled.owners) and compiled.model.nmesh >= len({p.mesh_key for p in parts})

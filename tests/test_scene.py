"""House to MuJoCo: every geom has an owner, collision boxes fit, and what is freed stays where it stands."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, box_mesh, furnished

from embodied.assets.catalogue import load_catalogue
from embodied.assets.importing.sh3f import find_packs
from embodied.assets.records import Asset, Finish, SupportSurface
from embodied.generate import HouseConfig, generate_house
from embodied.house.house import Placement
from embodied.scene import collision
from embodied.scene import model as scene
from embodied.scene.far_canvas import DOME
from embodied.scene.house_meshes import house_parts, owners
from embodied.scene.lit_pages import LitMesh, LitPages


@pytest.fixture(scope="module")
def house():
    return furnished(two_rooms())


@pytest.fixture(scope="module")
def compiled(house):
    return scene.compile_scene(house, HandCatalogue())


def test_every_geom_is_traceable_to_its_owner(house, compiled):
    names = owners(house)
    named = [compiled.model.geom(g).name for g in range(compiled.model.ngeom)]
    far = [g for g, owner in enumerate(compiled.owner_of_geom) if not owner]
    assert [named[g] for g in far] == [f"{DOME}#0"], "no geom without owner but the landscape"
    whose = {g: names[owner - 1] for g, owner in enumerate(compiled.owner_of_geom) if owner}
    assert all(named[g].startswith(owner + "#") for g, owner in whose.items())
    drawn = {owner for g, owner in whose.items() if compiled.kind_of_geom[g] != "collision"}
    assert drawn == {p.owner for p in house_parts(house, HandCatalogue())}


def test_only_boxes_collide_and_only_meshes_are_drawn(compiled):
    m = compiled.model
    for g, kind in enumerate(compiled.kind_of_geom):
        if kind == "collision":
            assert (
                m.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX and m.geom_contype[g] and m.geom_group[g] == scene.COLLISION
            )
        else:
            assert m.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH and not m.geom_contype[g] and not m.geom_conaffinity[g]


def _part_points(part) -> np.ndarray:
    c, s = np.cos(part.yaw), np.sin(part.yaw)
    return part.mesh.vertices @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + part.position


def test_geoms_stand_where_the_parts_say(house, compiled):
    """The vertices of the drawn meshes in the model are those of the parts, in the world."""
    data = mujoco.MjData(compiled.model)
    mujoco.mj_forward(compiled.model, data)
    m = compiled.model
    for owner in ("table_1", "mug_1", "living_room_1/wall_0"):
        parts = [p for p in house_parts(house, HandCatalogue()) if p.owner == owner]
        expected = np.concatenate([_part_points(p) for p in parts])
        found = []
        for g in range(m.ngeom):
            if m.geom(g).name.startswith(f"{owner}#") and compiled.kind_of_geom[g] != "collision":
                mesh = m.geom_dataid[g]
                v = m.mesh_vert[m.mesh_vertadr[mesh] :][: m.mesh_vertnum[mesh]]
                found.append(v @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g])
        found = np.concatenate(found)
        for end in (np.min, np.max):
            assert np.allclose(end(found, axis=0), end(expected, axis=0), atol=1e-4), owner


def test_equal_meshes_are_shared(house, compiled):
    twins = [g for g in range(compiled.model.ngeom) if compiled.model.geom(g).name in ("red_box_1#0", "red_box_2#0")]
    assert len({int(compiled.model.geom_dataid[g]) for g in twins}) == 1


def freed(house, catalogue, free) -> mujoco.MjModel:
    return scene.compile_spec(scene.build_spec(house, catalogue, free=frozenset(free)))


def displacements(house, catalogue, free, seconds: float = 1.0) -> dict[str, float]:
    """How far each free object moves in `seconds` of physics, metres."""
    model = freed(house, catalogue, free)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bodies = [model.body(name).id for name in free]
    start = data.xpos[bodies].copy()
    while data.time < seconds:
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all() and not any(w.number for w in data.warning[-3:]), "the freed house explodes"
    return dict(zip(free, np.linalg.norm(data.xpos[bodies] - start, axis=1).tolist()))


def test_free_furniture_stays_where_it_stands(house):
    catalogue = HandCatalogue()
    free = scene.loose(house, catalogue)
    assert free == {"red_box_1", "red_box_2", "flag_1", "table_1", "mug_1"}, "all but the rug"
    moved = displacements(house, catalogue, free)
    assert max(moved.values()) < 0.002, moved


class Unpainted:
    """The real catalogue without its procedural textures, which physics does not need."""

    def __init__(self, catalogue) -> None:
        self.assets, self.mesh = catalogue.assets, catalogue.mesh

    def finish(self, key: str) -> Finish:
        return Finish()


@pytest.mark.slow
def test_a_generated_flat_stays_put_for_a_second(shared_cache):
    assert find_packs(), "the furniture packs are missing: apt-get install sweethome3d-furniture"
    catalogue = load_catalogue(shared_cache)
    house = generate_house(7, HouseConfig(area=(38.0, 46.0)), catalogue)  # the README's
    moved = np.array(list(displacements(house, Unpainted(catalogue), scene.loose(house, catalogue)).values()))
    assert len(moved) > 25
    assert np.median(moved) < 0.001 and np.quantile(moved, 0.9) < 0.01, np.sort(moved)[-5:]


def test_a_floating_mug_falls(house):
    """The check above can fail."""
    lift = lambda p: dataclasses.replace(p, position=(1.3, 1.0, 1.2)) if p.id == "mug_1" else p
    lifted = dataclasses.replace(house, placements=tuple(map(lift, house.placements)))
    assert displacements(lifted, HandCatalogue(), ["mug_1"])["mug_1"] > 0.3


def test_a_free_body_weighs_what_its_boxes_weigh(house):
    model = freed(house, HandCatalogue(), ["red_box_1"])
    assert model.body("red_box_1").mass[0] == pytest.approx(0.5 * 0.5 * 0.8 * 500, rel=0.2)


def test_unknown_free_things_are_refused(house):
    with pytest.raises(ValueError, match="piano_1"):
        scene.build_spec(house, HandCatalogue(), free=frozenset({"piano_1"}))


def test_walls_stop_and_openings_let_through(compiled):
    """A ball the size of the agent passes the door and not the wall (walls as boxes around openings)."""
    m = compiled.model
    data = mujoco.MjData(m)
    mujoco.mj_forward(m, data)
    boxes = [g for g in range(m.ngeom) if "/wall_" in m.geom(g).name and compiled.kind_of_geom[g] == "collision"]

    def free_at(x: float, y: float, z: float) -> bool:
        for g in boxes:
            local = data.geom_xmat[g].reshape(3, 3).T @ (np.array([x, y, z]) - data.geom_xpos[g])
            outside = np.maximum(np.abs(local) - m.geom_size[g], 0)
            if np.linalg.norm(outside) < 0.2:
                return False
        return True

    assert all(free_at(x, 1.05, 1.0) for x in np.linspace(4.0, 6.0, 41)), "through the door"
    assert not free_at(5.0, 2.5, 1.0), "not through the wall"
    assert not free_at(5.0, 1.05, 2.2), "not through the lintel"
    assert not free_at(2.5, 0.0, 0.5) and not free_at(2.5, 0.0, 2.3), "not below or above the window"


def test_door_leaves_stand_where_they_are_drawn(compiled):
    """The bedroom door stands open at 80 degrees: its box lies in the bedroom, not in the doorway."""
    m = compiled.model
    data = mujoco.MjData(m)
    mujoco.mj_forward(m, data)
    g = m.geom("door_1/leaf#box0").id
    assert m.geom_size[g][2] > 0.9 and m.geom_size[g].min() < 0.04, "a leaf is tall and thin"
    assert data.geom_xpos[g][0] > 5.3, "in the bedroom"
    assert m.geom("window_1/glass#box0").id > 0


def test_a_table_keeps_its_underside_free_and_its_top_exact():
    catalogue = HandCatalogue()
    asset = catalogue.assets["hand/table"]
    boxes = collision.object_boxes(asset, catalogue.mesh(asset.key, asset.size), asset.size)

    def solid(x, y, z):
        return any(all(abs(p - c) <= h for p, c, h in zip((x, y, z), b.centre, b.half, strict=True)) for b in boxes)

    assert max(b.centre[2] + b.half[2] for b in boxes) == pytest.approx(0.75, abs=1e-3)
    assert solid(0, 0, 0.74) and solid(0.5, 0.3, 0.74) and solid(0.55, 0.35, 0.3)
    assert not solid(0, 0, 0.4) and not solid(0.3, 0.0, 0.2), "a chair can be pushed under it"


def test_collision_boxes_leave_support_surfaces_free():
    """Ornament above a declared surface is no obstacle for what stands on it."""
    shelf = SupportSurface("shelf_1", 0.5, -0.5, -0.2, 0.5, 0.2, 0.4)
    asset = Asset("t/shelf", "shelf", "shelf", (1.0, 0.4, 1.0), "floor", surfaces=(shelf,))
    body, ornament = ((-0.5, -0.2, 0), (0.5, 0.2, 0.5)), ((-0.1, -0.1, 0.5), (0.1, 0.1, 0.6))
    boxes = collision.object_boxes(asset, [box_mesh(*ends, (1, 1, 1, 1)) for ends in (body, ornament)], asset.size)
    assert max(b.centre[2] + b.half[2] for b in boxes) == pytest.approx(0.5, abs=5e-3)


def lit_rug() -> LitPages:
    corners = np.array([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], np.float32)
    faces, uv = np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros((4, 2), np.float32)
    mesh = LitMesh("rug_1", "object", "living_room_1", 0, corners, faces, uv)
    return LitPages((mesh,), (np.full((8, 8, 3), 77, np.uint8),), "x")


def test_lit_pages_replace_the_materials(house):
    s = scene.compile_scene(house, HandCatalogue(), collisions=False, lit=lit_rug())
    assert s.model.ngeom == 1 and s.owners[s.owner_of_geom[0] - 1] == "rug_1" and s.room_of_geom == ("living_room_1",)


def test_people_are_seen_from_inside_where_their_models_have_gaps(house):
    count = lambda h: scene.compile_scene(h, HandCatalogue(), collisions=False, lit=lit_rug()).model.nmeshface
    person = [dataclasses.replace(p, object_class="person") if p.id == "rug_1" else p for p in house.placements]
    assert (count(house), count(dataclasses.replace(house, placements=tuple(person)))) == (2, 4)


def test_light_of_another_house_is_refused(house):
    pages = LitPages((), (), "x", owners=("somebody_else",))
    with pytest.raises(ValueError, match="another house"):
        scene.build_spec(house, HandCatalogue(), lit=pages)


def test_rooms_that_are_no_rectangles_have_floors_to_their_edges():
    house = two_rooms()
    room = dataclasses.replace(house.rooms[0], polygon=((0, 0), (4, 0), (4, 2), (2, 2), (2, 4), (0, 4)))
    boxes = collision.floor_boxes(house, room)
    area = sum(4 * b.half[0] * b.half[1] for b in boxes)
    assert area == pytest.approx(12.0), "the L is covered once, the notch is not"


def test_placements_outside_the_catalogue_are_named(house):
    ghost = Placement("ghost_1", "hand/ghost", "ghost", "bedroom_1", (7.0, 2.0, 0.0), 0.0, (1.0, 1.0, 1.0))
    with pytest.raises(KeyError, match="hand/ghost"):
        scene.compile_scene(dataclasses.replace(house, placements=(ghost,)), HandCatalogue())


def test_kept_boxes_are_those_that_were_computed_and_damage_is_mended(tmp_path):
    plate = [box_mesh((0, 0, 0), (1, 1, 0.4), (1, 1, 1, 1))]
    asset = Asset("hand/plate", "plate", "plate", (1.0, 1.0, 0.4), "floor")
    first, again = (collision.kept_boxes(asset, plate, asset.size, tmp_path) for _ in range(2))
    assert first == again == collision.object_boxes(asset, plate, asset.size)
    kept = next((tmp_path / "collision").iterdir())
    kept.write_text(kept.read_text()[:-9])
    assert collision.kept_boxes(asset, plate, asset.size, tmp_path) == first

"""Bakes: agreement with the path tracer, several lightings, and what happens when one goes wrong."""

from __future__ import annotations

import dataclasses
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from conftest import two_rooms
from hand_light import TINY
from handmade import HandCatalogue, furnished

from embodied.house.house import Light, Sky
from embodied.house.shapes import inward, room_at
from embodied.light import LightError, StaleBake, backend, bake, bake_all, lightings_of, open_bake
from embodied.light.backend import array, floats
from embodied.light.baking import check, compose, solve
from embodied.light.baking import house as baking
from embodied.light.pages import files
from embodied.light.probes import harmonics
from embodied.light.tracing import emitters, luxels, radiosity
from embodied.light.tracing.reference import Tracer
from embodied.render.camera import camera_at
from embodied.render.classic import Renderer
from embodied.render.sampling import FACES
from embodied.scene.house_meshes import house_parts

pytestmark = [pytest.mark.slow, pytest.mark.gl]


def house_to_light():
    """The furnished two-room house with two lamps under an overcast sky."""
    lamps = (
        Light("l1", "living_room_1", None, (2.5, 2.0, 2.2), (1.0, 0.8, 0.6), 1100.0),
        Light("l2", "bedroom_1", None, (7.0, 2.0, 2.2), (1.0, 0.8, 0.6), 900.0),
    )
    return dataclasses.replace(furnished(two_rooms()), lights=lamps, sky=Sky(11.0, "overcast"))


@pytest.fixture(scope="module")
def lit(tmp_path_factory):
    """`house_to_light`, baked tinily: house, catalogue, cache, bake."""
    house, cache = house_to_light(), tmp_path_factory.mktemp("light")
    return house, HandCatalogue(), cache, bake(house, HandCatalogue(), cache, TINY)


@pytest.fixture(scope="module")
def solution(lit):
    house, catalogue, cache, _ = lit
    return baking.solve_house(
        house, baking.BakeContext(house, house_parts(house, catalogue), cache / "light", TINY), TINY
    )


def test_what_stands_in_outer_walls_takes_light_from_the_open_sky_on_its_outer_side_only(solution):
    """Doors straight from the sky; windows, which stand behind the portal they are, through it."""
    house, atlas, lux = solution.house, solution.atlas, solution.lux
    inputs = solve.BakeInput(house, atlas, lux, solution.space, solution.outdoors, solution.lamps, TINY)
    e, all_ = solve.outer_light(inputs).mean(1), solution.light.soft.mean(1)
    kinds = set()
    for opening in (o for o in house.openings if None in o.rooms):
        window = opening.kind == "window"
        mine = lux.owner == atlas.owners.index(f"{opening.id}/{'frame' if window else 'leaf'}")
        towards = lux.face_normal[:, :2] @ inward(house, opening)
        assert np.median((all_ if window else e)[mine & (towards < -0.9)]) > 0.1
        assert not e[mine & (towards > 0.9)].any()
        kinds.add(window)
    assert kinds == {True, False}


def test_where_a_kernel_knows_one_scene_light_is_the_same(lit, solution, tmp_path, monkeypatch):
    """As on CUDA, where rays into two scenes in one kernel meet nothing: every ray is traced by a kernel of its own."""
    if backend.device() != "llvm":
        pytest.skip("compares CUDA's way with LLVM's, on LLVM")
    house, catalogue, *_ = lit
    monkeypatch.setattr(backend, "_one_scene_per_kernel", lambda: True)
    again = baking.solve_house(house, baking.BakeContext(house, house_parts(house, catalogue), tmp_path, TINY), TINY)
    assert isinstance(again.space.scene, backend.Apart) and not isinstance(solution.space.scene, backend.Apart)
    assert np.allclose(again.light.soft, solution.light.soft, rtol=1e-4, atol=1e-4)


def test_a_bake_agrees_with_the_path_tracer_within_ten_percent(lit):
    report = lit[3].manifest["check"]
    assert report["luxels"] in (check.LUXELS, check.AGAIN) and abs(report["bias"]) < 0.1 and report["beyond"] <= 0.25


@pytest.mark.parametrize("fault", ["all bounces a third too bright", "no bounces", "lamps forgotten"])
def test_a_bake_that_is_broken_on_purpose_fails_loudly(fault, solution, monkeypatch):
    monkeypatch.setattr(check, "AGAIN", 40)
    light = solution.light
    broken = {
        "all bounces a third too bright": dataclasses.replace(light, indirect=light.indirect * 1.33),
        "no bounces": dataclasses.replace(light, indirect=light.indirect * 0),
        "lamps forgotten": dataclasses.replace(light, direct=light.direct * 0),
    }[fault]
    with pytest.raises(LightError, match="disagrees with the path tracer.*worst at"):
        check.check(dataclasses.replace(solution, light=broken))


def test_a_third_of_the_luxels_dark_slips_through_one_time_in_eight_at_most(solution, monkeypatch):
    """Whichever third it is, and whichever luxels are looked at; a bake without fault is not told off."""
    known = check.compare(solution, luxels=200, paths_each=check.PATHS)

    def told(dark: float, trial: int) -> bool:
        rng = np.random.default_rng(trial)

        def looked_at(solution, *, luxels=check.LUXELS, **_):
            baked, *rest = (a[pick] for pick in [rng.choice(len(known[0]), luxels, replace=False)] for a in known)
            return (np.where(rng.random(luxels) < dark, 0.0, baked), *rest)

        monkeypatch.setattr(check, "compare", looked_at)
        try:
            check.check(solution)
        except LightError:
            return True
        return False

    assert np.mean([told(1 / 3, k) for k in range(400)]) >= 7 / 8
    assert not any(told(0.0, k) for k in range(100))


def key(house, catalogue):
    return baking.key_of(house, baking.looks_of(house_parts(house, catalogue)), TINY)


def test_gaps_take_light_from_beside_them_on_the_same_thing_alone():
    position = np.array([[0, 0, 0], [0.02, 0, 0], [0.03, 0, 0], [0.5, 0, 0], [0.02, 0, 0]], np.float32)
    e = np.array([[1.0] * 3, [0.01] * 3, [0.9] * 3, [0.01] * 3, [0.01] * 3], np.float32)
    good, owner = np.array([True, False, False, False, False]), np.array([0, 0, 0, 0, 1])
    lit = compose.out_of_gaps(e, position, owner, good, good)
    assert lit[:, 0] == pytest.approx([1.0, compose.GAP_SHARE, 0.9, 0.01, 0.01])
    assert (compose.out_of_gaps(e, position, owner, good, np.ones(5, bool)) == e).all()


def test_another_look_of_a_material_makes_another_bake(lit):
    """An edited catalogue must not silently show an old bake; the same content elsewhere on disk may."""
    house, catalogue, _, baked = lit

    class Repainted(HandCatalogue):
        def mesh(self, *args):
            return tuple(
                dataclasses.replace(m, finish=dataclasses.replace(m.finish, color=(0.1, 0.2, 0.9, 1.0)))
                for m in super().mesh(*args)
            )

    assert f"custom-{key(house, catalogue)}" == baked.folder.name
    assert key(house, catalogue) != key(house, Repainted())
    assert f"custom-{key(house, HandCatalogue())}" == baked.folder.name


def test_a_bake_of_other_code_is_refused_and_has_another_key(lit, monkeypatch):
    house, catalogue, _, baked = lit
    before = key(house, catalogue)
    for module in (baking, files):
        monkeypatch.setattr(module, "light_code", lambda: "0123456789abcdef")
    assert key(house, catalogue) != before
    with pytest.raises(StaleBake, match="other code.*0123456789abcdef.*embodied light"):
        open_bake(baked.folder, house)


def test_no_valid_texel_is_black_and_every_owner_has_its_mesh(lit):
    house, _, _, baked = lit
    pages = baked.lit
    assert {p.id for p in house.placements} <= {m.owner for m in pages.meshes}
    for m in pages.meshes:
        assert m.uv.min() >= -1e-6 and m.uv.max() <= 1 + 1e-6 and m.faces.max() < len(m.vertices)
        if any(f"/{k}" in m.owner for k in ("wall_", "floor", "ceiling")):
            h, w = pages.pages[m.page].shape[:2]
            centre = m.uv[m.faces].mean(1) * [w, h]
            x, y = centre.astype(int).clip(0, [w - 1, h - 1]).T
            assert np.median(pages.pages[m.page][y, x].max(-1)) > 60


def test_lighting_again_opens_the_same_bake(lit):
    house, catalogue, cache, baked = lit
    before = (baked.folder / "manifest.json").stat().st_mtime_ns
    again = bake(house, catalogue, cache, TINY)
    assert again.folder == baked.folder and (again.folder / "manifest.json").stat().st_mtime_ns == before


def test_two_that_light_one_house_light_it_once(lit, tmp_path, monkeypatch):
    house, catalogue, _, baked = lit
    made = []

    def make(house, context, folder, *_):
        made.append(folder)
        time.sleep(0.2)
        return open_bake(shutil.copytree(baked.folder, folder, dirs_exist_ok=True), house)

    monkeypatch.setattr(baking, "_make", make)
    monkeypatch.setattr(baking, "BakeContext", lambda *_, **__: None)
    threads = [threading.Thread(target=bake, args=(house, catalogue, tmp_path, TINY)) for _ in range(2)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert len(made) == 1


def test_lit_at_several_hours_every_lighting_is_what_it_is_alone(lit, tmp_path, monkeypatch):
    """Hits of rays, lamps' light and colours are shared; the second lighting must not be a mix of both."""
    house, catalogue, cache, _ = lit
    monkeypatch.setattr(baking, "outside_of", lambda *_: None)
    monkeypatch.setattr(baking, "daylit", lambda *_: [np.zeros((4, 8, 3), np.uint8)])
    lightings = lightings_of(house, 3)
    assert lightings[0] == house and len({h.digest for h in lightings}) == 3 and lightings == lightings_of(house, 3)
    shared = bake_all(lightings, catalogue, tmp_path, TINY)
    assert [b.manifest["house"] for b in shared] == [h.digest for h in lightings]
    alone = bake(lightings[1], catalogue, cache, TINY)
    first, second, own = (b.probes.coefficients.astype(float) for b in (*shared[:2], alone))
    np.testing.assert_allclose(second, own, rtol=0.01, atol=0.01 * np.abs(own).mean())
    assert np.abs(first - second).mean() > 0.1 * np.abs(first).mean()
    assert alone.manifest["total_seconds"] > 0
    for a, b in zip(shared[1].lit.pages, alone.lit.pages):
        assert np.abs(a.astype(int) - b).mean() < 0.5
    with pytest.raises(ValueError, match="one house"):
        bake_all((house, dataclasses.replace(house, rooms=house.rooms[:1])), catalogue, tmp_path, TINY)


def test_a_house_edited_after_its_bake_is_refused_by_name(lit):
    house, _, _, baked = lit
    edited = dataclasses.replace(house, sky=Sky(20.0))
    with pytest.raises(StaleBake, match="edited.*embodied light"):
        open_bake(baked.folder, edited)
    with pytest.raises(StaleBake, match="no finished bake"):
        open_bake(baked.folder.parent / "nothing", house)


KILLED = """
import os, signal, sys
from pathlib import Path
from hand_light import TINY
from handmade import HandCatalogue
from test_baking import house_to_light
from embodied.light import bake
die = lambda stage, done: stage == "pages" and os.kill(os.getpid(), signal.SIGKILL)
bake(house_to_light(), HandCatalogue(), Path(sys.argv[1]), TINY, progress=die)
"""


def test_a_bake_that_is_killed_goes_on_where_it_was_and_a_damaged_one_is_repaired(lit, tmp_path, monkeypatch):
    house, catalogue, _, baked = lit
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    assert subprocess.run([sys.executable, "-c", KILLED, tmp_path], env=env).returncode == -signal.SIGKILL
    monkeypatch.setattr(check, "LUXELS", 2)
    monkeypatch.setattr(baking, "outside_of", lambda *_: None)
    monkeypatch.setattr(baking, "daylit", lambda *_: [np.zeros((4, 8, 3), np.uint8)])
    with monkeypatch.context() as m:
        for name in ("shone_on", "bounce"):
            m.setattr(solve, name, lambda *_, **__: pytest.fail("the light is solved again"))
        done = bake(house, catalogue, tmp_path, TINY)
    assert not list(tmp_path.rglob(".embodied-unfinished-*"))
    own = baked.manifest["own_pages"]
    assert all(np.abs(a.astype(int) - b).max() <= 1 for a, b in zip(done.lit.pages[:own], baked.lit.pages[:own]))
    np.testing.assert_allclose(done.probes.coefficients, baked.probes.coefficients, rtol=0.01, atol=0.01)
    (done.folder / "page_000.jpg").write_bytes(b"cut")
    with pytest.raises(StaleBake, match="damaged"):
        open_bake(done.folder, house)
    with pytest.warns(RuntimeWarning, match="damaged"):
        repaired = bake(house, catalogue, tmp_path, TINY)
    assert open_bake(repaired.folder, house).manifest["files"]["page_000.jpg"][0] > 100


def test_baked_pictures_equal_path_traced_diffuse_ones(lit):
    """28 dB and 6 levels at most between the classic renderer's pages and a path-traced picture of the same walls."""
    house, catalogue, _, baked = lit
    at, yaw, pitch, vfov, size = (4.2, 3.4, 1.5), -2.2, -0.15, 1.2, (72, 96)
    with Renderer(house, catalogue, lit=baked.lit, size=96) as renderer:
        view = renderer.view(at, yaw, pitch, vfov, size)
    camera = camera_at(at, yaw, pitch, vfov)
    traced, depth, ids = Tracer(baked, house, quality="diffuse", rays=64).picture(
        at, camera.forward, camera.up, vfov, size
    )
    a, b = (cv2.GaussianBlur(x, (0, 0), 1).astype(float) for x in (view.rgb, traced))
    psnr = 10 * np.log10(255**2 / np.mean((a - b) ** 2))
    assert psnr > 28 and abs((a - b).mean()) < 6
    known = np.isfinite(depth) & (ids == view.ids)
    assert known.mean() > 0.9 and np.median(np.abs(depth - view.depth)[known]) < 0.01


def test_faces_of_a_traced_panorama_are_pictures_of_their_directions(lit):
    house, _, _, baked = lit
    tracer = Tracer(baked, house, quality="reference", size=16, rays=16)
    at = (4.2, 3.4, 1.5)
    panorama = tracer.panorama(at)
    assert np.array_equal(panorama.rgb, tracer.panorama(at).rgb), "the same rays again"
    for k, (forward, up) in enumerate(FACES):
        rgb, depth, ids = tracer.picture(at, forward, up, np.pi / 2, (16, 16))
        assert np.array_equal(ids, panorama.ids[k]) and np.array_equal(depth, panorama.depth[k])
        assert abs(rgb.mean() - panorama.rgb[k].mean()) < 6, "other rays, the same light"


def test_a_mirror_shows_what_stands_before_it_however_few_rays_there_are(lit):
    """Noise in a mirror is smoothed over what is seen in it, not over its glass: as sharp as baked light, which has
    none."""
    house, _, _, baked = lit
    at, yaw, pitch, vfov, size = (3.9, 1.1, 0.7), 1.19, -0.2, 0.3, (48, 48)  # the red box's south side, no more
    camera = camera_at(at, yaw, pitch, vfov)

    def seen(quality: str, rays: int) -> tuple[np.ndarray, np.ndarray]:
        tracer = Tracer(baked, house, quality=quality, rays=rays)
        world, box = tracer._world, baked.lit.owners.index("red_box_1") + 1
        gloss = np.array(world.gloss).reshape(-1, 3)
        gloss[world.owner == box] = (0.02, 0.5, 1.0)
        tracer._world = dataclasses.replace(world, gloss=floats(gloss))
        rgb, _, ids = tracer.picture(at, camera.forward, camera.up, vfov, size)
        return rgb.astype(float), ids == box

    (baked_light, mirror), (traced, _) = seen("glossy", 64), seen("reference", 8)
    edges = lambda rgb: np.abs(np.diff(rgb.mean(2), axis=1)).mean()
    assert mirror.all() and edges(traced) > 0.7 * edges(baked_light), "a smoothed glass has 0.36 of it"
    assert np.corrcoef(baked_light.ravel(), traced.ravel())[0, 1] > 0.99


def light_at(solution, p: radiosity.Points) -> np.ndarray:
    """(n, 3) e but the sun's own at points, by the functions that light luxels and many rays."""
    lights = dataclasses.replace(TINY, sky_rays=256, lamp_rays=256)
    s = solution
    inputs = solve.BakeInput(s.house, s.atlas, s.lux, s.space, s.outdoors, s.lamps, lights, None, s.without)
    table, met = (
        floats(solve.clamp_fireflies(s.lux, solve.leaving(s.lux, s.light.soft))),
        radiosity.meet(s.space, p, 1024),
    )
    e = radiosity.gather(met, table)[0] / met.rays + luxels.AMBIENT
    for source in (*emitters.portals_of(inputs.house), *inputs.lamps):
        if isinstance(source, emitters.Portal):
            e += array(radiosity.sky_light(s.space, p, source, lights.sky_rays))
        else:
            e += array(
                radiosity.lamp_light(s.without.get(source.owner or "", s.space.scene), p, source, lights.lamp_rays)
            )
    return e


def test_probes_at_a_window_know_the_light_of_every_normal_to_six_percent(lit, solution):
    probes, n = lit[3].probes, 40
    at = np.argsort(np.linalg.norm(probes.position - [2.5, 0.7, 1.5], axis=1))[:6]
    assert probes.valid[at].all()
    normals = np.random.default_rng(0).normal(size=(n, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    around = np.tile(normals, (len(at), 1))
    p = radiosity.points_of(np.repeat(probes.position[at], n, axis=0), around, around, np.zeros(len(around), bool))
    true = light_at(solution, p).mean(1)
    own = (harmonics(normals) @ probes.coefficients[at].astype(float)).mean(2).ravel()
    assert np.sqrt(np.mean((own - true) ** 2)) < 0.06 * np.sqrt(np.mean(true**2))
    assert true.max() > 5 * true.min()


def test_floors_walls_and_ceilings_take_the_same_light_from_probes_as_from_the_bake(lit, solution):
    """To an eighth, by the median of luxels: away from things, whose shadows lie between probes."""
    lux, probes = solution.lux, lit[3].probes
    for name in probes.rooms:
        room = [r == name for r in solution.atlas.rooms]
        shell = np.flatnonzero(lux.shell & np.array(room)[lux.owner] & solution.light.good)[::7]
        e = np.einsum("nk,nkc->nc", harmonics(lux.normal[shell]), probes.at(lux.position[shell], name))
        baked = (solution.light.soft[shell] + luxels.AMBIENT).mean(1)
        assert np.median(np.abs(e.mean(1) - baked) / baked) < 0.125


def test_probes_fill_every_room_and_none_is_inside_furniture(lit):
    house, _, _, baked = lit
    probes = baked.probes
    assert probes.rooms.tolist() == [r.id for r in house.rooms] and np.bincount(probes.room, probes.valid).min() > 100
    assert {room_at(house, x) for x in probes.position[probes.room == 1]} == {"bedroom_1"}
    box = house.placement_by_id["red_box_1"]
    away = np.abs(probes.position - box.position - [0, 0, box.size[2] / 2]) - np.array(box.size) / 2
    within = (away < 0).all(1)
    assert within.sum() > 1 and not probes.valid[within].any() and not probes.coefficients[within].any()
    assert probes.valid[(away > 0.05).any(1)].mean() > 0.95
    assert (probes.sight[(away[:, :2] < 0).all(1) & (away[:, 2] > 0), 1, 2] < 255).any()  # down to the box

"""What the renderer shows is what is there: directions, depth, ids, and nothing lost by leaving things out."""

from __future__ import annotations

import dataclasses
import math
import multiprocessing

import cv2
import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, furnished

from embodied import gl
from embodied.assets.catalogue import load_catalogue
from embodied.house.house import Placement
from embodied.light.settings import QUALITIES
from embodied.render import geoms, visibility
from embodied.render.camera import face_cameras
from embodied.render.classic import Renderer
from embodied.render.geoms import RayCaster
from embodied.render.pictures import (
    BAKED_QUALITIES,
    WORDS_FOR_PICTURES,
    Baked,
    Traced,
    Unlit,
    from_recorded,
    from_words,
    in_words,
    parse_pictures,
    recorded,
)
from embodied.render.supersampling import averaged, drawn_size, nearest, step_of
from embodied.scene.house_meshes import owners

pytestmark = pytest.mark.gl

EYE = (2.5, 2.6, 1.2)


@pytest.fixture(scope="module")
def house():
    return furnished(two_rooms())


@pytest.fixture(scope="module")
def renderer(house):
    with Renderer(house, HandCatalogue(), size=128) as r:
        yield r


def is_red(rgb) -> np.ndarray:
    r, g, b = (np.asarray(rgb, int)[..., i] for i in range(3))
    return (r > 90) & (g < 60) & (b < 60)


def test_the_red_box_to_the_east_is_in_the_view_to_the_east(renderer):
    ahead = renderer.view(EYE, 0.0, -0.3, 1.0, (60, 80))
    assert is_red(ahead.rgb).mean() > 0.05
    assert is_red(ahead.rgb)[:, 30:50].sum() > 0.6 * is_red(ahead.rgb).sum(), "and in its middle"
    assert not is_red(renderer.view(EYE, math.pi, -0.3, 1.0, (60, 80)).rgb).any()
    faces = renderer.panorama(EYE)
    assert is_red(faces.rgb[0]).any() and not is_red(faces.rgb[2]).any()


def test_pictures_are_not_mirrored(renderer):
    """The flag to the north is green on its west half: on the left for who looks north."""
    rgb = renderer.view((2.0, 2.0, 0.8), math.pi / 2, 0.0, 1.0, (60, 80)).rgb.astype(int)
    green = np.argwhere((rgb[..., 1] > 90) & (rgb[..., 0] < 60) & (rgb[..., 2] < 80))
    blue = np.argwhere((rgb[..., 2] > 90) & (rgb[..., 0] < 60) & (rgb[..., 1] < 80))
    assert len(green) > 20 and len(blue) > 20
    assert green[:, 1].max() < blue[:, 1].min()


def test_up_is_up(renderer, house):
    names = owners(house)
    ids = renderer.panorama(EYE).ids
    assert names[ids[4, 64, 64] - 1] == "living_room_1/ceiling"
    assert names[ids[5, 64, 64] - 1] in ("living_room_1/floor", "rug_1")


def test_depth_and_ids_agree_with_ray_casting(renderer, house):
    """MuJoCo's own ray caster, which knows nothing of OpenGL, meets the same things at the same distance."""
    (depth, ids), (cast, met) = renderer.seen(EYE, 48), RayCaster(house, HandCatalogue()).seen(EYE, 48)
    same = ids == met
    assert (met > 0).mean() > 0.85 and same.mean() > 0.98, "all but pixels on an edge"
    assert (np.abs(depth - cast)[same & (met > 0)] < 2e-3 * cast[same & (met > 0)]).mean() > 0.98
    assert np.isinf(cast[met == 0]).all()


def test_depth_is_along_the_optical_axis(renderer):
    """A wall square to the camera has one depth all over the picture."""
    view = renderer.view((2.5, 2.0, 1.8), math.pi / 2, 0.0, 0.6, (40, 40))
    assert np.ptp(view.depth) < 2e-3
    assert view.depth.mean() == pytest.approx(4.0 - 0.06 - 2.0, abs=2e-3)


@pytest.mark.parametrize("yaw", [0.0, math.pi / 4, 2.3, -1.9])
def test_a_resampled_view_equals_a_direct_one(renderer, yaw):
    p = renderer.panorama(EYE, 256)
    rgb, depth, ids = p.view(yaw, -0.35, 1.0, (120, 160))
    direct = renderer.view(EYE, yaw, -0.35, 1.0, (120, 160))
    assert np.abs(rgb.astype(int) - direct.rgb).mean() < 1.5
    assert np.median(np.abs(depth - direct.depth)) < 1e-3
    assert np.quantile(np.abs(depth / direct.depth - 1), 0.95) < 0.01
    assert (ids == direct.ids).mean() > 0.97


def test_a_large_picture_shrunk_is_the_small_one(renderer):
    """Both are drawn one and a half times larger and averaged, which must neither shift nor stretch them."""
    small = renderer.view(EYE, 0.7, -0.3, 1.0, (240, 320)).rgb.astype(float)
    large = renderer.view(EYE, 0.7, -0.3, 1.0, (480, 640)).rgb
    shrunk = large.reshape(240, 2, 320, 2, 3).mean((1, 3))
    error = lambda moved: np.abs(small[2:-2, 2:-2] - moved[2:-2, 2:-2]).mean()
    assert error(shrunk) < 1.0
    assert all(error(shrunk) < error(np.roll(shrunk, by, axis)) for by in (-1, 1) for axis in (0, 1))
    assert renderer.view(EYE, 0.7, -0.3, 1.0, (385, 513)).rgb.shape == (385, 513, 3)


def test_leaving_out_what_is_hidden_changes_no_pixel(renderer, monkeypatch):
    rng = np.random.default_rng(1)
    by_the_door = [(0.4, 0.4), (4.9, 1.0), (5.0, 1.1), (5.1, 0.9), (6.0, 3.0), (8.6, 0.4)]
    for x, y in [*by_the_door, *rng.uniform([0.3, 0.3], [8.7, 3.7], (6, 2))]:
        yaw, pitch = rng.uniform(-math.pi, math.pi), rng.uniform(-0.6, 0.6)
        some = renderer.view((x, y, 1.5), yaw, pitch, 1.2, (64, 64))
        with monkeypatch.context() as m:
            m.setattr(renderer, "_in_view", lambda *_: renderer._is_visual)
            everything = renderer.view((x, y, 1.5), yaw, pitch, 1.2, (64, 64))
        differ = (some.rgb != everything.rgb).any(axis=-1).sum()
        assert differ <= 2, (x, y, yaw, pitch)  # one or two may peep through a crack between two meshes
        assert (some.ids != everything.ids).sum() <= 2


def test_hidden_rooms_are_left_out(renderer, house):
    """In the living room's corner beside the door one cannot look into the bedroom."""
    seen = visibility.visible_rooms(house, visibility.portals_of(house), (4.8, 3.7, 1.5))
    width = sum(s.high - s.low for s in seen["bedroom_1"])
    assert width < 0.3, "only a sliver through the door"
    faces = [renderer._in_view(camera, (64, 64)) for camera in face_cameras((4.8, 3.7, 1.5))]
    assert np.logical_or.reduce(faces).sum() < renderer._is_visual.sum() - 5
    aside = visibility.visible_rooms(house, visibility.portals_of(house), (4.8, 3.7, 1.5), visibility.Sector(2.0, 3.0))
    assert "bedroom_1" in seen and "bedroom_1" not in aside, "one looks away from the door"


@pytest.mark.parametrize(("drawn", "size"), [((3, 3), (2, 2)), ((192, 150), (128, 100)), ((600, 800), (480, 640))])
def test_what_is_drawn_larger_becomes_the_mean_over_each_pixels_area(drawn, size):
    assert drawn_size(size) == drawn and step_of(size, drawn)
    picture = np.random.default_rng(0).integers(0, 256, (*drawn, 3), np.uint8)
    expected = cv2.resize(picture, size[::-1], interpolation=cv2.INTER_AREA)[::-1]
    found = averaged(picture, size)
    assert np.abs(found.astype(int) - expected).max() <= (0 if step_of(size, drawn) == 3 else 3)


@pytest.mark.parametrize("size", [(8, 12), (480, 640)])
def test_the_nearest_drawn_pixel_is_that_of_the_middle(size):
    drawn = drawn_size(size)
    rows, columns = np.divmod(nearest(np.arange(np.prod(drawn), dtype=np.int32).reshape(drawn), size), drawn[1])
    for found, at, n in ((rows[:, 0], size[0], drawn[0]), (columns[0], size[1], drawn[1])):
        apart = (found + 0.5) * at / n - (np.arange(at) + 0.5)
        assert np.abs(apart).max() < 1 / 3


def test_rooms_seen_through_two_windows_of_an_l_shape_are_kept():
    """Out of one wing's window and in through the other's: both face the same court."""
    base = two_rooms()
    polygon = ((0.0, 4.0), (3.0, 4.0), (3.0, 9.0), (0.0, 9.0))
    wing = dataclasses.replace(base.rooms[0], id="study_1", kind="study", polygon=polygon)
    door, _, window, other = base.openings
    door = dataclasses.replace(door, id="door_2", rooms=("study_1", "living_room_1"), a=(1.0, 4.0), b=(2.0, 4.0))
    window = dataclasses.replace(window, id="window_3", rooms=("study_1", None), a=(3.0, 5.0), b=(3.0, 8.0))
    house = dataclasses.replace(base, rooms=(*base.rooms, wing), openings=(*base.openings, door, window))
    lone = dataclasses.replace(house, openings=tuple(o for o in house.openings if o != other))
    seen = [visibility.visible_rooms(h, visibility.portals_of(h), (7.0, 3.0, 1.5)) for h in (house, lone)]
    assert ["study_1" in rooms for rooms in seen] == [True, False], "the bedroom's window is the first of two"


def test_the_context_says_who_draws():
    facts = gl.info()
    assert facts.device and facts.vendor and facts.backend in gl.BACKENDS
    assert ("software" in str(facts)) == facts.software


def test_two_houses_can_be_open_at_once_and_a_closed_one_says_so(house):
    with Renderer(house, HandCatalogue(), size=32) as one, Renderer(two_rooms(), HandCatalogue(), size=32) as two:
        first = one.panorama(EYE).rgb
        assert not np.array_equal(first, two.panorama(EYE).rgb)
        assert np.array_equal(first, one.panorama(EYE).rgb), "drawing one house does not disturb another"
    with pytest.raises(RuntimeError, match="closed"):
        one.panorama(EYE)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: parse_pictures("photo"), "photo.*use one of unlit, fast"),
        (lambda: parse_pictures("fast", 0), "size"),
        (lambda: Unlit(size=-5), "size"),
        (lambda: Baked("pretty"), "pretty.*use one of fast, normal, high"),
        (lambda: Traced(0), "rays=0"),
    ],
)
def test_bad_settings_are_refused(make, match):
    with pytest.raises(ValueError, match=match):
        make()


def test_a_renderer_refuses_impossible_sizes(house):
    with pytest.raises(ValueError, match="size"):
        Renderer(house, HandCatalogue(), size=0)


def test_light_is_named_as_on_the_command_line():
    assert tuple(QUALITIES) == BAKED_QUALITIES


def test_pictures_are_known_again_from_what_files_record_of_them():
    traced = [Traced(4, "fast", reference=reference, size=96) for reference in (False, True)]
    for pictures in [*(parse_pictures(word, 64) for word in WORDS_FOR_PICTURES), *traced]:
        assert from_recorded(recorded(pictures)) == pictures == from_words(in_words(pictures))
    assert recorded(Baked("fast", size=8)) == {
        "size": 8, "quality": "fast", "backend": "classic", "light": "fast", "look": "gloss"
    }  # fmt: skip
    assert recorded(Traced(4, "fast")) == {
        "size": 256, "quality": "glossy", "backend": "classic", "light": "fast", "rays": 4
    }  # fmt: skip
    assert from_words({"kind": "traced", "size": 192, "light": None, "rays": None}) == Traced(size=192)
    with pytest.raises(ValueError, match="unknown; draw them again"):
        from_recorded({"size": 8, "quality": "fast", "backend": "filament", "light": "fast"})


def _try(queue) -> None:
    try:
        gl.make_current()
        queue.put("drew")
    except gl.GLError as e:
        queue.put(str(e))


def test_a_forked_worker_is_told_to_spawn(renderer):
    """Rather than to hang in Mesa, whose threads do not survive the fork."""
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    worker = context.Process(target=_try, args=(queue,))
    worker.start()
    assert "spawn" in queue.get(timeout=600)
    worker.join(timeout=600)


def test_people_who_are_small_in_a_picture_have_fewer_triangles_and_cover_the_same_pixels(monkeypatch):
    catalogue, key = load_catalogue(), "people/anna_waiting"
    size = catalogue.assets[key].size
    person = Placement("person_1", key, "person", "living_room_1", (4.0, 2.0, 0.0), 0.0, size)
    house, seen = dataclasses.replace(two_rooms(), placements=(person,)), []
    with Renderer(house, catalogue) as r:
        meshes = r._drawing._scene.model.mesh_facenum
        for pixels in (geoms.PERSON_PIXELS, (9.0, 9.0)):
            monkeypatch.setattr(geoms, "PERSON_PIXELS", pixels)
            seen.append(r.view((1.0, 2.0, 1.5), 0.0, -0.2, 1.0, (120, 160)))
            drawn = r._drawing._drawn
            seen.append(sum(meshes[g.dataid // 2] for g in drawn.geoms[: drawn.ngeom] if g.dataid >= 0))
    far, few, near, many = seen
    both, either = (f(far.ids == 1, near.ids == 1).sum() for f in (np.logical_and, np.logical_or))
    assert few < many - 8000 and both > 0.9 * either > 300

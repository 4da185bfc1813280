"""`embodied export`: what is written, and what wrong orders are told."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from conftest import two_rooms
from hand_data import boxes_house, build, built, live_among_boxes, read_features
from handmade import HandCatalogue, furnished

from embodied import cli
from embodied.agents.common.settings import SHIPPED_ENCODER
from embodied.agents.vision.encoder import load_encoder
from embodied.agents.vision.features import feature_path, save_features
from embodied.cli import export, exports
from embodied.cli.common import Printed
from embodied.cli.exports import register_export, registered_exports
from embodied.datasets.folders import names_of
from embodied.gym import drive
from embodied.options import OutputFolder
from embodied.render.pictures import Unlit
from embodied.world import open_world


@pytest.fixture
def data(tmp_path):
    return built(tmp_path / "data", "vln")


@pytest.mark.slow
def test_features_are_written_as_tsv_filled_up_to_the_length_that_programs_count_on(data, tmp_path, capsys):
    encoder = load_encoder(SHIPPED_ENCODER)
    made = {}
    for name in names_of(data):
        place = data.place(name)
        made[name] = np.random.default_rng(1).normal(size=(len(place.graph.ids), 36, encoder.size)).astype(np.float16)
        path = feature_path(data.folder / "features", encoder.digest, name)
        save_features(path, made[name], encoder, place.house.digest)
    order = ["export", "r2r", "--data", str(data.folder), "--out", str(tmp_path / "out"), "--features"]
    assert cli.main([*order, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["program"] == "r2r" and told["readme"].endswith("README-embodied.md")
    table = read_features(tmp_path / "out/img_features/ResNet-152-imagenet.tsv")
    name = names_of(data)[0]
    key = data.place(name).graph.ids[0]
    row = table[name.replace("_", ""), key]
    assert row.shape == (36, 2048) and not row[:, encoder.size :].any()
    assert np.array_equal(row[:, : encoder.size], made[name][0].astype(np.float32))
    assert cli.main([*order, "--pad", "8"]) == 2
    assert "--pad is 8" in capsys.readouterr().err


@pytest.mark.slow
def test_missing_features_name_the_command_that_makes_them(data, tmp_path, capsys):
    order = ["export", "iliad-nav", "--data", str(data.folder), "--out", str(tmp_path / "out")]
    assert cli.main([*order, "--features"]) == 2
    assert "embodied features" in capsys.readouterr().err
    assert cli.main(order) == 0
    assert "add --features" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.gl
def test_walks_of_a_data_set_are_written_in_its_houses(tmp_path, monkeypatch):
    live_among_boxes(monkeypatch)
    data = build(tmp_path / "data", tmp_path / "cache", "vln", size="1x2", make_house=boxes_house)
    found = drive.chosen_worlds
    monkeypatch.setattr(drive, "chosen_worlds", lambda **where: found(**where, pictures=Unlit(size=64)))
    order = ["export", "vlnce", "--data", str(data.folder), "--out", str(tmp_path / "out"), "--cache"]
    assert cli.main([*order, str(tmp_path / "cache"), "--tasks", "1", "--width", "64", "--action-noise", "0.1"]) == 0
    rows = [json.loads(line) for line in (tmp_path / "out/samples.jsonl").read_text().splitlines()]
    assert {row["instruction"] for row in rows} == {data.tasks("train")[0].request}
    assert all((tmp_path / "out" / row["image"]).is_file() for row in rows)


@pytest.mark.gl
def test_drives_are_written_in_every_house_of_a_split(data, tmp_path, monkeypatch):
    flat, how = furnished(two_rooms()), {"size": 32, "pictures": "unlit"}
    houses = [dataclasses.replace(flat, name=name) for name in ("left", "right")]
    worlds = {house.name: open_world(house, HandCatalogue(), tmp_path / "cache", **how) for house in houses}
    found = drive.chosen_worlds
    monkeypatch.setattr(drive, "chosen_worlds", lambda **how: found(**how, worlds=worlds))
    order = ["export", "lerobot-drive", "--data", str(data.folder), "--out", str(tmp_path / "out"), "--size", "16"]
    assert cli.main([*order, "--drives", "2"]) == 0
    episodes = pq.read_table(tmp_path / "out/meta/episodes/chunk-000/file-000.parquet").to_pydict()
    assert episodes["embodied/house"] == ["left", "right"]


def test_an_export_is_known_by_its_registered_record_alone(tmp_path, monkeypatch, capsys):
    @dataclasses.dataclass(frozen=True, kw_only=True)
    class Options(Printed):
        """A greeting."""

        out: OutputFolder
        """Folder to greet."""

    register_export("greeting", Options, lambda args: print("hello", args.out))
    monkeypatch.setattr(export, "COMMANDS", registered_exports())
    try:
        assert cli.main(["export", "greeting", "--out", str(tmp_path)]) == 0
        assert capsys.readouterr().out == f"hello {tmp_path}\n"
    finally:
        exports._REGISTERED.pop("greeting")

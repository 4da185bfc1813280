"""Files that the field's programs read: R2R, HANNA and VNLA JSON, action spaces, features.

Only here (and in the functions of navgraph and panorama that say so) the Matterport conventions
apply: heading clockwise from +y, viewIndex 12 band + heading bin. Scans are named like our houses
without underscores, because the programs join and split ids at underscores. Fields, per file:

  connectivity/<scan>_connectivity.json, scans.txt   see navgraph.to_matterport
  R2R_<split>.json      path_id, scan, heading, path, distance, instructions (three)
  hanna_<split>.json    path_id, scan, heading, paths (one shortest path per goal), instructions
  routes.json           scan -> [path_id (text), path, instruction, view_id, split]
  panoramic_action_space.json   '<scan>_<viewpoint>_<bin>' -> actions, see `action_list`
  vocab.txt, scan_split.json, accepted_objects.txt, region_label.txt    HANNA's side files
  asknav_<split>.json   as HANNA's, with trajectories (index, dHeading, dElevation), start_region_name,
                        end_region_name, object_name
  <scan>/house_segmentations/panorama_to_region.txt   number, viewpoint, -, region letter (VNLA)
  *.tsv                 scanId, viewpointId, image_w, image_h, vfov, base64 float32 36 x D
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from assets.cache import atomic_path, write_bytes
from embodied.action_spaces import directions, nearest_views
from embodied.geometry import heading_of_yaw, wrap
from embodied.interface import STEP, TURNS, VIEWS, FindObject, Pose, Route, Task
from embodied.navigation.graph import to_matterport
from embodied.teachers.vnla import VnlaTeacher

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset, Place
    from embodied.navigation.graph import NavGraph

REGIONS = {
    "bathroom": "a",
    "main_bedroom": "b",
    "bedroom": "b",
    "kids_room": "b",
    "guest_room": "b",
    "closet": "c",
    "dining_room": "d",
    "family_room": "f",
    "garage": "g",
    "hall": "e",
    "corridor": "h",
    "library": "i",
    "laundry_room": "j",
    "kitchen": "k",
    "living_room": "l",
    "study": "o",
    "sun_room": "p",
    "playroom": "r",
    "stairwell": "s",
    "toilet": "t",
    "workshop": "u",
    "pantry": "u",
    "gym": "w",
}
"""Our room kinds as Matterport's region letters; anything else is 'z', other room."""
REGION_NAMES = {
    "a": "bathroom",
    "b": "bedroom",
    "c": "closet",
    "d": "dining room",
    "e": "entryway",
    "f": "family room",
    "g": "garage",
    "h": "hallway",
    "i": "library",
    "j": "laundry room",
    "k": "kitchen",
    "l": "living room",
    "m": "meeting room",
    "n": "lounge",
    "o": "office",
    "p": "porch",
    "r": "rec room",
    "s": "stairs",
    "t": "toilet",
    "u": "utility room",
    "v": "tv room",
    "w": "gym",
    "x": "outdoor",
    "y": "balcony",
    "z": "other room",
    "B": "bar",
    "C": "classroom",
    "D": "dining booth",
    "S": "spa",
    "Z": "junk",
    "-": "no label",
}
CAMERA = {
    "left": (0, -1, 0),
    "right": (0, 1, 0),
    "up": (0, 0, 1),
    "down": (0, 0, -1),
    "forward": (1, 0, 0),
    "stop": (0, 0, 0),
}
"""VNLA's words as MatterSim actions: index of the move, sign of the heading change (right is +), of the elevation's."""


def scan_name(world: str) -> str:
    return world.replace("_", "")


def heading_bin(turn: int) -> int:
    """Matterport's heading bin (clockwise from +y) of our turn (counter-clockwise from +x)."""
    return (TURNS // 4 - turn) % TURNS


def view_index(view: int) -> int:
    """Matterport's viewIndex of our view; it is its own inverse."""
    return TURNS * (view // TURNS) + heading_bin(view % TURNS)


def in_matterport_order(features: np.ndarray) -> np.ndarray:
    """(..., 36, D) features with row k for viewIndex k, from rows in our order; its own inverse."""
    return features[..., [view_index(v) for v in range(VIEWS)], :]


def heading(pose: Pose) -> float:
    """Radians clockwise from +y."""
    return round(float(heading_of_yaw(pose.yaw)), 6)


def action_list(graph: NavGraph, node: int, bin_: int) -> list[dict[str, object]]:
    """HANNA's panoramic action list for a heading bin (originals 2.2).

    Element 0 stops: relViewIndex -1, absViewIndex the bin, nextViewpointId itself. Then every
    neighbour: relViewIndex (0 is the current heading looking down), absViewIndex, nextViewpointId,
    rel_heading (right is positive), rel_elevation (from the horizon), distance (angular, to the
    centre of its view). Sorted by |rel_heading|.
    """
    nodes, yaw, pitch = directions(graph, node)
    views = nearest_views(yaw, pitch)
    actions = []
    for j, y, p, v in zip(nodes, yaw, pitch, views, strict=True):
        index = view_index(int(v))
        relative = float(wrap(heading_of_yaw(y) - bin_ * STEP))
        offset = np.hypot(wrap(y - (v % TURNS) * STEP), p - (v // TURNS - 1) * STEP)
        actions.append(
            {
                "relViewIndex": TURNS * (index // TURNS) + (index - bin_) % TURNS,
                "absViewIndex": index,
                "nextViewpointId": graph.ids[int(j)],
                "rel_heading": relative,
                "rel_elevation": float(p),
                "distance": float(offset),
            }
        )
    stop = {"relViewIndex": -1, "absViewIndex": bin_, "nextViewpointId": graph.ids[node]}
    return [stop, *sorted(actions, key=lambda a: (abs(a["rel_heading"]), a["nextViewpointId"]))]


def export(data: Dataset, folder: Path) -> list[Path]:
    """Write a data set of kind vln, hanna or vnla as its program reads it; returns the files.

    Raises:
      ValueError: another kind of data set, which no published program reads.
    """
    writers = {"vln": _export_r2r, "hanna": _export_hanna, "vnla": _export_vnla}
    if data.kind not in writers:
        raise ValueError(f"no published program reads {data.kind!r} tasks; export one of {sorted(writers)}")
    folder = Path(folder)
    names = sorted({n for s in data.splits for n in data.names(s)})
    files = _export_graphs(data, names, folder / "connectivity")
    return files + writers[data.kind](data, names, folder)


def _export_graphs(data: Dataset, names: Sequence[str], folder: Path) -> list[Path]:
    files = []
    for name in names:
        files.append(folder / f"{scan_name(name)}_connectivity.json")
        to_matterport(data.place(name).graph, data.place(name).house, files[-1])
    return [*files, _text(folder / "scans.txt", [scan_name(n) for n in names])]


def _export_r2r(data: Dataset, names: Sequence[str], folder: Path) -> list[Path]:
    """One item per path with its three instructions; in seen splits the wordings are the held-out ones, repeated."""
    files, number = [], 0
    for split in data.splits:
        items = []
        by_path: dict[tuple[str, tuple[int, ...]], list[Task]] = {}
        for t in data.tasks(split):
            by_path.setdefault((t.world, t.goal.path), []).append(t)
        for (name, path), tasks in by_path.items():
            graph = data.place(name).graph
            texts = [t.request for t in tasks]
            number += 1
            items.append(
                {
                    "distance": round(float(graph.distance[path[0], path[-1]]), 4),
                    "scan": scan_name(name),
                    "path_id": number,
                    "path": [graph.ids[v] for v in path],
                    "heading": heading(tasks[0].start),
                    "instructions": [texts[k % len(texts)] for k in range(3)],
                }
            )
        files.append(_json(folder / f"R2R_{split}.json", items))
    return files


def _item(task: Task, number: int, place: Place) -> dict[str, object]:
    ids, graph = place.graph.ids, place.graph
    return {
        "path_id": number,
        "scan": scan_name(task.world),
        "heading": heading(task.start),
        "paths": [[ids[v] for v in graph.path(task.start.node, g)] for g in task.goal_nodes],
        "instructions": [tokenised(task.request)],
    }


def _export_hanna(data: Dataset, names: Sequence[str], folder: Path) -> list[Path]:
    hanna, files, number = folder / "hanna", [], 0
    words: dict[str, int] = {}
    for split in data.splits:
        items = []
        for t in data.tasks(split):
            number += 1
            items.append(_item(t, number, data.place(t.world)))
            if split == "train":
                _count(words, items[-1]["instructions"][0])
        files.append(_json(hanna / f"hanna_{split}.json", items))
    routes: dict[str, list[dict[str, object]]] = {}
    spaces: dict[str, list[dict[str, object]]] = {}
    for name in names:
        graph = data.place(name).graph
        routes[scan_name(name)] = [_route(r, graph) for r in data.routes(name)]
        for r in data.routes(name):
            if r.split == "train_seen":
                _count(words, tokenised(r.instruction))
        for node, key in enumerate(graph.ids):
            for b in range(TURNS):
                spaces[f"{scan_name(name)}_{key}_{b}"] = action_list(graph, node, b)
    groups = {g: [scan_name(n) for n in names if n.startswith(g)] for g in ("train", "val", "test")}
    objects = sorted({t.goal.object_class for s in data.splits for t in data.tasks(s)})
    return [
        *files,
        _json(hanna / "routes.json", routes),
        _json(hanna / "panoramic_action_space.json", spaces),
        _json(hanna / "scan_split.json", groups),
        _text(hanna / "accepted_objects.txt", objects),
        _regions(hanna),
        _text(hanna / "vocab.txt", ["<PAD>", "<UNK>", "<EOS>", *sorted(words, key=lambda w: (-words[w], w))]),
    ]


def _route(route: Route, graph: NavGraph) -> dict[str, object]:
    return {
        "path_id": route.id.replace("_", "-"),
        "path": [graph.ids[v] for v in route.path],
        "instruction": tokenised(route.instruction),
        "split": route.split,
        "view_id": view_index(Pose(0, route.turn, route.tilt).view),
    }


def _export_vnla(data: Dataset, names: Sequence[str], folder: Path) -> list[Path]:
    teacher, asknav, files, number = VnlaTeacher(), folder / "asknav", [], 0
    words: dict[str, int] = {}
    for split in data.splits:
        items = []
        for t in data.tasks(split):
            number += 1
            items.append({**_item(t, number, data.place(t.world)), **_vnla_fields(t, data.place(t.world), teacher)})
            if split == "train":
                _count(words, items[-1]["instructions"][0])
        files.append(_json(asknav / f"asknav_{split}.json", items))
    for name in names:
        graph, house = data.place(name).graph, data.place(name).house
        kinds = [house.room_by_id[r].kind for r in graph.room_of_node]
        lines = [
            f"{k} {key} - {REGIONS.get(kind, 'z')}" for k, (key, kind) in enumerate(zip(graph.ids, kinds, strict=True))
        ]
        files.append(
            _text(folder / "v1" / "scans" / scan_name(name) / "house_segmentations" / "panorama_to_region.txt", lines)
        )
    vocabulary = ["<PAD>", "<UNK>", "<EOS>", *sorted(words)]
    return [*files, _text(asknav / "train_vocab.txt", vocabulary), _regions(folder)]


def _vnla_fields(task: Task, place: Place, teacher: VnlaTeacher) -> dict[str, object]:
    assert isinstance(task.goal, FindObject), "VNLA tasks look for objects"
    plan, room = teacher.plan(place), place.house.room_by_id
    rooms = place.graph.room_of_node
    return {
        "trajectories": [[list(CAMERA[w]) for w in plan.words(task.start, (g,), 200)[0]] for g in task.goal_nodes],
        "start_region_name": _region_name(room[rooms[task.start.node]].kind),
        "end_region_name": _region_name(room[rooms[task.goal_nodes[0]]].kind),
        "object_name": task.goal.object_class,
    }


def write_features(path: Path, rows: Iterable[tuple[str, str, np.ndarray]]) -> None:
    """The feature file of Matterport3DSimulator.

    Args:
      rows: (house name, viewpoint id, (36, D) features in our order).
    """
    with atomic_path(Path(path)) as temporary, open(temporary, "w", encoding="ascii", newline="") as f:
        for name, viewpoint, features in rows:
            code = base64.b64encode(in_matterport_order(features).astype("<f4").tobytes()).decode()
            f.write("\t".join([scan_name(name), viewpoint, "640", "480", "60", code]) + "\r\n")


def read_features(path: Path) -> dict[tuple[str, str], np.ndarray]:
    """(scan, viewpoint) -> (36, D) float32 in our order, from such a file."""
    table = {}
    with open(path, encoding="ascii") as f:
        for line in f:
            scan, viewpoint, _, _, _, code = line.rstrip("\r\n").split("\t")
            features = np.frombuffer(base64.b64decode(code), dtype="<f4").reshape(VIEWS, -1)
            table[scan, viewpoint] = in_matterport_order(features)
    return table


def tokenised(text: str) -> str:
    """Lower case, punctuation set apart by blanks."""
    return " ".join(re.findall(r"[a-z0-9'-]+|[^\sa-z0-9]", text.lower()))


def _count(words: dict[str, int], text: str) -> None:
    for w in text.split():
        words[w] = words.get(w, 0) + 1


def _region_name(kind: str) -> str:
    return REGION_NAMES[REGIONS.get(kind, "z")]


def _regions(folder: Path) -> Path:
    return _text(folder / "region_label.txt", [f"'{k}' = {v}" for k, v in REGION_NAMES.items()])


def _json(path: Path, body: object) -> Path:
    write_bytes(path, json.dumps(body).encode())
    return path


def _text(path: Path, lines: Sequence[str]) -> Path:
    write_bytes(path, "".join(line + "\n" for line in lines).encode())
    return path

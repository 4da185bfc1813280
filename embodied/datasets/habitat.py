"""Episodes of continuous navigation in Habitat's files: VLN-CE (R2R_VLNCE_v1-3) and ObjectNav, .json.gz.

  <split>/<split>.json.gz       VLN-CE: episodes and the vocabulary; ObjectNav: categories, with one house a file below
  <split>/<split>_gt.json.gz    VLN-CE: where an expert was and what it did, by episode
  <split>/content/<scene>.json.gz    ObjectNav: goals by category with viewpoints, and episodes

Habitat's frame has y up: (x, y, z) there is (x, z, -y) here. An agent looks along -z; rotations are (x, y, z, w).
"""

from __future__ import annotations

import gzip
import itertools
import json
import math
import re
import zlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from embodied.assets.cache import write_bytes
from embodied.assets.json_file import RecordError, parse, shown
from embodied.datasets.matterport import tokenised
from embodied.envs.continuous import Aim, ContinuousEnv, Excursion, Follower, Grounds, Point, Walk, seen_from
from embodied.interface import FollowRoute, Place, Task
from embodied.seeds import stream

LONGEST = 200
"""Tokens of an instruction in VLN-CE's files, filled up with zeros."""
MOST = 2**30
"""Most bytes of a file, unpacked; VLN-CE's largest has a fifth."""
SPECIAL = ("<pad>", "<unk>")
"""Words 0 and 1 of the vocabulary."""
REACH = 1.0
"""ObjectNav: an object is found within so many metres of its outline, in its room."""
AT_VIEW = 0.1
"""ObjectNav: metres from a viewpoint that count as standing there, as in Habitat's evaluator."""
FARTHEST, NEAREST = 30.0, 1.0
"""ObjectNav: metres between a start and the nearest object."""


# Frames ------------------------------------------------------------------------------------------


def to_habitat(point: Sequence[float]) -> list[float]:
    """(x, y, z) with z up as Habitat's [x, y, z] with y up."""
    x, y, z = (float(v) for v in point)
    return [x, z, -y]


def from_habitat(point: Sequence[float]) -> Point:
    x, y, z = (float(v) for v in point)
    return x, -z, y


def rotation_of(yaw: float) -> list[float]:
    """Habitat's rotation (x, y, z, w) of an agent that looks along `yaw`."""
    half = (yaw - math.pi / 2) / 2
    return [0.0, math.sin(half), 0.0, math.cos(half)]


def yaw_of(rotation: Sequence[float]) -> float:
    """Where such a rotation looks; its horizontal part where it is tilted."""
    x, y, z, w = (float(v) for v in rotation)
    ahead_x, ahead_z = -2 * (x * z + w * y), -(1 - 2 * (x * x + y * y))
    return math.atan2(-ahead_z, ahead_x)


# Episodes of ours --------------------------------------------------------------------------------


def route_excursions(tasks: Iterable[Task], places: Mapping[str, Place]) -> list[Excursion]:
    """VLN tasks as continuous episodes: the same starts, paths and words."""
    found = []
    for number, task in enumerate(tasks, 1):
        assert isinstance(task.goal, FollowRoute), "VLN tasks follow routes"
        place = places[task.world]
        floor = float(place.house.storeys[0].elevation)
        path = tuple((float(x), float(y), floor) for x, y, _ in place.graph.positions[list(task.goal.path)])
        start, aims, route = (path[0], task.start.yaw), (Aim(path[-1]),), task.goal.route
        found.append(
            Excursion(str(number), task.world, *start, task.request, aims, task.radius, path, trajectory=route)
        )
    return found


def object_excursions(place: Place, count: int, *, seed: int, grounds: Grounds | None = None) -> list[Excursion]:
    """ObjectNav in one house: starts anywhere on the floor, every class of object that can be come near to.

    Raises:
      ValueError: the house has no object far enough from any start.
    """
    ground, found, far = (grounds or Grounds()).of(place.house), [], {}
    floor, rng = float(place.house.storeys[0].elevation), stream(seed, "objectnav", place.name)
    for name in sorted({p.object_class for p in place.house.placements}):
        if aims := seen_from(place.house, ground, name, REACH):
            cells = [ground.cell_at(np.array(v)) for a in aims for v in a.views]
            metres = ground.ways(np.unique(cells)).metres
            starts = np.flatnonzero((metres >= NEAREST) & (metres <= FARTHEST))
            if len(starts):
                far[name] = aims, starts
    if not far:
        raise ValueError(f"{place.name!r} has no object that is {NEAREST} to {FARTHEST} m away from a start")
    names = sorted(far)
    for number in range(count):
        name = names[int(rng.integers(len(names)))]
        aims, starts = far[name]
        x, y = ground.xy[int(rng.choice(starts))]
        yaw = float(rng.uniform(-math.pi, math.pi))
        start = (float(x), float(y), floor)
        found.append(Excursion(str(number), place.name, start, yaw, name, aims, AT_VIEW, object_class=name))
    return found


def with_experts(
    excursions: Iterable[Excursion], places: Mapping[str, Place], env: ContinuousEnv
) -> list[tuple[Excursion, Walk]]:
    """Each episode with the walk of an expert along its path, and its positions written into the episode."""
    found = []
    for e in excursions:
        env.reset(e, places[e.world])
        expert = Follower(env, along=bool(e.reference))
        while not env.ended:
            env.step(expert.action())
        walk = env.walk()
        passed = itertools.groupby((x, y, z) for x, y, z in walk.positions.tolist())
        whole = replace(e, expert=tuple(place for place, _ in passed))
        found.append((whole, replace(walk, excursion=whole)))
    return found


# Files -------------------------------------------------------------------------------------------


def write_vlnce(folder: Path, split: str, walked: Sequence[tuple[Excursion, Walk]]) -> list[Path]:
    """<split>.json.gz and <split>_gt.json.gz of VLN-CE; returns both.

    Args:
      walked: episodes and an expert's walks, from `with_experts`.
    """
    words = [w for w, _ in Counter(w for e, _ in walked for w in tokenised(e.instruction).split()).most_common()]
    word_list = [*SPECIAL, *words]
    number = {w: k for k, w in enumerate(word_list)}
    episodes, experts = [], {}
    for e, walk in walked:
        tokens = [number[w] for w in tokenised(e.instruction).split()][:LONGEST]
        episodes.append(
            {
                "episode_id": int(e.id) if e.id.isdecimal() else e.id,
                "trajectory_id": e.trajectory or e.id,
                "scene_id": f"embodied/{e.world}/{e.world}.glb",
                "start_position": to_habitat(e.start),
                "start_rotation": rotation_of(e.yaw),
                "info": {"geodesic_distance": float(walk.distances[0])},
                "goals": [{"position": to_habitat(a.position), "radius": e.radius} for a in e.aims],
                "instruction": {
                    "instruction_text": e.instruction,
                    "instruction_tokens": tokens + [0] * (LONGEST - len(tokens)),
                },
                "reference_path": [to_habitat(p) for p in e.reference],
            }
        )
        experts[e.id] = {
            "locations": [to_habitat(p) for p in e.expert],
            "forward_steps": sum(a == 1 for a in walk.actions),
            "actions": list(walk.actions),
        }
    vocabulary = {
        "word_list": word_list,
        "word2idx_dict": number,
        "itos": word_list,
        "stoi": number,
        "num_vocab": len(word_list),
        "UNK_INDEX": 1,
        "PAD_INDEX": 0,
    }
    home = Path(folder) / split
    return [
        _write(home / f"{split}.json.gz", {"episodes": episodes, "instruction_vocab": vocabulary}),
        _write(home / f"{split}_gt.json.gz", experts),
    ]


def read_vlnce(path: Path) -> list[Excursion]:
    """The episodes of a VLN-CE file, with the experts of <name>_gt.json.gz beside it where there is one.

    Raises:
      RecordError: it is no such file; says where.
    """
    path = Path(path)
    whole = _read(path)
    beside = path.with_name(path.name.replace(".json.gz", "_gt.json.gz"))
    experts = _read(beside) if beside != path and beside.exists() else {}
    found = []
    for k, item in enumerate(_field(whole, "episodes", list, str(path))):
        where = f"{path}: episode {k}"
        goals = _field(item, "goals", list, where)
        expert = experts.get(str(item.get("episode_id")), {"locations": ()})
        try:
            aims, radius = tuple(Aim(from_habitat(g["position"])) for g in goals), float(goals[0].get("radius") or 3.0)
            reference = tuple(from_habitat(p) for p in item.get("reference_path") or ())
            passed, route = tuple(from_habitat(p) for p in expert["locations"]), str(item.get("trajectory_id", ""))
            text = item["instruction"]["instruction_text"]
            found.append(Excursion(*_begun(item), text, aims, radius, reference, passed, trajectory=route))
        except (KeyError, TypeError, ValueError, IndexError) as e:
            raise RecordError(f"{where} is not one of VLN-CE's: {type(e).__name__} {e}") from e
    return found


def read_objectnav(path: Path) -> list[Excursion]:
    """The episodes of an ObjectNav file and of those in content/ beside it.

    Raises:
      RecordError: it is no such file; says where.
    """
    path = Path(path)
    files = [path, *sorted((path.parent / "content").glob("*.json.gz"))]
    found = []
    for file in files:
        whole = _read(file)
        goals = whole.get("goals_by_category", {})
        for k, item in enumerate(_field(whole, "episodes", list, str(file))):
            where = f"{file}: episode {k}"
            try:
                scene, name = item["scene_id"], item["object_category"]
                aims = tuple(
                    Aim(
                        from_habitat(g["position"]),
                        tuple(from_habitat(v["agent_state"]["position"]) for v in g["view_points"]),
                        str(g["object_id"]),
                    )
                    for g in goals[f"{scene.rsplit('/', 1)[-1]}_{name}"]
                )
                found.append(Excursion(*_begun(item), name, aims, AT_VIEW, object_class=name))
            except (KeyError, TypeError, ValueError, AttributeError) as e:
                raise RecordError(f"{where} is not one of ObjectNav's: {type(e).__name__} {e}") from e
    return found


def _begun(item: Mapping[str, Any]) -> tuple[str, str, Point, float]:
    """Id, house, start and yaw of an episode."""
    start, yaw = from_habitat(item["start_position"]), yaw_of(item["start_rotation"])
    return str(item["episode_id"]), scene_name(item["scene_id"]), start, yaw


def scene_name(scene_id: str) -> str:
    """The house of 'mp3d/flat_0/flat_0.glb'."""
    return re.sub(r"\.[^./]*$", "", scene_id.rsplit("/", 1)[-1])


def _write(path: Path, value: object) -> Path:
    write_bytes(path, gzip.compress(json.dumps(value).encode(), mtime=0))
    return path


def _read(path: Path) -> dict[str, Any]:
    try:
        with gzip.open(path) as f:
            body = f.read(MOST + 1)
    except (OSError, EOFError, zlib.error) as e:
        if isinstance(e, FileNotFoundError):
            raise
        raise RecordError(f"{path} is not a whole gzip file ({e})") from e
    if len(body) > MOST:
        raise RecordError(f"{path} unpacks to over {MOST} bytes; split it")
    value = parse(body, f"{path}")
    if not isinstance(value, dict):
        raise RecordError(f"{path} should hold one JSON object, got {shown(value)}")
    return value


def _field(value: object, name: str, kind: type, where: str) -> Any:
    if not isinstance(value, dict) or not isinstance(value.get(name), kind):
        raise RecordError(f"{where} should have a {kind.__name__} {name!r}, got {shown(value)}")
    return value[name]

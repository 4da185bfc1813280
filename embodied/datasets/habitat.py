"""Episodes of continuous navigation in Habitat's files: VLN-CE (R2R_VLNCE_v1-3), ObjectNav and GOAT-Bench, .json.gz.

  <split>/<split>.json.gz       VLN-CE: episodes and the vocabulary; ObjectNav: categories, with one house a file below
  <split>/<split>_gt.json.gz    VLN-CE: where an expert was and what it did, by episode
  <split>/content/<scene>.json.gz    ObjectNav, GOAT-Bench: goals by category with viewpoints, and episodes

Habitat's frame has y up: (x, y, z) there is (x, z, -y) here. An agent looks along -z; rotations are (x, y, z, w).
"""

import gzip
import itertools
import json
import math
import re
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from embodied.assets.cache import write_bytes
from embodied.assets.json_file import RecordError, parse, shown
from embodied.envs.continuous import (
    ContinuousEnv,
    ContinuousEpisode,
    ContinuousTrajectory,
    NavigationGoal,
    NavMeshCache,
    Point,
    ShortestPathFollower,
    seen_from,
)
from embodied.interface import FindInTurn, FollowRoute, Place, Task
from embodied.mattersim.pictures import tokenised
from embodied.navigation.free_space import EYE
from embodied.seeds import stream
from embodied.tasks.goals import GOAT_REACH, find_instances

INSTRUCTION_TOKENS = 200
"""Tokens of an instruction in VLN-CE's files, filled up with zeros."""
LARGEST_FILE = 2**30
"""Most bytes of a file, unpacked; VLN-CE's largest has a fifth."""
SPECIAL = ("<pad>", "<unk>")
"""Words 0 and 1 of the vocabulary."""
REACH = 1.0
"""ObjectNav: an object is found within so many metres of its outline, in its room."""
UPRIGHT = 0.01
"""How far a rotation may be from one about the vertical axis: files have a few digits."""
AT_VIEW = 0.1
"""ObjectNav: metres from a viewpoint that count as standing there, as in Habitat's evaluator."""
FARTHEST, NEAREST = 30.0, 1.0
"""ObjectNav: metres between a start and the nearest object."""


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
    """Yaw of an agent with such a rotation.

    Raises:
      ValueError: it is no unit quaternion, or one of an agent that does not stand upright, as in another order.
    """
    x, y, z, w = (float(v) for v in rotation)
    if not (abs(math.hypot(x, y, z, w) - 1) < UPRIGHT and math.hypot(x, z) < UPRIGHT):
        raise ValueError(
            f"start_rotation is {list(rotation)}; expected a unit quaternion (x, y, z, w) that turns about y, which is "
            "up: (0, sin, 0, cos) of half the angle"
        )
    return math.atan2(1 - 2 * y * y, -2 * w * y)


def route_episodes(tasks: Iterable[Task], places: Mapping[str, Place]) -> list[ContinuousEpisode]:
    """VLN tasks as continuous episodes: the same starts, paths and words."""
    episodes = []
    for number, task in enumerate(tasks, 1):
        assert isinstance(task.goal, FollowRoute), "VLN tasks follow routes"
        place = places[task.world]
        path = tuple((float(x), float(y), float(z) - EYE) for x, y, z in place.graph.positions[list(task.goal.path)])
        start, goals, route = (path[0], task.start.yaw), (NavigationGoal(path[-1]),), task.goal.route
        episodes.append(
            ContinuousEpisode(str(number), task.world, *start, task.request, goals, task.radius, path, trajectory=route)
        )
    return episodes


def object_episodes(
    place: Place, count: int, *, seed: int, navmeshes: NavMeshCache | None = None
) -> list[ContinuousEpisode]:
    """ObjectNav in one house: starts anywhere on the floor, every class of object that can be come near to.

    Raises:
      ValueError: the house has no object far enough from any start.
    """
    ground, episodes, far = (navmeshes or NavMeshCache()).of(place.house), [], {}
    rng = stream(seed, "objectnav", place.name)
    for name in sorted({p.object_class for p in place.house.placements}):
        if goals := seen_from(place.house, ground, name, REACH):
            cells = [ground.cell_at(np.array(v)) for a in goals for v in a.views]
            metres = ground.ways(np.unique(cells)).metres
            starts = np.flatnonzero((metres >= NEAREST) & (metres <= FARTHEST))
            if len(starts):
                far[name] = goals, starts
    if not far:
        raise ValueError(f"{place.name!r} has no object that is {NEAREST} to {FARTHEST} m away from a start")
    names = sorted(far)
    for number in range(count):
        name = names[int(rng.integers(len(names)))]
        goals, starts = far[name]
        x, y, z = ground.xyz[int(rng.choice(starts))]
        yaw = float(rng.uniform(-math.pi, math.pi))
        start = (float(x), float(y), float(z))
        episodes.append(ContinuousEpisode(str(number), place.name, start, yaw, name, goals, AT_VIEW, object_class=name))
    return episodes


def with_experts(
    episodes: Iterable[ContinuousEpisode], places: Mapping[str, Place], env: ContinuousEnv
) -> list[tuple[ContinuousEpisode, ContinuousTrajectory]]:
    """Each episode with the walk of an expert along its path, and its positions written into the episode."""
    expert_episodes = []
    for e in episodes:
        env.reset(e, places[e.world])
        expert = ShortestPathFollower(env, along=bool(e.reference))
        while not env.ended:
            env.step(expert.action())
        trajectory = env.trajectory()
        passed = itertools.groupby((x, y, z) for x, y, z in trajectory.positions.tolist())
        whole = replace(e, expert=tuple(place for place, _ in passed))
        expert_episodes.append((whole, replace(trajectory, episode=whole)))
    return expert_episodes


def write_vlnce(
    folder: Path, split: str, walked: Sequence[tuple[ContinuousEpisode, ContinuousTrajectory]]
) -> list[Path]:
    """<split>.json.gz and <split>_gt.json.gz of VLN-CE; returns both.

    Args:
      walked: episodes and an expert's walks, from `with_experts`.
    """
    words = [w for w, _ in Counter(w for e, _ in walked for w in tokenised(e.instruction).split()).most_common()]
    word_list = [*SPECIAL, *words]
    number = {w: k for k, w in enumerate(word_list)}
    episodes, experts = [], {}
    for e, trajectory in walked:
        tokens = [number[w] for w in tokenised(e.instruction).split()][:INSTRUCTION_TOKENS]
        filled = tokens + [0] * (INSTRUCTION_TOKENS - len(tokens))
        about: dict[str, Any] = {"episode_id": int(e.id) if e.id.isdecimal() else e.id}
        about |= {"trajectory_id": e.trajectory or e.id, "scene_id": f"embodied/{e.world}/{e.world}.glb"}
        about |= {"start_position": to_habitat(e.start), "start_rotation": rotation_of(e.yaw)}
        about["info"] = {"geodesic_distance": trajectory.shortest}
        about["goals"] = [{"position": to_habitat(a.position), "radius": e.radius} for a in e.goals]
        about["instruction"] = {"instruction_text": e.instruction, "instruction_tokens": filled}
        episodes.append({**about, "reference_path": [to_habitat(p) for p in e.reference]})
        steps, locations = list(trajectory.actions), [to_habitat(p) for p in e.expert]
        experts[e.id] = {"locations": locations, "forward_steps": steps.count(1), "actions": steps}
    vocabulary: dict[str, Any] = {"word_list": word_list, "word2idx_dict": number, "itos": word_list, "stoi": number}
    vocabulary |= {"num_vocab": len(word_list), "UNK_INDEX": 1, "PAD_INDEX": 0}
    home = Path(folder) / split
    return [
        _write(home / f"{split}.json.gz", {"episodes": episodes, "instruction_vocab": vocabulary}),
        _write(home / f"{split}_gt.json.gz", experts),
    ]


def write_goat(folder: Path, split: str, tasks: Iterable[Task], places: Mapping[str, Place]) -> list[Path]:
    """<split>.json.gz, empty, and <split>/content/<scene>.json.gz of GOAT-Bench for `goat` tasks; returns all."""
    scenes: dict[str, tuple[list[dict[str, Any]], dict[str, dict[str, Any]], dict[str, tuple[int, ...]]]] = {}
    for task in tasks:
        assert isinstance(task.goal, FindInTurn), "goat tasks find things in turn"
        place, name = places[task.world], task.world
        if name not in scenes:
            scenes[name] = [], {}, {x.placement: x.nodes for x in find_instances(place, GOAT_REACH)}
        episodes, goals, nodes = scenes[name]
        for goal in task.goal.goals:
            things = goals.setdefault(f"{name}.glb_{goal.category}", {})
            for thing in goal.placements:
                known = things.setdefault(thing, _goat_goal(place, thing, goal.category, nodes[thing]))
                if goal.form == "description":
                    known["lang_desc"] = goal.words.removeprefix("find ")
        start = place.graph.positions[task.start.node] - [0.0, 0.0, EYE]
        in_turn = [[g.category, g.form, None if g.form == "object" else g.placements[0]] for g in task.goal.goals]
        one: dict[str, Any] = {"episode_id": str(len(episodes)), "scene_id": f"embodied/{name}/{name}.glb"}
        one |= {"start_position": to_habitat(start), "start_rotation": rotation_of(task.start.yaw)}
        episodes.append(one | {"info": {}, "goals": [], "tasks": in_turn})
    home = Path(folder) / split
    written = [_write(home / f"{split}.json.gz", {"episodes": [], "goals": {}})]
    for name, (episodes, goals, _) in scenes.items():
        body = {"episodes": episodes, "goals": {key: [*things.values()] for key, things in goals.items()}}
        written.append(_write(home / "content" / f"{name}.json.gz", body))
    return written


def _goat_goal(place: Place, thing: str, category: str, nodes: Sequence[int]) -> dict[str, Any]:
    """A thing that may be looked for, its viewpoints and a picture from the nearest of them."""
    p, states = place.house.placement_by_id[thing], []
    for x, y, z in place.graph.positions[list(nodes)]:
        rotation = rotation_of(math.atan2(p.position[1] - y, p.position[0] - x))
        states.append({"position": to_habitat((x, y, z - EYE)), "rotation": rotation})
    eye = {"position": to_habitat(place.graph.positions[nodes[0]]), "rotation": states[0]["rotation"]}
    about: dict[str, Any] = {"object_category": category, "object_id": thing, "position": to_habitat(p.position)}
    views = [{"agent_state": state, "iou": None} for state in states]
    images = [eye | {"hfov": 90, "image_dimensions": [512, 512]}]
    about |= {"view_points": views, "image_goals": images, "lang_desc": None}
    return about | {"children_object_categories": []}


def read_vlnce(path: Path) -> list[ContinuousEpisode]:
    """The episodes of a VLN-CE file, with the experts of <name>_gt.json.gz beside it where there is one.

    Raises:
      RecordError: it is no such file; says where.
    """
    path = Path(path)
    beside = path.with_name(path.name.replace(".json.gz", "_gt.json.gz"))
    experts = _read(beside) if beside != path and beside.exists() else {}

    def episode(item: Mapping[str, Any]) -> ContinuousEpisode:
        places = _field(item, "goals", list, "it")
        text = _field(_field(item, "instruction", dict, "it"), "instruction_text", str, "its instruction")
        if not places:
            raise ValueError(f"it should have goals, got {shown(places)}")
        goals, radius = tuple(NavigationGoal(from_habitat(g["position"])) for g in places), places[0].get("radius")
        expert = experts.get(str(item["episode_id"]), {"locations": ()})["locations"]
        reference, passed = (tuple(map(from_habitat, way)) for way in (item.get("reference_path") or (), expert))
        more: dict[str, Any] = {"radius": float(radius or 3.0), "trajectory": str(item.get("trajectory_id", ""))}
        return ContinuousEpisode(*_begun(item), text, goals, reference=reference, expert=passed, **more)

    return _episodes(path, _read(path), episode, "VLN-CE")


def read_objectnav(path: Path) -> list[ContinuousEpisode]:
    """The episodes of an ObjectNav file and of those in content/ beside it.

    Raises:
      RecordError: it is no such file; says where.
    """

    def goal(item: Mapping[str, Any]) -> NavigationGoal:
        views = tuple(from_habitat(v["agent_state"]["position"]) for v in item["view_points"])
        return NavigationGoal(from_habitat(item["position"]), views, str(item["object_id"]))

    episodes = []
    for file in (Path(path), *sorted((Path(path).parent / "content").glob("*.json.gz"))):
        whole = _read(file)

        def episode(item: Mapping[str, Any], known: Mapping[str, Any] = whole.get("goals_by_category", {})) -> Any:
            scene, name = item["scene_id"], item["object_category"]
            goals = tuple(goal(g) for g in known[f"{scene.rsplit('/', 1)[-1]}_{name}"])
            return ContinuousEpisode(*_begun(item), name, goals, AT_VIEW, object_class=name)

        episodes += _episodes(file, whole, episode, "ObjectNav")
    return episodes


def _episodes(
    path: Path, whole: Mapping[str, Any], episode: Callable[[Mapping[str, Any]], ContinuousEpisode], task: str
) -> list[ContinuousEpisode]:
    """Those that a file lists, each made by `episode`.

    Raises:
      RecordError: one of them is not as the files of `task` have it.
    """
    episodes = []
    for k, item in enumerate(_field(whole, "episodes", list, str(path))):
        try:
            episodes.append(episode(item))
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as e:
            name = f" ({item['episode_id']!r})" if isinstance(item, dict) and "episode_id" in item else ""
            raise RecordError(f"{path}: episode {k}{name} is not one of {task}'s: {type(e).__name__} {e}") from e
    return episodes


def _begun(item: Mapping[str, Any]) -> tuple[str, str, Point, float]:
    """Id, house, start and yaw of an episode."""
    start, yaw = from_habitat(item["start_position"]), yaw_of(item["start_rotation"])
    house = re.sub(r"\.[^./]*$", "", re.split(r"[/\\]", item["scene_id"])[-1])  # of 'mp3d/flat_0/flat_0.glb'
    return str(item["episode_id"]), house, start, yaw


def _write(path: Path, value: object) -> Path:
    write_bytes(path, gzip.compress(json.dumps(value).encode(), mtime=0))
    return path


def _read(path: Path) -> dict[str, Any]:
    try:
        with gzip.open(path) as f:
            body = f.read(LARGEST_FILE + 1)
    except (OSError, EOFError, zlib.error) as e:
        if isinstance(e, FileNotFoundError):
            raise
        raise RecordError(f"{path} is not a whole gzip file ({e})") from e
    if len(body) > LARGEST_FILE:
        raise RecordError(f"{path} unpacks to over {LARGEST_FILE} bytes; split it")
    value = parse(body, f"{path}")
    if not isinstance(value, dict):
        raise RecordError(f"{path} should hold one JSON object, got {shown(value)}")
    return value


def _field(value: object, name: str, kind: type, where: str) -> Any:
    if not isinstance(value, dict) or not isinstance(value.get(name), kind):
        raise RecordError(f"{where} should have a {kind.__name__} {name!r}, got {shown(value)}")
    return value[name]

"""Building a set of questions: houses are lit and filmed, one at a time; then all walks are asked about and thinned."""

import dataclasses
import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import shapely

from embodied.assets.cache import digest, drafts, write_json
from embodied.assets.catalogue import Catalogue, load_catalogue
from embodied.assets.moving_parts import openness_of
from embodied.datasets.build import Watch, for_each_unit, make_dataset_house
from embodied.datasets.checks import DatasetError
from embodied.datasets.vqa.scene import WalkScene, movable
from embodied.datasets.vqa.scoring import VqaQuestion, less_guessed, narrowed, thinned
from embodied.datasets.vqa.types import CHANGE, TYPES
from embodied.datasets.vqa.walks import TURN, Walk, cameras, corners_of, film, fronts_of, look_around, tour, view_of
from embodied.generate import HouseConfig
from embodied.generate.people import CLASS, add_people, place_people
from embodied.house.contents import free_openness, left_open, stocked
from embodied.house.house import House, Placement
from embodied.house.moment import Moment, RigidPose, Triple
from embodied.locks import locked
from embodied.navigation.connectivity import from_matterport, to_matterport
from embodied.navigation.graph import NavGraph
from embodied.records import from_plain, load_lines, read_json, save_lines, to_json
from embodied.render.pictures import parse_pictures
from embodied.scene.model import takeable
from embodied.seeds import stream
from embodied.world import World

WALKS, CHANGES, ROOMS, SPARE, WRITERS = 2, 2, 4, 12, 3
"""Walks through a house; its rooms that are visited twice; most rooms of each walk; times as many questions as are
wanted that are drawn; people who ask."""
WIDE, PASSING = (0.6, 0.8), 0.1
"""Openness of doors and drawers that are opened for walks, from and to; metres from them at which the walks pass."""
CHANGED, MOVED_BY, ABOVE = 2, 1.0, 0.2
"""Most things that are moved or taken away between two visits; how far from where they were, from the camera and from
each other they are put; how far above the ceiling is what is taken away, metres."""

Judge = Callable[[Sequence[VqaQuestion], int], np.ndarray]
"""A further blind model, of all types together: questions and a seed to (2, n) scores and how sure it is."""


@dataclass(frozen=True)
class VqaConfig:
    """All that a set of questions depends on: number of houses, and most questions, of each split; the area of a house,
    m2, and its storeys (None: drawn); how frames are drawn; seeds of the houses of a hidden split."""

    houses: Mapping[str, int]
    questions: Mapping[str, int]
    seed: int = 0
    area: tuple[float, float] = (45.0, 80.0)
    pictures: str = "fast"
    seeds: tuple[int, ...] = ()
    storeys: int | None = 1


def build_vqa(
    config: VqaConfig, folder: Path, cache: Path, network: Judge, *, workers: int = 1, watch: Watch | None = None
) -> "VqaData":
    """Film what is missing, ask, and write vqa.json last; the same command goes on after an interruption.

    Raises:
      LockedError: another process builds it.
      DatasetError: the folder holds another set.
    """
    folder, path, every = Path(folder).resolve(), Path(folder) / "config.json", dict[str, list[VqaQuestion]]()
    with locked(folder):
        if path.exists() and from_plain(VqaConfig, read_json(path)) != config:
            raise DatasetError(f"{folder} holds questions of other settings; choose another folder")
        write_json(path, dataclasses.asdict(config))
        names = [(split, i) for split, n in config.houses.items() for i in range(n)]
        for_each_unit(film_house, names, (config, folder, cache), workers=workers, watch=watch)
        scenes = scenes_of([folder / "houses" / "{}_{:04d}".format(*name) for name in names], cache)
        for split, wanted in config.questions.items():
            own = [s for s in scenes if s.walk.house.startswith(f"{split}_")]
            most = -(-SPARE * wanted // (len(TYPES) * len(own)))
            parts = joblib.Parallel(n_jobs=workers)(joblib.delayed(asked_about)(s, most, config.seed) for s in own)
            every[split] = [q for part in parts for q in part]
        unguessed(config, every, network, workers)
        for split, questions in every.items():
            save_lines(folder / f"questions_{split}.jsonl", questions)
        counts = {split: Counter(q.type for q in questions) for split, questions in every.items()}
        about = {"counts": counts, "digest": digest([to_json(q) for questions in every.values() for q in questions])}
        write_json(folder / "vqa.json", about, indent=1)
        return VqaData(folder)


def film_house(which: tuple[str, int], config: VqaConfig, folder: Path, cache: Path) -> str:
    """Make a house, light it and film its walks, unless its folder is there; returns its name."""
    name = "{}_{:04d}".format(*which)
    home, catalogue = folder / "houses" / name, load_catalogue(cache)
    if home.exists():
        return name
    home.parent.mkdir(parents=True, exist_ok=True)
    seed = config.seeds[which[1]] if config.seeds else config.seed
    settings = HouseConfig(area=config.area, storeys=config.storeys, special=())
    house, graph = make_dataset_house(seed, name, settings, catalogue)
    rng, pictures = stream(seed, "vqa", name), parse_pictures(config.pictures)
    house = lived_in(house, graph, catalogue, rng)
    with drafts(home.parent) as private, World(house, catalogue, graph, cache, pictures) as world:
        views = {p.id: view_of(world, p) for p in house.placements if p.object_class == CLASS}
        doors = dict.fromkeys(sorted(graph.closed), 1.0)  # nearly shut doors stand wide open
        free, walks = free_openness(house, catalogue), [tour(house, graph, ROOMS, rng=rng) for _ in range(WALKS)]
        for k, (path, stops) in enumerate(walks):
            world.show(Moment(openness=doors | opened(world, free, path, k, rng)))
            track, to = [*cameras(graph, path, stops, rng.uniform(-np.pi, np.pi))], private / name / f"walk_{k}"
            track += look_around(track[-1][0], track[-1][1] + TURN)[: rng.integers(12)]  # it ends with any view
            rooms, frames = tuple(graph.room_of_node[n] for n in stops), tuple(film(world, track, to))
            inside = {o: i for i, o in enumerate(world.drawn, 1) if o not in house.placement_by_id}
            inside = {o: inside[o] for o in sorted({o for f in frames for o in f.shares} & inside.keys())}
            walk = Walk(f"{name}_{k}", name, rooms, frames, (), world.moment.openness, inside, views)
            write_json(to / "walk.json", dataclasses.asdict(walk))
        rooms_of_movables = [house.placement_by_id[i].room for i in sorted(movable(house, catalogue))]
        stops = sorted(walks[-1][1], key=lambda n: -rooms_of_movables.count(graph.room_of_node[n]))
        for k, node in enumerate(stops[:CHANGES], WALKS):
            to = private / name / f"walk_{k}"
            walk = two_visits(world, node, doors, to, f"{name}_{k}", rng)
            write_json(to / "walk.json", dataclasses.asdict(walk))
        house.save(private / name / "house.json")
        to_matterport(graph, house, private / name / "connectivity.json")
        (private / name).rename(home)
    return name


def lived_in(house: House, graph: NavGraph, catalogue: Catalogue, rng: np.random.Generator) -> House:
    """The house with somebody in most rooms, and with doors and drawers left open by an untidy household."""
    untidy = dataclasses.replace(house, disorder=1.0)
    met = place_people(house, graph, catalogue, seed=house.seed)
    rooms = {graph.room_of_node[n]: n for n in rng.permutation(sorted(met)).tolist()}
    return add_people(left_open(untidy, catalogue).applied(house), met, rooms.values())


def opened(
    world: World, free: Mapping[str, float], path: Sequence[int], first: int, rng: np.random.Generator
) -> dict[str, float]:
    """How far doors and drawers of furniture are open during a walk along nodes, by name: those of every other thing,
    from the `first`, are open where they can and are in the way of neither another nor the walk; others are shut."""
    graph, rooms, openness = world.graph, {world.graph.room_of_node[n] for n in path}, dict[str, float]()
    taken = shapely.LineString(graph.positions[[*path, path[-1]], :2]).buffer(PASSING)
    wide = lambda p: [m for m in fronts_of(p, world.catalogue) if free[f"{p.id}/{m.name}"] > WIDE[0]]
    things = [(p, fronts) for p in world.house.placements if (fronts := wide(p))]
    for k, (p, fronts) in enumerate(things, first):
        if p.room in rooms:
            openness |= {f"{p.id}/{part}": 0.0 for part in openness_of(p.params)}
        for m in (fronts[i] for i in rng.permutation(len(fronts)) if k % 2 and p.room in rooms):
            by = round(float(rng.uniform(WIDE[0], min(WIDE[1], free[f"{p.id}/{m.name}"]))), 3)
            corners = np.concatenate([corners_of(m, x) for x in (0.0, by / 2, by)])
            way = shapely.MultiPoint(RigidPose.upright(p.position, p.yaw).points(corners)[:, :2]).convex_hull
            if not way.intersects(taken):
                openness[f"{p.id}/{m.name}"], taken = by, taken | way
    return openness


def two_visits(
    world: World, node: int, openness: Mapping[str, float], to: Path, name: str, rng: np.random.Generator
) -> Walk:
    """Film two looks around at a node, between which things of its room are moved or, small ones, taken away; the first
    look alone where there are none. `openness` is that of doors."""
    eye, room = world.graph.positions[node], world.graph.room_of_node[node]
    world.show(Moment(openness=openness))
    track = look_around(eye, rng.uniform(-np.pi, np.pi))
    frames, moved = [*film(world, track, to)], dict[str, RigidPose]()
    small, seen = takeable(world.house, world.catalogue), {i for f in frames for i in f.clear}
    storey = world.house.storey_of(world.house.room_by_id[room])
    for i in rng.permutation(sorted(seen & movable(world.house, world.catalogue))).tolist():
        p = world.house.placement_by_id[i]
        if p.room == room and p.parent not in moved and len(moved) < CHANGED:
            away = (*p.position[:2], storey.elevation + storey.height + ABOVE)  # where nobody sees it
            others = [eye, *(pose.position for pose in moved.values())]
            if spot := away if i in small else free_spot(world, p, others, rng):
                moved[i] = RigidPose.upright(spot, p.yaw)
    world.show(Moment(openness=openness, moved=moved))
    frames += film(world, track, to, len(frames)) if moved else []
    return Walk(name, world.name, (room,), tuple(frames), moved=tuple(moved), openness=openness)


def free_spot(world: World, p: Placement, others: Sequence[Any], rng: np.random.Generator) -> Triple | None:
    """Free floor of its room to which a thing can be moved, metres, MOVED_BY from where it was and from others."""
    floor = world.house.floor(world.house.room_by_id[p.room])
    low, high = np.reshape(floor.bounds, (2, 2))
    for x, y in rng.uniform(low, high, (100, 2)).tolist():
        reach = max(p.size[:2]) / 2
        around = [(x + reach * math.cos(a), y + reach * math.sin(a), others[0][2]) for a in range(6)]
        far = min(math.dist((x, y), at[:2]) for at in (p.position, *others)) > MOVED_BY
        if far and floor.contains(shapely.Point(x, y)) and all(map(world.is_free, around)):
            return x, y, p.position[2]
    return None


def scenes_of(homes: Iterable[Path], cache: Path) -> list[WalkScene]:
    """All walks through houses, each with what those of other houses show."""
    scenes, catalogue = list[WalkScene](), load_catalogue(cache)
    for home in homes:
        house, graph = House.load(home / "house.json"), from_matterport(home / "connectivity.json")
        walks = [from_plain(Walk, read_json(file)) for file in sorted(home.glob("walk_*/walk.json"))]
        now = [stocked(Moment(openness=w.openness).applied(house), catalogue) if w.openness else house for w in walks]
        scenes += [WalkScene(walk, shown, graph, catalogue) for walk, shown in zip(walks, now)]
    shown = [(s.walk.house, name) for s in scenes for name in sorted({p.object_class for p in s.things})]
    for scene in scenes:
        scene.elsewhere = [name for house, name in shown if house != scene.walk.house]
    return scenes


def unguessed(config: VqaConfig, left: dict[str, list[VqaQuestion]], network: Judge, workers: int) -> None:
    """Leave out what blind models guess that know the questions about other houses; keep as many of each type as there
    are, up to a number that all types of a split share."""
    of_type = [[q for questions in left.values() for q in questions if q.type == name] for name in TYPES]
    of_type = joblib.Parallel(n_jobs=workers)(joblib.delayed(narrowed)(qs, config.seed) for qs in of_type)
    for judge in (network, network, None):  # what is left out may keep models from guessing the rest
        kept = joblib.Parallel(n_jobs=workers)(joblib.delayed(thinned)(qs, config.seed) for qs in of_type)
        if judge:
            of_id = dict(zip((q.id for qs in kept for q in qs), judge([q for qs in kept for q in qs], config.seed).T))
            kept = [less_guessed(qs, *np.array([of_id[q.id] for q in qs]).T) for qs in kept if qs]
        for split in left:
            own = [[q for q in qs if q.walk.startswith(f"{split}_")] for qs in kept]
            most = math.inf if judge else config.questions[split]  # fewer at last: thinning needs many
            level = max(n for n in range(max(map(len, own)) + 1) if sum(min(len(qs), n) for qs in own) <= most)
            rng = stream(config.seed, "kept", split)
            left[split] = [qs[i] for qs in own for i in sorted(rng.permutation(len(qs))[:level].tolist())]
        of_type = [[q for questions in left.values() for q in questions if q.type == name] for name in TYPES]


def asked_about(scene: WalkScene, most: int, seed: int) -> list[VqaQuestion]:
    """Up to so many questions of every type about a walk, no answer too often, in the words of several people."""
    questions: dict[tuple[str, ...], VqaQuestion] = {}
    types = [name for name in TYPES if (name == CHANGE) == bool(scene.walk.moved)]
    for name, writer in itertools.product(types, range(WRITERS)):
        s, answers = scene.asked(name, stream(seed, "questions", scene.walk.name, name, writer)), Counter[str]()
        for q in TYPES[name](s):
            number = f"{scene.walk.name}_{name}_{len(questions)}"
            if answers.total() * WRITERS >= most:
                break
            if len({*q.options}) == len(q.options) and answers[q.answer] * WRITERS * max(len(q.options), 1) < most:
                answers[q.answer] += (about := (name, q.fact, *q.about)) not in questions
                questions.setdefault(about, dataclasses.replace(q, id=number))
    return [*questions.values()]


class VqaData:
    """A whole set of questions in a folder; `about` has counts by split and type, and the digest of all questions."""

    def __init__(self, folder: Path) -> None:
        """
        Raises:
          DatasetError: none, or not whole.
        """
        self.folder = Path(folder)
        if not (self.folder / "vqa.json").exists():
            raise DatasetError(f"{folder} is no whole set of questions; build it with `embodied dataset vqa --out DIR`")
        self.about: dict[str, Any] = read_json(self.folder / "vqa.json")

    def questions(self, split: str) -> list[VqaQuestion]:
        """
        Raises:
          DatasetError: no such split.
        """
        if split not in self.about["counts"]:
            raise DatasetError(f"unknown split {split!r}; {self.folder} has {list(self.about['counts'])}")
        return [*load_lines(self.folder / f"questions_{split}.jsonl", VqaQuestion)]

    def frames(self, walk: str, most: int = 10**6) -> list[Path]:
        """Pictures of a walk, at most so many, evenly spaced."""
        house, _, number = walk.rpartition("_")
        files = sorted((self.folder / "houses" / house / f"walk_{number}").glob("*.jpg"))
        return [files[round(i)] for i in np.linspace(0, len(files) - 1, min(most, len(files)))]

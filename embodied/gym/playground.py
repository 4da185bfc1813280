"""One house or one split, ready to play in: worlds, tasks, environments and cheap features."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from embodied.assets.cache import atomic_path, default_cache, digest
from embodied.assets.catalogue import load_catalogue
from embodied.assets.closure import code_digest
from embodied.assets.records import ROOM_KINDS
from embodied.assistants.route_system import WORDINGS, route_paths, worded
from embodied.datasets.build import make_dataset_house, with_people
from embodied.datasets.store import Dataset, TaskSet
from embodied.generate import HouseConfig
from embodied.gym.semantic_features import semantic_features
from embodied.gym.sensors import checked_observations
from embodied.interface import Assistant, Language, Route, SeenPlace, Task
from embodied.kinds.plugins import assistant_of
from embodied.kinds.task_kind import EnvInputs, TaskInputs, TaskKind, kind_named
from embodied.language import People, PlainLanguage
from embodied.render.pictures import PictureSettings, Unlit, parse_pictures
from embodied.world import World, makers, open_world

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue

FLAT_TASKS = 200
"""Tasks of a generated house."""
FLAT_AREA = (70.0, 110.0)
"""Size of a generated house, square metres: a flat, so that it is ready in seconds."""


@dataclass(frozen=True, eq=False)
class Playground(TaskSet):
    features: Mapping[str, np.ndarray]
    """(nodes, 36, D) float32 by world; empty when not asked for."""


@dataclass(frozen=True, eq=False)
class PlaygroundSettings:
    """How houses are opened, and what is played in them."""

    cache: str | Path | None = None
    worlds: Mapping[str, SeenPlace] | None = None
    """Worlds to play in; otherwise opened."""
    pictures: PictureSettings | str | None = None
    """How the houses are drawn: "unlit", "fast", ... as in embodied.open_world, or settings.

    By default as the data set's pictures are, and 'fast' for a generated flat."""
    observations: str | Sequence[str] = ("oracle",)
    """Some of embodied.gym.sensors.OBSERVATIONS: 'rgb', 'depth', 'ids', 'features', 'oracle'."""
    rules: Any = None
    """Rules of play, of the type of TaskKind.rules; the usual ones if None. VNLA: one of
    embodied.kinds.shipped.vnla.RULES_OF_PLAY. HARI: HariRules (costs, stack, sub-goals' length, horizon, a willing
    assistant). Ask: AskSettings."""
    rooms: bool = True
    """False: requests in a generated flat name no room (VNLA); those of a data set are as it was built."""
    assistant: Assistant | str | None = None
    """Who answers requests instead of the kind's own assistant: an Assistant, or 'module:Class' to import one."""

    @property
    def cached(self) -> Path:
        """The cache folder."""
        return Path(self.cache) if self.cache else default_cache()

    @property
    def seen(self) -> tuple[str, ...]:
        """The observations.

        Raises:
          ValueError: something that cannot be seen, nothing, or the same twice.
        """
        return checked_observations(self.observations) if self.observations else ()


def split_playground(kind: str, data: Path, split: str, settings: PlaygroundSettings) -> Playground:
    """A split of a data set.

    Raises:
      ValueError: the data set is of another kind, or pictures are wanted and it has none.
    """
    catalogue, whole = load_catalogue(settings.cached), Dataset(data)
    if whole.kind != kind:
        raise ValueError(f"{data} is a data set of {whole.kind!r}, not of {kind!r}")
    if (rooms := settings.rooms) != (built := whole.config.rooms):
        raise ValueError(f"{data} was built with rooms={built}, not {rooms}; say so, or build another data set")
    worlds = settings.worlds
    if worlds is None:
        names = whole.names(split)
        drawn = settings.pictures or pictures_of(whole, names, wanted=bool(set(settings.seen) - {"oracle"}))
        worlds = {n: whole.open_world(n, catalogue, settings.cached, drawn) for n in names}
    chosen = whole.split(split, worlds=worlds, rules=settings.rules, assistant=assistant_of(settings.assistant))
    return Playground(worlds, chosen.tasks, chosen.make_env, _oracle(worlds, catalogue, settings))


def flat_playground(kind: str, seed: int, settings: PlaygroundSettings) -> Playground:
    """One world (generated from `seed` unless given) and tasks in it.

    In given worlds, which need not have pictures, people speak plainly; elsewhere of what they see.
    """
    catalogue = load_catalogue(settings.cached)
    if settings.worlds is None:
        return houses_playground(kind, [(f"flat_{seed}", seed)], seed, settings, catalogue, FLAT_AREA, FLAT_TASKS)
    name, place = next(iter(settings.worlds.items()))
    tasks, routes = _tasks_in(kind_named(kind), place, None, seed, PlainLanguage(), settings.rooms, FLAT_TASKS, None)
    return _playground(kind, settings.worlds, tasks, {name: routes}, settings, catalogue)


def houses_playground(
    kind: str,
    houses: Iterable[tuple[str, int]],
    seed: int,
    settings: PlaygroundSettings,
    catalogue: Catalogue,
    area: tuple[float, float],
    each: int,
    part: str | None = None,
) -> Playground:
    """Generated houses with `each` tasks in every one.

    Args:
      houses: names and seeds.
      seed: of tasks and routes.
      area: smallest and largest house, square metres.
      part: of the pool of tasks; that of unseen houses if None.
    """
    known, language = kind_named(kind), People(tries=1)
    drawn = parse_pictures(settings.pictures or ("fast" if set(settings.seen) - {"oracle"} else "unlit"))
    worlds, tasks, routes = dict[str, SeenPlace](), list[Task](), dict[str, Sequence[Route]]()
    for name, house_seed in houses:
        house, graph = make_dataset_house(house_seed, name, HouseConfig(area=area), catalogue)
        paths = None
        if known.people:
            house, paths = with_people(house, graph, catalogue, house_seed, "test")
        world = open_world(house, catalogue, settings.cached, graph=graph, pictures=drawn)
        if drawn.quality is not None:
            world.baked(progress=True)
        more, routes[name] = _tasks_in(known, world, paths, seed, language, settings.rooms, each, part)
        worlds[name], tasks = world, [*tasks, *more]
    return _playground(kind, worlds, tasks, routes, settings, catalogue)


def _tasks_in(
    kind: TaskKind,
    place: SeenPlace,
    paths: list[tuple[int, ...]] | None,
    seed: int,
    language: Language,
    rooms: bool,
    count: int,
    part: str | None,
) -> tuple[list[Task], Sequence[Route]]:
    """Tasks in a house that nobody learned in, and its routes, where the kind has such; along `paths` if given."""
    routes: Sequence[Route] = ()
    if kind.routes:
        paths = paths or route_paths(place.graph, place.house.name, seed=seed, house_split="test")
        routes = worded(place, paths, WORDINGS["test"], seed=seed, language=language)
    part = part or kind.unseen_part
    return kind.tasks(TaskInputs(place, routes, seed, language, rooms), [(part, count)])[part], routes


def _playground(
    kind: str,
    worlds: Mapping[str, SeenPlace],
    tasks: Sequence[Task],
    routes: Mapping[str, Sequence[Route]],
    settings: PlaygroundSettings,
    catalogue: Catalogue,
) -> Playground:
    known, routes_of, assistant = kind_named(kind), lambda name: routes.get(name, ()), assistant_of(settings.assistant)
    make_env = known.environments(EnvInputs(worlds, routes_of, rules=settings.rules, assistant=assistant))
    timed = known.tasks_under(tasks, worlds, settings.rules)
    return Playground(worlds, timed, make_env, _oracle(worlds, catalogue, settings))


def _oracle(
    worlds: Mapping[str, SeenPlace], catalogue: Catalogue, settings: PlaygroundSettings
) -> Mapping[str, np.ndarray]:
    if "oracle" not in settings.seen:
        return {}
    return {name: seen_features(w, catalogue, settings.cached) for name, w in worlds.items()}


def pictures_of(data: Dataset, names: Sequence[str], *, wanted: bool) -> PictureSettings:
    """How the pictures that a data set holds were drawn.

    Args:
      wanted: whether it is an error that there are none.

    Raises:
      ValueError: none, not of all houses, or not in one way, though they are wanted.
    """
    held = {n: drawn for n in names if (drawn := data.drawn_pictures(n)) is not None}
    again = f"`embodied dataset {data.kind} --out {data.folder} ... --pictures fast`"
    if wanted and len(held) < len(names):
        raise ValueError(
            f"{data.folder} has pictures of {len(held)} of its {len(names)} houses here; draw them with "
            f"{again}, or choose observations='oracle'"
        )
    if wanted and len(ways := {(p.word, p.size) for p in held.values()}) > 1:
        raise ValueError(f"the pictures in {data.folder} are of several kinds ({sorted(ways)}); finish {again}")
    return next(iter(held.values()), Unlit())


def seen_features(world: SeenPlace, catalogue: Catalogue, cache: Path) -> np.ndarray:
    """The semantic features of a world over all classes of the catalogue, kept in the cache for a house at rest."""
    classes = tuple(catalogue.classes)
    if isinstance(world, World) and not world.moment.is_rest:
        return semantic_features(world, classes, ROOM_KINDS)
    others = ("embodied.render.sightings", "embodied.gym.semantic_features")
    code = code_digest(*makers(Unlit()), *others)
    key = digest(world.house.digest, np.asarray(world.graph.positions).tolist(), classes, code)
    path = cache / "semantic" / f"{key[:32]}.npy"
    with contextlib.suppress(OSError, ValueError, EOFError):  # absent or damaged: made anew
        known = np.load(path, allow_pickle=False)
        if known.ndim == 3 and known.shape[::2] == (len(world.graph.positions), len(classes) + len(ROOM_KINDS)):
            return known
    features = semantic_features(world, classes, ROOM_KINDS)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        np.save(file, features, allow_pickle=False)
    return features

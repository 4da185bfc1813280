"""More described paths of a house than its data set holds, and its paths in the words of some people only."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from pathlib import Path
from typing import TypeVar

from assets.cache import digest
from assets.catalogue import load_catalogue
from assets.closure import code_digest
from embodied.assistants.route_system import RouteConfig, sampled_paths, worded
from embodied.datasets.store import Dataset
from embodied.interface import TURNS, FollowRoute, Route, SeenPlace, Task
from embodied.language import People
from embodied.records import load_lines, save_lines
from embodied.seeds import stream

T = TypeVar("T")


def more_routes(
    source: Dataset, name: str, count: int, *, seed: int, cache: Path, novelty: str | None = None
) -> list[Route]:
    """`count` paths of a house that the data set lacks, of the same lengths, each worded three times by people of a
    novelty (everybody if None); fewer where the house has fewer. They are kept in the cache."""

    def make() -> Iterable[Route]:
        known = {route.path for route in source.routes(name)}
        world = source.open_world(name, load_catalogue(cache), cache)
        rng = stream(seed, "nav", "more", name)
        every = sampled_paths(world.graph, len(world.graph.positions) ** 2, rng=rng, config=RouteConfig())
        paths = [p for p in every if p not in known][:count]
        return worded(world, paths, ("train_seen",) * 3, seed=seed, language=People(novelty=novelty))

    return _kept(cache, [source.digest, name, count, seed, *filter(None, [novelty])], Route, make)


def said_by(novelty: str, tasks: Sequence[Task], source: Dataset, *, cache: Path) -> list[Task]:
    """Tasks of following routes, house by house, each instruction said anew by somebody of a novelty. They are kept in
    the cache."""

    def said(world: SeenPlace, task: Task) -> Task:
        assert isinstance(task.goal, FollowRoute), "a route has words"
        yaw, rng = task.start.turn * 2 * math.pi / TURNS, stream(0, "said by", novelty, task.id)
        return dataclasses.replace(task, request=People(novelty=novelty).route(world, task.goal.path, yaw, rng=rng))

    found: list[Task] = []
    for name, many in groupby(tasks, lambda t: t.world):
        mine = list(many)

        def make(name: str = name, mine: list[Task] = mine) -> Iterable[Task]:
            world = source.open_world(name, load_catalogue(cache), cache)
            return [said(world, task) for task in mine]

        found += _kept(cache, [source.digest, [t.id for t in mine], novelty], Task, make)
    return found


def _kept(cache: Path, about: Sequence[object], kind: type[T], make: Callable[[], Iterable[T]]) -> list[T]:
    """What `make` makes, from the cache if it is there."""
    code = code_digest("embodied.language.voice", "embodied.assistants.route_system")
    path = cache / "paths" / f"{digest([*about, code])[:32]}.jsonl"
    if not path.exists():
        save_lines(path, make())
    return list(load_lines(path, kind))

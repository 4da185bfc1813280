"""More described paths of a house than its data set holds, and its paths in the words of some people only."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import TypeVar

from embodied.assets.cache import digest
from embodied.assets.catalogue import load_catalogue
from embodied.assets.closure import code_digest
from embodied.assistants.route_system import sampled_paths, worded
from embodied.datasets.store import Dataset
from embodied.interface import TURNS, FollowRoute, Route, Task
from embodied.language import People
from embodied.novelty import check_novelty
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
        every = sampled_paths(world.graph, len(world.graph.positions) ** 2, rng=rng)
        paths = [p for p in every if p not in known][:count]
        return worded(world, paths, ("train_seen",) * 3, seed=seed, language=People(novelty=novelty))

    return _kept(cache, [source.digest, name, count, seed, *filter(None, [novelty])], Route, make)


class SaidBy(Dataset):
    """A data set in which somebody of a novelty describes each route anew, and says each task of following one anew.

    The words are kept in the cache.
    """

    def __init__(self, novelty: str, source: Dataset, *, cache: Path) -> None:
        """
        Raises:
          ValueError: an unknown novelty.
        """
        check_novelty(novelty)
        vars(self).update(vars(source))  # what was read need not be read again
        self.novelty, self.source, self.cache = novelty, source, cache

    @property
    def kind(self) -> str:
        return self.source.kind

    @property
    def digest(self) -> str:
        return digest([self.source.digest, self.novelty, _code()])

    def routes(self, name: str) -> tuple[Route, ...]:
        return tuple(self._said(name, self.source.routes(name)))

    def tasks(self, split: str) -> tuple[Task, ...]:
        tasks = self.source.tasks(split)
        return tuple(self._asked(tasks)) if self.task_kind.from_routes else tasks

    def _asked(self, tasks: Iterable[Task]) -> Iterator[Task]:
        for name, many in groupby(tasks, lambda task: task.world):
            own_path = list(many)
            words = self._said(name, [way_of(task) for task in own_path])
            yield from (dataclasses.replace(t, request=r.instruction) for t, r in zip(own_path, words, strict=True))

    def _said(self, name: str, routes: Sequence[Route]) -> list[Route]:
        people, novelty = People(novelty=self.novelty), self.novelty

        def make() -> Iterator[Route]:
            world = self.source.open_world(name, load_catalogue(self.cache), self.cache)
            for route in routes:
                yaw, rng = route.turn * 2 * math.pi / TURNS, stream(0, "said by", novelty, route.id)
                yield dataclasses.replace(route, instruction=people.route(world, route.path, yaw, rng=rng))

        about = [self.source.digest, "said by", novelty, [route.id for route in routes]]
        return _kept(self.cache, about, Route, make)


def way_of(task: Task) -> Route:
    """The route that a task is to follow."""
    assert isinstance(task.goal, FollowRoute), "a route has words"
    return Route(task.id, task.goal.path, task.start.turn, 0, task.request)


def _kept(cache: Path, about: Sequence[object], kind: type[T], make: Callable[[], Iterable[T]]) -> list[T]:
    """The product of `make`, from the cache if it is there."""
    path = cache / "paths" / f"{digest([*about, _code()])[:32]}.jsonl"
    if not path.exists():
        save_lines(path, make())
    return list(load_lines(path, kind))


def _code() -> str:
    return code_digest("embodied.language.people_language", "embodied.assistants.route_system")

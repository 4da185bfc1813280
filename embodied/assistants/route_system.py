"""ANNA's route system Xi: which stretches of a house people can talk about (dissertation 4.2.2)."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

import numpy as np

from embodied.interface import TURNS, Language, PlaceT, Route
from embodied.seeds import stream

if TYPE_CHECKING:
    from embodied.navigation.graph import NavGraph

ROUTE_TRIES = 12
"""How often a wording is asked for again when the house already has it."""

WORDINGS: Mapping[str, tuple[str, ...]] = {
    "train": ("train_seen", "train_seen", "train_unseen"),
    "val": ("val", "val", "val"),
    "test": ("test", "test", "test"),
}
"""Splits of a path's three wordings, by the split of its house. In training houses one wording of
every path is held out, which is what Table 4.2's 8,586 : 4,287 amounts to (docs/sources.md, S15)."""


ROUTES_PER_NODE = 211 / 125
"""211 routes connect 125 locations per environment (4.2.2); a route is a path with one wording."""
FEWEST_EDGES, MOST_EDGES, SHORTEST = 4, 6, 5.0
"""Of a sampled path, the last in metres, as in Room-to-Room."""


def sampled_paths(
    graph: NavGraph, count: int, *, rng: np.random.Generator, starts: Collection[int] | None = None
) -> list[tuple[int, ...]]:
    """`count` different shortest paths of 4 to 6 edges between random nodes, as in Room-to-Room.

    Fewer when the house has fewer; in a house too small for any, the longest paths it has.

    Args:
      starts: where routes may begin: nodes at which somebody can be met. Where no path can, all may.
    """
    hops = graph.hops
    fits = (hops >= FEWEST_EDGES) & (hops <= MOST_EDGES) & (np.asarray(graph.distance) >= SHORTEST)
    if not fits.any():
        fits = hops == hops.max()
    if starts is not None:
        met = np.isin(np.arange(len(hops)), list(starts))[:, None]
        fits = fits & met if (fits & met).any() else fits
    pairs = np.argwhere(fits)
    chosen = rng.permutation(len(pairs))[:count]
    return [tuple(int(v) for v in graph.path(int(pairs[i, 0]), int(pairs[i, 1]))) for i in chosen]


def route_paths(
    graph: NavGraph, name: str, *, seed: int, house_split: str, starts: Collection[int] | None = None
) -> list[tuple[int, ...]]:
    """The sampled paths of the house `name`: so many that each can be worded once per wording of its split."""
    count = max(1, round(ROUTES_PER_NODE * len(graph.positions) / len(WORDINGS[house_split])))
    return sampled_paths(graph, count, rng=stream(seed, "routes", name), starts=starts)


def build_routes(world: PlaceT, *, seed: int, language: Language[PlaceT], house_split: str) -> tuple[Route, ...]:
    """The sampled route system of one house, each path worded three times."""
    paths = route_paths(world.graph, world.house.name, seed=seed, house_split=house_split)
    return worded(world, paths, WORDINGS[house_split], seed=seed, language=language)


def worded(
    world: PlaceT, paths: list[tuple[int, ...]], wordings: tuple[str, ...], *, seed: int, language: Language[PlaceT]
) -> tuple[Route, ...]:
    """Routes along the `paths` that `language` has words for: a random first heading, a text per wording, all unalike
    if it can be helped."""
    used: set[str] = set()
    routes = []
    for p, path in enumerate(paths):
        turn = int(stream(seed, "route", world.house.name, p).integers(TURNS))
        for k, split in enumerate(wordings):
            rng = stream(seed, "route", world.house.name, p, k)
            for _ in range(ROUTE_TRIES):
                text = language.route(world, path, turn * 2 * math.pi / TURNS, rng=rng)
                if text not in used:
                    break
            if text:
                used.add(text)
                routes.append(Route(f"{world.house.name}_{p}_{k}", path, turn, 0, text, split))
    return tuple(routes)

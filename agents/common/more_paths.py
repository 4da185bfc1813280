"""More described paths of a house than its data set holds."""

from __future__ import annotations

from pathlib import Path

from embodied.assets.cache import digest
from embodied.assets.catalogue import load_catalogue
from embodied.assets.closure import code_digest
from embodied.assistants.route_system import sampled_paths, worded
from embodied.datasets.store import Dataset
from embodied.interface import Route
from embodied.language import People
from embodied.records import load_lines, save_lines
from embodied.seeds import stream


def more_routes(source: Dataset, name: str, count: int, *, seed: int, cache: Path) -> list[Route]:
    """`count` paths of a house that the data set lacks, of the same lengths, each worded three times; fewer where the
    house has fewer. They are kept in the cache."""
    code = code_digest("embodied.language.people_language", "embodied.assistants.route_system")
    path = cache / "paths" / f"{digest([source.digest, name, count, seed, code])[:32]}.jsonl"
    if not path.exists():
        known = {route.path for route in source.routes(name)}
        world = source.open_world(name, load_catalogue(cache), cache)
        rng = stream(seed, "nav", "more", name)
        every = sampled_paths(world.graph, len(world.graph.positions) ** 2, rng=rng)
        paths = [p for p in every if p not in known][:count]
        save_lines(path, worded(world, paths, ("train_seen",) * 3, seed=seed, language=People()))
    return list(load_lines(path, Route))

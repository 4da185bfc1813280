"""A tiny data set over houses made by hand, built in a second; and the bytes of a folder."""

from __future__ import annotations

import dataclasses

from hand_worlds import grid_world, thing

from embodied.datasets.build import DatasetConfig, build_dataset
from embodied.datasets.store import Dataset


def hand_house(seed, name, config, catalogue):
    """The grid world with forty more things, one of each class, ten to a room."""
    world = grid_world(8, name=name)
    rooms = {r.id: r.polygon[0] for r in world.house.rooms}
    more = tuple(
        thing(f"thing{k}", 1, room, x + 1 + (k * 1.7) % 6.5, y + 1 + (k * 2.3) % 6.5)
        for k, (room, (x, y)) in ((k, sorted(rooms.items())[k % 4]) for k in range(40))
    )
    return dataclasses.replace(world.house, placements=world.house.placements + more), world.graph


def small_house(seed, name, config, catalogue):
    """Sixteen nodes and few things: quickly drawn."""
    world = grid_world(4, name=name)
    return world.house, world.graph


def build(folder, cache, kind="hanna", workers=1, size="tiny", make_house=hand_house, **options):
    config = DatasetConfig(kind, size, seed=4, language="plain", **options)
    build_dataset(config, folder, cache, workers=workers, make_house=make_house)
    return Dataset(folder)


def content(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}

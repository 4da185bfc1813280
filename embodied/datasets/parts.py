"""What one house gives to each split: which tasks of its pools, and what is held out."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence

from embodied.envs.make import look_of
from embodied.interface import Language, Place, Route, Task
from embodied.seeds import stream
from embodied.tasks.ask import ask_pool, ask_tasks
from embodied.tasks.find import Pool, find_pool, find_task
from embodied.tasks.hanna import hanna_pool, hanna_task
from embodied.tasks.hari import HARI, PRETRAINING, hari_pool, hari_task
from embodied.tasks.vln import vln_task
from embodied.tasks.vnla import VnlaConfig, vnla_pool, vnla_task
from embodied.teachers.vnla import VnlaTeacher

SIXTEENTHS = {"main": range(14), "val": range(14, 15), "test": range(15, 16)}
"""Positions of a pool, modulo 16, that belong to each part: seen splits hold out tasks (4.2.5)."""
HELD_OBJECTS = 0.15
"""Share of object classes that training never asks for, for validation and for test each (HARI)."""
WORDING_OF = {"main": ("train_seen", "val", "test"), "val": ("train_unseen",), "test": ("train_unseen",)}


def part_tasks(
    kind: str,
    world: Place,
    routes: Sequence[Route],
    parts: Sequence[tuple[str, int]],
    *,
    seed: int,
    language: Language,
    rooms: bool = True,
) -> dict[str, list[Task]]:
    """Up to `n` tasks of one house for each (part, n) of `parts`; fewer where its pool is smaller.

    Args:
      rooms: whether requests name the room (VNLA).

    Raises:
      ValueError: an unknown kind.
    """
    if kind == "vln":
        return {part: _vln(world, routes, part, n) for part, n in parts}
    if kind == "ask":
        asked = ask_pool(world, look_of(getattr(world, "catalogue", None)), seed=seed)
        return {part: ask_tasks(asked, n, seed=seed) for part, n in parts}
    if kind == "hari":
        return {part: _hari(world, part, n, seed=seed, language=language) for part, n in parts}
    if kind == "find":
        pool, make = find_pool(world, seed=seed), lambda i: find_task(pool, i, seed=seed, language=language)
    elif kind == "hanna":
        pool, make = hanna_pool(world, seed=seed), lambda i: hanna_task(pool, i, seed=seed, language=language)
    elif kind == "vnla":
        plan, config = VnlaTeacher().plan(world), VnlaConfig(by_room=rooms)
        pool = vnla_pool(world, plan, seed=seed, config=config)
        make = lambda i: vnla_task(pool, i, world, plan, seed=seed, language=language, config=config)
    else:
        raise ValueError(f"unknown kind of task {kind!r}")
    return {part: [make(i) for i in range(len(pool)) if i % 16 in SIXTEENTHS[part]][:n] for part, n in parts}


def _vln(world: Place, routes: Sequence[Route], part: str, n: int) -> list[Task]:
    """Held-out wordings serve the seen splits: every other path validation, the rest test."""
    paths = {p: k for k, p in enumerate(dict.fromkeys(r.path for r in routes))}
    mine = [
        r for r in routes if r.split in WORDING_OF[part] and (part == "main" or paths[r.path] % 2 == (part == "test"))
    ]
    return [vln_task(world.house.name, r) for r in mine[:n]]


def _hari(world: Place, part: str, n: int, *, seed: int, language: Language) -> list[Task]:
    """HARI's conditions (4.3.5): unseen start room, unseen object class, unseen environment."""
    pool = hari_pool(world, seed=seed, config=PRETRAINING if part.startswith("pretrain") else HARI)
    chosen = itertools.islice((i for i in range(len(pool)) if _belongs(pool, i, part, world, seed)), n)
    return [hari_task(pool, i, seed=seed, language=language) for i in chosen]


def _belongs(pool: Pool, i: int, part: str, world: Place, seed: int) -> bool:
    if part == "main_unseen":
        return True
    goal, start = pool.classes[int(pool.pairs[i, 0])], int(pool.pairs[i, 1])
    held_object = object_part(goal.object_class, seed=seed)
    held_room = room_part(world, str(world.graph.room_of_node[start]), seed=seed)
    if part.startswith("start_"):
        return held_object is None and held_room == part.removeprefix("start_")
    if part.startswith("object_"):
        return held_room is None and held_object == part.removeprefix("object_")
    if held_object is not None or held_room is not None:
        return False
    return part == "main" or (i % 32 == 31) == (part == "pretrain_val")


@functools.cache
def object_part(object_class: str, *, seed: int) -> str | None:
    """'val' or 'test' for object classes that training never asks for, the same in all houses; else None."""
    draw = stream(seed, "held object", object_class).random()
    return "val" if draw < HELD_OBJECTS else "test" if draw < 2 * HELD_OBJECTS else None


def room_part(world: Place, room: str, *, seed: int) -> str | None:
    """'val' or 'test' for the one room each of a house in which training never starts; else None."""
    rooms = sorted({str(r) for r in world.graph.room_of_node})
    if len(rooms) < 4:
        return None
    order = stream(seed, "held room", world.house.name).permutation(len(rooms))
    return {rooms[order[0]]: "val", rooms[order[1]]: "test"}.get(room)

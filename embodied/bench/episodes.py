"""Benchmarks of play: environment steps with help, on one core."""

from __future__ import annotations

import functools
from collections.abc import Iterator

from embodied.assets.catalogue import Catalogue
from embodied.assistants.route_system import build_routes
from embodied.bench.timing import Measure, measure
from embodied.datasets.build import DatasetConfig, make_dataset_house
from embodied.datasets.store import StoredPlace
from embodied.envs.base import HelpEnv
from embodied.generate import HouseConfig
from embodied.interface import Ask, Intention, Move, Observation, Task
from embodied.kinds.task_kind import EnvInputs, TaskInputs, kind_named
from embodied.language.plain_language import PlainLanguage

KINDS_PLAYED = ("find", "hanna")
"""HANNA's steps include the assistant's replies."""
TASKS_PLAYED = 60


def plays(catalogue: Catalogue, seed: int) -> Iterator[Measure]:
    """Environment steps per second of every kind of task, with caches warm, no pixels."""
    language = PlainLanguage()
    for kind in KINDS_PLAYED:
        known = kind_named(kind)
        house, graph = make_dataset_house(seed, "bench", HouseConfig(area=DatasetConfig(kind).area), catalogue)
        place = StoredPlace(house, graph)
        routes = build_routes(place, seed=seed, language=language, house_split="test") if known.routes else ()
        tasks = known.tasks(TaskInputs(place, routes, seed, language), [(known.unseen_part, TASKS_PLAYED)])[
            known.unseen_part
        ]
        env = known.environments(EnvInputs({"bench": place}, {"bench": routes}.__getitem__))()
        counts = walk(env, tasks)
        asked = counts[1] / counts[0]
        yield measure(
            f"{kind} steps, {100 * asked:.0f} % requests",
            functools.partial(walk, env, tasks),
            "1/s",
            repeats=7,
            per=counts[0],
        )


def walk(env: HelpEnv, tasks: list[Task]) -> tuple[int, int]:
    """Play tasks by a fixed rule that asks at every fifth step where it can; (steps, requests) taken."""
    steps = requests = 0
    for task in tasks:
        o: Observation | None = env.reset(task)
        while o is not None:
            help_wanted = o.can_ask and o.time % 5 == 4 and o.time_on_task
            action = Ask(o.can_ask[0] if o.can_ask[0] is Intention.HELP else o.can_ask[-1]) if help_wanted else _move(o)
            requests += isinstance(action, Ask)
            o = env.step(action)
            steps += 1
    return steps, requests


def _move(o: Observation) -> Move:
    choice = o.time % len(o.candidates)
    return Move(choice if o.candidates.allowed[choice] else 1)

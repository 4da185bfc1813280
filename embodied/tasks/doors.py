"""Tasks with closed doors: which of the doors of a house are closed when one begins."""

from __future__ import annotations

import dataclasses

from embodied.interface import FollowRoute, Language, Place, SeenPlace, Task
from embodied.navigation.doors import closable_doors
from embodied.seeds import stream


def with_closed_doors(task: Task, place: Place, share: float, *, seed: int) -> Task:
    """The task, of any kind, with doors closed at its start.

    Args:
      share: probability of each door that can be closed, 0 to 1. One in whose way a viewpoint stands cannot.
      seed: the doors of a task depend on it and on the task's id; those of a smaller share are among those of a larger.
    """
    doors = closable_doors(place.house, place.graph)
    drawn = stream(seed, "closed doors", task.id).random(len(doors))
    return dataclasses.replace(task, closed=tuple(d for d, x in zip(doors, drawn, strict=True) if x < share))


def told_of_doors(task: Task, place: SeenPlace, language: Language[SeenPlace], *, seed: int) -> Task:
    """A task of following a route in new words, which say where to open a door that is closed at the start."""
    assert isinstance(task.goal, FollowRoute), "others say no way"
    rng = stream(seed, "words for closed doors", task.id)
    now = place.with_doors(dict.fromkeys(task.closed, 0.0))
    return dataclasses.replace(task, request=language.route(now, task.goal.path, task.start.yaw, rng=rng))

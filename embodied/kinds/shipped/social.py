"""Social: go to a point of a house in which people walk to and fro, without touching anybody (Social-HM3D, Falcon).

After Gong et al. 2024 (arXiv 2409.13244), whose robot nobody sees, either. On the graph a move takes a second a
metre. embodied/SocialNav-v0 plays the same tasks with a body; in FollowNav-v0 it follows the first of the people.
"""

import functools
import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from embodied.envs.base import HelpEnv
from embodied.envs.continuous import CONTACT, PERSONAL
from embodied.interface import TURNS, AmongPeople, Pose, Task
from embodied.kinds import task_kind
from embodied.navigation.free_space import EYE
from embodied.navigation.graph import NavGraph
from embodied.people.errands import Walks
from embodied.people.strolls import Crowd, draw_strolls, who_is_about
from embodied.seeds import stream

POOL, MOST_PEOPLE, STEPS = 640, 3, 40
FAR, STRIDE, EYES = (3.0, 20.0), 0.25, (0.0, 0.0, EYE)
"""Least and most metres from a start to its goal, and between the places of a move at which people are looked at; from
the floor to a viewpoint."""


def tasks(inputs: task_kind.TaskInputs, parts: task_kind.Parts) -> task_kind.PartTasks:
    """Nothing in a house that is too small."""
    world, graph, house = inputs.world, inputs.world.graph, inputs.world.house
    level, walks = np.flatnonzero(graph.positions[:, 2] < house.storeys[0].elevation + 2.0), Walks(house)
    metres = np.asarray(graph.distance)[np.ix_(level, level)]
    pairs = level[np.argwhere((metres >= FAR[0]) & (metres <= FAR[1]))]

    def task(i: int) -> Task:
        name = f"{house.name}/social/{i}"
        rng = stream(inputs.seed, "task", name)
        (start, goal), turn = pairs[int(rng.integers(len(pairs)))].tolist(), int(rng.integers(TURNS))
        here, there = graph.positions[[start, goal]] - EYES
        who = who_is_about(house, int(rng.integers(1, MOST_PEOPLE + 1)), rng=rng)
        people = AmongPeople(draw_strolls(walks, who, here, rng=rng))
        far, aside = math.dist(here, there), math.atan2(*(there - here)[1::-1]) - turn * math.tau / TURNS
        words = f"go to the place {far * math.cos(aside):.1f} m ahead and {far * math.sin(aside):.1f} m to the left"
        return Task(name, "social", world.name, Pose(start, turn), people, (goal,), words, 0.0, STEPS)

    return task_kind.parts_of_pool(POOL if len(pairs) else 0, task, parts)


def approaches(task: Task, graph: NavGraph, nodes: Sequence[int]) -> np.ndarray:
    """(n,) metres to the nearest person along the moves between nodes, STRIDE by STRIDE."""
    assert isinstance(task.goal, AmongPeople), "tasks of this kind"
    crowd, near = Crowd(task.goal.strolls), list[float]()
    for a, b in pairwise(graph.positions[list(nodes)] - EYES):
        way = np.linspace(a, b, math.ceil(math.dist(a, b) / STRIDE) + 1)
        near += [crowd.go_on(math.dist(p, q), p, q) for p, q in pairwise(way)]
    return np.array(near)


class SocialEnv(HelpEnv):
    """Touching somebody ends an episode."""

    def _moved(self) -> None:
        if (approaches(self.task, self.world.graph, (*self.so_far().nodes, self.pose.node)) < CONTACT).any():
            self.ended = "limit"


came: task_kind.Measure = lambda e, g: float(approaches(e.task, g, e.nodes).min(initial=math.inf))
"""Metres to the nearest person on the whole way."""
SOCIAL = task_kind.register_kind(
    task_kind.TaskKind(
        name="social",
        title="Social",
        tasks=tasks,
        environment=lambda inputs: functools.partial(SocialEnv, inputs.worlds),
        success=lambda e, g: float(e.nodes[-1] in e.task.goal_nodes and came(e, g) >= CONTACT),
        metrics={
            "personal space": task_kind.Metric(
                lambda e, g: float((approaches(e.task, g, e.nodes) >= PERSONAL).sum()),
                percent=True,
                per=lambda e, g: float(len(approaches(e.task, g, e.nodes))),
            ),
            "human collision": task_kind.Metric(lambda e, g: float(came(e, g) < CONTACT), percent=True, share=True),
        },
        columns=("success", "spl", "personal space", "human collision", "steps"),
        splits=None,
        pictures=False,
        story=task_kind.StoryStyle(dialogue=False),
    )
)

"""A kind of task of your own: visit three rooms in any order, then say that you are done.

    cd examples
    embodied dataset my_task:VISIT --out DATA --houses 2 --pictures none
    embodied evaluate my_task:VISIT --data DATA
    python -c "import gymnasium; gymnasium.make('my_task:embodied/Visit-v0', data='DATA', observations='oracle')"

docs/tutorials/your_task.md explains it line by line.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from embodied.envs.base import HelpEnv
from embodied.interface import TURNS, Extras, GoTo, Pose, Task
from embodied.kinds.task_kind import ArraySpec, ExtraArrays, Metric, StoryStyle, TaskKind, parts_of_pool, register_kind
from embodied.seeds import stream

NAME = "my_task:VISIT"
ROOMS = 3

# What is asked: every choice of three rooms, from every viewpoint elsewhere, in a seeded order --------------------


def tasks(inputs, parts):
    house, room_of_node = inputs.world.house, inputs.world.graph.room_of_node
    kinds = [room.kind for room in house.rooms]
    rooms = [r.id for r in house.rooms if kinds.count(r.kind) == 1 and r.id in room_of_node]  # one 'kitchen' only
    starts = range(len(room_of_node))
    pool = [(c, v) for c in itertools.combinations(rooms, ROOMS) for v in starts if room_of_node[v] not in c]
    order = stream(inputs.seed, "pool", NAME, house.name).permutation(len(pool))

    def task(i):
        chosen, start = pool[order[i]]
        turn = int(stream(inputs.seed, "task", NAME, house.name, i).integers(TURNS))
        names = [house.room_by_id[room].kind.replace("_", " ") for room in chosen]
        return Task(
            id=f"{house.name}/visit/{i}",
            kind=NAME,
            world=house.name,
            start=Pose(start, turn),
            goal=GoTo(rooms=chosen),
            goal_nodes=tuple(v for v in starts if room_of_node[v] in chosen),
            request=f"visit {', '.join(f'the {name}' for name in names)}",
            radius=0.0,
            horizon=60,
        )

    return parts_of_pool(len(pool), task, parts)


# How it is played: as plain navigation, but the agent is told how many rooms are left -----------------------------


@dataclass(frozen=True)
class RoomsLeft(Extras):
    rooms: int

    def lines(self, turn):
        return (f"rooms left to visit: {self.rooms}",)


class VisitEnv(HelpEnv):
    def _begin(self):
        self._left = set(self.task.goal.rooms)
        self._moved()

    def _moved(self):
        room_of_node = self.world.graph.room_of_node
        self._left.discard(room_of_node[self.pose.node])
        self.targets = tuple(v for v, r in enumerate(room_of_node) if r in self._left) or (self.pose.node,)

    def _extras(self):
        return RoomsLeft(len(self._left))


arrays = ExtraArrays(
    specs=lambda candidates, rules: {"rooms_left": ArraySpec((), 0, ROOMS, "int64")},
    encode=lambda observation, specs: {"rooms_left": np.int64(observation.extras.rooms)},
)

# How it is judged and told ----------------------------------------------------------------------------------------


def visited(episode, graph):
    """Share of the rooms that were visited."""
    return len({graph.room_of_node[v] for v in episode.nodes} & set(episode.task.goal.rooms)) / ROOMS


def shortest(episode, graph):
    """Metres of the shortest way through all rooms, in the best order."""
    lengths = []
    for order in itertools.permutations(episode.task.goal.rooms):
        metres = graph.distance[episode.task.start.node]
        for room in order:
            nodes = [v for v in episode.task.goal_nodes if graph.room_of_node[v] == room]
            metres = (metres[nodes][:, None] + graph.distance[nodes]).min(axis=0)
        lengths.append(metres.min())
    return float(min(lengths))


VISIT = register_kind(
    TaskKind(
        name=NAME,
        title="Visit",
        tasks=tasks,
        environment=lambda inputs: lambda: VisitEnv(inputs.worlds),
        success=lambda episode, graph: float(visited(episode, graph) == 1.0),
        needs_stop=True,
        shortest=shortest,
        metrics={"rooms visited": Metric(visited, percent=True)},
        columns=("success", "rooms visited", "spl", "steps"),
        extras=arrays,
        story=StoryStyle(dialogue=False),
    )
)

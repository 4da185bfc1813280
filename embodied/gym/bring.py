"""Bring: a task of Robot-v0 in which a person asks for a thing, answers questions that cost, and walks about.

An action has a number for each of BRING_QUESTIONS; as it rises above 0.5, the question is asked.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from embodied.assets.people import people
from embodied.assistants.bring import BRING_QUESTIONS, BringTruth, Requester
from embodied.envs.ask import Prices
from embodied.gym.robot import RobotEnv, RobotGoal, RobotSettings, RobotTask, register_robot_task, shut_parts, some_thing
from embodied.house.house import House
from embodied.house.moment import MovingPerson
from embodied.interface import (
    STEP, TURNS, Candidates, FindDescribed, Intention, Mode, Pose, Reply, Situation, Task,
)  # fmt: skip
from embodied.navigation.free_space import EYE
from embodied.navigation.graph import NavGraph
from embodied.people.gait import Limbs, solved, walk
from embodied.seeds import stream
from embodied.tasks.ask import look_of
from embodied.world import World

HANDED, HIDDEN, STAYS = 0.7, 0.3, 20.0
"""Metres from the person at which a thing is handed over; share of the things behind a closed door of furniture; and
seconds after which the person goes to another place."""
HOT = ("washing_machine", "tumble_dryer", "cooker")
"""Furniture in which nothing is hidden."""
NOWHERE = Candidates(*np.zeros((2, 0), np.float32), np.zeros(0, np.int64), np.zeros(0, bool))


@dataclass(frozen=True)
class AsItIs:
    """A place whose house is as it is now."""

    name: str
    house: House
    graph: NavGraph


class BringEnv(RobotEnv):
    """Robot-v0 with a person. Reward: less the price of questions. info: price, too."""

    spoken = tuple(f"ask {q.value}" for q in BRING_QUESTIONS)
    text = 240

    def __init__(
        self,
        worlds: Mapping[str, World],
        settings: RobotSettings,
        render_mode: str | None = None,
        *,
        prices: Prices = Prices(),
    ) -> None:
        """`prices`: of the questions, where a success is worth 1."""
        self.prices, self.price, self.time = prices, 0.0, 0.0
        super().__init__(worlds, settings, render_mode)

    def _begin(self, rng: np.random.Generator) -> int:
        start, self.price, self._asked, self.replies = super()._begin(rng), 0.0, set[str](), list[Reply]()
        names, here = sorted(n for n, p in people().items() if p.age > 12), self.ground.room_of_cell != ""
        a, b = (int(c) for c in rng.choice(np.flatnonzero(here), 2))
        self.shortest += float(self.ground.ways(self.goal.cells).metres[b]) - HANDED
        points = self.ground.xyz[self.ground.wide_ways(np.array([b])).cells(a)]
        points = points if len(points) > 1 else points[[0, 0]] + [[0.0] * 3, [1e-3, 0, 0]]
        ahead = np.diff(points[:, :2], axis=0, append=2 * points[-1:, :2] - points[-2:-1, :2])
        self._name, self._noise = names[int(rng.integers(len(names)))], int(rng.integers(2**31))
        self._walk = walk(Limbs(people()[self._name]), points, np.unwrap(np.arctan2(*ahead.T[::-1])))
        if self.goal.part:
            self._hide()
        return start

    def _hide(self) -> None:
        """Put the thing into furniture, onto what is under the height of the handle."""
        m, d, (middle, half) = self.body.model, self.body.data, inside(self, self.goal.part)
        handle = d.xipos[self.body.handles[self.goal.part.replace("/", "_")]][2]
        height = float(np.clip(handle, middle[2] - half[2] + 0.05, middle[2] + half[2]))
        solid, geom = np.array([0, 0, 0, 1, 0, 0], np.uint8), np.zeros(1, np.int32)
        down = mujoco.mj_ray(m, d, np.array([*middle[:2], height]), np.array([0.0, 0, -1]), solid, 1, -1, geom)
        adr = m.jnt_qposadr[m.body_jntadr[self.body.things[self.goal.thing]]]
        d.qpos[adr : adr + 3] = *middle[:2], height - max(down, 0.0) + 0.01
        mujoco.mj_forward(m, d)

    @property
    def person(self) -> np.ndarray:
        """(2,) where the person is by now, metres, world."""
        return self._walk.body(self._walk.walked(max(self.time - STAYS, 0.0)))[0][:2]

    @property
    def heard(self) -> str:
        """The request and the last reply."""
        return " . ".join([self.goal.request, *(str(r.text) for r in self.replies[-1:])])

    def _spoke(self, named: Mapping[str, float]) -> float:
        before, self._asked = self._asked, {w for w in self.spoken if named[w] > 0.5}
        new = [q for q in BRING_QUESTIONS if f"ask {q.value}" in self._asked - before]
        return sum(self.ask(q) for q in new if q in self.can_ask)

    @property
    def can_ask(self) -> tuple[Intention, ...]:
        """The questions that may be asked now."""
        return BRING_QUESTIONS if self.body.held in self.body.things else BRING_QUESTIONS[:-1]

    def ask(self, question: Intention) -> float:
        """Ask; the reply is the last of `replies`. Returns its price."""
        rng = stream(self._noise, "requester", len(self.replies))
        self.replies.append(Requester(look_of(self.world.catalogue)).answer(self._situation(), question, rng=rng))
        self.price += self.prices.of(question)
        return self.prices.of(question)

    def _situation(self) -> Situation:
        """As a node of the graph and the house tell it."""
        graph, thing, part = self.world.graph, self.goal.thing, self.goal.part
        house, at = self.world.house, tuple(self.body.thing(thing).tolist())
        now = {thing: dataclasses.replace(house.placement_by_id[thing], position=at, room=self.room_at(at))}
        now_house = dataclasses.replace(house, placements=tuple(now.get(p.id, p) for p in house.placements))
        eye = np.array([*self.body.position, house.storeys[0].elevation + EYE])
        node = int(np.linalg.norm(graph.positions - eye, axis=1).argmin())
        away = np.linalg.norm(graph.positions[:, :2] - at[:2], axis=1)
        away += 99.0 * (np.array(graph.room_of_node) != now[thing].room)
        pose, goals = Pose(node, round(self.body.yaw / STEP) % TURNS), (int(away.argmin()),)
        request, name, goal = self.goal.request, house.name, self.described
        task = Task(f"{name}/bring", "bring", name, pose, goal, goals, request, HANDED, 10**6)
        shut = part and self.openness[part] < 0.5 and self.body.held != thing
        furniture = house.placement_by_id[part.partition("/")[0]].object_class if shut else ""
        held = self.body.held if self.body.held in self.body.things else ""
        truth = BringTruth(goal.fitting, str(held), furniture, self.room_at(self.person))
        known = AsItIs(name, now_house, graph)
        return Situation(known, task, pose, Mode.MAIN, goals, None, (), NOWHERE, 0, len(self.replies), extras=truth)

    @property
    def described(self) -> FindDescribed:
        """The goal as Ask-v0 has it: what is meant among what the request fits."""
        look, of = look_of(self.world.catalogue), self.world.house.placement_by_id
        p, same = of[self.goal.thing], [i for i in sorted(self.body.things) if i in of]
        words = look(p)[:1]
        same = [i for i in same if of[i].object_class == p.object_class]
        fits = tuple(i for i in same if look(of[i])[:1] == words)
        return FindDescribed(p.object_class, p.id, fits, tuple(i for i in same if i not in fits), words)

    def room_at(self, point: np.ndarray | tuple[float, ...]) -> str:
        """The room of the floor nearest to a point."""
        away = np.linalg.norm(self.ground.xy - point[:2], axis=1) + 9.0 * (self.ground.room_of_cell == "")
        return str(self.ground.room_of_cell[away.argmin()])

    def _look(self) -> dict[str, Any]:
        if self.settings.observations and self.world.pictures.quality is not None:
            posed = solved(self._walk.limbs, self._walk.at(max(self.time - STAYS, 0.0)))
            self.world.show(dataclasses.replace(self.world.moment, people={"person": MovingPerson(self._name, *posed)}))
        return super()._look()

    def _facts(self) -> dict[str, Any]:
        return {**super()._facts(), "price": self.price}


def inside(env: RobotEnv, part: str) -> tuple[np.ndarray, np.ndarray]:
    """(3,) middle, world, and (3,) half sides, metres, of the space that a part of furniture closes; or zeros."""
    thing, _, name = part.partition("/")
    model, names = env.body.model, (f"{thing}_reg_int_{name}", f"{thing}_reg_int")
    found = [g for n in names if (g := mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, n)) >= 0]
    return (env.body.data.geom_xpos[found[0]], model.geom_size[found[0]]) if found else (np.zeros(3), np.zeros(3))


def hidden_or_not(env: RobotEnv, rng: np.random.Generator) -> RobotGoal | None:
    """Something that a hand can take, in the open or behind a closed door."""
    goal = some_thing(env, rng)
    if goal is None or rng.random() >= HIDDEN:
        return goal
    of = env.world.house.placement_by_id
    doors = [p for p in shut_parts(env) if "door" in p and not p.startswith(HOT)]
    doors = [p for p in doors if (2 * inside(env, p)[1] > np.add(of[goal.thing].size, 0.05)).all()]
    if not doors:
        return None
    part = doors[int(rng.integers(len(doors)))]
    cells = env.cells_near(inside(env, part)[0], of[part.partition("/")[0]].room)
    return dataclasses.replace(goal, part=part, cells=cells)


def handed(env: BringEnv) -> bool:
    """True where the robot has the thing, and brought it to the person."""
    thing = env.goal.thing
    return thing in (env.body.held, *env.body.met) and math.dist(env.body.thing(thing)[:2], env.person) <= HANDED


BRING = register_robot_task(RobotTask("bring", "bring me the {}", hidden_or_not, handed, BringEnv))

"""Bring: a task of Robot-v0 in which a person asks for a thing, answers questions that cost, and walks about.

An action has a number for each of BRING_QUESTIONS; as it rises above 0.5, the question is asked.
"""

import dataclasses
import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np

from embodied import interface
from embodied.assets.people import people
from embodied.assistants.ask import BRING_QUESTIONS, BringTruth, Requester
from embodied.envs.ask import Prices
from embodied.gym import robot
from embodied.house.moment import MovingPerson
from embodied.navigation.free_space import EYE
from embodied.people.gait import Limbs, solved, walk
from embodied.people.strolls import noticing
from embodied.seeds import stream
from embodied.tasks.ask import look_of

HANDED, HIDDEN, STAYS = 0.7, 0.3, 20.0
"""Metres from the person at which a thing is handed over; chance that a thing is put behind a closed door of furniture;
and seconds after which the person goes to another place."""
HOT = ("washing_machine", "tumble_dryer", "cooker")
"""Furniture in which nothing is hidden."""


class BringEnv(robot.RobotEnv):
    """Robot-v0 with a person. The reward is less the prices of questions, which are info's price, too."""

    spoken = tuple(f"ask {q.value}" for q in BRING_QUESTIONS)
    text = 240
    prices = Prices()

    def _begin(self, rng: np.random.Generator) -> int:
        start, self.price, self._asked = super()._begin(rng), 0.0, set[str]()
        self.replies: list[interface.Reply] = []
        grown, xy = sorted(n for n, p in people().items() if p.age > 12), self.ground.xyz
        a, b = (int(c) for c in rng.choice(np.flatnonzero(self.ground.room_of_cell != ""), 2, replace=False))
        self.shortest += float(self.ground.ways(self.goal.cells).metres[b]) - HANDED
        points = xy[self.ground.wide_ways(np.array([b])).cells(a)]
        ahead = np.diff(points[:, :2], axis=0, append=2 * points[-1:, :2] - points[-2:-1, :2])
        self._name, self._noise = grown[int(rng.integers(len(grown)))], int(rng.integers(2**31))
        self._walk = walk(Limbs(people()[self._name]), points, np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0])))
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
    def holds(self) -> str:
        """The thing in its hand, '' for none."""
        return str(self.body.held) if self.body.held in self.body.things else ""

    @property
    def heard(self) -> str:
        """The request and the last reply."""
        return " . ".join([self.goal.request, *(str(r.text) for r in self.replies[-1:])])

    def _spoke(self, named: Mapping[str, float]) -> float:
        before, self._asked = self._asked, {w for w in self.spoken if named[w] > 0.5}
        price, assistant = self.price, Requester(look_of(self.world.catalogue))
        for question in BRING_QUESTIONS if self._asked - before else ():
            situation = self._situation()
            if f"ask {question.value}" in self._asked - before and question in assistant.intentions(situation):
                rng = stream(self._noise, "requester", len(self.replies))
                self.replies.append(assistant.answer(situation, question, rng=rng))
                self.price += self.prices.of(question)
        return self.price - price

    def _situation(self) -> interface.Situation:
        """As Ask-v0 tells it: by a node of the graph, and the house as it is now."""
        graph, house, thing, part = self.world.graph, self.world.house, self.goal.thing, self.goal.part
        at, of, look = self.body.thing(thing), house.placement_by_id, look_of(self.world.catalogue)
        p = dataclasses.replace(of[thing], position=tuple(at.tolist()), room=self.room_at(at))
        now = dataclasses.replace(house, placements=tuple(p if q.id == thing else q for q in house.placements))
        alike = [of[i] for i in sorted(self.body.things) if of[i].object_class == p.object_class]
        fits = tuple(q.id for q in alike if look(q)[:1] == look(p)[:1])
        others = tuple(q.id for q in alike if q.id not in fits)
        turn = round(self.body.yaw / interface.STEP) % interface.TURNS
        pose = interface.Pose(int(np.linalg.norm(graph.positions - self._eye, axis=1).argmin()), turn)
        away = np.linalg.norm(graph.positions[:, :2] - at[:2], axis=1)
        goals = (int((away + 99.0 * (np.array(graph.room_of_node) != p.room)).argmin()),)
        goal = interface.FindDescribed(p.object_class, thing, fits, others, look(p)[:1])
        task = interface.Task("", "bring", house.name, pose, goal, goals, self.goal.request, HANDED, 10**6)
        shut = part and self.openness[part] < robot.OPENED and self.holds != thing
        furniture = of[part.partition("/")[0]].object_class if shut else ""
        truth = BringTruth(fits, self.holds, furniture, self.room_at(self.person))
        place: Any = SimpleNamespace(name=house.name, house=now, graph=graph)
        none = np.zeros(0)
        nothing, main = interface.Candidates(none, none, none, none), interface.Mode.MAIN
        return interface.Situation(place, task, pose, main, goals, None, (), nothing, 0, 0, extras=truth)

    @property
    def _eye(self) -> np.ndarray:
        return np.array([*self.body.position, self.world.house.storeys[0].elevation + EYE])

    def room_at(self, point: np.ndarray) -> str:
        """The room of the floor nearest to a point."""
        away = np.linalg.norm(self.ground.xy - point[:2], axis=1) + 9.0 * (self.ground.room_of_cell == "")
        return str(self.ground.room_of_cell[away.argmin()])

    def _look(self) -> dict[str, Any]:
        if self.settings.observations and self.world.pictures.quality is not None:
            posed = solved(self._walk.limbs, self._walk.at(max(self.time - STAYS, 0.0)))
            now = dataclasses.replace(self.world.moment, people={"person": MovingPerson(self._name, *posed)})
            self.world.show(noticing(now, self._eye, self.world.house))
        return super()._look()

    def _facts(self) -> dict[str, Any]:
        return {**super()._facts(), "price": self.price}


def inside(env: robot.RobotEnv, part: str) -> tuple[np.ndarray, np.ndarray]:
    """(3,) middle, world, and (3,) half sides, metres, of the space that a part of furniture closes; or zeros."""
    thing, _, name = part.partition("/")
    model, names = env.body.model, (f"{thing}_reg_int_{name}", f"{thing}_reg_int")
    geoms = [g for n in names if (g := mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, n)) >= 0]
    return (env.body.data.geom_xpos[geoms[0]], model.geom_size[geoms[0]]) if geoms else (np.zeros(3), np.zeros(3))


def hidden_or_not(env: robot.RobotEnv, rng: np.random.Generator) -> robot.RobotGoal | None:
    """Something that a hand can take, in the open or behind a closed door."""
    goal, of = robot.some_thing(env, rng), env.world.house.placement_by_id
    if goal is None or rng.random() >= HIDDEN:
        return goal
    doors = [p for p in robot.shut_parts(env) if "door" in p and not p.startswith(HOT)]
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


BRING = robot.register_robot_task(robot.RobotTask("bring", "bring me the {}", hidden_or_not, handed, BringEnv))

"""Bring me the blue mug: a robot looks for a thing, may ask, opens what is closed, and brings it to the person.

    python examples/bring_me.py                              # who plays how well, in three small flats
    python examples/bring_me.py --houses 50 --out rows.json

The task is one of your own for embodied/Robot-v0: a subclass of its environment and an entry of ROBOT_TASKS. `Skills`
plays it by five words, which a language model can say, too: go, open, take, give and ask.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from embodied.envs.ask import Prices
from embodied.geometry import wrap
from embodied.gym.drive import chosen_worlds
from embodied.gym.robot import ROBOT_TASKS, RobotEnv, RobotGoal, RobotSettings, shut_parts, some_thing
from embodied.scene.part import Part
from embodied.seeds import stream
from embodied.tasks.ask import look_of

HANDED = 0.7
"""Metres from the person at which a thing is handed over."""
HIDDEN = 0.3
"""Share of the things that are behind a closed door of furniture."""
CROWDED = ("washing_machine", "tumble_dryer", "cooker")
"""Furniture in which nothing is hidden."""
STAYS, WALKS = 20.0, 0.8
"""Seconds after which the person goes to another place, and metres per second."""
PRICES = Prices()
QUESTIONS = {"region": PRICES.region, "route": PRICES.route, "confirm": PRICES.confirm}
"""Prices, where a success is worth 1: the room of the thing, what it is in or on, and where the person is."""
ARM = 0.25
"""Metres from the base's middle to the hand when the arm is drawn in."""
SEES = 4.0
"""Metres within which a thing is seen, in the line of sight of the head."""


class BringEnv(RobotEnv):
    """Robot-v0 with a person who asks for a thing, answers questions, and goes to another place after a while."""

    def _furnish(self, spec: mujoco.MjSpec) -> None:
        spec.worldbody.add_body(name="person", mocap=True)
        if self.world.pictures.quality is not None and (figures := self.world.catalogue.of_class("person")):
            meshes = self.world.catalogue.mesh(figures[0].key, figures[0].size, ())
            self.world.add("person", [Part("person", "object", "", m, f"person/{k}") for k, m in enumerate(meshes)])

    def _begin(self, rng: np.random.Generator) -> int:
        start, self.price = super()._begin(rng), 0.0
        here, there = (int(c) for c in rng.choice(np.flatnonzero(self.ground.room_of_cell != ""), 2))
        self._walk = self.ground.xy[self.ground.ways(np.array([there])).cells(here)]
        self.shortest += float(self.ground.ways(self.goal.cells).metres[there]) - HANDED
        if self.goal.part:
            self._hide()
        self._walk_on()
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

    def step(self, action: np.ndarray) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        self._walk_on()
        return super().step(action)

    def _walk_on(self) -> None:
        """Bring the person to where they are by now."""
        metres = max(self.time - STAYS, 0.0) * WALKS
        self.person = self._walk[min(int(metres / 0.1), len(self._walk) - 1)]
        self.body.data.mocap_pos[0] = *self.person, self.world.house.storeys[0].elevation

    def ask(self, question: str) -> str:
        """The person's answer, for its price."""
        if question not in QUESTIONS:
            return f"ask one of {', '.join(QUESTIONS)}"
        self.price += QUESTIONS[question]
        if question == "confirm":
            return f"I am in {self.room_at(self.person)}."
        if question == "region":
            return f"It is in {self.room_at(self.body.thing(self.goal.thing))}."
        holder = self.goal.part or self.world.house.placement_by_id[self.goal.thing].parent
        return f"It is {'in' if self.goal.part else 'on'} {holder or 'the floor'}."

    def room_at(self, point: np.ndarray) -> str:
        """The room of the floor nearest to a point."""
        near = np.linalg.norm(self.ground.xy - point[:2], axis=1) + 9.0 * (self.ground.room_of_cell == "")
        return str(self.ground.room_of_cell[near.argmin()])


def inside(env: RobotEnv, part: str) -> tuple[np.ndarray, np.ndarray]:
    """(3,) middle, world, and (3,) half sides, metres, of the space that a part of furniture closes."""
    thing, _, name = part.partition("/")
    model, names = env.body.model, (f"{thing}_reg_int_{name}", f"{thing}_reg_int")
    g = next(g for g in range(model.ngeom) if model.geom(g).name in names)
    return env.body.data.geom_xpos[g], model.geom_size[g]


def hidden_or_not(env: RobotEnv, rng: np.random.Generator) -> RobotGoal | None:
    """Something that a hand can take, in the open or behind a closed door."""
    goal = some_thing(env, rng)
    if goal is None or rng.random() >= HIDDEN:
        return goal
    size, of = env.world.house.placement_by_id[goal.thing].size, env.world.house.placement_by_id
    doors = [p for p in shut_parts(env) if "door" in p and not p.startswith(CROWDED)]
    doors = [p for p in doors if (2 * inside(env, p)[1] > np.add(size, 0.05)).all()]
    if not doors:
        return None
    part = doors[int(rng.integers(len(doors)))]
    cells = env.cells_near(inside(env, part)[0], of[part.partition("/")[0]].room)
    return RobotGoal(goal.request, goal.thing, part, cells)


def handed(env: Any) -> bool:
    """True where the robot has the thing, and brought it to the person."""
    thing = env.goal.thing
    return thing in (env.body.held, *env.body.met) and math.dist(env.body.thing(thing)[:2], env.person) <= HANDED


ROBOT_TASKS["bring"] = ("bring me the {}", hidden_or_not, handed)


class Skills:
    """Words that a robot of Robot-v0 carries out; each returns what came of it, in words."""

    def __init__(self, env: BringEnv) -> None:
        self.env = env
        self.arm = np.zeros(len(self.env.body.arm))
        self.info: dict[str, Any] = {}
        self.hold, self.over = False, False
        self._look_of = look_of(self.env.world.catalogue)

    def reset(self, seed: int) -> str:
        _, self.info = self.env.reset(seed=seed)
        self.request, self.hold, self.over = str(self.info["request"]), False, False
        self._arm(0.9, 0.0)
        return self.request

    def do(self, words: str) -> str:
        """Carry out 'go ROOM', 'go person', 'open PART', 'take THING', 'give' or 'ask QUESTION'."""
        verb, _, what = words.partition(" ")
        if self.over:
            return "it is over"
        if verb not in ("go", "open", "take", "give", "ask"):
            return "say go, open, take, give or ask"
        return self.env.ask(what) if verb == "ask" else getattr(self, verb)(*[what] if what else [])

    @property
    def rooms(self) -> list[str]:
        return sorted({r for r in self.env.ground.room_of_cell if r})

    def look(self) -> list[str]:
        """Things and closed parts in sight, and 'person', while the head turns about."""
        body, env, here = self.env.body, self.env, []
        eye = body.data.cam_xpos[body.model.camera("robot/head").id].copy()
        geom = np.zeros(1, np.int32)
        places = {**{n: body.thing(n) for n in body.things}, "person": np.array([*env.person, 1.2])}
        for name, at in places.items():
            way = at - eye
            if np.linalg.norm(way) > SEES:
                continue
            robot = body.root
            reached = mujoco.mj_ray(body.model, body.data, eye, way / np.linalg.norm(way), None, 1, robot, geom)
            b = body.things.get(name, -1)
            if reached < 0 or reached > np.linalg.norm(way) - 0.15 or body.model.geom_bodyid[geom[0]] == b:
                here.append(name)
        return here

    def fits(self, name: str) -> bool:
        """True of what the request describes, by class and colour."""
        p = self.env.world.house.placement_by_id.get(name)
        return p is not None and self.request.endswith(" ".join([*self._look_of(p)[:1], p.object_class]))

    def go(self, where: str) -> str:
        """Drive to a room, or to the person."""
        env = self.env
        if where == "person":
            return "there" if self._drive(self._cells(env.person, 0.35, 0.6)) else "the way is blocked"
        cells = np.flatnonzero(env.ground.room_of_cell == where)
        if not len(cells):
            return f"there is no {where}; there are {self.rooms}"
        middle = env.ground.xy[cells].mean(0)
        best = cells[np.linalg.norm(env.ground.xy[cells] - middle, axis=1).argmin()]
        arrived = self._drive(np.array([best]))
        return f"{'in' if arrived else 'not in'} {where}; in sight: {', '.join(self.look()) or 'nothing'}"

    def open(self, part: str) -> str:
        """Take a handle and pull."""
        env, body, name = self.env, self.env.body, part.replace("/", "_")
        if name not in body.handles or "/" not in part:
            return f"nothing is called {part}"
        handle, yaw = body.handles[name], env.world.house.placement_by_id[part.partition("/")[0]].yaw
        at, (way, aside) = body.data.xipos[handle].copy(), self._way(handle)
        stand = at[:2] + 0.5 * np.array([math.sin(yaw), -math.cos(yaw)]) + 0.3 * aside
        for cells in self._spots(np.array([*stand, 0.0]), 0.0, 0.4, best=0.0):
            if self._reach(cells, body.data.xipos[handle]):
                self.hold = True
                self._wait(3)
                for _ in range(80):
                    way, aside = self._way(handle)
                    if body.held != name or self.info["openness"][part] > 0.95 or self.over:
                        break
                    self._follow(body.data.xipos[handle] + 0.06 * way, aside.any())
                self.hold = False
                self._wait(1)
                self._arm(None, 0.0)
            if self.over or self.info["openness"][part] >= 0.5:
                break
        return f"{part} is {'open' if self.info['openness'][part] >= 0.5 else 'not open'}"

    def _way(self, handle: int) -> tuple[np.ndarray, np.ndarray]:
        """(3,) unit in which a handle opens, and (2,) unit from an upright hinge to it, or zeros."""
        model, data = self.env.body.model, self.env.body.data
        joint = model.body_jntadr[model.body_parentid[handle]]
        way, arm = data.xaxis[joint].copy(), data.xipos[handle] - data.xanchor[joint]
        if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
            return way, np.zeros(2)
        upright = abs(way[2]) > 0.5
        way = np.cross(way, arm)
        return way / np.linalg.norm(way), arm[:2] / np.linalg.norm(arm[:2]) if upright else np.zeros(2)

    def _follow(self, point: np.ndarray, turns: bool) -> None:
        """One action after which the hand is nearer to a point: by turning and reaching, or by driving."""
        to = point[:2] - self.env.body.position
        if not turns and np.linalg.norm(to) < 0.45:
            self._step((-0.5, 0.0, 0.0))
            return
        self._aim(float(point[2]), float(np.linalg.norm(to)) - ARM)
        off = float(wrap(math.atan2(to[1], to[0]) - self.env.body.yaw))
        self._step((0.0, 0.0, float(np.clip(2.5 * off, -1, 1))))

    def take(self, thing: str) -> str:
        """Drive up to a thing and take it."""
        body = self.env.body
        if thing not in body.things:
            return f"nothing is called {thing}"
        here = np.array([self.env.ground.cell_at(body.position)])
        near = [here] if np.linalg.norm(body.position - body.thing(thing)[:2]) < 0.95 else []
        spots = near + self._spots(body.thing(thing), 0.4, 0.95)
        for cells, above in [(c, a) for c in spots for a in (0.0, 0.2)]:
            if not self._reach(cells, body.thing(thing), above):
                continue
            self.hold = True
            self._wait(2)
            if body.held == thing:
                self._arm(min(1.4, self.height + 0.12), None)
                self._arm(None, 0.0)
                return f"it holds {thing}"
            self.hold = False
            self._wait(1)
            self._arm(None, 0.0)
            if self.over:
                break
        return f"it could not take {thing}"

    def give(self) -> str:
        """Bring what is held to the person."""
        for _ in range(4):
            self._drive(self._cells(self.env.person, 0.35, 0.6))
            self._turn(self.env.person)
            self._arm(1.0, min(0.4, max(0.0, math.dist(self.env.body.position, self.env.person) - 0.5)))
            if self.over:
                break
        return "given" if self.info.get("is_success") else "not given"

    # How --------------------------------------------------------------------------------------

    @property
    def height(self) -> float:
        return float(self.env.body.hand[2])

    def _step(self, base: tuple[float, float, float]) -> bool:
        """One action; True when the episode is over."""
        if not self.over:
            action = np.array([*base, *self.arm, float(self.hold)])
            _, _, ended, cut, self.info = self.env.step(action)
            self.over = ended or cut
        return self.over

    def _wait(self, steps: int) -> None:
        for _ in range(steps):
            self._step((0.0, 0.0, 0.0))

    def _aim(self, height: float | None, reach: float | None) -> None:
        """Set the hand's height, metres above the floor, and how far it is out; as they are where None."""
        target = self.env.middle + self.env.half * self.arm
        if height is not None:
            target[0] = np.clip(height - self.env.body.placed.pose[2], 0.1, 1.45)
        if reach is not None:
            target[1] = np.clip(reach / 4, 0.0, 0.2)
        self.arm = (target - self.env.middle) / self.env.half

    def _arm(self, height: float | None, reach: float | None) -> None:
        """Bring the hand there, and wait until it is."""
        self._aim(height, reach)
        for k in range(20):
            before = self.env.body.hand
            if self._step((0.0, 0.0, 0.0)) or (k > 1 and np.linalg.norm(self.env.body.hand - before) < 0.003):
                break

    def _drive(self, cells: np.ndarray) -> bool:
        """Along a wide way to the nearest of some cells."""
        if not len(cells):
            return False
        body, ground = self.env.body, self.env.ground
        ways, stuck, tries, last = ground.wide_ways(cells), 0, 0, body.position
        for _ in range(600):
            way = ground.xy[ways.cells(ground.cell_at(body.position))]
            if np.linalg.norm(way[-1] - body.position) < 0.06:
                return True
            to = way[min(3, len(way) - 1)] - body.position
            far = float(np.linalg.norm(way[-1] - body.position))
            turn = float(wrap(math.atan2(to[1], to[0]) - body.yaw))
            speed = min(1.0, 0.15 + far) if abs(turn) < 0.6 or far < 0.3 else 0.0
            angle = turn
            base = (
                speed * math.cos(angle),
                speed * math.sin(angle),
                float(np.clip(1.5 * turn, -1, 1)) if far > 0.3 else 0.0,
            )
            if self._step(base):
                return False
            stuck = stuck + 1 if np.linalg.norm(body.position - last) < 0.005 and speed else 0
            last = body.position
            if stuck > 8:
                for _ in range(6):
                    self._step((-0.7 * math.cos(turn), -0.7 * math.sin(turn), 0.3 * (-1) ** tries))
                stuck, tries = 0, tries + 1
                if tries > 3:
                    return False
        return False

    def _turn(self, point: np.ndarray) -> None:
        """Face a point."""
        body = self.env.body
        for _ in range(60):
            to = point[:2] - body.position
            off = float(wrap(math.atan2(to[1], to[0]) - body.yaw))
            if abs(off) < 0.02 or self._step((0.0, 0.0, float(np.clip(2.5 * off, -1, 1)))):
                return

    def _cells(self, point: np.ndarray, low: float, high: float) -> np.ndarray:
        far = np.linalg.norm(self.env.ground.xy - point[:2], axis=1)
        return np.flatnonzero((far >= low) & (far <= high))

    def _spots(self, point: np.ndarray, low: float, high: float, best: float = 0.65) -> list[np.ndarray]:
        """Up to five places between two distances from a point, apart from each other, the one nearest to `best`
        first."""
        cells = self._cells(point, low, high)
        xy, spots = self.env.ground.xy, []
        far = np.linalg.norm(xy[cells] - point[:2], axis=1)
        for cell in cells[np.argsort(np.abs(far - best), kind="stable")]:
            if all(np.linalg.norm(xy[cell] - xy[s[0]]) > 0.25 for s in spots) and len(spots) < 5:
                spots.append(np.array([cell]))
        return spots

    def _reach(self, cells: np.ndarray, point: np.ndarray, above: float = 0.0) -> bool:
        """Drive to a cell, face a point and bring the hand there, or first so far above it, metres."""
        self._arm(None, 0.0)
        if not self._drive(cells):
            return False
        self._turn(point)
        self._arm(float(point[2]) + 0.02 + above, None)
        self._arm(None, math.dist(self.env.body.position, point[:2]) - ARM - 0.05)
        if above:
            self._arm(float(point[2]) + 0.05, None)
        return not self.over


# Players ----------------------------------------------------------------------------------------


def expert(s: Skills, rng: np.random.Generator) -> None:
    """Knows where everything is."""
    goal = s.env.goal
    if goal.part:
        s.do(f"open {goal.part}")
    s.do(f"take {goal.thing}")
    s.do("give")


def searcher(s: Skills, rng: np.random.Generator, *, asks: tuple[str, ...] = (), sees: bool = True) -> None:
    """Looks through the rooms for something that the request fits, asking first or not; without sight it takes one of
    the things that there are."""
    replies = " ".join(s.do(f"ask {question}") for question in asks)
    rooms = sorted((s.rooms[k] for k in rng.permutation(len(s.rooms))), key=lambda room: room not in replies)
    part = next((p for p in s.info["openness"] if p in replies), None)
    if part:
        s.do(f"open {part}")
        rooms.insert(0, "")
    for room in rooms:
        s.do(f"go {room}" if room else "look")
        fitting = [name for name in s.look() if s.fits(name)] if sees else sorted(s.env.body.things)
        if fitting:
            s.do(f"take {fitting[0 if sees else int(rng.integers(len(fitting)))]}")
        if s.env.body.held or s.over:
            break
    while s.env.body.held and not s.over:
        if "person" in s.look() or "confirm" in asks:
            s.do("give")
        else:
            s.do(f"go {s.rooms[int(rng.integers(len(s.rooms)))]}")


def at_random(s: Skills, rng: np.random.Generator) -> None:
    """Says random words."""
    any_of = lambda names: names[int(rng.integers(len(names)))]
    for _ in range(200):
        verb = any_of(("go", "open", "take", "give"))
        names = {
            "go": [*s.rooms, "person"],
            "open": sorted(p for p in s.info["openness"] if "/" in p),
            "take": sorted(s.env.body.things),
        }
        s.do(f"{verb} {any_of(names[verb])}" if verb in names else verb)


PLAYERS: dict[str, Callable[[Skills, np.random.Generator], None]] = {
    "expert": expert,
    "searcher": searcher,
    "searcher, asks region": lambda s, rng: searcher(s, rng, asks=("region",)),
    "searcher, asks region, place and person": lambda s, rng: searcher(s, rng, asks=("region", "route", "confirm")),
    "searcher, blind": lambda s, rng: searcher(s, rng, sees=False),
    "random": at_random,
}


def play(seeds: range, episodes: int, players: list[str]) -> Iterator[dict[str, Any]]:
    """Facts of the episodes of each player, in flats of their own."""
    for seed in seeds:
        worlds, _ = chosen_worlds(seed=seed, pictures="unlit")
        env = BringEnv(worlds, RobotSettings(task="bring", observations=()))
        for k in range(episodes):
            for name in players:
                skills = Skills(env)
                skills.reset(1000 * seed + k)
                PLAYERS[name](skills, stream(seed, "bring", name, k))
                facts = {f: skills.info[f] for f in ("success", "spl", "metres", "seconds")}
                facts |= {"price": skills.env.price, "fallen": len(skills.info["fallen"])}
                yield {"player": name, "house": seed, "hidden": bool(skills.env.goal.part), **facts}
        env.close()


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--houses", type=int, default=3)
    parser.add_argument("--episodes", type=int, default=2)
    parser.add_argument("--players", nargs="*", default=list(PLAYERS), choices=list(PLAYERS))
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rows = []
    for row in play(range(500, 500 + options.houses), options.episodes, options.players):
        rows.append(row)
        print(json.dumps(row), flush=True)
    for name in options.players:
        own = [r for r in rows if r["player"] == name]
        means = {f: float(np.mean([r[f] for r in own])) for f in ("success", "spl", "price", "seconds")}
        print(f"{name:40} n {len(own)} " + " ".join(f"{f} {x:.2f}" for f, x in means.items()))
    if options.out:
        options.out.write_text(json.dumps(rows, indent=1))

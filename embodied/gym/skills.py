"""Skills: a robot of Robot-v0 that is told to go, open, take, give, leave and ask, as an agent of interface.py is told.

    skills = Skills(BringEnv(worlds, RobotSettings(task="bring", observations=())))
    observation = skills.reset(0)
    observation = skills.step(Move(observation.candidates.words.index("go kitchen_1")))

Candidates are words, so any `Policy` that reads words plays it, a language model, too. Hands are assisted; the arm is a
lift and a telescope, as FETCHER's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from embodied.assistants.descriptions import side
from embodied.geometry import wrap
from embodied.gym.bring import BringEnv, inside
from embodied.gym.robot import CONTROL
from embodied.interface import (
    STEP, TURNS, Action, Ask, Candidates, Extras, Mode, Move, Observation, Policy, Sight,
)  # fmt: skip
from embodied.seeds import stream
from embodied.tasks.ask import look_of

ARM, SEES = 0.25, 4.0
"""Metres from the base's middle to the hand when the arm is drawn in, and within which a thing is seen, in the line of
sight of the head."""


@dataclass(frozen=True)
class SkillExtras(Extras):
    """Observation of the robot besides what all kinds see."""

    sees: Mapping[str, str]
    """Things in sight, by what skills call them: class and colour, metres, direction; 'person' for whoever asked."""
    holds: str
    room: str
    """Where it is."""
    outcome: str
    """What came of the last skill."""

    def lines(self, turn: int) -> tuple[str, ...]:
        lines = (f"you are in {self.room}", f"you hold {self.holds or 'nothing'}", self.outcome)
        return (*lines, *(f"{name}: {words}" for name, words in self.sees.items()))


class Skills:
    """Owns an episode of 'bring' by skills."""

    def __init__(self, env: BringEnv, watch: Callable[[np.ndarray], None] = lambda action: None) -> None:
        """`watch`: told every action of the environment before it is taken."""
        self.env, self._watch = env, watch

    def reset(self, seed: int, world: str | None = None) -> Observation:
        _, self.info = self.env.reset(seed=seed, options={"world": world} if world else None)
        self.hold, self.over, self.time, self.arm = False, False, 0, np.zeros(len(self.env.body.arm))
        self._look_of, self._been = look_of(self.env.world.catalogue), dict[str, list[int]]()
        self._arm(0.9, 0.0)
        return self.look("")

    def step(self, action: Action) -> Observation | None:
        """Carry out a candidate or a question, or stop; None when the episode is over."""
        self.time += 1
        if isinstance(action, Ask):
            self._step(ask=f"ask {action.intention.value}")
            return None if self.over else self.look(str(self.env.replies[-1].text))
        if not isinstance(action, Move):
            self.over = True
        return None if self.over else self.look(self.do(self.words[action.candidate]))  # type: ignore[union-attr]

    def do(self, words: str) -> str:
        """Carry out 'go ROOM', 'open PART', 'take THING', 'give' or 'leave'; returns what came of it."""
        verb, _, what = words.partition(" ")
        return str({"go": self.go, "open": self.open, "take": self.take, "give": self.give, "leave": self.leave}[verb](
            *[what] if what else []
        ))  # fmt: skip

    def look(self, outcome: str) -> Observation | None:
        """What is known now; None when the episode is over."""
        env, body = self.env, self.env.body
        if self.over:
            return None
        seen, held = self.in_sight(), body.held if body.held in body.things else ""
        rooms = sorted({r for r in env.ground.room_of_cell if r})
        closed = [n for n in seen if "/" in n]
        takes = [f"take {n}" for n in seen if n in body.things and n != held]
        gives = ["give"] * ("person" in seen) + ["leave"]
        self.words = (*(f"go {r}" for r in rooms), *(gives if held else [*takes, *(f"open {p}" for p in closed)]))
        n = len(self.words)
        return Observation(
            sight=Sight(env.world.name, 0),
            turn=round(body.yaw / STEP) % TURNS,
            tilt=0,
            candidates=Candidates(*np.zeros((2, n), np.float32), np.zeros(n, np.int64), np.ones(n, bool), self.words),
            instruction=env.heard,
            target=None,
            mode=Mode.MAIN,
            can_ask=env.can_ask,
            requests_left=None,
            time=self.time,
            time_on_task=self.time,
            extras=SkillExtras(seen, str(held), env.room_at(body.position), outcome),
        )

    def in_sight(self) -> dict[str, str]:
        """Things, closed parts and the person in sight while the head turns about, the nearest first, in words."""
        body, env, of = self.env.body, self.env, self.env.world.house.placement_by_id
        eye, geom, seen = body.data.cam_xpos[body.model.camera("robot/head").id].copy(), np.zeros(1, np.int32), []
        shut = {n: body.handles[n.replace("/", "_")] for n, x in env.openness.items() if "/" in n and x < 0.5}
        bodies, found = {**body.things, **shut, "person": -1}, self._found
        for name, b in bodies.items():
            at = np.array([*env.person, 1.2]) if b < 0 else body.data.xipos[b]
            metres = float(np.linalg.norm(way := at - eye))
            if metres > SEES:
                continue
            reached = mujoco.mj_ray(body.model, body.data, eye, way / metres, None, 1, body.root, geom)
            if 0 <= reached <= metres - 0.15 and body.model.geom_bodyid[geom[0]] != b and name not in found:
                continue
            p = of.get(name.partition("/")[0])
            noun = " ".join([*self._look_of(p)[:1], p.object_class]) if p and "/" not in name else ""
            noun = noun or (f"closed {name.partition('/')[2]} of the {p.object_class}" if p else "whoever asked you")
            bearing = math.atan2(way[1], way[0]) - body.yaw
            seen.append((metres, name, f"{noun}, {metres:.1f} m, {side(float(wrap(bearing)))}"))
        return {name: words for _, name, words in sorted(seen)}

    @property
    def _found(self) -> list[str]:
        """Things in the furniture that stands open, near enough to look into."""
        env, found = self.env, []
        for part, x in env.openness.items():
            if "/" in part and x >= 0.5 and math.dist(env.body.position, (space := inside(env, part))[0][:2]) < 1.5:
                found += [n for n in env.body.things if (np.abs(env.body.thing(n) - space[0]) <= space[1]).all()]
        return found

    # Skills -----------------------------------------------------------------------------------

    def go(self, room: str) -> str:
        """Drive to the middle of a room, or when it has been there, to what is farthest from where it was."""
        ground = self.env.ground
        cells, been = np.flatnonzero(ground.room_of_cell == room), self._been.setdefault(room, [])
        middle = np.linalg.norm(ground.xy[cells] - ground.xy[cells].mean(0), axis=1)
        away = np.linalg.norm(ground.xy[cells, None] - ground.xy[been][None], axis=2).min(1) if been else -middle
        been.append(int(cells[away.argmax()]))
        return f"you are {'' if self._drive(np.array(been[-1:])) else 'not '}there"

    def open(self, part: str) -> str:
        """Take a handle and pull."""
        env, body, name = self.env, self.env.body, part.replace("/", "_")
        handle, yaw = body.handles[name], env.world.house.placement_by_id[part.partition("/")[0]].yaw
        at, (way, aside) = body.data.xipos[handle].copy(), self._way(handle)
        stand = at[:2] + 0.5 * np.array([math.sin(yaw), -math.cos(yaw)]) + 0.3 * aside
        for cells in self._spots(np.array([*stand, 0.0]), 0.0, 0.4, best=0.0):
            if self._reach(cells, body.data.xipos[handle]):
                self.hold = True
                self._wait(3)
                for _ in range(80):
                    way, aside = self._way(handle)
                    if body.held != name or env.openness[part] > 0.95 or self.over:
                        break
                    self._follow(body.data.xipos[handle] + 0.06 * way, aside.any())
                self._let_go()
            if self.over or env.openness[part] >= 0.5:
                break
        return f"{part} is {'open' if env.openness[part] >= 0.5 else 'not open'}"

    def take(self, thing: str) -> str:
        """Drive up to a thing and take it."""
        body = self.env.body
        here = np.array([self.env.ground.cell_at(body.position)])
        near = [here] if np.linalg.norm(body.position - body.thing(thing)[:2]) < 0.95 else []
        spots = near + self._spots(body.thing(thing), 0.4, 0.95)
        for cells, above in [(c, a) for c in spots for a in (0.0, 0.2)]:
            if not self._reach(cells, body.thing(thing), above):
                continue
            self.hold = True
            self._wait(2)
            if body.held == thing:
                self._arm(min(1.4, float(body.hand[2]) + 0.12), None)
                self._arm(None, 0.0)
                return f"you hold {thing}"
            self._let_go()
            if self.over:
                break
        return f"you could not take {thing}"

    def give(self) -> str:
        """Bring what is held to the person."""
        for _ in range(4):
            self._drive(self._cells(self.env.person, 0.35, 0.6))
            self._turn(self.env.person)
            self._arm(1.0, min(0.4, max(0.0, math.dist(self.env.body.position, self.env.person) - 0.5)))
            if self.over:
                break
        return "it is not what was asked for, or the way is blocked"

    def leave(self) -> str:
        """Put down what is held."""
        self._let_go()
        return "you put it down"

    # How --------------------------------------------------------------------------------------

    def _step(self, base: tuple[float, float, float] = (0.0, 0.0, 0.0), *, ask: str = "") -> bool:
        """One action; True when the episode is over."""
        if not self.over:
            spoken = [float(word == ask) for word in self.env.spoken]
            action = np.array([*base, *self.arm, float(self.hold), *spoken])
            self._watch(action)
            _, _, ended, cut, self.info = self.env.step(action)
            self.over = ended or cut
        return self.over

    def _wait(self, steps: int) -> None:
        for _ in range(steps):
            self._step()

    def _let_go(self) -> None:
        self.hold = False
        self._wait(1)
        self._arm(None, 0.0)

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
            if self._step() or (k > 1 and np.linalg.norm(self.env.body.hand - before) < 0.003):
                break

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

    def _drive(self, cells: np.ndarray) -> bool:
        """Along a wide way to the nearest of some cells."""
        if not len(cells):
            return False
        body, ground = self.env.body, self.env.ground
        ways, stuck, tries, last = ground.wide_ways(cells), 0, 0, body.position
        for _ in range(600):
            way = ground.xy[ways.cells(ground.cell_at(body.position))]
            far, to = float(np.linalg.norm(way[-1] - body.position)), way[min(3, len(way) - 1)] - body.position
            if far < 0.06:
                return True
            turn = float(wrap(math.atan2(to[1], to[0]) - body.yaw))
            speed = min(1.0, 0.15 + far) if abs(turn) < 0.6 or far < 0.3 else 0.0
            ahead = np.array([math.cos(turn), math.sin(turn)])
            if self._step((*speed * ahead, float(np.clip(1.5 * turn, -1, 1)) if far > 0.3 else 0.0)):
                return False
            stuck = stuck + 1 if np.linalg.norm(body.position - last) < 0.005 and speed else 0
            last = body.position
            if stuck > 8:
                for _ in range(6):
                    self._step((*-0.7 * ahead, 0.3 * (-1) ** tries))
                stuck, tries = 0, tries + 1
                if tries > 3:
                    return False
        return False

    def _turn(self, point: np.ndarray) -> None:
        """Face a point."""
        for _ in range(60):
            to = point[:2] - self.env.body.position
            off = float(wrap(math.atan2(to[1], to[0]) - self.env.body.yaw))
            if abs(off) < 0.02 or self._step((0.0, 0.0, float(np.clip(2.5 * off, -1, 1)))):
                return

    def _cells(self, point: np.ndarray, low: float, high: float) -> np.ndarray:
        far = np.linalg.norm(self.env.ground.xy - point[:2], axis=1)
        return np.flatnonzero((far >= low) & (far <= high))

    def _spots(self, point: np.ndarray, low: float, high: float, best: float = 0.65) -> list[np.ndarray]:
        """Up to five places between two distances from a point, apart from each other, the one nearest to `best`
        first."""
        cells, xy, spots = self._cells(point, low, high), self.env.ground.xy, list[np.ndarray]()
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


def play_skills(skills: Skills, agent: Policy | None, seed: int, world: str | None = None) -> dict[str, Any]:
    """Facts of an episode; without an agent that of an expert, who knows where everything is."""
    o, memory, goal = skills.reset(seed, world), None, skills.env.goal
    for words in (*[f"open {goal.part}"] * bool(goal.part), f"take {goal.thing}", "give") if agent is None else ():
        skills.do(words)
    while agent is not None and o is not None:
        [action], memory = agent.act([o], memory, rngs=[stream(seed, "skills", skills.time)])
        o = skills.step(action)
    facts = {name: skills.info[name] for name in ("success", "spl", "metres", "seconds", "price")}
    return {**facts, "hidden": bool(goal.part), "asked": len(skills.env.replies), "fallen": len(skills.info["fallen"])}

"""Skills: a robot of Robot-v0's 'bring' is told to go, open, take, give, leave and ask (see bring_me.py).

    skills = Skills(gymnasium.make("embodied/Robot-v0", task="bring", observations=()).unwrapped)
    observation = skills.reset(0)
    observation = skills.step(Move(observation.candidates.words.index("go kitchen_1")))

Candidates are words, so any `Policy` that reads words plays it, a language model, too. The robot is FETCHER, whose arm
is a lift and a telescope, and grasps are assisted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import shapely

from embodied import interface
from embodied.assistants.ask import BRING_QUESTIONS
from embodied.assistants.descriptions import side
from embodied.geometry import wrap
from embodied.gym.bring import BringEnv, inside
from embodied.gym.robot import OPENED, SHUT
from embodied.tasks.ask import look_of

ARM, SEES, REACHED_IN, CLEAR = 0.25, 4.0, 1.5, 0.23
"""Metres from the base's middle to the hand when the arm is drawn in, within which a thing in the line of sight of the
head is seen, and what lies in open furniture; and by which its middle stays away from open doors of furniture."""


@dataclass(frozen=True)
class SkillExtras(interface.Extras):
    """Observation of the robot besides what all kinds see."""

    sees: Mapping[str, str]
    """Things in sight by name, the nearest first: class and colour, metres, direction; 'person' is who asked."""
    holds: str
    room: str
    outcome: str
    """Of the last skill, in words."""

    def lines(self, turn: int) -> tuple[str, ...]:
        lines = (f"you are in {self.room}", f"you hold {self.holds or 'nothing'}", self.outcome)
        return (*lines, *(f"{name}: {words}" for name, words in self.sees.items()))


class Skills:
    """Owns an episode of 'bring' by skills."""

    def __init__(self, env: BringEnv, watch: Callable[[dict[str, Any], np.ndarray], None] = lambda o, a: None) -> None:
        """`watch`: told the environment's observation and the action before it is taken."""
        self.env, self._watch = env, watch

    def reset(self, seed: int) -> interface.Observation:
        self._seen, self.info = self.env.reset(seed=seed)
        self._hold, self.over, self.time, self._set = False, False, 0, np.zeros(len(self.env.body.arm))
        self._look_of, self._been = look_of(self.env.world.catalogue), dict[str, list[int]]()
        self._arm(0.9, 0.0)
        return self.look("you begin")

    def step(self, action: interface.Action) -> interface.Observation | None:
        """Carry out a candidate or a question, or stop; None when the episode is over."""
        self.time, outcome = self.time + 1, "you asked"
        if isinstance(action, interface.Ask):
            self._act(ask=action.intention.value)
        elif isinstance(action, interface.Move):
            outcome = self.do(self.words[action.candidate])
        else:
            self.over = True
        return None if self.over else self.look(outcome)

    def do(self, words: str) -> str:
        """Carry out 'go ROOM', 'open PART', 'take THING', 'give' or 'leave'; returns what came of it."""
        verb, _, what = words.partition(" ")
        skill = {"go": self.go, "open": self.open, "take": self.take, "give": self.give, "leave": self.leave}[verb]
        return skill(what)

    def look(self, outcome: str) -> interface.Observation:
        """The observation as of now."""
        env, seen, holds = self.env, self.in_sight(), self.env.holds
        things = [f"take {n}" if n in env.body.things else f"open {n}" for n in seen if n != "person"]
        can = ["give"] * ("person" in seen) + ["leave"] if holds else things
        self.words = (*(f"go {room}" for room in sorted({*env.ground.room_of_cell} - {""})), *can)
        extras, zeros = SkillExtras(seen, holds, env.room_at(env.body.position), outcome), np.zeros(len(self.words))
        candidates = interface.Candidates(zeros, zeros, zeros.astype(int), zeros == 0, self.words)
        turn = round(env.body.yaw / interface.STEP) % interface.TURNS
        sight, can_ask = interface.Sight(env.world.name, 0), BRING_QUESTIONS[: None if holds else -1]
        first = (sight, turn, 0, candidates, env.heard, None, interface.Mode.MAIN, can_ask, None)
        return interface.Observation(*first, time=self.time, time_on_task=self.time, extras=extras)

    def in_sight(self) -> dict[str, str]:
        """Things, closed parts and the person in sight while the head turns about, in words."""
        body, env, of = self.env.body, self.env, self.env.world.house.placement_by_id
        eye, geom, seen = body.data.cam_xpos[body.model.camera("robot/head").id].copy(), np.zeros(1, np.int32), []
        shut = {n: body.handles[n.replace("/", "_")] for n, x in env.openness.items() if "/" in n and x < OPENED}
        lying = self._in_open()
        for name, b in {**body.things, **shut, "person": -1}.items():
            way = (body.data.xipos[b] if b >= 0 else np.array([*env.person, 1.2])) - eye
            if (metres := float(np.linalg.norm(way))) > SEES or name == body.held:
                continue
            met = mujoco.mj_ray(body.model, body.data, eye, way / metres, None, 1, body.root, geom)
            seen_into = name in lying and metres < REACHED_IN
            if seen_into or not 0 <= met <= metres - 0.15 or body.model.geom_bodyid[geom[0]] == b:
                (thing, _, part), noun = name.partition("/"), "whoever asked you"
                if thing in of:
                    words = [f"closed {part} of the"] if part else self._look_of(of[thing])[:1]
                    noun = " ".join([*words, of[thing].object_class])
                bearing = float(wrap(math.atan2(way[1], way[0]) - body.yaw))
                seen.append((metres, name, f"{noun}, {metres:.1f} m, {side(bearing)}"))
        return {name: words for _, name, words in sorted(seen)}

    def _in_open(self) -> dict[str, str]:
        """Things in furniture that stands open, and the furniture."""
        holders, thing = dict[str, str](), self.env.body.thing
        for part in (n for n, x in self.env.openness.items() if "/" in n and x >= OPENED):
            middle, half = inside(self.env, part)
            within = [n for n in self.env.body.things if (np.abs(thing(n) - middle) <= half).all()]
            holders |= dict.fromkeys(within, part.partition("/")[0])
        return holders

    # Skills -----------------------------------------------------------------------------------

    def go(self, room: str) -> str:
        """Drive to the middle of a room, or when it has been there, to what is farthest from where it was."""
        xy, been = self.env.ground.xy, self._been.setdefault(room, [])
        cells = np.flatnonzero(self.env.ground.room_of_cell == room)
        away = -np.linalg.norm(xy[cells] - xy[cells].mean(0), axis=1)
        if been:
            away = np.linalg.norm(xy[cells, None] - xy[been][None], axis=2).min(1)
        been.append(int(cells[away.argmax()]))
        return f"you are {'' if self._drive(np.array(been[-1:])) else 'not '}there"

    def open(self, part: str) -> str:
        """Take a handle and pull."""
        env, body, name = self.env, self.env.body, part.replace("/", "_")
        handle = body.handles[name]
        at, (way, aside) = body.data.xipos[handle].copy(), self._way(handle)
        stand = at[:2] + 0.5 * self._front(part.partition("/")[0]) + 0.3 * aside
        for cells in self._spots(stand, 0.0, 0.7, best=0.0, to=at):
            beside = np.append(-0.05 * self._way(handle)[1], 0.0)  # away from the handle of another leaf
            if self._reach(cells, body.data.xipos[handle] + beside):
                self._hold = True
                self._act(times=3)
                opened = [env.openness[part]]
                while body.held == name and opened[-1] < 0.95 and not self.over:
                    if len(opened) > 15 and opened[-1] < opened[-15] + 0.02:
                        break
                    way, now = self._way(handle)
                    self._follow(body.data.xipos[handle] + 0.06 * way, turns=bool(now.any()))
                    opened.append(env.openness[part])
                self.leave()
                if aside.any() and SHUT < env.openness[part] < 0.95:
                    self._push(handle, at, aside, part)
            if self.over or env.openness[part] >= OPENED:
                break
        return f"{part} is {'open' if env.openness[part] >= OPENED else 'not open'}"

    def _push(self, handle: int, at: np.ndarray, aside: np.ndarray, part: str) -> None:
        """Push a door further open from within, whose handle was `at` when it was shut."""
        body, front = self.env.body, self._front(part.partition("/")[0])
        hinge = body.data.xanchor[body.model.body_jntadr[body.model.body_parentid[handle]]][:2]
        wide = float((at[:2] - hinge) @ aside)
        within = hinge + 0.5 * wide * aside + 0.1 * front
        self._turn(within)
        self._arm(None, math.dist(body.position, within) - ARM)
        self._turn(over := hinge + 0.75 * wide * front)
        self._arm(None, math.dist(body.position, over) - ARM)
        self._arm(None, 0.0)

    def take(self, thing: str) -> str:
        """Drive up to a thing and take it."""
        body, at = self.env.body, self.env.body.thing(thing)
        spots = self._spots(at, 0.4, 0.95, to=at)
        if holder := self._in_open().get(thing):
            spots = self._spots(at[:2] + 0.65 * self._front(holder), 0.0, 0.4, best=0.0, to=at)
        elif math.dist(body.position, at[:2]) < 0.95:
            spots.insert(0, np.array([self.env.ground.cell_at(body.position)]))
        for cells, above in [(c, a) for c in spots for a in (0.0, 0.2)]:
            if self._reach(cells, body.thing(thing), above):
                self._hold = True
                self._act(times=2)
                if body.held == thing:
                    self._arm(min(1.4, float(body.hand[2]) + 0.12), None)
                    self._arm(None, 0.0)
                    return f"you hold {thing}"
                self.leave()
            if self.over:
                break
        return f"you could not take {thing}"

    def give(self, _: str = "") -> str:
        """Bring what is held to the person."""
        for _k in range(4):
            far = np.linalg.norm(self.env.ground.xy - self.env.person, axis=1)
            self._drive(np.flatnonzero((far >= 0.35) & (far <= 0.6)))
            self._turn(self.env.person)
            self._arm(1.0, min(0.4, max(0.0, math.dist(self.env.body.position, self.env.person) - 0.5)))
        return "it is not what was asked for, or the way is blocked"

    def leave(self, _: str = "") -> str:
        """Let go, and draw the arm in."""
        self._hold = False
        self._act()
        self._arm(None, 0.0)
        return "you put it down"

    # How --------------------------------------------------------------------------------------

    def _act(self, ahead: float = 0.0, left: float = 0.0, turn: float = 0.0, *, ask: str = "", times: int = 1) -> bool:
        """One action, or several times the same; True when the episode is over."""
        for _ in range(times):
            if not self.over:
                asks = [float(word == f"ask {ask}") for word in self.env.spoken]
                action = np.array([ahead, left, turn, *self._set, float(self._hold), *asks])
                self._watch(self._seen, action)
                self._seen, _, ended, late, self.info = self.env.step(action)
                self.over = ended or late
        return self.over

    def _aim(self, height: float | None, reach: float | None) -> None:
        """Set the hand's height, metres above the floor, and how far it is out; as they are where None."""
        target = self.env.middle + self.env.half * self._set
        if height is not None:
            target[0] = np.clip(height - self.env.body.placed.pose[2], 0.1, 1.45)
        if reach is not None:
            target[1] = np.clip(reach / 4, 0.0, 0.2)
        self._set = (target - self.env.middle) / self.env.half

    def _arm(self, height: float | None, reach: float | None) -> None:
        """Bring the hand there, and wait until it is."""
        self._aim(height, reach)
        for k in range(20):
            before = self.env.body.hand
            if self._act() or (k > 1 and np.linalg.norm(self.env.body.hand - before) < 0.003):
                break

    def _way(self, handle: int) -> tuple[np.ndarray, np.ndarray]:
        """(3,) unit in which a handle opens, and (2,) unit from an upright hinge to it, or zeros."""
        model, data = self.env.body.model, self.env.body.data
        joint = model.body_jntadr[model.body_parentid[handle]]
        axis, arm = data.xaxis[joint].copy(), data.xipos[handle] - data.xanchor[joint]
        if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
            return axis, np.zeros(2)
        way = np.cross(axis, arm)
        return way / np.linalg.norm(way), arm[:2] / np.linalg.norm(arm[:2]) * (abs(axis[2]) > 0.5)

    def _front(self, furniture: str) -> np.ndarray:
        """(2,) unit to which the front of furniture looks."""
        yaw = self.env.world.house.placement_by_id[furniture].yaw
        return np.array([math.sin(yaw), -math.cos(yaw)])

    def _follow(self, point: np.ndarray, turns: bool) -> None:
        """One action after which the hand is nearer to a point: by turning and reaching, or by driving."""
        away = math.dist(point[:2], self.env.body.position)
        if not turns and away < 0.45:
            self._act(-0.5)
            return
        self._aim(float(point[2]), away - ARM)
        self._act(turn=float(np.clip(2.5 * self._bearing(point), -1, 1)))

    def _bearing(self, point: np.ndarray) -> float:
        to = point[:2] - self.env.body.position
        return float(wrap(math.atan2(to[1], to[0]) - self.env.body.yaw))

    def _turn(self, point: np.ndarray) -> None:
        """Face a point."""
        for _ in range(60):
            off = self._bearing(point)
            if abs(off) < 0.02 or self._act(turn=float(np.clip(2.5 * off, -1, 1))):
                return

    def _drive(self, cells: np.ndarray) -> bool:
        """Along a wide way to the nearest of some cells, at least one."""
        body, ground, stuck, tries, last = self.env.body, self.env.ground, 0, 0, self.env.body.position
        here, shut = ground.cell_at(body.position), np.zeros(len(ground.xy), bool)
        for leaf in self._leaves():
            away = shapely.distance(shapely.points(ground.xy), leaf)
            shut |= away < min(CLEAR, away[here])
        ways = ground.wide_ways(cells, shut)
        for _ in range(600):
            if tries > 3 or self.over:
                break
            if not np.isfinite(ways.metres[here := ground.cell_at(body.position)]):
                ways = ground.wide_ways(cells)  # doors give way, or not
            way = ground.xy[ways.cells(here)]
            if (far := math.dist(way[-1], body.position)) < 0.06:
                return True
            turn = self._bearing(way[min(3, len(way) - 1)])
            speed = min(1.0, 0.15 + far) if abs(turn) < 0.6 or far < 0.3 else 0.0
            ahead, left = math.cos(turn), math.sin(turn)
            self._act(speed * ahead, speed * left, float(np.clip(1.5 * turn, -1, 1)) * (far > 0.3))
            stuck = stuck + 1 if speed and math.dist(body.position, last) < 0.005 else 0
            last = body.position
            if stuck > 8:
                self._act(-0.7 * ahead, -0.7 * left, 0.3 * (-1) ** tries, times=6)
                stuck, tries = 0, tries + 1
        return False

    def _spots(
        self, point: np.ndarray, low: float, high: float, best: float = 0.65, *, to: np.ndarray
    ) -> list[np.ndarray]:
        """Up to five cells between two distances from a point, apart from each other; first those from where the arm
        meets neither walls nor open doors on its way `to` something, the nearest to `best` first."""
        xy, leaves, spots = self.env.ground.xy, self._leaves(), list[np.ndarray]()
        far = np.linalg.norm(xy - point[:2], axis=1)
        near = {int(c): self._blocked(xy[c], to, leaves) for c in np.flatnonzero((far >= low) & (far <= high))}
        for cell in sorted(near, key=lambda c: (near[c], abs(far[c] - best))):
            if len(spots) < 5 and all(math.dist(xy[cell], xy[s[0]]) > 0.25 for s in spots):
                spots.append(np.array([cell]))
        return spots

    def _blocked(self, xy: np.ndarray, to: np.ndarray, leaves: list[shapely.LineString]) -> bool:
        """True if the base meets open doors at a place, or an arm from there meets them or anything else."""
        away, line = to - (*xy, to[2]), shapely.linestrings([xy, to[:2]])
        metres, body, geom = float(np.linalg.norm(away)), self.env.body, np.zeros(1, np.int32)
        start = np.array([*xy, to[2] + 0.02])
        met = mujoco.mj_ray(body.model, body.data, start, away / metres, None, 1, body.root, geom)
        at = shapely.Point(xy)
        shell = met >= 0 and body.model.geom(geom[0]).name.partition("/")[2].startswith(("wall", "leaf"))
        if 0 <= met < metres - 0.3 * (not shell):
            return True
        return any(x.distance(at) < CLEAR or x.distance(line) < 0.06 for x in leaves)

    def _leaves(self) -> list[shapely.LineString]:
        """Where doors of furniture stand that are open, from hinge to handle, metres."""
        body, lines = self.env.body, list[shapely.LineString]()
        for part in (n for n, x in self.env.openness.items() if "/" in n and x > SHUT):
            if (handle := body.handles.get(part.replace("/", "_"))) is not None:
                joint = body.model.body_jntadr[body.model.body_parentid[handle]]
                if self._way(handle)[1].any():
                    lines.append(shapely.LineString([body.data.xanchor[joint][:2], body.data.xipos[handle][:2]]))
        return lines

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

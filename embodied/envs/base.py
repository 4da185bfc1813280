"""Episodes as small explicit state machines: one class per rule of play, all driven by `step`.

`HelpEnv` keeps what every rule shares (pose, time, recording, checks) and is by itself the rule of
plain navigation: moves move, stop ends. A rule with help overrides three methods: what a reply
does, what stopping does, and what may be asked.
"""

import dataclasses
import enum
from collections.abc import Mapping
from typing import Any, TypeVar

from embodied import interface
from embodied.action_spaces import Moves, PanoramicMoves, doors_moved
from embodied.navigation.doors import seen_name
from embodied.navigation.graph import behind_doors
from embodied.seeds import checked_seed, stream

T = TypeVar("T")
STEP_COST = 0.01
"""Of a step, in the reward of Gymnasium."""


class TaskError(ValueError):
    """A task that cannot be played in the worlds at hand."""


class ActionError(ValueError):
    """An action that is not possible now; the episode is unchanged and can go on."""


class DoorRule(enum.StrEnum):
    """Effects of a move towards a closed door."""

    OPEN = "open"
    """It is masked: the agent has to open the door by an action of its own."""
    PUSH = "push"
    """It is the action of opening the door: the agent stays, and can go on by the next move."""
    WALK = "walk"
    """It opens the door and goes through, for agents that know nothing of doors."""


class HelpEnv:
    """Plays one task at a time; without an assistant this is plain navigation ('find' and VLN).

    Nothing it does depends on other episodes: the only randomness is what the assistant draws
    from a generator named after the seed, the task and the step.
    """

    asking_takes_time = True
    """A request uses up a step of the horizon (Algorithms 6 and 7)."""
    doors: DoorRule = DoorRule.OPEN

    def __init__(
        self,
        worlds: Mapping[str, interface.Place],
        assistant: interface.Assistant | None = None,
        moves: Moves | None = None,
    ) -> None:
        """
        Args:
          worlds: by House.name.
          assistant: who answers; None where nobody does.
          moves: the action space; environments of one batch may share it, and its cache.
        """
        self.worlds = worlds
        self.assistant = assistant
        self.moves = moves or PanoramicMoves()
        self.ended: str | None = "limit"
        self._steps: list[interface.Step] = []

    # Playing -------------------------------------------------------------------------------------

    def reset(self, task: interface.Task, *, seed: int = 0) -> interface.Observation:
        """Begin `task`; equal (task, seed) and equal actions give equal episodes.

        Raises:
          TaskError: unknown world, nodes outside the graph, a goal that is not in the house.
        """
        check_task(task, self.worlds)
        self.task, self.seed, self.world = task, checked_seed(seed), self.worlds[task.world]
        self.pose = task.start
        self.mode, self.instruction = interface.Mode.MAIN, task.request
        self.target: interface.Viewpoint | None = None
        self.targets = task.goal_nodes
        self.subtask: interface.Subtask | None = None
        self.time = self.time_on_task = self.requests = 0
        self.budget = self._budget()
        self.ended = None
        self._steps = []
        self._trail: list[int] = []
        self.closed = self.world.graph.closed.union(task.closed)
        self._begin()
        return self._look()

    def step(self, action: interface.Action) -> interface.Observation | None:
        """Take one action; the next observation, or None when the episode has ended.

        Raises:
          ActionError: the episode is over, the candidate does not exist or is masked, or nobody
            can be asked that here. Nothing has changed then.
        """
        self._check(action)
        if isinstance(action, interface.Move) and self.doors is DoorRule.PUSH and self._barred(action.candidate):
            action = interface.Open(action.candidate, action.thought)
        before, situation = self.observation, self.situation
        mode, instruction, targets, subtask = self.mode, self.instruction, self.targets, self.subtask
        reply, cost, moved = None, self._cost(action), self._moved_part(action)
        self.time_on_task += 1
        if isinstance(action, interface.Move):
            self.pose = self._reach[1][action.candidate]
            self._moved()
        elif isinstance(action, interface.Ask):
            rng = stream(self.seed, "assistant", self.task.id, self.time)
            asked = dataclasses.replace(situation, question=action.question or "")
            reply = required(self.assistant, "assistant").answer(asked, action.intention, rng=rng)
            self.requests += 1
            self._replied(reply)
        elif isinstance(action, interface.Stop):
            self._stopped()
        if self.asking_takes_time or not isinstance(action, interface.Ask):
            self.time += 1
        if self.ended is None and self.time >= self.task.horizon:
            self.ended = "limit"
        stated = situation.pose, mode, instruction, targets, subtask.id if subtask else "none", before.can_ask
        did = situation.candidate_nodes, action, reply, self.pose, cost
        step = interface.Step(*stated, *did, moved=moved)
        self._steps.append(step)
        self.closed ^= doors_moved(step, self.world.graph, self.closed)
        return self._look() if self.ended is None else None

    def cut_short(self) -> None:
        """End the episode here, as its horizon does; nothing where it has ended."""
        self.ended = self.ended or "limit"

    def facts(self) -> dict[str, float]:
        """Numbers about the episode so far, for Gymnasium's info."""
        return {}

    def reward(self, success: float) -> float:
        """Gymnasium's reward of the last step: success, at the end, less STEP_COST and what the step cost."""
        return success - STEP_COST - self.last_step.cost

    def potential(self) -> float:
        """How far the goal is, for a shaped reward: metres to the nearest goal / 10."""
        distance = behind_doors(self.world.graph, self.closed).distance
        return min(float(distance[self.pose.node, g]) for g in self.task.goal_nodes) / 10.0

    @property
    def last_step(self) -> interface.Step:
        """The step that was just written down."""
        return self._steps[-1]

    def episode(self, agent: str = "") -> interface.Episode:
        """The finished episode.

        Raises:
          RuntimeError: it has not ended.
        """
        if self.ended is None:
            raise RuntimeError(f"episode of task {self.task.id!r} has not ended; step until it returns None")
        return self.so_far(agent)

    def so_far(self, agent: str = "") -> interface.Episode:
        """The episode as if its time were up now, unless it has ended."""
        played, house = (tuple(self._steps), self.ended or "limit", self.seed), self.world.house.digest[:16]
        return interface.Episode(self.task, *played, agent, self.budget, house)

    # What a rule with help overrides -------------------------------------------------------------

    def _begin(self) -> None:
        """Set up what the rule needs beyond the common state."""

    def _replied(self, reply: interface.Reply) -> None:
        """Take in what the assistant said; set time_on_task to 0 when it changes the instruction."""
        raise TypeError(
            f"{type(self).__name__} does not say what a reply does; override _replied, or play by a rule with help"
        )

    def _stopped(self) -> None:
        """The agent says it is done."""
        self.ended = "stop"

    def _moved(self) -> None:
        """The agent has just moved."""

    def _askable(self, situation: interface.Situation) -> tuple[interface.Intention, ...]:
        if self.assistant is None or (self.budget is not None and self.requests >= self.budget):
            return ()
        return self.assistant.intentions(situation)

    def _moved_part(self, action: interface.Action) -> tuple[str, ...]:
        """Parts of furniture that an action opens or closes."""
        return ()

    def _cost(self, action: interface.Action) -> float:
        return 0.0

    def _extras(self) -> interface.Extras | None:
        """Observation.extras: what the agent is told besides."""
        return None

    def _truth(self) -> Any:
        """Situation.extras: what the assistant knows besides."""
        return None

    # Looking -------------------------------------------------------------------------------------

    def _budget(self) -> int | None:
        """The task's budget; a fraction becomes one more request with that probability (docs/sources.md, S46)."""
        if self.task.budget is None:
            return None
        whole, part = divmod(self.task.budget, 1)
        return int(whole) + (part > 0 and stream(self.seed, "budget", self.task.id).random() < part)

    def _look(self) -> interface.Observation:
        self._reach = self.moves.at(self.world, self.pose)
        candidates, poses = self._reach
        barred = [k for k in range(len(poses)) if self.closed and self._barred(k)]
        if barred and self.doors is DoorRule.OPEN:
            allowed = candidates.allowed.copy()
            allowed[barred] = False
            candidates = dataclasses.replace(candidates, allowed=allowed)
        if len(self._trail) <= self.time:
            self._trail.append(self.pose.node)
        left = None if self.budget is None else max(self.budget - self.requests, 0)
        self.situation = interface.Situation(
            world=self.world,
            task=self.task,
            pose=self.pose,
            mode=self.mode,
            targets=self.targets,
            subtask=self.subtask,
            candidate_nodes=tuple(p.node for p in poses),
            candidates=candidates,
            time=self.time,
            requests=self.requests,
            requests_left=left,
            trail=tuple(self._trail),
            extras=self._truth(),
            closed=self.closed,
        )
        self.observation = interface.Observation(
            sight=interface.Sight(self.seen_from(self.pose.node), self.pose.node),
            turn=self.pose.turn,
            tilt=self.pose.tilt,
            candidates=candidates,
            instruction=self.instruction,
            target=None if self.target is None else interface.Sight(self.target.world, self.target.node, picture=True),
            mode=self.mode,
            can_ask=self._askable(self.situation),
            requests_left=left,
            time=self.time,
            time_on_task=self.time_on_task,
            moved=bool(self._steps) and self._steps[-1].pose.node != self.pose.node,
            extras=self._extras(),
            can_open=tuple(barred),
            can_close=self._closable(),
        )
        return self.observation

    def _barred(self, candidate: int) -> tuple[str, ...]:
        """The closed doors on the way to a candidate."""
        here, there = self.pose.node, self._reach[1][candidate].node
        return self.world.graph.barred(here, there, self.closed) if here != there else ()

    def _closable(self) -> tuple[int, ...]:
        """Candidates behind a door that was closed at the start and is open now."""
        opened = self.world.graph.closed.union(self.task.closed) - self.closed
        here, graph = self.pose.node, self.world.graph
        return tuple(k for k, p in enumerate(self._reach[1]) if opened and graph.barred(here, p.node, opened))

    def seen_from(self, node: int) -> str:
        """Name of what is seen from a node, doors and furniture as they are."""
        house, graph = self.world.house, self.world.graph
        return self.task.world if self.closed == graph.closed else seen_name(house, graph, node, self.closed)

    def _check(self, action: interface.Action) -> None:
        if self.ended is not None:
            raise ActionError(f"the episode is over ({self.ended}); reset before taking {action}")
        if isinstance(action, interface.Move):
            allowed = self.observation.candidates.allowed
            if not 0 <= action.candidate < len(allowed):
                raise ActionError(f"candidate {action.candidate} does not exist, there are {len(allowed)} here")
            if not allowed[action.candidate]:
                raise ActionError(f"candidate {action.candidate} is masked here; choose one with allowed = True")
        elif isinstance(action, interface.Ask):
            if action.intention not in self.observation.can_ask:
                can = [i.value for i in self.observation.can_ask] or "nothing"
                raise ActionError(
                    f"cannot ask {action.intention.value!r} here, only {can}; look at Observation.can_ask"
                )
        elif isinstance(action, interface.Open | interface.Close):
            can_move = self.observation.can_open if isinstance(action, interface.Open) else self.observation.can_close
            if action.candidate not in can_move:
                raise ActionError(f"{action} is not possible here, only of the candidates {list(can_move)}")
        elif not isinstance(action, interface.Stop):
            raise ActionError(f"expected Move, Ask, Open, Close or Stop, got {action!r}")


def required(value: T | None, what: str) -> T:
    """`value`, which a rule of play cannot do without.

    Raises:
      TypeError: it is not there; the assistant does not fit the rule.
    """
    if value is None:
        raise TypeError(f"there is no {what}, which this rule of play needs; give the environment another assistant")
    return value


def check_task(task: interface.Task, worlds: Mapping[str, interface.Place]) -> None:
    """Refuse a task that cannot be played.

    Raises:
      TaskError: says what is missing.
    """
    if task.world not in worlds:
        raise TaskError(f"task {task.id!r} plays in the unknown world {task.world!r}; known are {sorted(worlds)[:8]}")
    world = worlds[task.world]
    n = len(world.graph.positions)
    nodes = (task.start.node, *task.goal_nodes)
    if not task.goal_nodes or not all(0 <= v < n for v in nodes):
        raise TaskError(
            f"task {task.id!r} names the nodes {nodes}, world {task.world!r} has 0..{n - 1}; sample it again"
        )
    house, goal = world.house, task.goal
    rooms = goal.rooms if isinstance(goal, interface.GoTo) else ()
    things: tuple[str, ...] = getattr(goal, "placements", ())
    if isinstance(goal, interface.FindDescribed):
        things = (goal.placement, *goal.fitting, *goal.similar)
    doors = {d for passed in world.graph.doors.values() for d in passed}
    if unknown := sorted(set(task.closed) - doors):
        raise TaskError(f"task {task.id!r} closes {unknown}; doors that bar ways of {task.world!r} are {sorted(doors)}")
    missing = [p for p in things if not {p, p.partition(".")[0]} & {*house.placement_by_id}] + [
        r for r in rooms if r not in house.room_by_id
    ]
    if missing:
        raise TaskError(f"task {task.id!r} looks for {missing}, not in the house {task.world!r}; sample it again")
    if task.horizon < 1 or (task.budget is not None and task.budget < 0):
        raise TaskError(f"task {task.id!r} needs horizon >= 1 and budget >= 0, got {task.horizon} and {task.budget}")

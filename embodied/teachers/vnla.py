"""VNLA's teachers: the shortest way in turns and steps, and the rules of when to ask (docs/sources.md, S49, S50)."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from embodied import interface
from embodied.action_spaces import WORDS, MonocularMoves
from embodied.navigation.graph import nearest

ACTION = 1e-3
"""Metres that one action weighs in planning: the shortest walk first, the fewest actions second."""


LOST = 1e6
"""Metres that a state costs from which no goal can be reached in this action space: its best move is one that the state
has, towards the goal along the graph."""


class MonocularPlan:
    """Shortest ways through the poses of one world, whose 'forward' goes where the camera looks.

    A neighbour that is never nearest the middle of any view cannot be walked to directly, so the
    shortest way in this action space may be longer than along the graph.
    """

    def __init__(self, world: interface.Place, moves: MonocularMoves) -> None:
        nodes = len(world.graph.positions)
        self.distance = distance = np.asarray(world.graph.distance)
        states = nodes * interface.VIEWS
        self.next = np.tile(np.arange(states)[:, None], (1, len(WORDS)))
        self.weight = np.full((states, len(WORDS)), np.inf)
        for state in range(states):
            pose = pose_of(state)
            candidates, poses = moves.at(world, pose)
            for a in np.flatnonzero(candidates.allowed):
                self.next[state, a] = state_of(poses[a])
                self.weight[state, a] = distance[pose.node, poses[a].node] + ACTION
        here, action = np.nonzero(np.isfinite(self.weight))
        there, weight = self.next[here, action], self.weight[here, action]
        self._backwards = csr_matrix((weight, (there, here)), shape=(states, states))
        self._cost: dict[tuple[int, ...], np.ndarray] = {}
        self._cost_to: dict[interface.Pose, np.ndarray] = {}
        self._actions: dict[tuple[int, ...], np.ndarray] = {}
        self._counts: dict[tuple[int, ...], np.ndarray] = {}

    def cost(self, goals: tuple[int, ...]) -> np.ndarray:
        """(states,) metres plus ACTION per action to the nearest of `goals`; inf where none can be reached."""
        if goals not in self._cost:
            sources = [g * interface.VIEWS + v for g in goals for v in range(interface.VIEWS)]
            self._cost[goals] = dijkstra(self._backwards, indices=sources, min_only=True)
        return self._cost[goals]

    def action(self, pose: interface.Pose, goals: tuple[int, ...]) -> int | None:
        """Index into WORDS of the best move; None at a goal (stop)."""
        return None if pose.node in goals else int(self._best(goals)[state_of(pose)])

    def _best(self, goals: tuple[int, ...]) -> np.ndarray:
        """(states,) int8 index into WORDS of the best move to the nearest of `goals`, the first of equals."""
        if goals not in self._actions:
            total = np.round(self.weight + self._known(self.cost(goals), goals)[self.next], 9)
            self._actions[goals] = np.argmin(total, axis=1).astype(np.int8)
        return self._actions[goals]

    def _known(self, cost: np.ndarray, goals: tuple[int, ...]) -> np.ndarray:
        """(states,) costs; where no goal can be reached, how far the nearest is along the graph, behind all others."""
        behind = LOST + np.repeat(self.distance[:, list(goals)].min(axis=1), interface.VIEWS)
        return np.where(np.isfinite(cost), cost, behind)

    def action_to(self, pose: interface.Pose, end: interface.Pose) -> int | None:
        """Index into WORDS of the best move towards a pose, its angles included; None in it.

        On the way that `words` described it says the words themselves: what is best towards the end of a best way
        is best towards its goals, and of equals both take the first.
        """
        if pose == end:
            return None
        if end not in self._cost_to:
            self._cost_to[end] = self._known(dijkstra(self._backwards, indices=state_of(end)), (end.node,))
        state = state_of(pose)
        return int(np.argmin(np.round(self.weight[state] + self._cost_to[end][self.next[state]], 9)))

    def after(self, pose: interface.Pose, words: Sequence[str]) -> interface.Pose:
        """The pose that `words` lead to."""
        for word in words:
            if word != "stop":
                pose = pose_of(int(self.next[state_of(pose), WORDS.index(word)]))
        return pose

    def words(self, pose: interface.Pose, goals: tuple[int, ...], most: int) -> tuple[tuple[str, ...], interface.Pose]:
        """The next `most` teacher actions, ending with 'stop' if it comes, and the pose they lead to (4.1)."""
        words: list[str] = []
        while len(words) < most:
            action = self.action(pose, goals)
            if action is None:
                words.append("stop")
                break
            words.append(WORDS[action])
            pose = pose_of(int(self.next[state_of(pose), action]))
        return tuple(words), pose

    def counts(self, goals: tuple[int, ...]) -> np.ndarray:
        """(states,) int64: actions of the teacher, the final stop included; -1 where no goal can be reached."""
        if goals not in self._counts:
            cost = self.cost(goals)
            follow = self.next[np.arange(len(cost)), self._best(goals)]
            arrived = np.isin(np.arange(len(cost)) // interface.VIEWS, goals)
            lost, here = ~np.isfinite(cost), np.arange(len(cost))
            counts = np.ones(len(cost), dtype=np.int64)
            for _ in range(len(cost)):
                going = ~arrived[here] & ~lost
                if not going.any():
                    break
                counts += going
                here = np.where(going, follow[here], here)
            self._counts[goals] = np.where(lost, -1, counts)
        return self._counts[goals]

    def count(self, pose: interface.Pose, goals: tuple[int, ...]) -> int:
        """Actions of the teacher from `pose`, the final stop included.

        Raises:
          ValueError: no goal can be reached.
        """
        n = int(self.counts(goals)[state_of(pose)])
        if n < 0:
            raise ValueError(f"none of the goals {goals} can be reached from {pose} in the monocular action space")
        return n


def state_of(pose: interface.Pose) -> int:
    return pose.node * interface.VIEWS + pose.view


def pose_of(state: int) -> interface.Pose:
    node, view = divmod(state, interface.VIEWS)
    return interface.Pose(node, view % interface.TURNS, view // interface.TURNS - 1)


DEVIATE, UNCERTAIN, UNMOVED = 8.0, 1.0, 9
"""Thresholds of the help-request teacher (docs/sources.md, S50): (a) metres from the shortest path; (b) nats below the
entropy of the uniform distribution over the six actions; (c) equal entries at the end of the trail."""


def ask_reason(situation: interface.Situation, thought: interface.Thought | None) -> str | None:
    """The first rule that says to ask, in the order of docs/sources.md, S50; None if none does.

    Args:
      thought: what the policy was about to do; without it the rules about it do not fire.
    """
    s, graph = situation, situation.world.graph
    if s.requests_left is not None and s.requests_left <= 0:
        return None
    here = s.trail[-1]
    goal = nearest(graph, here, s.task.goal_nodes)
    moves = None if thought is None or thought.moves is None else np.asarray(thought.moves, dtype=float)
    if moves is not None and here == goal and _best(moves) == "forward":
        return "arrive"
    if min(graph.distance[here, v] for v in graph.path(s.trail[0], goal)) > DEVIATE:
        return "deviate"
    if moves is not None:
        some = moves[moves > 0]
        if math.log(len(moves)) + float((some * np.log(some)).sum()) < UNCERTAIN:
            return "uncertain"
    last = s.trail[-UNMOVED:]
    if len(last) == UNMOVED and len(set(last)) == 1:
        return "unmoved"
    if s.requests_left is not None and s.requests_left >= s.task.horizon - s.time:
        return "remain"
    return None


def _best(moves: np.ndarray) -> str:
    return (*WORDS, "stop")[int(np.argmax(moves))]


class VnlaTeacher:
    """Reference moves of the monocular action space and, given a thought, whether to ask.

    Inside a sub-task of Algorithm 6 its reference leads to the pose in which the described actions end, and stops
    there (docs/sources.md, S110).
    """

    def __init__(self, moves: MonocularMoves | None = None) -> None:
        self.moves = moves or MonocularMoves()
        self._plans: dict[str, MonocularPlan] = {}

    def plan(self, world: interface.Place) -> MonocularPlan:
        """The plan of a world, made on first use."""
        name = world.house.name
        if name not in self._plans:
            self._plans[name] = MonocularPlan(world, self.moves)
        return self._plans[name]

    def label(self, situation: interface.Situation, thought: interface.Thought | None = None) -> interface.Label:
        return interface.Label(self.reference(situation), ask_reason(situation, thought) is not None)

    def reference(self, situation: interface.Situation) -> interface.Move | interface.Stop:
        """The reference move."""
        s, plan = situation, self.plan(situation.world)
        if s.mode is interface.Mode.SUB and s.subtask is not None and s.subtask.start is not None:
            action = plan.action_to(s.pose, plan.after(s.subtask.start, s.subtask.words))
        else:
            action = plan.action(s.pose, s.targets)
        return interface.Stop() if action is None else interface.Move(action)

    def relabel(self, episode: interface.Episode, world: interface.Place) -> tuple[interface.Label, ...]:
        """Labels of a finished episode; the thought at an Ask step is what its policy was about to do."""
        labels: list[interface.Label] = []
        trail: list[int] = []
        time = requests = 0
        subtask: interface.Subtask | None = None
        for step in episode.steps:
            if len(trail) <= time:
                trail.append(step.pose.node)
            left = None if episode.budget is None else episode.budget - requests
            candidates, _ = self.moves.at(world, step.pose)
            stated = world, episode.task, step.pose, step.mode, step.targets, subtask, step.candidate_nodes, candidates
            situation = interface.Situation(*stated, time, requests, left, tuple(trail))
            label = self.label(situation, step.action.thought)
            asked = isinstance(step.action, interface.Ask)
            labels.append(interface.Label(None if asked else label.move, label.ask if step.can_ask else None))
            subtask = subtask if step.reply is None else step.reply.subtask
            requests += asked
            time += not asked
        return tuple(labels)

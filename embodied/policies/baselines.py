"""Agents that do not learn: baselines, skylines, and the asking rules that go with them.

Those that need privileged information are PrivilegedPolicies and are shown the situations; the
others see Observations only.
"""

from collections import Counter
from collections.abc import Callable, Container, Iterable, Mapping
from typing import Any, Protocol

import numpy as np

from embodied.action_spaces import WORDS
from embodied.interface import (
    Action,
    Actions,
    Agent,
    Ask,
    Intention,
    Mode,
    Move,
    Observation,
    Observations,
    Open,
    PrivilegedPolicy,
    Rngs,
    Situation,
    Situations,
    Stop,
    Teacher,
    Thought,
    act,
)
from embodied.language.plain_language import heard_subgoal
from embodied.teachers.shortest import ShortestTeacher, shortest_of
from embodied.teachers.vnla import ask_reason


class RandomWalk:
    """Uniform over the candidates, doors to open and stop at every step (docs/sources.md, S42); never asks."""

    def act(self, observations: Observations, memory: Any, *, rngs: Rngs) -> tuple[Actions, Any]:
        return [None if o is None else _random_move(o, rng) for o, rng in zip(observations, rngs)], ()


class Forward10:
    """The candidate nearest the middle of the view for ten steps, then stop (docs/sources.md, S42)."""

    def act(self, observations: Observations, memory: Any, *, rngs: Rngs) -> tuple[Actions, Any]:
        ahead = lambda o: (
            Move(int(o.candidates.allowed.argmax())) if o.time < 10 and o.candidates.allowed.any() else Stop()
        )
        return [None if o is None else ahead(o) for o in observations], ()


class PerEpisodePolicy:
    """A PrivilegedPolicy that looks at each episode by itself: derive `act_one` and, where it remembers something of an
    episode, `new_memory`."""

    def new_memory(self) -> Any:
        """Memory at the beginning of an episode; `act_one` may change it."""
        return None

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        """The action of one episode."""
        raise NotImplementedError

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Rngs
    ) -> tuple[Actions, Any]:
        memories = memory or [self.new_memory() for _ in observations]
        return [
            None if o is None or s is None else self.act_one(o, s, own_memory, rng)
            for o, s, own_memory, rng in zip(observations, situations, memories, rngs, strict=True)
        ], memories


class Shortest(PerEpisodePolicy):
    """The skyline: the navigation teacher acts; never asks."""

    def __init__(self, teacher: Teacher | None = None) -> None:
        """`teacher`: of the action space; the panoramic shortest-path teacher if None."""
        self._label = (teacher or ShortestTeacher()).label

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        move = self._label(s).move
        assert move is not None, "where an agent is there is something to do"
        return move


WITHOUT_LEARNING: Mapping[str, Callable[[], Agent]] = {
    "shortest": Shortest,
    "random": RandomWalk,
    "forward10": Forward10,
}
"""Who plays any kind of task, by one word."""


class AskRule(Protocol):
    """True to ask now; called only where help can be asked for."""

    def __call__(self, observation: Observation, last_asked: int, *, rng: np.random.Generator) -> bool:
        """`last_asked` is the time of the last request, -1 before any."""


def never_ask(observation: Observation, last_asked: int, *, rng: np.random.Generator) -> bool:
    """NOASK."""
    return False


def ask_at_random(observation: Observation, last_asked: int, *, rng: np.random.Generator) -> bool:
    """RANDOMASK: with probability 0.2, the average of the authors' learned agent (4.2.5)."""
    return bool(rng.random() < 0.2)


def ask_every_5(observation: Observation, last_asked: int, *, rng: np.random.Generator) -> bool:
    """ASKEVERY5: as soon as five steps have passed since the last request (docs/sources.md, S42)."""
    return observation.time - last_asked >= 5


class PrivilegedAsking:
    """A privileged navigation policy with an asking rule in front of it."""

    def __init__(self, navigation: PrivilegedPolicy, rule: AskRule, question: str | None = None) -> None:
        """`question`: in words, for assistants who understand them."""
        self._navigation, self._rule, self._question = navigation, rule, question

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Rngs
    ) -> tuple[Actions, Any]:
        last, inner = memory or ([-1] * len(observations), None)
        actions, inner = self._navigation.act_privileged(observations, situations, inner, rngs=rngs)
        for i, o in enumerate(observations):
            if o is not None and o.can_ask and self._rule(o, last[i], rng=rngs[i]):
                actions[i], last[i] = Ask(o.can_ask[0], question=self._question), o.time
        return actions, (last, inner)


class PerfectInterpreter(PerEpisodePolicy):
    """The skyline 'perfect assistance interpretation' for an agent without learning.

    On a route the teacher acts, so every instruction is understood (4.2.5). On the main task the
    agent has no skill but its memory: it goes to the least visited neighbour, asks whenever it
    meets somebody it has not asked about the same target, and stops once it is as near a goal as
    the task demands (it recognises the object). The authors' row has a trained navigator there (docs/sources.md, S40).
    """

    def new_memory(self) -> Any:
        """Steps that began at each node, and nodes where it asked."""
        return Counter[int](), set[int]()

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        here, (visited, asked) = s.pose.node, memory
        visited[here] += 1
        if o.mode is Mode.SUB:
            return shortest_of(s)
        distance = s.world.graph.distance
        if min(distance[here, g] for g in s.task.goal_nodes) <= s.task.radius:
            return Stop()
        if Intention.HELP in o.can_ask and here not in asked:
            asked.add(here)
            return Ask()
        visits = np.array([visited[v] for v in s.candidate_nodes])
        return Move(int(rng.choice(np.flatnonzero(visits == visits.min()))))


class RecognisingExplorer(PerEpisodePolicy):
    """Goes where it has been least and stops at what is wanted, which it recognises; that alone is privileged."""

    def __init__(self, remembers: bool) -> None:
        """`remembers`: where it has been goes on across goals, and it goes back to what it has seen."""
        self._remembers = remembers

    def new_memory(self) -> Any:
        return {}, Counter[int]()

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        ways, visited = memory
        if o.time_on_task == 0 and not self._remembers:
            ways.clear()
            visited.clear()
        ways[s.pose.node] = s.candidate_nodes
        visited[s.pose.node] += 1
        if s.pose.node in s.targets or not s.candidate_nodes:
            return Stop()
        if (known := step_on_known_way(ways, s.pose.node, ways.keys() & {*s.targets})) is not None:
            return Move(s.candidate_nodes.index(known))
        visits = np.array([visited[v] for v in s.candidate_nodes])
        return Move(int(rng.choice(np.flatnonzero(visits == visits.min()))))


class SubgoalListener:
    """VNLA: does what the advisor's sentence says, word by word; otherwise a monocular random walk.

    The walk never stops by itself and prefers going forward, so what it reaches it owes to help. Under Algorithm 6
    it goes back to the request when it has done what was said.
    """

    def act(self, observations: Observations, memory: Any, *, rngs: Rngs) -> tuple[Actions, Any]:
        pending = memory or [("", (), False) for _ in observations]
        actions: Actions = []
        for i, o in enumerate(observations):
            if o is None:
                actions.append(None)
                continue
            heard, words, arrived = pending[i]
            if o.instruction != heard or o.time_on_task == 0:
                heard, words = o.instruction, heard_subgoal(o.instruction)
            if not words and (o.mode is Mode.SUB or arrived):  # Algorithm 6: back to the request, or done with it
                words = ("stop",)
            elif words[:1] == ("stop",):
                arrived = True
            pending[i] = (heard, words[1:], arrived)
            actions.append(_taken({words[0]: 1.0} if words else WANDER, o, rngs[i]))
        return actions, pending


WANDER = {"forward": 0.7, "left": 0.15, "right": 0.15}
"""Probabilities of a listener's moves while it has nothing to go by."""


def _taken(odds: dict[str, float], o: Observation, rng: np.random.Generator) -> Move | Stop:
    """A move drawn from `odds` over WORDS and 'stop'; one that is masked becomes a turn to the left."""
    moves = np.array([odds.get(w, 0.0) for w in (*WORDS, "stop")])
    masked = np.append(~o.candidates.allowed, False)
    moves[WORDS.index("left")] += moves[masked].sum()
    moves[masked] = 0.0
    choice = int(rng.choice(len(moves), p=moves)) if moves.max() < 1.0 else int(np.argmax(moves))
    thought = Thought(moves.astype(np.float32))
    return Stop(thought) if choice == len(WORDS) else Move(choice, thought)


def asking_times(asker: str, situations: Situations, rngs: Rngs) -> tuple[frozenset[int], ...]:
    """When the asker 'random' asks, drawn at the beginning of each episode: as often as its budget allows."""

    def drawn(s: Situation, rng: np.random.Generator) -> frozenset[int]:
        left = min(s.requests_left or 0, s.task.horizon)
        return frozenset(int(t) for t in rng.choice(s.task.horizon, left, replace=False))

    random = asker == "random"
    return tuple(drawn(s, rng) if random and s else frozenset() for s, rng in zip(situations, rngs, strict=True))


class VnlaAsking:
    """A VNLA navigation policy with one of the program's askers in front of it (docs/sources.md, S51)."""

    def __init__(self, navigation: Agent, ask: str) -> None:
        """`ask`: 'none', 'first', 'random' or 'teacher'.

        Raises:
          ValueError: another word.
        """
        if ask not in ("none", "first", "random", "teacher"):
            raise ValueError(f"unknown asker {ask!r}; use 'none', 'first', 'random' or 'teacher'")
        self._navigation, self._ask = navigation, ask

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Rngs
    ) -> tuple[Actions, Any]:
        times, inner = memory or (asking_times(self._ask, situations, rngs), None)
        actions, inner = act(self._navigation, observations, situations, inner, rngs=rngs)
        for i, (o, s, planned) in enumerate(zip(observations, situations, actions, strict=True)):
            if o is None or s is None or planned is None:
                continue
            if o.can_ask and self._wants(s, planned, times[i]):
                actions[i] = Ask(o.can_ask[0], planned.thought)
        return actions, (times, inner)

    def _wants(self, s: Situation, planned: Action, times: frozenset[int]) -> bool:
        if self._ask == "teacher":
            return ask_reason(s, planned.thought) is not None
        return self._ask == "first" or (self._ask == "random" and s.time in times)


class HalfwaySkyline(PerEpisodePolicy):
    """HARI with perfect navigation on sub-goals (Table 4.7, last row): it asks for a sub-goal, goes
    there, says so, and asks again, until a sub-goal turns out to be the goal itself.

    Knowing that is privileged; the authors' skyline learns when to ask (docs/sources.md, S62).
    """

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        if len(s.extras.goals) == 1 and s.pose.node != s.extras.goals[0] and Intention.SUB in o.can_ask:
            return Ask(Intention.SUB)
        return shortest_of(s)


def fewest_moves(start: int, leads: Callable[[int], Iterable[tuple[int, int]]]) -> dict[int, tuple[int, int | None]]:
    """How many known moves lead from `start` to every place that they lead to, the nearest first, and which way they
    begin.

    Args:
      leads: the ways that are known from a place, each with the place at its end.
    """
    reached: dict[int, tuple[int, int | None]] = {start: (0, None)}
    for place in (line := [start]):
        steps, first = reached[place]
        for way, end in leads(place):
            if end not in reached:
                reached[end] = steps + 1, way if first is None else first
                line.append(end)
    return reached


def step_on_known_way(ways: Mapping[int, tuple[int, ...]], here: int, goals: Container[int]) -> int | None:
    """The next place on the way of fewest steps to one of `goals`, among the places of which neighbours are known; None
    where they do not lead there, or one is there."""
    reached = fewest_moves(here, lambda v: ((w, w) for w in ways.get(v, ())))
    return next((first for v, (_, first) in reached.items() if v in goals), None)


def _random_move(o: Observation, rng: np.random.Generator) -> Action:
    possible: list[Action] = [Move(int(k)) for k in np.flatnonzero(o.candidates.allowed)]
    possible += [*map(Open, o.can_open), Stop()]
    return possible[int(rng.integers(len(possible)))]

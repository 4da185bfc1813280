"""The oracle of asking: it plays every question to the end in its head, and asks what pays most.

It is privileged: it knows where everything is, and its own luck. It does not know the way: between questions it
explores like the baselines. One that doubts does not know which thing is meant and weighs all that fit what was said:
what it does can be imitated.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from embodied.assistants.ask import CONFIRM_DISTANCE, in_view
from embodied.envs.ask import AskEnv
from embodied.envs.base import HelpEnv
from embodied.interface import (
    Action,
    Actions,
    FindDescribed,
    Intention,
    Observation,
    Observations,
    Rngs,
    Situation,
    Situations,
    Stop,
)
from embodied.kinds.metrics import success
from embodied.kinds.shipped.ask import price
from embodied.policies.ask import Asker, EpisodeMemory, confirm_on_sight, onward, reached

EVERY = 4
"""Steps between two moments at which it thinks about asking; it also does whenever a thing was reached."""
LABELLED = 0.5
"""Of a learner's decisions, how many the oracle thinks about."""
IMAGINED = 3
"""Things that one who doubts weighs at a time."""
SLOW = 0.0003
"""The worth of a step: of two ways that succeed alike, the shorter one."""
Choice = Intention | str
"""A question, 'go' or 'stop'."""
CHOICES: tuple[Choice, ...] = (
    "go",
    "stop",
    Intention.CONFIRM,
    Intention.APPEARANCE,
    Intention.REGION,
    Intention.ROUTE,
    Intention.DISAMBIGUATE,
)


ONCE = (Intention.APPEARANCE, Intention.REGION)
"""Questions whose answers stay the same."""
HERE = (Intention.CONFIRM, Intention.DISAMBIGUATE)
"""Questions whose answers stay the same where one stands."""


def possible(o: Observation, trail: EpisodeMemory) -> list[Choice]:
    """The choices that can be made; no question twice whose answer is known."""
    known = [q for q in ONCE if trail.asked.get(q)] + [q for q in HERE if trail.asked_at.get(q) == trail.moment]
    questions = [c for c in CHOICES if isinstance(c, Intention) and c in o.can_ask and c not in known]
    return ["go", *(["stop"] if reached(o) else []), *questions]


def thinks(o: Observation, trail: EpisodeMemory) -> bool:
    """True if this is a moment to decide; between them, and on a route, one goes on."""
    return o.extras.advised is None and (reached(o) is not None or o.time % EVERY == 0)


class Foresight:
    """Asks what pays most in the end, if afterwards one only confirms on sight."""

    def __init__(
        self,
        make_env: Callable[[], HelpEnv],
        note: Callable[[Observation, EpisodeMemory, np.ndarray], None] | None = None,
        doubts: bool = False,
        learner: Callable[[Observation, EpisodeMemory], Choice] | None = None,
    ) -> None:
        """
        Args:
          make_env: of the same houses and rules, to play in the head.
          note: is told at a decision what each of CHOICES is worth, (7,) float64, NaN for those that cannot be.
          doubts: whether which thing is meant is not known.
          learner: who decides instead, while the oracle says of some decisions what they are worth (DAgger).
        """
        self._make_env, self._note, self._doubts, self._learner = make_env, note, doubts, learner

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Rngs
    ) -> tuple[Actions, Any]:
        if memory is None:
            memory = []
            for s in situations:
                assert s is not None, "episodes of a batch begin together"
                env = self._make_env()
                env.reset(s.task)
                memory.append((env, EpisodeMemory()))
        actions: Actions = [None] * len(observations)
        for i, (o, s) in enumerate(zip(observations, situations, strict=True)):
            if o is not None and s is not None:
                env, trail = memory[i]
                actions[i] = self._one(env, o, trail, rngs[i])
                env.step(actions[i])
        return actions, memory

    def _one(self, env: HelpEnv, o: Observation, trail: EpisodeMemory, rng: np.random.Generator) -> Action:
        choice = CHOICES[0]
        if thinks(o, trail) and self._learner and copy.deepcopy(rng).random() > LABELLED:
            choice = self._learner(o, trail)
        elif thinks(o, trail):
            minds = imagined(env, rng) if self._doubts else [env]
            values = np.full(len(CHOICES), np.nan)
            for c in possible(o, trail):
                values[CHOICES.index(c)] = np.mean([self._value(e, o, trail, c, rng) for e in minds])
            if self._note:
                self._note(o, trail, values)
            choice = self._learner(o, trail) if self._learner else CHOICES[int(np.nanargmax(values))]
        return carried_out(choice, env.situation, o, trail, rng)

    def _value(
        self, env: HelpEnv, o: Observation, trail: EpisodeMemory, choice: Choice, rng: np.random.Generator
    ) -> float:
        """Success less price in the end, after this choice, with the draws that will come."""
        ahead, mind, rng = _copy(env), copy.deepcopy(trail), copy.deepcopy(rng)
        seen = ahead.step(carried_out(choice, ahead.situation, o, mind, rng))
        asker = Asker(confirm_on_sight)
        while seen is not None:
            seen = ahead.step(asker.act_one(seen, ahead.situation, mind, rng))
        episode = ahead.episode()
        graph = env.world.graph
        return success(episode, graph) - price(episode, graph) - SLOW * len(episode.steps)


def imagined(env: HelpEnv, rng: np.random.Generator) -> list[HelpEnv]:
    """The same moment in tasks in which other things that fit what was said are meant; at most IMAGINED of them."""
    task, world = env.task, env.world
    assert isinstance(task.goal, FindDescribed), "Ask-v0"
    possible = sorted(env.situation.extras.possible)
    chosen = copy.deepcopy(rng).permutation(len(possible))[:IMAGINED]
    minds = []
    for placement in (possible[i] for i in sorted(chosen)):
        near = ((node, in_view(world, node, task.goal)[:1]) for node in range(len(world.graph.positions)))
        nodes = tuple(v for v, seen in near if seen and seen[0][0] == placement and seen[0][2] <= CONFIRM_DISTANCE)
        if not nodes:
            continue
        other = _copy(env)
        goal = dataclasses.replace(task.goal, placement=placement)
        other.task = dataclasses.replace(task, goal=goal, goal_nodes=nodes)
        other.targets = nodes
        other.situation = dataclasses.replace(env.situation, task=other.task, targets=nodes)
        minds.append(other)
    return minds or [env]


def carried_out(choice: Choice, s: Situation, o: Observation, trail: EpisodeMemory, rng: np.random.Generator) -> Action:
    """The action of a choice; notes it in the trail."""
    if choice == "stop":
        return Stop()
    if isinstance(choice, Intention):
        return trail.ask(choice, reached(o))
    trail.visits[s.pose.node] = trail.visits.get(s.pose.node, 0) + 1
    return onward(o, s, trail, rng)


def _copy(env: HelpEnv) -> HelpEnv:
    """The environment as it is; what happens in the copy stays there."""
    other = copy.copy(env)
    other._steps, other._trail = list(env._steps), list(env._trail)
    if isinstance(other, AskEnv) and isinstance(env, AskEnv):
        other._denied = set(env._denied)
    return other

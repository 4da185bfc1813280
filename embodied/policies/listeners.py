"""Agents that do what the text says: a scripted listener follows route instructions to their end.

The listener sees what an agent may see on the way, with the names of visible objects (a matter of
language, not of vision); it is given its places and the Situation because it reads the names there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from embodied.interface import (
    Action,
    Actions,
    Mode,
    Move,
    Observation,
    Observations,
    SeenPlace,
    Situation,
    Situations,
    Stop,
)
from embodied.language import follow
from embodied.policies.baselines import PerfectInterpreter

Plan = tuple[str, tuple[int, ...]]
"""The text that was heard and the nodes still to walk, the current one first."""
NOTHING: Plan = ("", ())


class ScriptedListener:
    """VLN: reads the instruction once, walks as it understood, stops."""

    def __init__(self, worlds: Mapping[str, SeenPlace]) -> None:
        """`worlds`: the places it may be in, by name."""
        self._worlds = worlds

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[Actions, list[Plan]]:
        plans: list[Plan] = memory or [NOTHING] * len(observations)
        actions: Actions = [None] * len(observations)
        for i, (o, s) in enumerate(zip(observations, situations, strict=True)):
            if o is not None and s is not None:
                actions[i], plans[i] = heard_step(self._worlds[s.task.world], o, s, plans[i])
        return actions, plans


class ListeningInterpreter(PerfectInterpreter):
    """HANNA: like the perfect interpreter, but on a route it has nothing but the words.

    The gap between the two is what is lost in language.
    """

    def __init__(self, worlds: Mapping[str, SeenPlace]) -> None:
        """`worlds`: the places it may be in, by name."""
        self._worlds = worlds

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[Actions, Any]:
        plans, inner = memory or ([NOTHING] * len(observations), None)
        actions, inner = super().act_privileged(observations, situations, inner, rngs=rngs)
        for i, (o, s) in enumerate(zip(observations, situations, strict=True)):
            if o is not None and s is not None and o.mode is Mode.SUB:
                actions[i], plans[i] = self._on_route(o, s, plans[i])
            else:
                plans[i] = NOTHING
        return actions, (plans, inner)

    def _on_route(self, o: Observation, s: Situation, plan: Plan) -> tuple[Action, Plan]:
        """It also departs where the target image was taken."""
        if s.pose.node in s.targets:
            return Stop(), NOTHING
        return heard_step(self._worlds[s.task.world], o, s, plan)


def heard_step(world: SeenPlace, o: Observation, s: Situation, plan: Plan) -> tuple[Action, Plan]:
    """The next step of what the text says, and what remains; stop at its end."""
    heard, nodes = plan
    if heard != o.instruction or o.time_on_task == 0:
        heard, nodes = o.instruction, follow(world, o.instruction, s.pose.node, s.pose.yaw).path
    if len(nodes) < 2:
        return Stop(), (heard, nodes)
    return Move(s.candidate_nodes.index(nodes[1])), (heard, nodes[1:])

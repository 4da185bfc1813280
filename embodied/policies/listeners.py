"""Agents that do what the text says: a scripted listener follows route instructions to their end.

The listener sees what an agent may see on the way, with the names of visible objects (issue of
language, not of vision); it is given the Situation because it reads them from the world.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from embodied.interface import Action, Mode, Move, Observation, Situation, Stop
from embodied.language import follow
from embodied.policies.baselines import Actions, Observations, PerfectInterpreter

Plan = tuple[str, tuple[int, ...]]
"""The text that was heard and the nodes still to walk, the current one first."""


class ScriptedListener:
    """VLN: reads the instruction once, walks as it understood, stops."""

    privileged = True

    def act(
        self,
        observations: Observations,
        memory: object | None,
        *,
        rngs: Sequence[np.random.Generator],
        situations: Sequence[Situation | None],
    ) -> tuple[Actions, object]:
        plans: list[Plan] = memory or [("", ()) for _ in observations]
        actions: Actions = []
        for i, (o, s) in enumerate(zip(observations, situations, strict=True)):
            action, plans[i] = (None, plans[i]) if o is None else heard_step(o, s, plans[i])
            actions.append(action)
        return actions, plans


class ListeningInterpreter(PerfectInterpreter):
    """HANNA: like the perfect interpreter, but on a route it has nothing but the words.

    The gap between the two is what is lost in language.
    """

    def act(
        self,
        observations: Observations,
        memory: object | None,
        *,
        rngs: Sequence[np.random.Generator],
        situations: Sequence[Situation | None],
    ) -> tuple[Actions, object]:
        plans, inner = memory or ([("", ()) for _ in observations], None)
        actions, inner = super().act(observations, inner, rngs=rngs, situations=situations)
        for i, (o, s) in enumerate(zip(observations, situations, strict=True)):
            if o is not None and o.mode is Mode.SUB:
                actions[i], plans[i] = self._on_route(o, s, plans[i])
            else:
                plans[i] = ("", ())
        return actions, (plans, inner)

    def _on_route(self, o: Observation, s: Situation, plan: Plan) -> tuple[Action, Plan]:
        """It also departs where the target image shows what it sees."""
        if o.target == o.sight:
            return Stop(), ("", ())
        return heard_step(o, s, plan)


def heard_step(o: Observation, s: Situation, plan: Plan) -> tuple[Action, Plan]:
    """The next step of what the text says, and what remains; stop at its end."""
    heard, nodes = plan
    if heard != o.instruction or o.time_on_task == 0:
        heard, nodes = o.instruction, follow(s.world, o.instruction, s.pose.node, s.pose.yaw).path
    if len(nodes) < 2:
        return Stop(), (heard, nodes)
    return Move(s.candidate_nodes.index(nodes[1])), (heard, nodes[1:])

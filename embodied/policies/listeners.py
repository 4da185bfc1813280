"""Agents that do what the text says: a scripted listener follows route instructions to their end.

The listener sees what an agent may see on the way, with the names of visible objects (a matter of
language, not of vision); it is given its places and the Situation because it reads the names there.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from embodied.interface import Action, Mode, Move, Observation, Open, SeenPlace, Situation, Stop
from embodied.language import follow
from embodied.navigation.doors import changed_doors
from embodied.policies.baselines import PerEpisodePolicy, PerfectInterpreter


@dataclass
class HeardRoute:
    """Owns what was understood of a text."""

    heard: str = ""
    nodes: tuple[int, ...] = ()
    """Still to walk, the current one first."""

    def step(self, world: SeenPlace, o: Observation, s: Situation) -> Action:
        """The next step of what the text says, opening doors on the way; stop at its end."""
        if doors := changed_doors(s.world.graph, s.closed):
            world = world.with_doors(doors)
        if self.heard != o.instruction or o.time_on_task == 0:
            self.heard, self.nodes = o.instruction, follow(world, o.instruction, s.pose.node, s.pose.yaw).path
        if len(self.nodes) < 2:
            return Stop()
        chosen = s.candidate_nodes.index(self.nodes[1])
        if chosen in o.can_open:
            return Open(chosen)
        self.nodes = self.nodes[1:]
        return Move(chosen)


class ScriptedListener(PerEpisodePolicy):
    """VLN: reads the instruction once, walks as it understood, stops."""

    def __init__(self, worlds: Mapping[str, SeenPlace]) -> None:
        """`worlds`: the places it may be in, by name."""
        self._worlds = worlds

    def new_memory(self) -> Any:
        return HeardRoute()

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        return memory.step(self._worlds[s.task.world], o, s)


class ListeningInterpreter(PerfectInterpreter):
    """HANNA: like the perfect interpreter, but on a route it has nothing but the words, and the target image to depart
    at. The gap between the two is what is lost in language."""

    def __init__(self, worlds: Mapping[str, SeenPlace]) -> None:
        """`worlds`: the places it may be in, by name."""
        self._worlds = worlds

    def new_memory(self) -> Any:
        return super().new_memory(), HeardRoute()

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        trail, plan = memory
        action = super().act_one(o, s, trail, rng)
        if o.mode is Mode.SUB and s.pose.node not in s.targets:
            return plan.step(self._worlds[s.task.world], o, s)
        plan.heard = ""
        return Stop() if o.mode is Mode.SUB else action

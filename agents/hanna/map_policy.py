"""MapPolicy: a HANNA agent that draws a map of where it has been and goes by it, besides by its networks."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from embodied.agents.hanna.inputs import action_index
from embodied.agents.hanna.policy import HannaMemory, HannaPolicy, Steering, unsteered
from embodied.agents.hanna.topological_map import PlaceMap, Trail, weigh_by_image
from embodied.interface import Actions, Mode, Observation, Observations, Rngs, Situations
from embodied.teachers.shortest import shortest_of


@dataclass(frozen=True, eq=False)
class MapMemory:
    """State that the policy carries between steps."""

    networks: HannaMemory | None = None
    trails: Mapping[int, Trail] = field(default_factory=dict)
    """The way of each episode so far, by its place in the batch."""


@dataclass(frozen=True, eq=False)
class MapPolicy:
    """A HANNA policy with a topological map, which is not learned."""

    policy: HannaPolicy
    revisit_weight: float = 1.0
    """A move's weight for each time the agent was, under the same words, where it knows the move to lead."""
    use_goal_image: bool = False
    """Go by the image of where to go, if one is shown (hanna.topological_map.weigh_by_image)."""
    frontier_discount: float = 0.0
    """How it looks for what the image shows; see hanna.topological_map.weigh_by_image."""

    def changed(self, **settings: Any) -> MapPolicy:
        """The same with other settings, of its own or of the policy in it."""
        own = {f.name for f in dataclasses.fields(self)} & settings.keys()
        policy = dataclasses.replace(self.policy, **{k: v for k, v in settings.items() if k not in own})
        return dataclasses.replace(self, policy=policy, **{k: settings[k] for k in own})

    def act(
        self,
        observations: Observations,
        memory: MapMemory | None,
        *,
        rngs: Rngs,
        imposed: Sequence[int | None] | None = None,
    ) -> tuple[Actions, MapMemory]:
        """One step of every running episode; see embodied.interface.Policy and HannaPolicy.act."""
        memory = memory or MapMemory()
        trails = self._arrived(memory.trails, observations)

        def steer(position: int, o: Observation, moves: np.ndarray) -> Steering:
            trail = trails[position]
            weights = moves * np.append(1.0, self.revisit_weight ** trail.times(o))
            if not self.use_goal_image:
                return Steering(weights, match=trail.match)
            trails[position] = trail.thinking(o, moves[1:])
            return Steering(*weigh_by_image(trails[position], o, weights, self.frontier_discount), trail.match)

        actions, networks = self.policy.act(
            observations, memory.networks, rngs=rngs, steer=steer if trails else unsteered, imposed=imposed
        )
        left = {i: trail.left(o, actions[i]) for i, trail in trails.items() if (o := observations[i]) is not None}
        return actions, MapMemory(networks, left)

    def _arrived(self, trails: Mapping[int, Trail], observations: Observations) -> dict[int, Trail]:
        """The trails when a step begins, by what the agents see; none where no rule goes by them."""
        running = [(i, o) for i, o in enumerate(observations) if o is not None]
        if not running or (self.revisit_weight == 1 and not self.use_goal_image):
            return {}
        bank = self.policy.bank
        current = bank.gather([o.sight for _, o in running]).cpu().numpy()
        target = bank.gather([o.target for _, o in running]).cpu().numpy()
        return {
            i: trails.get(i, Trail(PlaceMap())).here(o, panorama, None if o.target is None else picture)
            for (i, o), panorama, picture in zip(running, current, target, strict=True)
        }


@dataclass(frozen=True, eq=False)
class PerfectInterpretation:
    """The skyline of Table 4.3: the teacher walks whenever an instruction is followed.

    Asking, and walking on the main task, are still the agent's own.
    """

    policy: MapPolicy

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: MapMemory | None, *, rngs: Rngs
    ) -> tuple[Actions, MapMemory]:
        imposed = [None if s is None or s.mode is Mode.MAIN else action_index(shortest_of(s)) for s in situations]
        return self.policy.act(observations, memory, rngs=rngs, imposed=imposed)

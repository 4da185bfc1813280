"""Playing training episodes with a policy that is shown the situations, and whose last memory is wanted: it holds all
outputs of the episodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from embodied.envs.base import HelpEnv
from embodied.evaluation.evaluate import rollout
from embodied.interface import Actions, Agent, Episode, Observations, Place, Rngs, Situations, Task, act


@dataclass(frozen=True, eq=False)
class Supervised:
    """A policy while a teacher watches: its `play` is given the situations."""

    policy: Any
    how: Mapping[str, Any] = field(default_factory=dict)
    """Further arguments of `play`."""

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Rngs
    ) -> tuple[Actions, Any]:
        """See embodied.interface.PrivilegedPolicy."""
        return self.policy.play(observations, situations, memory, rngs=rngs, **self.how)


class _MemoryKeeper:
    """An agent that keeps the memory of its last call, because `rollout` does not hand it out."""

    def __init__(self, agent: Agent) -> None:
        self._agent = agent
        self.memory: Any = None

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Rngs
    ) -> tuple[Actions, Any]:
        actions, self.memory = act(self._agent, observations, situations, memory, rngs=rngs)
        return actions, self.memory


@dataclass(frozen=True, eq=False)
class TaskSet:
    """Tasks of some houses and the environment they are played in."""

    worlds: Mapping[str, Place]
    tasks: Sequence[Task]
    make_env: Callable[[], HelpEnv]


def play_with_memory(
    make_env: Callable[[], HelpEnv], agent: Agent, tasks: Sequence[Task], *, seed: int
) -> tuple[tuple[Episode, ...], Any]:
    """Play `tasks` side by side; their episodes and the agent's last memory."""
    remembering = _MemoryKeeper(agent)
    frames = rollout(make_env, remembering, tasks, seed=seed, batch=len(tasks))
    done = {f.index: f.episode for f in frames if f.episode is not None}
    return tuple(done[i] for i in range(len(tasks))), remembering.memory

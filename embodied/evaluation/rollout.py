"""Playing episodes: a generator of frames that streaming, saving, training and metrics consume."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from embodied.envs.base import HelpEnv
from embodied.interface import Agent, Episode, Observation, Situation, Step, Task, act
from embodied.seeds import stream


@dataclass(frozen=True, slots=True)
class Frame:
    """One step of one episode, as it happens."""

    index: int
    """Which of the tasks."""
    observation: Observation
    """Given to the policy."""
    situation: Situation
    """The truth, before the action."""
    step: Step
    """The action with its consequences."""
    episode: Episode | None
    """The whole episode with its last frame, else None."""


def rollout(
    make_env: Callable[[], HelpEnv], player: Agent, tasks: Iterable[Task], *, seed: int, batch: int = 1, agent: str = ""
) -> Iterator[Frame]:
    """Play `tasks`, `batch` at a time; frames of one episode come in order.

    Every episode gets its own generator, stream(seed, 'policy', task id), so what happens in it
    does not depend on the batch, nor on the order of the tasks.

    Args:
      make_env: gives a fresh environment; called `batch` times.
      player: who acts; `agent` is its name in the episodes.
    """
    envs: list[HelpEnv] = []
    numbered = enumerate(tasks)
    while group := list(itertools.islice(numbered, batch)):
        yield from _play(make_env, envs, player, group, seed, agent)


def play(
    make_env: Callable[[], HelpEnv], player: Agent, tasks: Iterable[Task], *, seed: int, batch: int = 1, agent: str = ""
) -> list[Episode]:
    """The finished episodes of `rollout`, in the order of the tasks.

    Examples:
      >>> episodes = embodied.play(split.make_env, agent, split.tasks, seed=0)
    """
    frames = rollout(make_env, player, tasks, seed=seed, batch=batch, agent=agent)
    done = {f.index: f.episode for f in frames if f.episode is not None}
    return [done[i] for i in sorted(done)]


def _play(
    make_env: Callable[[], HelpEnv],
    envs: list[HelpEnv],
    player: Agent,
    group: Sequence[tuple[int, Task]],
    seed: int,
    agent: str,
) -> Iterator[Frame]:
    while len(envs) < len(group):
        envs.append(make_env())
    observations: list[Observation | None] = [env.reset(task, seed=seed) for env, (_, task) in zip(envs, group)]
    rngs = [stream(seed, "policy", task.id) for _, task in group]
    memory: Any = None
    while any(o is not None for o in observations):
        situations = [None if o is None else env.situation for env, o in zip(envs, observations)]
        actions, memory = act(player, observations, situations, memory, rngs=rngs)
        for i, (env, (index, _)) in enumerate(zip(envs, group)):
            seen, situation, action = observations[i], situations[i], actions[i]
            if seen is None or situation is None:
                continue
            if action is None:
                raise TypeError(f"{type(player).__name__} gave no action for task {env.task.id!r}, which is not over")
            observations[i] = env.step(action)
            episode = env.episode(agent) if observations[i] is None else None
            yield Frame(index, seen, situation, env.last_step, episode)

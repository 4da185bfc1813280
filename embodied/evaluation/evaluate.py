"""Playing tasks with an agent, and judging agents on the splits of a data set: a row of a table each."""

from __future__ import annotations

import dataclasses
import importlib.util
import itertools
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from embodied.envs.base import DoorRule, HelpEnv
from embodied.evaluation.tables import Row, row
from embodied.interface import (
    Agent,
    Assistant,
    Episode,
    Intention,
    Observation,
    Reply,
    SeenPlace,
    Situation,
    Step,
    Task,
    act,
)
from embodied.kinds.plugins import made_by_name
from embodied.kinds.task_kind import kind_named
from embodied.seeds import stream
from embodied.tasks.goals import with_closed_doors

if TYPE_CHECKING:
    from embodied.datasets.store import SplitData, TaskSet


S = TypeVar("S", bound="TaskSet")


def agent(kind: str, name: str, worlds: Mapping[str, SeenPlace] | None = None) -> Agent:
    """A fresh agent without learning, by name, of a kind of task; see TaskKind.agent.

    Raises:
      ValueError: unknown for this kind of task, or one that looks around and was given no worlds.

    Examples:
      >>> agent = embodied.baseline('hanna', 'shortest')
    """
    return kind_named(kind).agent(name, worlds)


def spread(tasks: Sequence[Task], limit: int | None) -> list[Task]:
    """At most `limit` tasks, taken from all houses alike, every house's first, then every second one, ...; house by
    house, so that few are open at a time."""
    by_house: dict[str, list[Task]] = {}
    for t in tasks:
        by_house.setdefault(t.world, []).append(t)
    longest = max(map(len, by_house.values()), default=0)
    order = [ts[i] for i in range(longest) for ts in by_house.values() if i < len(ts)]
    chosen = order[:limit]
    return [t for name in by_house for t in chosen if t.world == name]


def with_doors(split: S, share: float, rule: DoorRule, *, seed: int) -> S:
    """A split in which this share of the doors is closed at the start of every task, and what moves towards them do."""

    def make_env() -> HelpEnv:
        env = split.make_env()
        env.doors = rule
        return env

    closed = lambda t: with_closed_doors(t, split.worlds[t.world], share, seed=seed) if share else t
    return dataclasses.replace(split, tasks=tuple(map(closed, split.tasks)), make_env=make_env)


def evaluate(
    split: SplitData,
    agents: Mapping[str, Agent],
    *,
    seed: int = 0,
    limit: int | None = None,
    batch: int = 1,
    keep: Callable[[str, Sequence[Episode]], None] | None = None,
    watch: Callable[[Iterable[str]], Iterable[str]] = iter,
) -> list[Row]:
    """One row per agent, over the same tasks.

    Args:
      limit: at most so many tasks, from all houses alike.
      keep: is given each agent's name and episodes (to save them).
      watch: wraps the iterator over agent names (a progress bar).

    Examples:
      >>> rows = embodied.evaluate(split, {'shortest': agent}, limit=10)
    """
    tasks = spread(split.tasks, limit)
    graphs = {name: world.graph for name, world in split.worlds.items()}
    rows = []
    for name in watch(agents):
        episodes = play(split.make_env, agents[name], tasks, seed=seed, batch=batch, agent=name)
        rows.append(row(name, split.name, episodes, graphs, seed=seed))
        if keep:
            keep(name, episodes)
    return rows


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
    memory: Any
    """The player's, of all episodes of the batch, after the action."""


def rollout(
    make_env: Callable[[], HelpEnv], player: Agent, tasks: Iterable[Task], *, seed: int, batch: int = 1, agent: str = ""
) -> Iterator[Frame]:
    """Play `tasks`, `batch` at a time; frames of one episode come in order, for who streams, saves, trains or measures.

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
            yield Frame(index, seen, situation, env.last_step, episode, memory)


def read_seeds(path: Path) -> list[int]:
    """The seeds of a list: one whole number a line, '#' begins a remark.

    Raises:
      ValueError: names the line.
    """
    seeds = []
    for number, line in enumerate(Path(path).read_text(encoding="utf-8").splitlines(), 1):
        word = line.partition("#")[0].strip()
        if word:
            try:
                seeds.append(int(word))
            except ValueError:
                raise ValueError(f"{path}:{number} should be a whole number, got {word[:40]!r}") from None
    if not seeds or len(set(seeds)) < len(seeds):
        raise ValueError(f"{path} should hold at least one seed and none twice")
    return seeds


def submitted(where: str) -> Agent:
    """An agent of somebody's own: a folder whose agent.py has `make_agent()`, or 'module:Policy'.

    Its code is run as it is: run agents that you do not trust in a container.

    Raises:
      ValueError: none of them, or an agent of a folder that wants to be shown the situations.
    """
    if ":" in where:
        return made_by_name(where)
    file = Path(where) / "agent.py"
    if not file.exists():
        raise ValueError(f"{where} should be a folder with an agent.py with make_agent()")
    spec = importlib.util.spec_from_file_location("submission", file)
    assert spec is not None and spec.loader is not None, "a .py file"
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(file.parent.resolve()))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.pop(0)
    if not callable(getattr(module, "make_agent", None)):
        raise ValueError(f"{file} should define make_agent(), which gives an embodied.interface.Policy")
    agent = module.make_agent()
    if hasattr(agent, "act_privileged") or not hasattr(agent, "act"):
        raise ValueError(f"{file}: an agent has `act` and is not shown the situations")
    return agent


def late_env(make_env: Callable[[], HelpEnv], share: float) -> HelpEnv:
    """An environment in which nobody can be asked before a share of the task's steps has passed."""
    env = make_env()
    env.assistant = env.assistant and LateAssistant(env.assistant, share)
    return env


@dataclass(frozen=True)
class LateAssistant:
    assistant: Assistant
    share: float

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        early = situation.time < self.share * situation.task.horizon
        return () if early else self.assistant.intentions(situation)

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        return self.assistant.answer(situation, question, rng=rng)

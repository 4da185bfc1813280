"""Pre-training of the execution policy: DAgger on shortest paths, with rich descriptions that are thinned at random.

    for update in ...:
        play a batch of pre-training tasks with the policy's own draws     (DAgger: states it will visit)
        ask the shortest path what would have been right at each step
        cross-entropy, Adam step                                           (appendix E)

A simulator supplies dense descriptions here, so no assistant takes part (the pre-training phase of 4.3.5).
"""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Unpack

import numpy as np
import torch
from torch import Tensor

from embodied.action_spaces import PanoramicMoves
from embodied.agents.common import session as sessions
from embodied.agents.common.tensors import padded
from embodied.agents.common.weights import Stateful
from embodied.agents.hari.networks import EncodedDescriptions, Executor, save
from embodied.agents.hari.words import collate, percept
from embodied.agents.learners.hari import ExecutionConfig
from embodied.assistants.descriptions import Describer, dropped
from embodied.interface import Description, Episode, FindObject, Move, Place, Pose, Task
from embodied.kinds.shipped.hari import LONGEST_SUBGOAL, described_subgoal
from embodied.records import Identity
from embodied.seeds import stream
from embodied.teachers.shortest import shortest_action


@dataclass(frozen=True, eq=False)
class PretrainingData:
    """The data of pre-training."""

    places: Mapping[str, Place]
    describer: Describer
    training: Sequence[Task]
    validation: Sequence[Task]
    moves: PanoramicMoves = dataclasses.field(default_factory=PanoramicMoves)


@dataclass
class ExecutionWalk:
    """One pre-training episode as it goes on."""

    task: Task
    place: Place
    pose: Pose
    goal: Description
    rng: np.random.Generator
    ended: bool = False
    stands: bool = False
    """True where it stands still in this step."""


def pretrain(
    executor: Executor, source: PretrainingData, folder: Path, identity: Identity, **options: Unpack[sessions.Options]
) -> sessions.Progress:
    """Train `executor` in place (see embodied.agents.common.session.run).

    Writes best.safetensors (by validation success) and what embodied.agents.common.session writes.
    """
    config, network = executor.config, executor.network
    optimizer = torch.optim.Adam(network.parameters(), config.learning_rate)

    def validate(session: sessions.Session) -> Sequence[Episode]:
        tasks = source.validation[: config.validation_tasks]
        success = pretraining_success(executor, source, tasks)
        session.record({"success": success, "episodes": len(tasks)})
        if session.improved(success):
            save(executor, session.folder / "best.safetensors", identity)
        return ()

    parts: dict[str, Stateful] = {"network": network, "optimizer": optimizer}
    step = lambda update: train_step(executor, optimizer, source, update)
    done = sessions.run(folder, identity, parts, config, step, validate, **options)
    network.eval()
    return done


def train_step(
    executor: Executor, optimizer: torch.optim.Optimizer, source: PretrainingData, update: int
) -> dict[str, float]:
    """One update; returns its loss per step and the share of steps at which the likeliest move was right.

    Raises:
      DivergedError: not finite; no weight was changed.
    """
    config = executor.config
    tasks = sessions.tasks_of_update(source.training, update, config.batch, config.seed)
    walks = [_begin(source, t, stream(config.seed, "pretraining", update, i)) for i, t in enumerate(tasks)]
    for walk in walks if config.subgoals else ():
        if walk.rng.random() < config.subgoals:  # no farther than to what the assistant would name where it is
            longest, place = int(walk.rng.integers(1, LONGEST_SUBGOAL + 1)), walk.place
            goal = walk.task.goal_nodes[0]
            way, walk.goal = described_subgoal(source.describer, place, walk.pose.node, goal, longest)
            walk.task = dataclasses.replace(walk.task, goal_nodes=(way[-1],))
    executor.network.train()
    with sessions.seeded_dropout(config.seed, update):
        losses, right = _play(executor, source, walks, config.horizon, guided_share(config, update))
    loss = torch.cat(losses).mean()
    sessions.set_learning_rate(optimizer, config.learning_rate, update, config.iterations, config.cooldown)
    sessions.descend(loss, optimizer, f"update {update}", config.clip)
    steps = torch.cat(right)
    return {"loss": float(loss.detach()), "right moves": float(steps.float().mean()), "steps": float(len(steps))}


def guided_share(config: ExecutionConfig, update: int) -> float:
    """DAgger's beta: the share of steps that the shortest path takes, falling linearly from 1 to 0."""
    return max(0.0, 1 - update / (config.guided * config.iterations)) if config.guided else 0.0


def _play(
    executor: Executor, source: PretrainingData, walks: Sequence[ExecutionWalk], horizon: int, beta: float
) -> tuple[list[Tensor], list[Tensor]]:
    """Walk by the policy's own draws; per step (b,) cross-entropies against the shortest path, (b,) whether right.

    Args:
      beta: share of the steps that go where the shortest path goes instead.
    """
    stay, describer = executor.config.stay_fraction, source.describer
    goals = executor.network.encode(padded([executor.words.rows(w.goal, "goal") for w in walks]))
    losses, right = [], []

    def describe(walk: ExecutionWalk) -> Description:
        walk.stands = stay > 0 and walk.rng.random() < stay
        if walk.stands:
            return describer.sparse(walk.place, walk.pose.node)
        return dropped(describer.dense(walk.place, walk.pose.node), rng=walk.rng)

    for going, reach, log_moves in _steps(executor, source, walks, horizon, describe, goals):
        stop = log_moves.shape[1] - 1
        wanted = torch.tensor([_right(walk, poses, stop) for walk, poses in zip(going, reach, strict=True)])
        losses.append(-log_moves.gather(1, wanted[:, None])[:, 0])
        right.append((log_moves.argmax(1) == wanted).detach())
        p = log_moves.detach().exp().double().numpy()
        for row, walk in enumerate(going):
            if not walk.stands:
                drawn = int(walk.rng.choice(stop + 1, p=p[row] / p[row].sum()))
                _go(walk, int(wanted[row]) if walk.rng.random() < beta else drawn, reach[row], stop)
    return losses, right


def _steps(
    executor: Executor,
    source: PretrainingData,
    walks: Sequence[ExecutionWalk],
    horizon: int,
    describe: Callable[[ExecutionWalk], Description],
    goals: EncodedDescriptions | None = None,
) -> Iterator[tuple[list[ExecutionWalk], list[Sequence[Pose]], Tensor]]:
    """The steps of walks: b that have not ended, where their moves lead, and log-probabilities (b, C + 1) of these."""
    words, beliefs = executor.words, executor.network.begin(len(walks))  # (B, h)
    for _ in range(horizon):
        alive = [i for i, w in enumerate(walks) if not w.ended]
        if not alive:
            return
        going = [walks[i] for i in alive]
        reach = [source.moves.at(w.place, w.pose) for w in going]
        rows = [
            percept(words, words.rows(describe(w), "state"), words.rows(w.goal, "goal"), candidates, w.pose.turn)
            for w, (candidates, _) in zip(going, reach, strict=True)
        ]
        goal = None if goals is None else goals.select(alive)
        new, log_moves = executor.network(beliefs[alive], collate(rows), goal=goal)
        beliefs = beliefs.index_put((torch.tensor(alive),), new)
        yield going, [poses for _, poses in reach], log_moves


def _begin(source: PretrainingData, task: Task, rng: np.random.Generator) -> ExecutionWalk:
    """An episode with its goal described as in pre-training."""
    place, goal = source.places[task.world], task.goal_nodes[0]
    if not isinstance(task.goal, FindObject):
        raise TypeError(f"HARI's tasks ask for objects; task {task.id!r} asks for {task.goal}")
    described = source.describer.pretraining_goal(place, goal, task.start.node, task.goal.object_class, rng=rng)
    return ExecutionWalk(task, place, task.start, described, rng)


def _right(walk: ExecutionWalk, poses: Sequence[Pose], stop: int) -> int:
    """Column of the shortest path's action."""
    action = shortest_action(walk.place.graph, walk.pose, walk.task.goal_nodes, tuple(p.node for p in poses))
    return action.candidate if isinstance(action, Move) else stop


def _go(walk: ExecutionWalk, column: int, poses: Sequence[Pose], stop: int) -> None:
    if column == stop:
        walk.ended = True
    else:
        walk.pose = poses[column]


def pretraining_success(executor: Executor, source: PretrainingData, tasks: Sequence[Task]) -> float:
    """Share of tasks that end at their goal, taking the likeliest moves, with whole descriptions of the state."""
    config = executor.config
    executor.network.eval()
    walks = [_begin(source, t, stream(config.seed, "validation", t.id)) for t in tasks]
    dense = lambda walk: source.describer.dense(walk.place, walk.pose.node)
    with torch.inference_mode():
        for k in range(0, len(walks), config.batch):
            some = walks[k : k + config.batch]
            for going, reach, log_moves in _steps(executor, source, some, config.horizon, dense):
                for walk, column, poses in zip(going, log_moves.argmax(1).tolist(), reach, strict=True):
                    _go(walk, column, poses, log_moves.shape[1] - 1)
    return sum(w.ended and w.pose.node in w.task.goal_nodes for w in walks) / len(walks)

"""The training loops of ILIAD: of one network before a student learns, whatever the world, by maximum likelihood or
imitation; and of a student, whatever the problem and the learner. Resumable, validated, exact after a kill, since
batches are drawn by (seed, update)."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from embodied.agents.common.session import Note, Session, descend, seeded_dropout, set_learning_rate, tasks_of_update
from embodied.agents.common.weights import Stateful, load_into, origin_of, read_weights, save_weights, seeded
from embodied.agents.iliad import protocol
from embodied.agents.learners.iliad import LearnerConfig, TeacherConfig, mixing_at
from embodied.records import Identity, differences, identity_of
from embodied.seeds import stream

COOLDOWN = 0.4
"""Share of the updates, the last ones, over which the rate of these stages falls (docs/sources.md, S92)."""
CLIP = 5.0
REPORT = 250
"""Updates between judgings."""
OF_OTHERS = (
    *("teacher", "candidates", "unlabeled", "blind"),
    *("executor_iterations", "describer_iterations", "pretraining_iterations"),
)
"""Settings on which what a stage gives does not depend, or that are its own number of updates."""
Network = TypeVar("Network", bound=nn.Module)


def begun(world: str, seed: int, name: str) -> AbstractContextManager[None]:
    """The first weights of a network follow from these inside."""
    return seeded(int(stream(seed, world, "begin", name).integers(2**31)))


def teach(
    network: Network,
    name: str,
    loss_of: Callable[[np.random.Generator], Tensor],
    judge: Callable[[], Mapping[str, float]],
    *,
    world: str,
    folder: Path,
    updates: int,
    seed: int,
    config: TeacherConfig,
    about: object,
    note: Note,
    **depends: object,
) -> Network:
    """Train `network` or go on, unless NAME.safetensors in the folder is what would come of it.

    Args:
      world: 'regex' or 'nav'; draws are named by it.
      about: stands beside the weights (embodied.agents.common.weights).
      depends: all that the network depends on besides name, updates and seed.
    """
    depends["settings"] = {k: v for k, v in vars(config).items() if k not in OF_OTHERS}
    identity = identity_of(f"embodied.agents.iliad.{world}.run", stage=name, updates=updates, seed=seed, **depends)
    path = folder / f"{name}.safetensors"
    if path.exists() and not differences(origin_of(path) or {}, identity):
        load_into(network, read_weights(path), path)
        return network.eval()
    optimizer = torch.optim.Adam(network.parameters(), config.teacher_rate, fused=True)
    network.train()
    parts: dict[str, Stateful] = {"network": network, "adam": optimizer}
    with Session(folder / name, identity, parts, updates, checkpoint_minutes=2.0, every=REPORT, note=note) as session:
        for update in session:
            set_learning_rate(optimizer, config.teacher_rate, update, updates, COOLDOWN)
            with seeded_dropout(seed, update):
                loss = loss_of(stream(seed, world, name, update))
            descend(loss, optimizer, f"{name}, update {update}", CLIP)
            session.add({"loss": float(loss.detach()), "updates": 1.0})
            if session.due(REPORT):
                session.record({"loss": session.sums["loss"] / session.sums["updates"], **judge()})
                session.sums = {}
        if session.progress.update >= updates:
            save_weights(path, world, network.state_dict(), about, identity)
    return network.eval()


def drawn(tasks: protocol.Tasks, count: int, rng: np.random.Generator) -> list[Any]:
    """Random tasks."""
    return [tasks[int(i)] for i in rng.integers(len(tasks), size=count)]


def asked(tasks: protocol.Tasks, rng: np.random.Generator) -> list[str]:
    """One request of each task."""
    return [protocol.one_request(task, rng=rng) for task in tasks]


BATCH = 256
"""Tasks that are validated side by side; no influence on results."""


@dataclass(frozen=True, eq=False)
class IliadProblem:
    """A world with everybody in it."""

    world: protocol.RequestWorld
    teacher: protocol.DescribingTeacher
    marginal: protocol.Marginal
    student: protocol.Student
    """pi_theta, which is judged."""
    explorer: protocol.Student
    """pi_beta, which only ADEL has."""
    training: protocol.Tasks
    validation: protocol.Tasks
    identity: Identity
    """Parts of a run's identity besides the learner's settings."""
    save: Callable[[Path, Identity], None]
    """Writes the student's weights."""


def train(
    problem: IliadProblem, config: LearnerConfig, folder: Path, *, minutes: float | None = None, note: Note = print
) -> list[dict[str, float]]:
    """Learn, or go on learning, in a run folder; the student that is best in validation becomes best.safetensors.

    Returns what each validation found: 'update', 'episodes' (with the teacher), 'success' (validation), 'training
    success' (of all episodes so far), and since the last one 'loss' and 'described', the share of episodes with a
    description.

    Raises:
      CheckpointError, KeyboardInterrupt, DivergedError: see embodied.agents.common.
    """
    learner = _Learner(problem, config)
    identity = {**problem.identity, "settings": dataclasses.asdict(config)}
    with Session(
        folder,
        identity,
        {**learner.modules, "optimizer": learner.optimizer},
        config.iterations,
        minutes=minutes,
        checkpoint_minutes=config.checkpoint_minutes,
        every=config.validate_every,
        note=note,
    ) as session:
        for update in session:
            session.add(learner.update(update, session.sums))
            if session.due(config.validate_every):
                success = success_rate(problem.world, problem.student, problem.validation)
                session.record(_found(session.done, success, config, session.sums))
                if success > session.progress.best and session.improved(success):
                    problem.save(session.folder / "best.safetensors", identity)
                session.sums = {k: v for k, v in session.sums.items() if k in ("episodes", "fulfilled", "reward")}
    return session.history


def success_rate(world: protocol.RequestWorld, student: protocol.Student, tasks: protocol.Tasks) -> float:
    """Share of tasks that the student fulfils; see `successes`."""
    return sum(successes(world, student, tasks)) / len(tasks)


def successes(world: protocol.RequestWorld, student: protocol.Student, tasks: protocol.Tasks) -> list[bool]:
    """Which tasks the student fulfils, acting greedily on their first (for held-out tasks, only) request."""
    good: list[bool] = []
    for at in range(0, len(tasks), BATCH):
        some = tasks[at : at + BATCH]
        rng = np.random.Generator(np.random.PCG64(0))  # held-out tasks have one request: nothing is drawn
        requests = asked(some, rng)
        good += [world.success(q, e) for q, e in zip(some, student.greedy(some, requests), strict=True)]
    return good


def episodes_to(history: Sequence[Mapping[str, float]], threshold: float) -> float:
    """Training episodes until validation success first reached `threshold`; infinite if it never did (Table 3.4)."""
    return next((h["episodes"] for h in history if h["success"] >= threshold), float("inf"))


class _Learner:
    """Owns the optimizer; one update of whichever learner the settings name."""

    def __init__(self, problem: IliadProblem, config: LearnerConfig) -> None:
        self.problem, self.config = problem, config
        self.modules = {"student": problem.student.network}
        if config.learner == "adel":
            self.modules["explorer"] = problem.explorer.network
        weights = [p for m in self.modules.values() for p in m.parameters()]
        self.optimizer = torch.optim.Adam(weights, config.rate, fused=True)

    def update(self, update: int, sums: Mapping[str, float]) -> dict[str, float]:
        """One update; returns numbers to add up to `sums`."""
        c, world = self.config, self.problem.world
        set_learning_rate(self.optimizer, c.rate, update, c.iterations, c.cooldown)
        tasks = tasks_of_update(self.problem.training, update, c.batch, c.seed)
        rng = stream(c.seed, "iliad", update)
        batch = protocol.RequestBatch(tasks, asked(tasks, rng), rng)
        with seeded_dropout(c.seed, update):
            lesson = self._learn(batch, mixing_at(c, update), sums)
            descend(lesson.loss, self.optimizer, c.learner, c.clip)
        fulfilled = sum(world.success(q, e) for q, e in zip(tasks, lesson.executions, strict=True))
        loss = float(lesson.loss.detach())
        numbers = {"episodes": len(tasks), "fulfilled": fulfilled, "loss": loss, "updates": 1.0}
        if lesson.descriptions:
            numbers["described"] = sum(d is not None for d in lesson.descriptions) / len(tasks)
        return numbers | ({"reward": float(sum(lesson.rewards))} if lesson.rewards else {})

    def _learn(self, asked: protocol.RequestBatch, mixing: float, sums: Mapping[str, float]) -> protocol.IliadLesson:
        p, c = self.problem, self.config
        if c.learner == "adel":
            return protocol.adel(asked, p.teacher, p.marginal, p.explorer, p.student, mixing)
        if c.learner == "dagger":
            return protocol.dagger(asked, p.world, p.student)
        reward = p.world.success if c.learner == "binary" else p.world.reward
        return protocol.reinforce(
            asked, reward, p.student, c.entropy, (sums.get("reward", 0.0), sums.get("episodes", 0))
        )


def _found(done: int, success: float, config: LearnerConfig, sums: Mapping[str, float]) -> dict[str, float]:
    body = {
        "episodes": float(done * config.batch),
        "success": success,
        "training success": sums["fulfilled"] / sums["episodes"],
        "loss": sums["loss"] / sums["updates"],
    }
    return body | ({"described": sums["described"] / sums["updates"]} if "described" in sums else {})

"""The training of a follower: imitation of the shortest path, in the loop of agents.common.imitation; and VLN as a
learner of the studies' engine.

    episodes = play tasks, actions of teacher or follower (FORCING)                                  (policy)
    loss = - log pi(a*) + progress_weight (left - left*)^2 - room_weight log p(room*)                (`losses_of`)
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor

from embodied.agents.common import imitation
from embodied.agents.common.tensors import IGNORE, choose_sampled, negative_log_likelihood
from embodied.agents.common.vocabulary import Vocabulary, build_vocabulary
from embodied.agents.learners.vln import FollowerSettings
from embodied.agents.studies.tables import study_tables
from embodied.agents.vision.sighted_study import SightedLearner, SightedStudy, Split, TrainingData
from embodied.agents.vln.policy import VlnAgent, VlnMemory, VlnMoment
from embodied.assets.cache import digest
from embodied.assets.catalogue import load_catalogue
from embodied.assets.closure import code_digest
from embodied.assistants.route_system import sampled_paths, worded
from embodied.datasets.store import Dataset
from embodied.interface import Agent, Episode, Route, Task
from embodied.kinds.shipped.vln import vln_task
from embodied.language import People
from embodied.records import load_lines, save_lines
from embodied.seeds import stream

LONGEST_EPISODE = 12
"""Steps of an episode of training: described paths have at most six, and who is lost learns little more."""


class VlnLearner(SightedLearner):
    """A follower in training."""

    agent_kind, optimizer_kind = VlnAgent, torch.optim.AdamW

    @classmethod
    def splits(cls, source: TrainingData, config: FollowerSettings) -> tuple[Split, Split]:
        training, validation = super().splits(source, config)
        tasks = [*training.tasks, *(more_tasks(source, training, config) if config.more_paths else ())]
        return dataclasses.replace(training, tasks=tasks), validation

    @classmethod
    def words_of(cls, data: Dataset, training: Split) -> Vocabulary:
        return build_vocabulary(t.request for t in training.tasks)

    def timed(self, task: Task, training: bool) -> Task:
        return dataclasses.replace(task, horizon=min(task.horizon, LONGEST_EPISODE)) if training else task

    def player(self, update: int) -> Agent:
        dropout, share = self.config.environment_dropout, teacher_share(self.config, update)
        policy = self.agent.policy(self.training.bank)
        policy = dataclasses.replace(policy, choose=choose_sampled, environment_dropout=dropout)
        return imitation.Supervised(policy, {"guided": lambda _, rng: bool(rng.random() < share)})

    def loss_of(self, episodes: Sequence[Episode], memory: VlnMemory) -> imitation.BatchLoss:
        c, moments = self.config, memory.moments
        moves, left, rooms = losses_of(moments, c.batch)
        right = torch.cat([m.said.moves.argmax(-1) == m.moves for m in moments])
        known = torch.cat([m.rooms.flatten() for m in moments])
        guessed = torch.cat([m.said.rooms.argmax(-1).flatten() for m in moments])
        numbers = {
            "right moves": float(right.float().mean()),
            "right rooms": float((guessed == known)[known != IGNORE].float().mean()),
            **imitation.played(episodes, self.training.worlds),
        }
        loss = moves + c.progress_weight * left + c.room_weight * rooms
        return imitation.BatchLoss((moves, torch.zeros(())), loss, numbers)


def teacher_share(config: FollowerSettings, update: int) -> float:
    """Share of the steps in which the teacher acts; of 'dagger' it falls to the least over the first half."""
    if config.forcing == "dagger":
        return max(config.least_teacher, 1.0 - 2.0 * update / config.iterations)
    return float(config.forcing == "teacher")


def losses_of(moments: Sequence[VlnMoment], episodes: int) -> tuple[Tensor, Tensor, Tensor]:
    """Of actions, of the way that is left and of rooms, each summed over steps and averaged over episodes."""
    moves = sum(negative_log_likelihood(m.said.moves, m.moves).sum() for m in moments)
    left = sum(F.mse_loss(m.said.left, m.left, reduction="sum") for m in moments)
    rooms = sum(_rooms(m) for m in moments)
    return tuple(torch.as_tensor(x) / episodes for x in (moves, left, rooms))  # type: ignore[return-value]


def _rooms(m: VlnMoment) -> Tensor:
    """-log p of the kinds of rooms, averaged over the actions of a step."""
    lost = negative_log_likelihood(m.said.rooms.flatten(0, 1), m.rooms.flatten()).view(m.rooms.shape)
    return (lost.sum(1) / (m.rooms != IGNORE).sum(1)).sum()


def more_tasks(source: TrainingData, training: Split, config: FollowerSettings) -> list[Task]:
    """Tasks of further paths through the training houses; the same for all training seeds."""
    more = lambda name: more_routes(source.data, name, config.more_paths, seed=0, cache=source.cache)
    routes = {name: more(name) for name in training.worlds}
    return [vln_task(name, route) for name, many in routes.items() for route in many]


def more_routes(source: Dataset, name: str, count: int, *, seed: int, cache: Path) -> list[Route]:
    """`count` paths of a house that the data set lacks, of the same lengths, each worded three times; fewer where the
    house has fewer. They are kept in the cache."""
    code = code_digest("embodied.language.people_language", "embodied.assistants.route_system")
    path = cache / "paths" / f"{digest([source.digest, name, count, seed, code])[:32]}.jsonl"
    if not path.exists():
        known = {route.path for route in source.routes(name)}
        world = source.open_world(name, load_catalogue(cache), cache)
        rng = stream(seed, "nav", "more", name)
        every = sampled_paths(world.graph, len(world.graph.positions) ** 2, rng=rng)
        paths = [p for p in every if p not in known][:count]
        save_lines(path, worded(world, paths, ("train_seen",) * 3, seed=seed, language=People()))
    return list(load_lines(path, Route))


@dataclass(frozen=True, kw_only=True)
class VlnStudy(SightedStudy):
    """Followers."""

    config: FollowerSettings

    name, agent_kind, learner, all_tables = "vln", VlnAgent, VlnLearner, study_tables("vln")

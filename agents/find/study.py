"""Agents that find things, with and without sight, from the houses of any data set with features: their tasks, training
and files; and their tables, as a learner of embodied.agents.studies.engine."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F

from embodied.action_spaces import PanoramicMoves
from embodied.agents.common import imitation, session
from embodied.agents.common.imitation import About, SightedAgent, Supervised, play_with_memory
from embodied.agents.common.settings import EvaluationSettings
from embodied.agents.common.tensors import choose_sampled
from embodied.agents.common.vocabulary import Vocabulary, build_vocabulary
from embodied.agents.common.weights import check_features, load_into, load_weights, save_weights, seeded
from embodied.agents.find.network import READ, Explorer, SeekNetwork
from embodied.agents.find.policy import CERTAIN, WORDS, FindPolicy, Search, imitation_loss
from embodied.agents.learners.find import THINGS, FinderConfig
from embodied.agents.studies.tables import StudyRow, StudyTable, study_tables
from embodied.agents.vision.encoder import load_encoder
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vision.sighted_study import SightedStudy, Split, TrainingData
from embodied.assets.catalogue import load_catalogue
from embodied.datasets.store import Dataset, SplitData
from embodied.evaluation.evaluate import play
from embodied.interface import STEP, TURNS, VIEWS, FindObject, Place, Pose, Sight, Task
from embodied.kinds import metrics
from embodied.kinds.shipped.doors import CONFIG, SHARE
from embodied.kinds.shipped.find import FIND
from embodied.kinds.task_kind import EnvInputs
from embodied.language.plain_language import PlainLanguage
from embodied.records import Identity, identity_of
from embodied.seeds import stream
from embodied.tasks.goals import FindConfig, find_pool, find_task, with_closed_doors

SINGLE_VIEWS = 0.75
"""Share of the updates, at the start, that train only the heads that read single views (later: DAgger, too)."""
HOUSE_TASKS = 100
"""Tasks of each training house."""
CLIP = 5.0
"""Norm to which gradients are cut."""
SEEN_PIXELS = 12
"""Pixels from which on something counts as visible, of the 24,576 of embodied.interface.Sighting."""
LOOKS = 64
"""Viewpoints whose views are read in one update."""
BARS, PATIENCES = (-2.0, -1.0, 0.0, 1.0), (0.1, 0.3, 1.0)
"""Values among which the explorer's bar and patience are chosen, in validation houses."""


def tasks_in(
    places: Mapping[str, Place], per_house: int, things: Collection[str] = THINGS, kind: str = "find"
) -> list[Task]:
    """At most so many find tasks of each house, all for one of `things`; of the kind 'doors' with doors closed."""
    language, fitting_tasks = PlainLanguage(), list[Task]()
    config, share = (CONFIG, SHARE) if kind == CONFIG.kind else (FindConfig(), 0.0)
    for place in places.values():
        pool = find_pool(place, seed=0, config=config)
        fitting = [k for k, (c, _) in enumerate(pool.pairs) if pool.classes[c].object_class in things]
        tasks = (find_task(pool, k, seed=0, language=language, config=config) for k in fitting[:per_house])
        fitting_tasks += [with_closed_doors(t, place, share, seed=0) for t in tasks]
    return fitting_tasks


def find_split(source: TrainingData, name: str, per_house: int, houses: int | None = None) -> Split:
    """Find tasks in the houses of a split."""
    split = source.split(name, limit=1, houses=houses)
    tasks = tasks_in(split.worlds, per_house)
    return dataclasses.replace(split, tasks=tasks, make_env=FIND.environments(EnvInputs(split.worlds)))


@dataclass(frozen=True, kw_only=True)
class FinderAbout(About):
    config: FinderConfig


@dataclass(frozen=True, eq=False)
class Finder(SightedAgent):
    """An agent that finds things."""

    about: FinderAbout
    network: SeekNetwork
    kind, about_kind = "find", FinderAbout

    def policy(self, bank: FeatureBank) -> FindPolicy:
        check_features(bank.digest, self.about.encoder)
        sees = self.about.config.sees
        looks = bank.blind() if sees == "nothing" else bank
        return FindPolicy(self.network, self.vocabulary, bank if sees == "all" else bank.blind(), looks)

    def save(self, path: Path, identity: Identity | None = None) -> None:
        """Write the agent, atomically."""
        save_weights(path, "find", self.network.state_dict(), self.about, identity)

    @classmethod
    def load(cls, path: Path) -> Finder:
        tensors, about = load_weights(path, "find", FinderAbout, "train the agent again with `embodied study find`")
        finder = new_finder(about, tensors["requests"])
        load_into(finder.network, tensors, path)
        finder.network.eval()
        return finder


def new_finder(about: FinderAbout, requests: torch.Tensor) -> Finder:
    """An untrained agent; its weights follow from the seed. `requests`: as of SeekNetwork."""
    c, kind = about.config, {"network": SeekNetwork, "detector": Explorer}[about.config.agent]
    with seeded(c.seed):
        network = kind(about.feature_size, requests, c.hidden_size, c.dropout)
        return Finder(about, network, Vocabulary(about.words))


class FindLearner(imitation.ImitationLearner):
    """An agent in training."""

    optimizer_kind = torch.optim.AdamW

    def __init__(self, finder: Finder, training: Split, labels: Labels) -> None:
        super().__init__(finder, training)
        self._labels = labels

    def learn(self, update: int) -> Mapping[str, float]:
        c, numbers, searches = self.config, dict[str, float](), list[Search]()
        if update >= SINGLE_VIEWS * c.iterations and c.agent != "detector":
            self.network.eval()
            searches, numbers = self._search(update)
        self.network.train()
        with session.seeded_dropout(c.seed, update):
            session.set_learning_rate(self.optimizer, c.learning_rate, update, c.iterations, c.cooldown)
            seen = stream(c.seed, "looks", update).integers(len(self._labels.seen), size=LOOKS)
            loss = self._labels.loss(self.network, torch.from_numpy(seen))
            numbers["reading"] = float(loss.detach())
            if searches:
                imitated, right = imitation_loss(self.network, searches)
                loss, numbers["loss"], numbers["right"] = loss + imitated, float(imitated.detach()), float(right)
            numbers["gradient"] = session.descend(loss, self.optimizer, f"update {update}", CLIP)
        return numbers

    def _search(self, update: int) -> tuple[list[Search], dict[str, float]]:
        """Whole episodes, watched by a teacher."""
        c, split = self.config, self.training
        policy = Supervised(dataclasses.replace(self.agent.policy(split.bank), choose=choose_sampled))
        tasks = session.tasks_of_update(split.tasks, update, c.batch, c.seed)
        episodes, searches = play_with_memory(split.make_env, policy, tasks, seed=session.episode_seed(c.seed, update))
        return list(searches.values()), imitation.played(episodes, split.worlds)


def train_finder(
    source: TrainingData, config: FinderConfig, folder: Path, cache: Path, *, note: session.Note = print
) -> None:
    """Train, or go on training, an agent; writes best.safetensors and what embodied.agents.common.session writes."""
    training = find_split(source, "train", HOUSE_TASKS, config.training_houses or None)
    validation = find_split(source, "val_unseen", -(-config.validation_tasks // len(source.data.names("val_unseen"))))
    vocabulary = build_vocabulary(t.request for t in training.tasks)
    about = source.about(FinderAbout, config, EvaluationSettings(), vocabulary)
    classes = sorted({t.goal.object_class for t in training.tasks if isinstance(t.goal, FindObject)})
    say = lambda c: PlainLanguage().request(FindObject(c), rng=stream(config.seed, "unused"))
    requests = torch.stack([torch.from_numpy(vocabulary.encode(say(c), WORDS)) for c in classes])
    finder = new_finder(about, requests)
    identity = identity_of("embodied.agents.find.study", settings=config, **source.identity())
    looks = dataclasses.replace(training, bank=finder.policy(training.bank).bank)
    learner = FindLearner(finder, training, labels_of(source.data, looks, classes, cache))
    if config.agent == "detector":
        explorer_of(learner, validation, note=note).save(folder / "best.safetensors", identity)
        return
    imitation.train(learner, validation, folder, identity, note=note)


@dataclass(frozen=True, eq=False)
class Labels:
    """Labels of all views of some houses: n viewpoints."""

    seen: torch.Tensor
    """(n, 36, D) features."""
    read: torch.Tensor
    """(n, 36, READ, C) bool."""
    ways: torch.Tensor
    """(n, 36) bool, whether a way begins in a view."""
    there: torch.Tensor
    """(n, C) bool, whether the house has such things."""

    def loss(self, network: SeekNetwork, rows: torch.Tensor) -> torch.Tensor:
        """Cross-entropy of what is read of some viewpoints, averaged over what there is, times 20."""
        logits = network.read(self.seen[rows].float())
        off = F.binary_cross_entropy_with_logits(logits, self.read[rows].float(), reduction="none")
        leads = off[:, :, 2] * (self.ways[rows][..., None] & self.there[rows][:, None])
        return 20 * off[:, :, :2].mean() + leads.sum() / (leads > 0).sum().clamp(min=1)


def labels_of(data: Dataset, split: Split, classes: Sequence[str], cache: Path) -> Labels:
    """The labels of a split's houses, by what the simulator knows."""
    catalogue, number, moves = load_catalogue(cache), {c: i for i, c in enumerate(classes)}, PanoramicMoves()
    parts = []
    for name, place in split.worlds.items():
        world, nodes = data.open_world(name, catalogue, cache), len(place.graph.positions)
        read = np.zeros((nodes, VIEWS, len(READ), len(classes)), bool)
        ways, there = np.zeros((nodes, VIEWS), bool), np.zeros(len(classes), bool)
        left, goal = np.full((nodes, len(classes)), np.inf), np.zeros((nodes, len(classes)), bool)
        distance = np.asarray(place.graph.distance)
        for c in find_pool(place, seed=0).classes:
            if c.object_class in number:
                k, goals = number[c.object_class], list(c.goal_nodes)
                there[k], goal[goals, k], left[:, k] = True, True, distance[:, goals].min(1)
        for node in range(nodes):
            for s in world.sightings(node):
                if s.object_class in number and s.pixels >= SEEN_PIXELS:
                    k, tilt = number[s.object_class], min(max(round(s.pitch / STEP), -1), 1)
                    view = TURNS * (tilt + 1) + round(s.yaw / STEP) % TURNS
                    read[node, view, 0, k], read[node, view, 1, k] = True, goal[node, k]
            candidates, poses = moves.at(place, Pose(node))
            ends = [p.node for p in poses]
            costs = distance[node, ends][:, None] + left[ends]
            ways[node, candidates.view] = True
            for view, good in zip(candidates.view, costs <= costs.min(0) + CERTAIN, strict=True):
                read[node, view, 2] |= good & there
        seen = split.bank.gather([Sight(name, v) for v in range(nodes)])
        parts.append((seen, *map(torch.from_numpy, (read, ways, np.tile(there, (nodes, 1))))))
    return Labels(*(torch.cat(x) for x in zip(*parts, strict=True)))


def explorer_of(learner: FindLearner, validation: Split, *, note: session.Note) -> Finder:
    """The finder that explores, with patience and bar chosen in validation houses, once its readers have learned."""
    finder, explorer = learner.agent, learner.network
    for update in range(learner.config.iterations):
        learner.learn(update)
    explorer.eval()
    scores = {}
    for patience in PATIENCES:
        for bar in BARS:
            explorer.ruled(patience, bar)
            with torch.inference_mode():
                player = finder.policy(validation.bank)
                episodes = play(validation.make_env, player, validation.tasks, seed=0, batch=32)
            good = [metrics.success(e, validation.worlds[e.task.world].graph) for e in episodes]
            scores[patience, bar] = sum(good) / len(good)
            note(f"explorer, patience {patience:g}, bar {bar:g}: validation success {scores[patience, bar]:.3f}")
    explorer.ruled(*max(scores, key=lambda k: scores[k]))
    return finder


SEVERAL = ("Seeing", "Blind")
"""Rows that learn with several seeds; who is only compared with learns once."""


@dataclass(frozen=True, kw_only=True)
class FindStudy(SightedStudy):
    """Success of agents that find things in unseen houses."""

    config: FinderConfig
    house_tasks: int = 50
    """Tasks of each house that agents are judged on."""

    name, agent_kind = "find", Finder

    def tables(self) -> Mapping[str, StudyTable]:
        """Of houses as they are; of a data set of the kind 'doors', with closed doors."""
        doors = self.training_data().data.kind == CONFIG.kind
        return {CONFIG.kind if doors else name: table for name, table in study_tables("find").items()}

    def seeds(self, row: StudyRow) -> Sequence[int]:
        return self.repeats if row.label in SEVERAL else self.repeats[:1]

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: session.Note) -> Path:
        train_finder(self.training_data(), self.settings(train, seed), home, self.cache, note=note)
        return home / "best.safetensors"

    def where(self, agent: Any, judge: Mapping[str, Any], split: str) -> SplitData:
        places = self.judged_in(judge).places(split)
        tasks = tasks_in(places, self.house_tasks, kind=self.training_data().data.kind)
        return SplitData(places, tasks, FIND.environments(EnvInputs(places)), split)

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return {**super().judged(row, split), "house tasks": self.house_tasks}

    def training_data(self) -> TrainingData:
        """Of any kind: its houses are all that counts, but that agents are judged behind closed doors on 'doors'."""
        return TrainingData(Dataset(self.data), load_encoder(self.encoder), self.pictures, cache=self.cache)

    def about(self) -> str:
        return f"{super().about()} {self.house_tasks} tasks of each house; hidden size {self.config.hidden_size}."

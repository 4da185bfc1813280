"""A learner in one file: ridge regression on an expert's walks learns which views lead to the object of a request.

embodied dataset find --out DATA && embodied features --data DATA
embodied train my_learner:LEARNER --data DATA --out RUN
embodied evaluate find --data DATA --agent my_learner:LEARNER=RUN
embodied study my_learner:LEARNER --data DATA --out STUDY
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch

import embodied
from embodied.action_spaces import PanoramicMoves
from embodied.agents.common.weights import load_weights, save_weights
from embodied.agents.learner import Learner, Players, PlaySettings
from embodied.agents.options import Encoded, Repeated, StudyOptions, WithData, study_of, training_data
from embodied.agents.studies.tables import StudyRow, StudyTable
from embodied.agents.vision.sighted_study import FeatureStudy, TrainingData, evaluation_data
from embodied.interface import Actions, FeatureSource, Move, Observation, Observations, Rngs, Sight, Stop
from embodied.options import OutputFolder, Settings


@dataclass(frozen=True)
class RidgeSettings:
    episodes: int = 1000
    """Walks of the expert to learn from."""
    seed: int = 0


Config = Annotated[RidgeSettings, Settings("settings of training", RidgeSettings())]


@dataclass(frozen=True, eq=False)
class RidgePolicy:
    """Goes where views, and stops where places look as they did when the expert went or stopped there."""

    weights: Mapping[str, np.ndarray]
    features: FeatureSource

    def act(self, observations: Observations, memory: object, *, rngs: Rngs) -> tuple[Actions, None]:
        return [None if o is None else self.action(o, rng) for o, rng in zip(observations, rngs)], None

    def action(self, o: Observation, rng: np.random.Generator) -> Move | Stop:
        x = rows(self.features.features(o.sight), o.candidates.view)
        p = np.exp(10 * (x @ self.weights.get(o.instruction, np.zeros(x.shape[1]))))
        chosen = int(rng.choice(len(x), p=p / p.sum()))
        return Stop() if chosen == len(x) - 1 else Move(chosen)


def rows(views: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """(A + 1, 2 D + 1) of the views (36, D) of a place: those of its ways, and their mean for stopping there."""
    x, size = np.zeros((len(ways) + 1, 2 * views.shape[1] + 1)), views.shape[1]
    x[:-1, :size], x[-1, size:-1], x[-1, -1] = views[ways], views.mean(0), 1.0
    return x


def fit(source: TrainingData, settings: RidgeSettings, folder: Path) -> Path:
    """Learn what the expert does in training houses; writes best.safetensors."""
    split, moves, pairs = source.split("train", limit=settings.episodes), PanoramicMoves(), dict[str, list[Any]]()
    for e in embodied.play(split.make_env, embodied.baseline("find", "shortest"), split.tasks, seed=settings.seed):
        for step in e.steps:
            ways = moves.at(split.worlds[e.task.world], step.pose)[0].view
            x = rows(split.bank.features(Sight(e.task.world, step.pose.node)), ways)
            right = step.action.candidate if isinstance(step.action, Move) else len(ways)
            pairs.setdefault(e.task.request, []).append((x, np.arange(len(x)) == right))
    ridge = lambda x, y: np.linalg.solve(x.T @ x + 10 * np.eye(x.shape[1]), x.T @ y)
    weights = {k: torch.from_numpy(ridge(*map(np.concatenate, zip(*some)))) for k, some in pairs.items()}
    save_weights(folder / "best.safetensors", "my_learner", weights, settings)
    return folder / "best.safetensors"


def load(path: Path) -> Mapping[str, np.ndarray]:
    return {k: w.numpy() for k, w in load_weights(path, "my_learner", RidgeSettings, "train it again")[0].items()}


@dataclass(frozen=True, kw_only=True)
class RidgeStudy(FeatureStudy):
    name, task_kind = "my_learner", "find"
    rows = StudyRow("10 walks", {"episodes": 10}), StudyRow("all"), StudyRow("random", None, {"played": "random walk"})
    all_tables = {"walks": StudyTable("What experience is worth", rows, ("success", "spl"), ("test_unseen",))}
    load, policy = staticmethod(load), staticmethod(RidgePolicy)

    def train(self, train: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Callable[[str], None]) -> Path:
        return fit(self.training_data(), self.settings(train, seed), home)


@dataclass(frozen=True, kw_only=True)
class RidgeTraining(WithData, Encoded):
    """Agents that find things, by which views lead there."""

    out: OutputFolder
    config: Config


@dataclass(frozen=True, kw_only=True)
class RidgeStudyOptions(StudyOptions, Repeated, WithData, Encoded):
    """Agents that find things, by how much they learned from."""

    config: Config


def train(args: RidgeTraining, *, note: Callable[[str], None]) -> None:
    note(f"weights in {fit(training_data(args, 'find'), args.config, args.out)}")


def players(file: Path, data: embodied.Dataset, how: PlaySettings) -> Callable[[str], Players]:
    weights, seen = load(file), evaluation_data(data, how)
    return lambda split: Players({"learned": (data.split(split), RidgePolicy(weights, seen.split(split).bank))})


STUDY = (RidgeStudyOptions, lambda args: study_of(RidgeStudy, args))
LEARNER = Learner(name="my_learner:LEARNER", train=(RidgeTraining, train), study=STUDY, players=players)

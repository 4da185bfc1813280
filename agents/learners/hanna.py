"""HANNA: agents that ask people for help and follow their routes: the hyperparameters of dissertation Table D.1 and the
ablations of D.2, in one record; who decides when to ask, the learned network, or one of the heuristics of 4.2.5; and
commands.

Three rows of Table D.1 belong to the world and live there: gamma = 0.25 with the teacher
(embodied.teachers.shortest), the attention radius with the assistant (embodied.assistants.anna), the
success radius with the task (embodied.kinds.shipped.hanna).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol

import numpy as np

from embodied.agents import options
from embodied.agents.common import settings
from embodied.agents.common.settings import SHIPPED_AGENT
from embodied.agents.learner import Learner, Players, PlayersOfSplit, PlaySettings, register_learner
from embodied.interface import Mode, Observation
from embodied.options import Count, Option, Settings
from embodied.policies import baselines

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset


class HannaAskRule(Protocol):
    def __call__(
        self, probability: float, observation: Observation, last_asked: int, *, rng: np.random.Generator
    ) -> bool:
        """True to ask now, at a place where it is possible.

        Args:
          probability: of REQUEST according to the help-request network.
          observation: what the agent sees.
          last_asked: time of the last request, -1 before any.
        """


def ask_sampled(probability: float, observation: Observation, last_asked: int, *, rng: np.random.Generator) -> bool:
    """Ask with the probability that the network gives: for training."""
    return bool(rng.random() < probability)


def ask_above(threshold: float, *, first: float, on_route: float, patience: int = 0) -> HannaAskRule:
    """Ask where the network's probability exceeds `threshold`, or `first` while nobody has shown where to go, or
    `on_route` while following one person's route, from which the next person may send elsewhere, and, once a route is
    left, not before `patience` moves towards what was shown: who asks again at once is sent back to where it came
    from. For evaluation."""

    def rule(probability: float, observation: Observation, last_asked: int, *, rng: np.random.Generator) -> bool:
        if observation.target is None:
            return probability > first
        if observation.mode is Mode.SUB:
            return probability > on_route
        return probability > threshold and observation.time_on_task >= patience

    return rule


ask_greedily = ask_above(0.5, first=0.5, on_route=0.5)
"""Ask where the network finds it more likely than not."""


def heuristic(rule: baselines.AskRule) -> HannaAskRule:
    """A rule that does not listen to the network."""
    return lambda probability, observation, last_asked, *, rng: rule(observation, last_asked, rng=rng)


RULES: dict[str, tuple[HannaAskRule, HannaAskRule]] = {
    "learned": (ask_sampled, ask_greedily),
    "never": (heuristic(baselines.never_ask),) * 2,
    "random": (heuristic(baselines.ask_at_random),) * 2,
    "every5": (heuristic(baselines.ask_every_5),) * 2,
}
"""Name of a help-request policy -> its rule in training and its rule in evaluation."""


MODELS = ("hanna", "lstm")


@dataclass(frozen=True, kw_only=True)
class TrainingConfig(settings.SightedSettings):
    """The defaults are Table D.1; HANNA_SCALES holds the smaller settings."""

    model: Annotated[str, Option(words=MODELS)] = "hanna"
    """'hanna' (appendix D.2) or 'lstm' (the encoder-decoder of Table 4.6)."""
    navigation_embedding: settings.AtLeastOne = 256
    """Width of an embedded navigation action."""
    ask_embedding: settings.AtLeastOne = 128
    """Width of an embedded decision to ask."""
    self_heads: settings.AtLeastOne = 8
    """Number of self-attention heads."""
    text_heads: settings.AtLeastOne = 8
    """Number of instruction-attention heads."""
    iterations: settings.AtLeastOne = 30_000
    training_steps: settings.AtLeastOne = 20
    """Horizon of training episodes."""
    alpha: settings.NotNegative = 1.0
    """Weight of the curiosity-encouraging loss; 0: ablation. The authors use 0.5 with ask rules other than
    'learned'."""
    curiosity_floor: settings.NotAll = 0.0
    """Mistakes with a lower probability than this add nothing to the curiosity loss; 0: Eq 4.13 (docs/sources.md,
    S34)."""
    ask_rule: Annotated[str, Option(words=tuple(sorted(RULES)))] = "learned"
    """Who decides when to ask: 'learned', 'never', 'random' or 'every5'."""
    guided_asking: settings.Share = 0.0
    """Share of training episodes in which 'every5' asks instead of the learned rule, so that early mistakes in asking
    do not spoil the routes to learn from (docs/sources.md, S33)."""
    read_assistance: bool = True
    """Read the words of routes; False: show only the goal image (Table 4.4)."""
    reset_inter_task: bool = True
    """Reset the inter-task module between sub-tasks; False: ablation of Table D.2."""
    predict_reasons: bool = True
    """Predict the reasons for asking, too; False: ablation of Table D.2."""
    similarity_attention: bool = True
    """Attend by cosine similarity; False: ablation of Table D.2 (beta = 0)."""


@dataclass(frozen=True, kw_only=True)
class HannaEvaluation(settings.EvaluationSettings):
    """How a HANNA agent is evaluated."""

    evaluation_steps: settings.AtLeastOne = 50
    """Longest episode in evaluation, steps."""
    revisit_weight: settings.Share = 1.0
    """In evaluation, multiply the probability of a move by this for each earlier visit to its target under the same
    instruction; 1: no effect (docs/sources.md, S36)."""
    use_goal_image: bool = False
    """In evaluation with a goal image, stop only at the place that it shows, and take the shortest path there if it is
    on the topological map (docs/sources.md, S161)."""
    frontier_discount: settings.Share = 0.0
    """In evaluation with a goal image, multiply the value of an untried move by this for each step back to it; 0: no
    exploration."""
    first_ask_threshold: settings.Share = 0.5
    """In evaluation, `ask_threshold` before the first goal image (docs/sources.md, S162)."""
    route_ask_threshold: settings.Share = 0.5
    """In evaluation, `ask_threshold` on a route (docs/sources.md, S162)."""
    min_moves_between_requests: settings.Whole = 0
    """In evaluation, moves after leaving a route before the learned rule asks again."""


HANNA_SCALES = settings.scales(TrainingConfig, "hanna")
"""'mini': minutes on two cores; 'paper': Table D.1, for one GPU (docs/sources.md, S31)."""
EVALUATIONS = settings.scales(HannaEvaluation, "hanna-evaluation")
"""How agents of each scale are judged."""


@dataclass(frozen=True, kw_only=True)
class HannaTraining(options.SightedRun):
    """An agent that asks people for help (HANNA), by imitation, on a HANNA data set with features.

    Trains an agent by imitation to navigate, to ask for help and to follow it, on data of `embodied features`.
    """

    threads: Count = 2
    config: Annotated[TrainingConfig, Settings(options.TRAINING, HANNA_SCALES)]
    evaluation: Annotated[HannaEvaluation, Settings(options.EVALUATION, EVALUATIONS)]


@dataclass(frozen=True, kw_only=True)
class HannaStudyOptions(options.EpisodeStudyOptions, options.Encoded, options.WithDevice):
    """Agents that ask people for help and follow their routes."""

    tables: options.Tables
    """Make these tables: 4.3, 4.4, 4.5, 4.6 or D.2."""
    seeds: options.Seeds = 1
    config: Annotated[TrainingConfig, Settings(options.TRAINING, HANNA_SCALES, skip=("training_houses",))]
    evaluation: Annotated[HannaEvaluation, Settings(options.EVALUATION, EVALUATIONS)]


def players(file: Path, data: Dataset, how: PlaySettings) -> PlayersOfSplit:
    """Tables 4.3 to 4.5."""
    from embodied.agents.hanna.agent import WITHOUT_LEARNING, HannaAgent, hanna_policies
    from embodied.agents.vision.sighted_study import evaluation_data
    from embodied.evaluation.evaluate import agent as agent_without_learning

    source, agent = evaluation_data(data, how), HannaAgent.load(file)
    without = {name: agent_without_learning("hanna", name) for name in WITHOUT_LEARNING}

    def of_split(split: str) -> Players:
        whole, policies = data.split(split, rules=how.rules), hanna_policies(agent, source.split(split).bank)
        return Players({name: (whole, p) for name, p in {**without, **policies}.items()}, WITHOUT_LEARNING)

    return of_split


register_learner(
    Learner(
        name="hanna",
        train=(HannaTraining, options.training("embodied.agents.hanna.agent:HannaLearner.train", "hanna")),
        study=(HannaStudyOptions, options.study_by("embodied.agents.hanna.agent:HannaStudy")),
        players=players,
        columns=(
            *("success", "strict success", "spl", "navigation error", "requests"),
            *("ask F1", "oracle success", "mistake repeat", "request repeat"),
        ),
        shipped=SHIPPED_AGENT,
    )
)

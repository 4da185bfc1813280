"""Ask-v0: agents that decide when to ask, against the price of their questions; settings and command."""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from embodied.agents.common.settings import AtLeastOne, Checked, NotNegative, Positive, Whole
from embodied.agents.language_models.client import WithModel, client_of
from embodied.agents.learner import Learner, register_learner
from embodied.agents.options import EVALUATION, Repeated, StudyOptions, Tables, study_of
from embodied.options import Cached, Settings

if TYPE_CHECKING:
    from embodied.agents.studies.engine import StudyLearner
    from embodied.interface import Agent


@dataclass(frozen=True, kw_only=True)
class AskerConfig(Checked):
    """How it learns; a few minutes on a core."""

    houses: AtLeastOne = 20
    """Training houses of 90 to 140 square metres."""
    tasks: AtLeastOne = 10
    """Tasks of each house in the first round, which the oracle plays."""
    rounds: Whole = 2
    """Further rounds, which the learner plays (DAgger)."""
    round_tasks: AtLeastOne = 6
    """Tasks of each house in a further round."""
    hidden_size: AtLeastOne = 64
    """Width of the network's two hidden layers."""
    passes: AtLeastOne = 120
    """Passes over all decisions in each round."""
    learning_rate: Positive = 3e-3
    """Learning rate of AdamW."""
    weight_decay: NotNegative = 1e-3
    """Weight decay of AdamW."""
    seed: int = 0
    """Random seed."""


@dataclass(frozen=True, kw_only=True)
class AskEvaluation(Checked):
    """The houses in which all agents are evaluated, that nobody learned in."""

    test_houses: AtLeastOne = 8
    """Houses to evaluate in, of 90 to 140 square metres."""
    test_tasks: AtLeastOne = 15
    """Tasks of each house to evaluate on."""
    oracle_tasks: AtLeastOne = 40
    """Tasks in all that the oracle of asking plays, which is slow; spread over the houses."""
    model_tasks: AtLeastOne = 20
    """Tasks in all that a language model plays, spread over the houses."""


@dataclass(frozen=True, kw_only=True)
class AskStudyOptions(StudyOptions, Repeated, WithModel, Cached):
    """Agents that decide when a question is worth its price (Ask-v0)."""

    tables: Tables
    """Make these tables: houses, classes or moments."""
    config: Annotated[AskerConfig, Settings("the learned asker", AskerConfig())]
    evaluation: Annotated[AskEvaluation, Settings(EVALUATION, AskEvaluation())]


def study(args: AskStudyOptions) -> StudyLearner:
    from embodied.agents.ask.study import AskStudy

    learner = study_of(AskStudy, args)
    if not args.server.model:
        return learner
    about = {k: getattr(args.server, k) for k in ("model", "form", "temperature", "most_tokens")}
    return dataclasses.replace(learner, model=functools.partial(model_agent, args), model_about=about)


def model_agent(args: AskStudyOptions, places: object) -> Agent:
    """The language model that the options name."""
    from embodied.agents.language_models.agent import LanguageModelAgent
    from embodied.agents.language_models.prompts import PromptBuilder, agent_prompt

    return LanguageModelAgent(client_of(args), PromptBuilder(prompt=agent_prompt(args.prompts)))


register_learner(Learner(name="ask", study=(AskStudyOptions, study)))

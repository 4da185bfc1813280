"""Ask-v0: agents that decide when to ask, against the price of their questions."""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from embodied.agents.ask.config import AskerConfig, AskEvaluation
from embodied.agents.language_models.client import WithModel, client_of
from embodied.agents.learner import Learner, register_learner
from embodied.agents.options import EVALUATION, Repeated, StudyOptions, Tables, study_of
from embodied.options import Cached, Settings

if TYPE_CHECKING:
    from embodied.agents.studies.engine import StudyLearner
    from embodied.interface import Agent


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

"""HannaAgent: trained networks with all that is needed to act again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from agents.common.choosing import choose_at
from agents.common.settings import LEARNED_WORDS
from agents.common.sighted import About, SightedAgent
from agents.common.weights import check_features
from agents.common.word_vectors import take_weights as take_into
from agents.hanna.asking import RULES, ask_patiently
from agents.hanna.config import HannaSizes
from agents.hanna.lstm import LstmNetwork
from agents.hanna.network import HannaNetwork
from agents.hanna.policy import HannaPolicy
from agents.hanna.training_config import HannaEvaluation, TrainingConfig
from agents.vision.bank import FeatureBank

NETWORKS: Mapping[str, type[HannaNetwork] | type[LstmNetwork]] = {"hanna": HannaNetwork, "lstm": LstmNetwork}


@dataclass(frozen=True, kw_only=True)
class HannaAbout(About):
    config: TrainingConfig
    evaluation: HannaEvaluation = HannaEvaluation()

    @property
    def sizes(self) -> HannaSizes:
        """Of its networks."""
        return self.config.network_config(len(self.words), self.feature_size)


@dataclass(frozen=True, eq=False)
class HannaAgent(SightedAgent):
    about: HannaAbout
    network: HannaNetwork | LstmNetwork
    kind, about_kind = "hanna", HannaAbout

    @staticmethod
    def network_of(about: HannaAbout) -> HannaNetwork | LstmNetwork:
        return NETWORKS[about.config.model](about.sizes)

    def policy(self, bank: FeatureBank) -> HannaPolicy:
        check_features(bank.digest, self.about.encoder)
        config, judged = self.about.config, self.about.evaluation
        learned = ask_patiently(
            judged.ask_threshold,
            first=judged.first_ask_threshold,
            on_route=judged.route_ask_threshold,
            patience=judged.min_moves_between_requests,
        )
        rule = learned if config.ask_rule == "learned" else RULES[config.ask_rule][1]
        return HannaPolicy(
            self.network,
            self.vocabulary,
            bank,
            choose=choose_at(judged.evaluation_temperature),
            ask_rule=rule,
            instruction_length=config.instruction_length,
            turn_to_agent=config.turn_to_agent,
            read_assistance=config.read_assistance,
            revisit_weight=judged.revisit_weight,
            use_goal_image=judged.use_goal_image,
            frontier_discount=judged.frontier_discount,
        )


def take_weights(agent: HannaAgent, other: HannaAgent, source: Path) -> None:
    """Copy the weights of `other`, read from `source`, into `agent`.

    Raises:
      ValueError: their networks differ, or the features that they know.
    """
    mine, its = agent.about, other.about
    if _kind(mine) != _kind(its) or its.config.word_vectors not in (LEARNED_WORDS, mine.config.word_vectors):
        raise ValueError(
            f"{source} cannot be begun with: it is a {its.config.model!r} of {its.sizes} on encoder "
            f"{its.encoder[:12]}, this run a {mine.config.model!r} of {mine.sizes} on encoder "
            f"{mine.encoder[:12]}; give this run its settings"
        )
    take_into(agent.network, other.network.state_dict())


def _kind(about: HannaAbout) -> tuple[str, str, HannaSizes]:
    return about.encoder, about.config.model, about.sizes

"""HannaAgent: trained networks with all that is needed to act again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from embodied.agents.common.choosing import choose_at
from embodied.agents.common.sighted import About, SightedAgent
from embodied.agents.common.weights import check_features
from embodied.agents.hanna.asking import RULES, ask_patiently
from embodied.agents.hanna.lstm import LstmNetwork
from embodied.agents.hanna.map_policy import MapPolicy
from embodied.agents.hanna.network import AgentNetwork, HannaNetwork
from embodied.agents.hanna.policy import HannaPolicy
from embodied.agents.hanna.training_config import HannaEvaluation, TrainingConfig
from embodied.agents.vision.bank import FeatureBank

NETWORKS: Mapping[str, type[AgentNetwork]] = {"hanna": HannaNetwork, "lstm": LstmNetwork}


@dataclass(frozen=True, kw_only=True)
class HannaAbout(About):
    config: TrainingConfig
    evaluation: HannaEvaluation = HannaEvaluation()


@dataclass(frozen=True, eq=False)
class HannaAgent(SightedAgent):
    about: HannaAbout
    network: AgentNetwork
    kind, about_kind = "hanna", HannaAbout

    @staticmethod
    def network_of(about: HannaAbout) -> AgentNetwork:
        return NETWORKS[about.config.model](about.config, len(about.words), about.feature_size)

    def policy(self, bank: FeatureBank) -> MapPolicy:
        check_features(bank.digest, self.about.encoder)
        config, judged = self.about.config, self.about.evaluation
        learned = ask_patiently(
            judged.ask_threshold,
            first=judged.first_ask_threshold,
            on_route=judged.route_ask_threshold,
            patience=judged.min_moves_between_requests,
        )
        rule = learned if config.ask_rule == "learned" else RULES[config.ask_rule][1]
        policy = HannaPolicy(
            self.network,
            self.vocabulary,
            bank,
            choose=choose_at(judged.evaluation_temperature),
            ask_rule=rule,
            instruction_length=config.instruction_length,
            turn_to_agent=config.turn_to_agent,
            read_assistance=config.read_assistance,
        )
        return MapPolicy(policy, judged.revisit_weight, judged.use_goal_image, judged.frontier_discount)

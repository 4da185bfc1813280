"""VlnAgent: a trained follower with all that is needed to act again."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.agents.common.choosing import choose_at
from embodied.agents.common.sighted import About, SightedAgent
from embodied.agents.common.weights import check_features
from embodied.agents.vision.bank import FeatureBank
from embodied.agents.vln.config import FollowerSettings
from embodied.agents.vln.network import FollowerNetwork
from embodied.agents.vln.policy import VlnPolicy


@dataclass(frozen=True, kw_only=True)
class VlnAbout(About):
    config: FollowerSettings


@dataclass(frozen=True, eq=False)
class VlnAgent(SightedAgent):
    about: VlnAbout
    network: FollowerNetwork
    kind, about_kind = "vln", VlnAbout

    @staticmethod
    def network_of(about: VlnAbout) -> FollowerNetwork:
        return FollowerNetwork(about.config, len(about.words), about.feature_size)

    def policy(self, bank: FeatureBank) -> VlnPolicy:
        check_features(bank.digest, self.about.encoder)
        config = self.about.config
        return VlnPolicy(
            self.network,
            self.vocabulary,
            bank.blind() if config.blind else bank,
            choose=choose_at(self.about.evaluation.evaluation_temperature),
            instruction_length=config.instruction_length,
            wordless=config.wordless,
        )

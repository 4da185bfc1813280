"""VnlaAgent: a trained network with all that is needed to act again, and the rows that it is judged in: other askers,
direct intervention, agents without learning."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.agents.common.imitation import About, SightedAgent, Supervised
from embodied.agents.common.tensors import choose_at
from embodied.agents.common.weights import check_features
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vnla.config import VnlaSettings
from embodied.agents.vnla.network import VnlaNetwork
from embodied.agents.vnla.policy import VnlaPolicy
from embodied.interface import Agent
from embodied.kinds.shipped.vnla import VNLA
from embodied.teachers.vnla import AskRules

WITHOUT_LEARNING = ("random walk", "listener, random", "listener, teacher", "shortest")
TEACHER = "learned, asks as its teacher"
NEVER, AT_RANDOM = "learned, asks never", "learned, asks at random"
ASKED = {NEVER: "none", "learned, asks first": "first", AT_RANDOM: "random", TEACHER: "teacher"}
"""Rows that put another asker in front of the same networks (docs/sources.md, S39), and that asker."""
DIRECT = "learned, direct intervention"
"""The advisor carries out what it said: direct with sub-goals in the paper."""
LEARNED = "learned"
BLIND = {"learned, blind": LEARNED, "blind, asks never": NEVER}
"""Rows of the same networks, which see black, and who plays them."""


@dataclass(frozen=True, kw_only=True)
class VnlaAbout(About):
    config: VnlaSettings


@dataclass(frozen=True, eq=False)
class VnlaAgent(SightedAgent):
    about: VnlaAbout
    network: VnlaNetwork
    kind, about_kind = "vnla", VnlaAbout

    @staticmethod
    def network_of(about: VnlaAbout) -> VnlaNetwork:
        return VnlaNetwork(about.config, len(about.words), about.feature_size)

    def policy(self, bank: FeatureBank, asker: str | None = None) -> VnlaPolicy:
        """The networks acting as they are judged.

        Args:
          asker: another than that of its training.

        Raises:
          ValueError: features of another encoder.
        """
        check_features(bank.digest, self.about.encoder)
        config, judged = self.about.config, self.about.evaluation
        return VnlaPolicy(
            self.network,
            self.vocabulary,
            bank.blind() if config.blind else bank,
            asker=asker or config.asker,
            ask_threshold=judged.ask_threshold,
            choose=choose_at(judged.evaluation_temperature),
            instruction_length=config.instruction_length,
        )

    def rows(self) -> tuple[str, ...]:
        """All rows that it gives; direct intervention is that of one which learned to read what the advisor says."""
        direct = (DIRECT,) if self.config.rules == "indirect" else ()
        return (LEARNED, *ASKED, *BLIND, *direct, *WITHOUT_LEARNING)

    def rules_of_row(self, row: str) -> str:
        """The rule of play that a row is judged under."""
        return "direct" if row == DIRECT else self.config.rules

    def player(self, bank: FeatureBank, row: str = LEARNED) -> Agent:
        """Who plays a row: shown the situations only where its asker needs them."""
        if row in WITHOUT_LEARNING:
            return VNLA.agent(row)
        if row in BLIND:
            return self.player(bank.blind(), BLIND[row])
        policy = self.policy(bank, None if row in (LEARNED, DIRECT) else ASKED[row])
        shown = policy.asker in ("random", "teacher")
        return Supervised(policy, {"rules": AskRules()}) if shown else policy

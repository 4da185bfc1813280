"""HannaAgent: trained networks with all that is needed to act again; its variants by name, and what is counted of each.

The playing itself is embodied.evaluation, the same for everybody.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import torch

from embodied.agents.common.choosing import choose_at
from embodied.agents.common.sighted import About, SightedAgent
from embodied.agents.common.weights import check_features
from embodied.agents.hanna.inputs import Percept
from embodied.agents.hanna.lstm import LstmNetwork
from embodied.agents.hanna.network import AgentNetwork, HannaNetwork, Scores
from embodied.agents.hanna.policy import HannaMemory, HannaPolicy
from embodied.agents.hanna.topological_map import MapPolicy, PerfectInterpretation
from embodied.agents.hanna.training_config import RULES, HannaEvaluation, TrainingConfig, ask_patiently
from embodied.agents.vision.features import FeatureBank
from embodied.evaluation.evaluate import agent as agent_without_learning
from embodied.interface import Agent

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


WITHOUT_LEARNING = ("random walk", "forward 10", "shortest", "perfect interpretation")
"""Agents of embodied.evaluation.evaluate that are judged beside the learned one; they need no pictures."""
Judged = Callable[[HannaAgent, FeatureBank], MapPolicy]
"""How an agent acts when it is judged."""


def by_the_text(agent: HannaAgent, bank: FeatureBank) -> MapPolicy:
    """The agent as the text judges it: the likeliest move and decision to ask, without rules of ours (docs/sources.md,
    S36, S161, S162)."""
    rule = RULES[agent.config.ask_rule][1]
    return agent.policy(bank).changed(choose=choose_at(0.0), use_goal_image=False, revisit_weight=1.0, ask_rule=rule)


def hanna_policies(agent: HannaAgent, bank: FeatureBank, of: Judged = HannaAgent.policy) -> dict[str, Agent]:
    """Variants of a learned agent by the names of Tables 4.3 to 4.5, and two that show the worth of sight.

    'no ask', 'random ask' and 'ask every 5' put another rule before the same networks; the
    authors train an agent for each rule (`embodied train hanna --ask-rule ...`; docs/sources.md, S39).
    'blind' sees black with network and matcher alike; 'rules only' draws moves evenly, stops by the picture alone and
    asks every 5 steps.
    """
    learned, every5 = of(agent, bank), RULES["every5"][1]
    ours = agent.policy(bank)
    even = EvenMoves(**{**vars(ours.policy), "ask_rule": every5})
    return {
        "learned": learned,
        "learned, no ask": learned.changed(ask_rule=RULES["never"][1]),
        "learned, random ask": learned.changed(ask_rule=RULES["random"][1]),
        "learned, ask every 5": learned.changed(ask_rule=every5),
        "learned, target image only": learned.changed(read_assistance=False),
        "learned, perfect interpretation": PerfectInterpretation(learned),
        "blind": agent.policy(bank.blind()),
        "rules only": dataclasses.replace(ours, policy=even),
    }


UNWILLING = 20.0
"""Logit by which stopping is less likely than a move where nothing was learned."""


class EvenMoves(HannaPolicy):
    """A policy that has learned nothing: all moves are equally likely, and it does not stop by itself."""

    def scored(self, memory: HannaMemory, percept: Percept) -> tuple[Scores, tuple[Any, Any]]:
        logits = torch.zeros(percept.action_mask.shape).masked_fill(~percept.action_mask, -torch.inf)
        logits[:, 0] = -UNWILLING
        return Scores(logits, torch.zeros(len(logits), 2), None), memory.networks


def players(agent: HannaAgent, bank: FeatureBank) -> dict[str, Agent]:
    """All rows that an agent gives, beside agents without learning."""
    without = {name: agent_without_learning("hanna", name) for name in WITHOUT_LEARNING}
    return {**without, **hanna_policies(agent, bank)}

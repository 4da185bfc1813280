"""VNLA: a trained agent and the rows that it is judged in (other askers, direct intervention, agents without
learning); its training by imitation with two cross-entropies (Eq 4.2 and 4.3), in the loop of agents.common.imitation;
and the table of its first paper (Nguyen et al. 2019, arXiv 1812.04155), as a learner of the studies' engine.

episodes = play tasks: moves are sampled, questions are the asking teacher's, and where an advisor acts in the
           learner's place it learns from what is done all the same                              (policy)
loss = - log pi_main(a*) - log pi_ask(a*), summed over steps, averaged over episodes              (`losses_of`)

Agents are judged with the program's five seeds, from which budgets are drawn. Other askers play with the learned
asker's networks (docs/sources.md, S160).
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from embodied.action_spaces import WORDS
from embodied.agents.common import imitation
from embodied.agents.common.imitation import About, SightedAgent, Supervised
from embodied.agents.common.session import descend, seeded_dropout, set_learning_rate
from embodied.agents.common.tensors import choose_at, negative_log_likelihood
from embodied.agents.common.vocabulary import Vocabulary, build_vocabulary
from embodied.agents.common.weights import check_features
from embodied.agents.learners.vnla import VnlaSettings
from embodied.agents.studies.tables import study_tables
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vision.sighted_study import SightedLearner, SightedStudy, Split, TrainingData
from embodied.agents.vnla.network import VnlaNetwork, lessons_of, reading_loss
from embodied.agents.vnla.policy import VnlaMemory, VnlaMoment, VnlaPolicy, for_training
from embodied.datasets.store import Dataset, SplitData
from embodied.interface import Agent, Episode
from embodied.kinds.shipped.vnla import HELP_STEPS, VNLA
from embodied.language.plain_language import PlainLanguage
from embodied.seeds import stream
from embodied.teachers.vnla import VnlaTeacher

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

    def policy(self, bank: FeatureBank, asker: str = "learned") -> VnlaPolicy:
        """The networks acting as they are judged.

        Args:
          asker: who decides when to ask: 'learned', or one of ASKED (docs/sources.md, S51).

        Raises:
          ValueError: features of another encoder.
        """
        check_features(bank.digest, self.about.encoder)
        config, judged = self.about.config, self.about.evaluation
        return VnlaPolicy(
            self.network,
            self.vocabulary,
            bank.blind() if config.blind else bank,
            asker=asker,
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
        policy = self.policy(bank, ASKED.get(row, "learned"))
        shown = policy.asker in ("random", "teacher")
        return Supervised(policy, {"as_teacher": True}) if shown else policy


class VnlaLearner(SightedLearner):
    """A VNLA agent in training."""

    agent_kind, optimizer_kind = VnlaAgent, torch.optim.AdamW

    @classmethod
    def splits(cls, source: TrainingData, config: VnlaSettings) -> tuple[Split, Split]:
        rules = "direct" if config.rules == "indirect" else config.rules
        training = source.split("train", houses=config.training_houses or None, rules=rules)
        return training, source.split("val_unseen", limit=config.validation_tasks, rules=config.rules)

    @classmethod
    def words_of(cls, data: Dataset, training: Split) -> Vocabulary:
        """Words of the requests, and of all that the advisor can say."""
        answers = [PlainLanguage().subgoal([w] * n + ["stop"]) for w in WORDS for n in range(1, HELP_STEPS + 1)]
        people = (s.text for s in data.utterances(tuple(training.worlds)))
        return build_vocabulary([*(t.request for t in training.tasks), *answers, *people])

    def __init__(self, agent: VnlaAgent, training: Split) -> None:
        super().__init__(agent, training)
        policy = agent.policy(training.bank)
        self._player = for_training(policy, VnlaTeacher())
        self._lessons = lessons_of(dataclasses.replace(training, bank=policy.bank), agent.vocabulary)

    def learn(self, update: int) -> Mapping[str, float]:
        c = self.config
        if update >= c.looking:
            return super().learn(update)
        self.network.train()
        with seeded_dropout(c.seed, update):
            set_learning_rate(self.optimizer, c.learning_rate, update, c.looking, c.cooldown)
            loss = reading_loss(self.network.looker, self._lessons, stream(c.seed, "looks", update))
            return {"reading": float(loss.detach()), "gradient": descend(loss, self.optimizer, f"update {update}")}

    def loss_of(self, episodes: Sequence[Episode], memory: VnlaMemory) -> imitation.BatchLoss:
        losses, moments = losses_of(memory.moments, self.config.batch), memory.moments
        right = torch.cat([m.moves.argmax(-1) == m.move_labels for m in moments])
        asks, wished = torch.cat([m.asks for m in moments]), torch.cat([m.ask_labels for m in moments])
        numbers = {
            "right moves": float(right.float().mean()),
            **imitation.played(episodes, self.training.worlds),
            **imitation.asked(episodes, asks, wished),
        }
        return imitation.BatchLoss(losses, losses[0] + losses[1], numbers)


def losses_of(moments: Sequence[VnlaMoment], episodes: int) -> tuple[Tensor, Tensor]:
    """Eq 4.3: navigation and asking, summed over steps, averaged over episodes (docs/sources.md, S114)."""
    moves, asks = (torch.cat([getattr(m, n) for m in moments]) for n in ("moves", "asks"))
    wanted, wished = (torch.cat([getattr(m, n) for m in moments]) for n in ("move_labels", "ask_labels"))
    navigation = negative_log_likelihood(moves, wanted).sum() / episodes
    return navigation, negative_log_likelihood(asks, wished).sum() / episodes


EVALUATION_SEEDS = (123, 435, 6757, 867, 983)
"""The program's."""


@dataclass(frozen=True, kw_only=True)
class VnlaStudy(SightedStudy):
    """Table 2 of VNLA's first paper."""

    config: VnlaSettings
    eval_seeds: tuple[int, ...] = EVALUATION_SEEDS

    name, agent_kind, learner, all_tables = "vnla", VnlaAgent, VnlaLearner, study_tables("vnla")

    def policies(self, agent: VnlaAgent | None, judge: Mapping[str, Any], split: str) -> Agent:
        if agent is None:
            return super().policies(agent, judge, split)
        return agent.player(self.training_data().split(split).bank, judge["played"])

    def where(self, agent: VnlaAgent | None, judge: Mapping[str, Any], split: str) -> SplitData:
        if agent is None:
            return super().where(agent, judge, split)
        return self.judged_in(judge).split(split, rules=agent.rules_of_row(judge["played"]))

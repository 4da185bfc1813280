"""HannaAgent: trained networks with all that is needed to act again; its variants by name, and what is counted of each.
The playing itself is embodied.evaluation, the same for everybody.

The training of HANNA: retrospective DAgger with the losses of 4.2.3, in the loop of agents.common.imitation; and
what its commands do: a data set with features becomes a split, a split an agent.

    episodes = play tasks with the sampling policies
    labels = teacher.relabel(episodes)                        (`labelled`)
    loss = L_main + L_ask  (4.9, 4.10, 4.13, 4.14)            (`imitation_loss`)

The retrospective mode of 4.2.3: the learner acts alone until its episodes end, sampling from its
own policies; then the teacher, who can now see each step's future, labels all steps at once. What
the networks said while acting is kept with its gradients, so each step is computed once.

N is any number of (episode, step) pairs, A the number of navigation actions. Each loss is one number per pair, zero
where a label says that the step is not to be learned from.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from embodied.agents.common import imitation
from embodied.agents.common.imitation import About, SightedAgent
from embodied.agents.common.session import Note
from embodied.agents.common.tensors import IGNORE, choose_at, negative_log_likelihood
from embodied.agents.common.vocabulary import Vocabulary, build_vocabulary
from embodied.agents.common.weights import check_features
from embodied.agents.hanna.attention import Percept, action_index
from embodied.agents.hanna.network import AgentNetwork, HannaNetwork, Scores
from embodied.agents.hanna.policy import HannaMemory, HannaPolicy, LstmNetwork, StepScores, for_training
from embodied.agents.hanna.topological_map import MapPolicy, PerfectInterpretation
from embodied.agents.learners.hanna import RULES, HannaEvaluation, TrainingConfig, ask_above
from embodied.agents.studies.tables import StudyRow, StudyTable, study_tables
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vision.sighted_study import TEST_SPLITS as TEST
from embodied.agents.vision.sighted_study import SightedLearner, SightedStudy, Split
from embodied.datasets.store import Dataset, SplitData
from embodied.interface import Agent, Episode, Place, Task, Teacher
from embodied.teachers.shortest import HannaTeacher

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
        learned = ask_above(
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

    'no ask', 'random ask' and 'ask every 5' put another rule before the same networks; the authors train an agent for
    each rule (`embodied train hanna --ask-rule ...`; docs/sources.md, S39). 'blind' sees black with network and matcher
    alike; 'rules only' draws moves evenly, stops by the picture alone and asks every 5 steps.
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


@dataclass(frozen=True, eq=False)
class Experience:
    """Outputs of the networks in the N steps of a batch of finished episodes, in the order in which they were taken,
    and what the teacher says of them."""

    moves: Tensor
    """(N, A) logits."""
    asks: Tensor
    """(N, 2) logits."""
    reasons: Tensor | None
    """(N, 3) logits."""
    right_moves: Tensor
    """(N,) int64 index of the reference action (0 is stop), IGNORE without one."""
    negatives: Tensor
    """(N, A) bool, past mistakes (4.12)."""
    right_asks: Tensor
    """(N,) int64, IGNORE where nobody could be asked."""
    true_reasons: Tensor
    """(N, 3) float32."""


def labelled(
    episodes: Sequence[Episode], moments: Sequence[StepScores], teacher: Teacher, worlds: Mapping[str, Place]
) -> Experience:
    """Outputs of the networks in some episodes, beside the teacher's labels; A is the most actions of any step."""
    labels = [teacher.relabel(e, worlds[e.task.world]) for e in episodes]
    rows = [labels[position][t] for t, (positions, _) in enumerate(moments) for position in positions]
    scores = [s for _, s in moments]
    most, device = max(s.navigation.shape[1] for s in scores), scores[0].navigation.device
    negatives = np.zeros((len(rows), most), dtype=bool)
    for i, label in enumerate(rows):
        for action in label.negatives:
            negatives[i, action_index(action)] = True
    reasons = [s.reasons for s in scores if s.reasons is not None]
    true_reasons = np.array([r.reasons or (False, False, False) for r in rows], dtype=np.float32)
    return Experience(
        moves=torch.cat([F.pad(s.navigation, (0, most - s.navigation.shape[1]), value=-torch.inf) for s in scores]),
        asks=torch.cat([s.ask for s in scores]),
        reasons=torch.cat(reasons) if reasons else None,
        right_moves=torch.tensor([IGNORE if r.move is None else action_index(r.move) for r in rows], device=device),
        negatives=torch.from_numpy(negatives).to(device),
        right_asks=torch.tensor([IGNORE if r.ask is None else int(r.ask) for r in rows], device=device),
        true_reasons=torch.from_numpy(true_reasons).to(device),
    )


def imitation_loss(x: Experience, alpha: float, episodes: int, floor: float = 0.0) -> tuple[Tensor, Tensor]:
    """Eqs 4.9 and 4.10: navigation and help-request losses, summed over steps, averaged over episodes.

    `floor` as in `curiosity`.
    """
    navigation = navigation_loss(x.moves, x.right_moves, x.negatives, alpha, floor).sum() / episodes
    asking = help_loss(x.asks, x.right_asks, x.reasons, x.true_reasons).sum() / episodes
    return navigation, asking


def curiosity(logits: Tensor, labels: Tensor, negatives: Tensor, floor: float = 0.0) -> Tensor:
    """Mean log-likelihood of the mistakes made before in this situation: second term of Eq 4.13.

    Args:
      logits: (N, A).
      labels: (N,) int64.
      negatives: (N, A) bool, the set A^main-otimes of Eq 4.12.
      floor: a mistake less likely than this is not pushed down any further; 0 is the equation as
        printed, which has no lower bound: at learning rates above the authors' it runs away.

    Returns:
      (N,), zero where there are no mistakes.
    """
    log_p = logits.log_softmax(-1)
    if floor > 0:
        log_p = log_p.clamp(min=math.log(floor))
    log_p = log_p.masked_fill(~negatives, 0.0)
    mean = log_p.sum(-1) / negatives.sum(-1).clamp(min=1)
    return mean * (labels != IGNORE)


def navigation_loss(logits: Tensor, labels: Tensor, negatives: Tensor, alpha: float, floor: float = 0.0) -> Tensor:
    """L_main of Eq 4.13, (N,); `floor` as in `curiosity`."""
    loss = negative_log_likelihood(logits, labels)
    return loss + alpha * curiosity(logits, labels, negatives, floor) if alpha else loss


def reason_loss(logits: Tensor, reasons: Tensor, labels: Tensor) -> Tensor:
    """Binary logistic loss of the three conditions, second term of Eq 4.14.

    Args:
      logits, reasons: (N, 3); reasons are 0 or 1.
      labels: (N,) int64 of asking; IGNORE silences the reasons as well.

    Returns:
      (N,).
    """
    each = F.binary_cross_entropy_with_logits(logits, reasons, reduction="none")
    return each.mean(-1) * (labels != IGNORE)


def help_loss(ask: Tensor, labels: Tensor, reason_logits: Tensor | None, reasons: Tensor) -> Tensor:
    """L_ask of Eq 4.14, (N,); without reason logits its first term only.

    Args:
      ask: (N, 2) logits of DO_NOTHING and REQUEST.
      labels: (N,) int64, IGNORE outside the zones of attention.
      reason_logits: (N, 3) or None.
      reasons: (N, 3) float, 0 or 1.
    """
    loss = negative_log_likelihood(ask, labels)
    return loss if reason_logits is None else loss + reason_loss(reason_logits, reasons, labels)


class HannaLearner(SightedLearner):
    """A HANNA agent in training."""

    agent_kind = HannaAgent

    def __init__(self, agent: HannaAgent, training: Split) -> None:
        super().__init__(agent, training)
        config, self._teacher = agent.about.config, HannaTeacher()
        guided = config.guided_asking if config.ask_rule == "learned" else 0.0
        self._player = for_training(
            agent.policy(training.bank).policy, RULES[config.ask_rule][0], config.environment_dropout, guided
        )

    @classmethod
    def words_of(cls, data: Dataset, training: Split) -> Vocabulary:
        """Words of requests, and of the routes that training hears."""
        routes = [r.instruction for n in training.worlds for r in data.routes(n) if r.split == "train_seen"]
        return build_vocabulary([*(t.request for t in training.tasks), *routes], 2)

    def timed(self, task: Task, training: bool) -> Task:
        steps = self.config.training_steps if training else self.evaluation.evaluation_steps
        return dataclasses.replace(task, horizon=steps)

    def loss_of(self, episodes: Sequence[Episode], memory: HannaMemory) -> imitation.BatchLoss:
        c, x = self.config, labelled(episodes, memory.moments, self._teacher, self.training.worlds)
        losses = imitation_loss(x, c.alpha, c.batch, c.curiosity_floor)
        known, askable = x.right_moves != IGNORE, x.right_asks != IGNORE
        numbers = {
            "right moves": float((x.moves.argmax(-1) == x.right_moves)[known].float().mean()),
            **imitation.played(episodes, self.training.worlds),
            **imitation.asked(episodes, x.asks[askable], x.right_asks[askable]),
        }
        return imitation.BatchLoss(losses, losses[0] + losses[1] if c.ask_rule == "learned" else losses[0], numbers)


PRINTED = ("4.3", "4.4", "4.5", "4.6", "D.2")
"""Tables whose numbers the dissertation prints: judged as the text has it, and in columns of their own as we do."""
BY_TEXT, SHIPPED = "by the text", " as shipped"
"""In a row's `judge`, and at the end of a split's name."""


def in_both_ways(table: StudyTable) -> StudyTable:
    """The table with columns of the text's way of judging, then of ours; comparisons are of both."""
    text = lambda row: dataclasses.replace(row, judge={**row.judge, BY_TEXT: True})
    return dataclasses.replace(
        table,
        rows=tuple(text(row) for row in table.rows),
        splits=(*table.splits, *(s + SHIPPED for s in table.splits)),
        compared=tuple((text(a), text(b)) for a, b in table.compared),
    )


@dataclass(frozen=True, kw_only=True)
class HannaStudy(SightedStudy):
    """Tables 4.3 to 4.6 and D.2."""

    config: TrainingConfig
    evaluation: HannaEvaluation

    name, agent_kind, learner = "hanna", HannaAgent, HannaLearner

    def tables(self) -> Mapping[str, StudyTable]:
        """Splits out of distribution come beside the test splits."""
        ood, tables = Dataset(self.data).ood, {}
        for name, table in study_tables("hanna").items():
            wider = dataclasses.replace(table, splits=(*table.splits, *ood)) if table.splits == TEST else table
            tables[name] = in_both_ways(wider) if name in PRINTED else wider
        return tables

    def prepare(self, rows: Sequence[StudyRow], splits: Sequence[str], folder: Path, note: Note) -> None:
        """Features that are missing are told before anything is trained."""
        for split in dict.fromkeys(s.removesuffix(SHIPPED) for s in splits):
            self.training_data().split(split)

    def policies(self, agent: HannaAgent | None, judge: Mapping[str, Any], split: str) -> Agent:
        if agent is None:
            return super().policies(agent, judge, split)
        bank = self.training_data().split(split.removesuffix(SHIPPED)).bank
        by_text = judge.get(BY_TEXT) and not split.endswith(SHIPPED)
        return hanna_policies(agent, bank, by_the_text if by_text else HannaAgent.policy)[judge["played"]]

    def where(self, agent: HannaAgent | None, judge: Mapping[str, Any], split: str) -> SplitData:
        return super().where(agent, judge, split.removesuffix(SHIPPED))

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        return super().judged(row, split.removesuffix(SHIPPED))

    def about(self) -> str:
        return (
            f"{super().about()} Judged at temperature {self.evaluation.evaluation_temperature:g} and by "
            f"docs/sources.md, S36, S161, S162; in {', '.join(PRINTED)} so in the columns 'as shipped' alone, in the "
            "others, beside the printed numbers, the likeliest action is taken."
        )

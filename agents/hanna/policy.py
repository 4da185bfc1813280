"""HannaPolicy: the networks as a Policy of embodied.interface, batched over episodes."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from embodied.agents.common.choosing import Chooser, choose_greedily, choose_sampled
from embodied.agents.common.rows import RunningRows, hidden_channels
from embodied.agents.common.vocabulary import Vocabulary
from embodied.agents.hanna.asking import RULES, HannaAskRule, ask_greedily, ask_sampled
from embodied.agents.hanna.network import AgentNetwork, Scores
from embodied.agents.hanna.percept import (
    COPIES,
    DO_NOTHING,
    HEADINGS,
    REQUEST,
    SLOTS,
    START,
    VIEWS,
    Percept,
    action_index,
    candidate_rows,
    orientation,
)
from embodied.agents.hanna.recognition import Likeness, PlaceMap
from embodied.agents.hanna.trail import Trail, weigh, weigh_by_image
from embodied.agents.vision.bank import FeatureBank
from embodied.interface import (
    Actions,
    Ask,
    Intention,
    Mode,
    Move,
    Observation,
    Observations,
    Rngs,
    Situations,
    Stop,
    Thought,
)
from embodied.teachers.shortest import shortest_of


@dataclass(frozen=True, eq=False)
class Moment:
    """What the networks said in one step, for the episodes that were still running."""

    positions: tuple[int, ...]
    """Place of each row in the batch."""
    scores: Scores


@dataclass(frozen=True, eq=False)
class HannaMemory(RunningRows):
    """What the policy carries between steps; rows belong to the episodes that still run."""

    networks: tuple[Any, Any]
    """Memories of the navigation and the help-request network."""
    previous_action: Tensor
    """(k, E)."""
    previous_ask: Tensor
    """(k,) int64."""
    last_ask: tuple[int, ...]
    trails: tuple[Trail, ...] = ()
    """The way of each episode so far; empty if the policy does not mind."""


@dataclass(frozen=True, eq=False)
class HannaPolicy:
    """A trained (or training) pair of networks that acts."""

    network: AgentNetwork
    vocabulary: Vocabulary
    bank: FeatureBank
    choose: Chooser = choose_greedily
    ask_rule: HannaAskRule = ask_greedily
    instruction_length: int = 50
    turn_to_agent: bool = True
    """Rows of views begin at the agent's own heading. The authors' program keeps them absolute
    (docs/sources.md, S29), which tells the agent where east is; D.1 leaves the order open, a robot has no compass."""
    read_assistance: bool = True
    """False: on a route the text is empty, 'target image only' of Table 4.4."""
    environment_dropout: float = 0.0
    """Share of feature channels that an episode does not see at all (Tan et al. 2019): every episode
    plays in a house that looks a little different, so houses cannot be learned by heart. For training."""
    guided_asking: float = 0.0
    """Share of the episodes of a batch, the first ones, in which 'every5' asks in place of `ask_rule`: a mixture
    of policies as in DAgger (Ross et al. 2011). For training."""
    revisit_weight: float = 1.0
    """A move's weight for each time the agent was, under the same words, where it knows the move to lead."""
    use_goal_image: bool = False
    """Go by the image of where to go, if one is shown (hanna.trail.weigh_by_image)."""
    frontier_discount: float = 0.0
    """How it looks for what the image shows; see hanna.trail.weigh_by_image."""
    least: Likeness = Likeness()
    """From which match on pictures are of one place."""
    keep_moments: bool = False
    """Keep Scores, with their gradients, in memory: for training."""

    def act(
        self,
        observations: Observations,
        memory: HannaMemory | None,
        *,
        rngs: Rngs,
        imposed: Sequence[int | None] | None = None,
    ) -> tuple[Actions, HannaMemory]:
        """One step of every running episode; see embodied.interface.Policy.

        Args:
          imposed: navigation actions (0 is stop, c + 1 candidate c) that replace the network's own
            choice in some episodes; whether to ask stays its own decision.
        """
        running = [(i, o) for i, o in enumerate(observations) if o is not None]
        positions, seen = tuple(i for i, _ in running), [o for _, o in running]
        memory = self.start(positions) if memory is None else memory.keep(positions)
        if not positions:
            return [None] * len(observations), memory
        with torch.set_grad_enabled(self.keep_moments and torch.is_grad_enabled()):
            percept = self.percept(seen, memory)
            scores, networks = self.network(memory.networks, percept)
        moves = scores.navigation.detach().softmax(-1).cpu().numpy()  # (k, A), stop first
        asks = scores.ask.detach().softmax(-1)[:, REQUEST].cpu().numpy()  # (k,)
        said = None if scores.reasons is None else scores.reasons.detach().sigmoid().tolist()  # (k, 3)
        reasons = [None] * len(seen) if said is None else [tuple(r) for r in said]
        trails = self._trails(memory.trails, seen) if memory.trails else []
        actions: Actions = [None] * len(observations)
        guided = round(self.guided_asking * len(observations))
        chosen, last_ask = [], []
        for row, (position, o) in enumerate(zip(positions, seen, strict=True)):
            n, rng = len(o.candidates), rngs[position]
            thought = thought_of(moves[row], asks[row], reasons[row], n, trails[row].match if trails else None)
            weights, known = moves[row, : n + 1], False
            if trails:
                trails[row], weights, known = self._weighed(trails[row], o, weights)
            index = self.choose(weights, rng)  # drawn before asking, so asking shifts no draw
            given = None if imposed is None else imposed[position]
            index = index if given is None else given
            rule = RULES["every5"][0] if position < guided else self.ask_rule
            if Intention.HELP in o.can_ask and not known and rule(float(asks[row]), o, memory.last_ask[row], rng=rng):
                actions[position] = Ask(Intention.HELP, thought)
                chosen.append(0)  # its own move is discarded; the last action reads as stop
                last_ask.append(o.time)
            else:
                actions[position] = Stop(thought) if index == 0 else Move(index - 1, thought)
                chosen.append(index)
                last_ask.append(memory.last_ask[row])

        device = percept.actions.device
        taken = torch.arange(len(positions), device=device), torch.tensor(chosen, device=device)
        asked = [REQUEST if isinstance(actions[p], Ask) else DO_NOTHING for p in positions]
        return actions, dataclasses.replace(
            memory,
            networks=networks,
            previous_action=percept.actions[taken],
            previous_ask=torch.tensor(asked, device=device),
            last_ask=tuple(last_ask),
            moments=(*memory.moments, Moment(positions, scores)) if self.keep_moments else (),
            trails=tuple(t.left(seen[row], actions[positions[row]]) for row, t in enumerate(trails)),
        )

    def _weighed(self, trail: Trail, o: Observation, moves: np.ndarray) -> tuple[Trail, np.ndarray, bool]:
        """What of the probabilities of stop and moves the map and the goal image leave, and whether its place is known;
        and the trail that has seen them."""
        weights = weigh(trail, o, moves, self.revisit_weight)
        if not self.use_goal_image:
            return trail, weights, False
        trail = trail.thinking(o, moves[1:])
        return trail, *weigh_by_image(trail, o, weights, self.frontier_discount)

    def _trails(self, trails: Sequence[Trail], observations: Sequence[Observation]) -> list[Trail]:
        """The trails when a step begins, by what the agents see."""
        current = self.bank.gather([o.sight for o in observations]).cpu().numpy()
        target = self.bank.gather([o.target for o in observations]).cpu().numpy()
        return [
            t.here(o, panorama, None if o.target is None else picture)
            for t, o, panorama, picture in zip(trails, observations, current, target, strict=True)
        ]

    def start(self, positions: tuple[int, ...]) -> HannaMemory:
        """Memory before the first step of the episodes at `positions`."""
        k, device = len(positions), next(self.network.parameters()).device
        return HannaMemory(
            positions=positions,
            networks=self.network.start(k, self.instruction_length),
            previous_action=torch.zeros(k, self.network.action_size, device=device),
            previous_ask=torch.full((k,), START, device=device),
            last_ask=(-1,) * k,
            channels=hidden_channels(k, self.bank.size, self.environment_dropout, device),
            trails=(Trail(PlaceMap(self.least)),) * k if self.revisit_weight < 1 or self.use_goal_image else (),
        )

    def percept(self, observations: Sequence[Observation], memory: HannaMemory) -> Percept:
        """The tensors of one step, from observations of running episodes and their memory."""
        views, angles, mask = candidate_rows(observations)
        k, most = views.shape
        turns = np.array([o.turn for o in observations])[:, None]  # (k, 1)
        slots = views // HEADINGS * HEADINGS + (views - turns) % HEADINGS
        slots[:, 0] = SLOTS - 1

        device = next(self.network.parameters()).device
        send = lambda array: torch.from_numpy(array).to(device)
        current = self.bank.gather([o.sight for o in observations])  # (k, 36, D) absolute
        target = self.bank.gather([o.target for o in observations])
        if memory.channels is not None:
            current, target = current * memory.channels[:, None], target * memory.channels[:, None]
        rows = torch.arange(k, device=device)[:, None]
        looks = current[rows, send(views)]  # (k, A, D)
        facing = orientation(send(angles[0]), send(angles[1]), COPIES)  # docs/sources.md, S27
        exists = torch.arange(most, device=device)[:, None] > 0  # stop and padding are zero vectors
        actions = torch.cat([looks, facing], -1) * (exists & send(mask)[..., None])
        if self.turn_to_agent:
            views_of_turn = np.arange(VIEWS)[None]
            order = send(views_of_turn // HEADINGS * HEADINGS + (views_of_turn + turns) % HEADINGS)  # (k, 36)
            current, target = current[rows, order], target[rows, order]
        return Percept(
            tokens=send(np.stack([self.encode(o) for o in observations])),
            new_task=send(np.array([o.time_on_task == 0 for o in observations])),
            current=current,
            target=target,
            actions=actions,
            action_mask=send(mask),
            action_slots=send(slots),
            previous_action=memory.previous_action,
            previous_ask=memory.previous_ask,
        )

    def encode(self, observation: Observation) -> np.ndarray:
        """(L,) int64 numbers of the instruction's words."""
        text = observation.instruction if self.read_assistance or observation.mode is Mode.MAIN else ""
        return self.vocabulary.encode(text, self.instruction_length)


def thought_of(
    moves: np.ndarray, ask: np.float32, reasons: tuple[float, ...] | None, candidates: int, match: float | None = None
) -> Thought:
    """What the networks said, as it is written down: `moves` has stop first, a Thought has it last."""
    return Thought(
        moves=np.append(moves[1 : candidates + 1], moves[0]),
        asks={"help": float(ask), "nothing": float(1 - ask)},
        reasons=reasons,
        match=match,
    )


def for_training(
    policy: HannaPolicy,
    ask_rule: HannaAskRule = ask_sampled,
    environment_dropout: float = 0.0,
    guided_asking: float = 0.0,
) -> HannaPolicy:
    """The same networks, sampling their actions and keeping what they said."""
    return dataclasses.replace(
        policy,
        choose=choose_sampled,
        ask_rule=ask_rule,
        environment_dropout=environment_dropout,
        guided_asking=guided_asking,
        revisit_weight=1.0,
        use_goal_image=False,
        keep_moments=True,
    )


@dataclass(frozen=True, eq=False)
class PerfectInterpretation:
    """The skyline of Table 4.3: the teacher walks whenever an instruction is followed.

    Asking, and walking on the main task, are still the agent's own.
    """

    policy: HannaPolicy

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: HannaMemory | None, *, rngs: Rngs
    ) -> tuple[Actions, HannaMemory]:
        imposed = [None if s is None or s.mode is Mode.MAIN else action_index(shortest_of(s)) for s in situations]
        return self.policy.act(observations, memory, rngs=rngs, imposed=imposed)

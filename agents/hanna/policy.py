"""HannaPolicy: the networks as a Policy of embodied.interface, batched over episodes; and as one that learns.

LstmNetwork, the encoder-decoder baseline of Table 4.6, after Wang et al. (2019c), has the same interface as
HannaNetwork. It predicts no reasons, is trained without the curiosity loss, and its recurrent state is never reset
within an episode.
"""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from embodied import interface
from embodied.agents.common.tensors import Chooser, Rows, RunningRows, choose_greedily, choose_sampled, hidden_channels
from embodied.agents.common.vocabulary import Vocabulary
from embodied.agents.hanna import attention
from embodied.agents.hanna.attention import SLOTS, DotAttend, Percept, action_size
from embodied.agents.hanna.network import AgentNetwork, Scores
from embodied.agents.learners.hanna import RULES, HannaAskRule, TrainingConfig, ask_greedily, ask_sampled
from embodied.agents.vision.features import FeatureBank
from embodied.interface import VIEWS

StepScores = tuple[tuple[int, ...], Scores]
"""Outputs of the networks in one step, after the places in the batch of the episodes that were still running."""


@dataclass(frozen=True, eq=False)
class HannaMemory(RunningRows):
    """State that the policy carries between steps; rows belong to the episodes that still run."""

    networks: tuple[Any, Any]
    """Memories of the navigation and the help-request network."""
    previous_action: Tensor
    """(k, E)."""
    previous_ask: Tensor
    """(k,) int64."""
    last_ask: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Steering:
    """Weights of the moves by somebody who knows more than the networks."""

    weights: np.ndarray
    """(n + 1,) of the actions, stop first."""
    known: bool = False
    """The agent knows where it has to go, so it need not ask."""
    match: float | None = None
    """How well the picture that it was shown matches what it sees."""


Steer = Callable[[int, interface.Observation, np.ndarray], Steering]
"""(place in the batch, observation, (n + 1,) probabilities of the actions, stop first) -> what is made of them."""


@dataclass(frozen=True, eq=False)
class HannaPolicy:
    """A pair of networks that acts."""

    network: AgentNetwork
    vocabulary: Vocabulary
    bank: FeatureBank
    choose: Chooser = choose_greedily
    ask_rule: HannaAskRule = ask_greedily
    instruction_length: int = 50
    read_assistance: bool = True
    """False: on a route the text is empty, 'target image only' of Table 4.4."""
    learns: bool = False
    """The networks learn: what they said is kept, with its gradients."""
    environment_dropout: float = 0.0
    """Share of feature channels that an episode does not see at all (Tan et al. 2019): every episode
    plays in a house that looks a little different, so houses cannot be learned by heart."""
    guided_asking: float = 0.0
    """Share of the episodes of a batch, the first ones, in which 'every5' asks in place of `ask_rule`: a mixture
    of policies as in DAgger (Ross et al. 2011)."""

    def act(
        self,
        observations: interface.Observations,
        memory: HannaMemory | None,
        *,
        rngs: interface.Rngs,
        steer: Steer | None = None,
        imposed: Sequence[int | None] | None = None,
    ) -> tuple[interface.Actions, HannaMemory]:
        """One step of every running episode; see embodied.interface.Policy.

        Args:
          steer: what is made of the networks' moves before one is chosen; None: nothing.
          imposed: navigation actions (0 is stop, c + 1 candidate c) that replace the choice in some episodes; whether
            to ask stays the networks' decision.
        """
        positions = tuple(i for i, o in enumerate(observations) if o is not None)
        seen = [o for o in observations if o is not None]
        memory = self.start(positions) if memory is None else memory.keep(positions)
        actions: interface.Actions = [None] * len(observations)
        if not positions:
            return actions, memory
        percept = self.percept(seen, memory)
        with torch.set_grad_enabled(self.learns and torch.is_grad_enabled()):
            scores, networks = self.scored(memory, percept)
        chosen, guided = [], round(self.guided_asking * len(observations))
        for row, (position, o, thought) in enumerate(zip(positions, seen, thoughts_of(scores, seen), strict=True)):
            assert thought.moves is not None
            moves = np.roll(thought.moves, 1)  # stop first
            steering = Steering(moves) if steer is None else steer(position, o, moves)
            index = self.choose(steering.weights, rngs[position])  # drawn before asking, so asking shifts no draw
            given = None if imposed is None else imposed[position]
            index = index if given is None else given
            rule = RULES["every5"][0] if position < guided else self.ask_rule
            thought = dataclasses.replace(thought, match=steering.match)
            actions[position] = asked_or(
                index, thought, o, None if steering.known else rule, memory.last_ask[row], rngs[position]
            )
            chosen.append(0 if isinstance(actions[position], interface.Ask) else index)  # its own move is discarded
        device, asks = percept.actions.device, [isinstance(actions[p], interface.Ask) for p in positions]
        taken = torch.arange(len(positions), device=device), torch.tensor(chosen, device=device)
        return actions, dataclasses.replace(
            memory,
            networks=networks,
            previous_action=percept.actions[taken],
            previous_ask=torch.tensor(
                [attention.REQUEST if ask else attention.DO_NOTHING for ask in asks], device=device
            ),
            last_ask=tuple(o.time if ask else t for ask, o, t in zip(asks, seen, memory.last_ask, strict=True)),
            moments=(*memory.moments, (positions, scores)) if self.learns else (),
        )

    def scored(self, memory: HannaMemory, percept: attention.Percept) -> tuple[Scores, tuple[Any, Any]]:
        """Outputs of the networks for a step, and their memories."""
        return self.network(memory.networks, percept)

    def start(self, positions: tuple[int, ...]) -> HannaMemory:
        """Memory before the first step of the episodes at `positions`."""
        k, device = len(positions), next(self.network.parameters()).device
        return HannaMemory(
            positions=positions,
            networks=self.network.start(k, self.instruction_length),
            previous_action=torch.zeros(k, self.network.action_size, device=device),
            previous_ask=torch.full((k,), attention.START, device=device),
            last_ask=(-1,) * k,
            channels=hidden_channels(k, self.bank.size, self.environment_dropout, device),
        )

    def percept(self, observations: Sequence[interface.Observation], memory: HannaMemory) -> attention.Percept:
        """The tensors of one step, from observations of running episodes and their memory."""
        views, angles, mask = attention.candidate_rows(observations)
        k, most = views.shape
        turns = np.array([o.turn for o in observations])[:, None]  # (k, 1)
        slots = views // interface.TURNS * interface.TURNS + (views - turns) % interface.TURNS
        slots[:, 0] = attention.SLOTS - 1

        device = next(self.network.parameters()).device
        send = lambda array: torch.from_numpy(array).to(device)
        current = self.bank.gather([o.sight for o in observations])  # (k, 36, D) absolute
        target = self.bank.gather([o.target for o in observations])
        if memory.channels is not None:
            current, target = current * memory.channels[:, None], target * memory.channels[:, None]
        rows = torch.arange(k, device=device)[:, None]
        looks = current[rows, send(views)]  # (k, A, D)
        facing = attention.orientation(send(angles[0]), send(angles[1]), attention.COPIES)  # docs/sources.md, S27
        exists = torch.arange(most, device=device)[:, None] > 0  # stop and padding are zero vectors
        actions = torch.cat([looks, facing], -1) * (exists & send(mask)[..., None])
        # The authors' program keeps rows of views absolute (docs/sources.md, S29), which tells the agent where east is;
        # D.1 leaves the order open, a robot has no compass: they begin at the agent's own heading.
        absolute = np.arange(interface.VIEWS)[None]
        order = absolute // interface.TURNS * interface.TURNS + (absolute + turns) % interface.TURNS  # (k, 36)
        current, target = current[rows, send(order)], target[rows, send(order)]
        return attention.Percept(
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

    def encode(self, observation: interface.Observation) -> np.ndarray:
        """(L,) int64 numbers of the instruction's words."""
        text = observation.instruction if self.read_assistance or observation.mode is interface.Mode.MAIN else ""
        return self.vocabulary.encode(text, self.instruction_length)


def thoughts_of(scores: Scores, observations: Sequence[interface.Observation]) -> list[interface.Thought]:
    """Outputs of the networks for each observation, as it is written down: a Thought has stop last."""
    moves = scores.navigation.detach().softmax(-1).cpu().numpy()  # (k, A), stop first
    asks = scores.ask.detach().softmax(-1)[:, attention.REQUEST].cpu().numpy()  # (k,)
    reasons = None if scores.reasons is None else scores.reasons.detach().sigmoid().tolist()  # (k, 3)
    return [
        interface.Thought(
            moves=np.roll(moves[row, : len(o.candidates) + 1], -1),
            asks={"help": float(asks[row]), "nothing": float(1 - asks[row])},
            reasons=None if reasons is None else tuple(reasons[row]),
        )
        for row, o in enumerate(observations)
    ]


def asked_or(
    index: int,
    thought: interface.Thought,
    o: interface.Observation,
    rule: HannaAskRule | None,
    last_ask: int,
    rng: np.random.Generator,
) -> interface.Action:
    """A request if the rule wants one where it can be made, else the action `index`: 0 is stop, c + 1 candidate c."""
    assert thought.asks is not None
    if interface.Intention.HELP in o.can_ask and rule is not None and rule(thought.asks["help"], o, last_ask, rng=rng):
        return interface.Ask(interface.Intention.HELP, thought)
    return interface.Stop(thought) if index == 0 else interface.Move(index - 1, thought)


def for_training(
    policy: HannaPolicy,
    ask_rule: HannaAskRule = ask_sampled,
    environment_dropout: float = 0.0,
    guided_asking: float = 0.0,
) -> HannaPolicy:
    """The same networks, sampling their actions and learning."""
    policy = dataclasses.replace(policy, choose=choose_sampled, ask_rule=ask_rule, learns=True)
    return dataclasses.replace(policy, environment_dropout=environment_dropout, guided_asking=guided_asking)


@dataclass(frozen=True, eq=False)
class LstmMemory(Rows):
    """State that one decoder carries from step to step, for B agents."""

    text: Tensor
    """(B, L, h), with `text_mask` (B, L) bool."""
    text_mask: Tensor
    hidden: Tensor
    cell: Tensor
    """(B, h)."""


class LstmStateNetwork(nn.Module):
    """Text LSTM, decoder LSTM, attention over words, current view and target view."""

    def __init__(
        self, config: TrainingConfig, words: int, feature_size: int, previous_size: int, extra_size: int
    ) -> None:
        super().__init__()
        h, d = config.hidden_size, feature_size
        self.hidden_size = h
        self.embedding = nn.Embedding(words, h, padding_idx=0)
        self.text_lstm = nn.LSTM(h, h, batch_first=True)
        self.scene_attend = DotAttend(h, d, h)
        self.decoder = nn.LSTMCell(previous_size + d + VIEWS + extra_size, h)
        self.text_attend = DotAttend(h, h, h)
        self.current_attend = DotAttend(h, d, h)
        self.target_attend = DotAttend(h, d, h)
        self.dropout = nn.Dropout(config.dropout)
        self.out = nn.Linear(2 * h + 2 * d, h)

    def start(self, batch: int, length: int) -> LstmMemory:
        """The memory of `batch` agents before their first step."""
        zero = self.out.weight.new_zeros(batch, self.hidden_size)
        mask = torch.ones(batch, length, dtype=torch.bool, device=zero.device)
        return LstmMemory(zero[:, None].expand(-1, length, -1), mask, zero, zero)

    def forward(
        self, m: LstmMemory, percept: Percept, delta: Tensor, previous: Tensor, extra: Tensor, similar: Tensor
    ) -> tuple[Tensor, LstmMemory]:
        """State (B, h) of this step, and the memory after it; arguments as of StateNetwork, `similar` is not used."""
        text, text_mask = m.text, m.text_mask
        rows = percept.new_task.nonzero()[:, 0]
        if len(rows):
            words, _ = self.text_lstm(self.dropout(self.embedding(percept.tokens[rows])))  # left to right: padding
            text = text.index_copy(0, rows, words)  # comes last, so it changes nothing before it
            text_mask = percept.tokens != 0
        scene = self.scene_attend(m.hidden, percept.current)  # (B, D)
        inputs = self.dropout(torch.cat([previous, scene, delta, extra], -1))
        hidden, cell = self.decoder(inputs, (m.hidden, m.cell))  # (B, h)
        seen = self.dropout(hidden)
        scores = torch.einsum("bh,blh->bl", self.text_attend.query(seen) @ self.text_attend.row.weight, text)
        decoded = torch.einsum("bl,blh->bh", scores.masked_fill(~text_mask, -torch.inf).softmax(-1), text)  # (B, h)
        here = self.current_attend(decoded, percept.current)  # (B, D)
        there = self.target_attend(decoded, percept.target)  # (B, D)
        state = torch.tanh(self.out(torch.cat([seen, decoded, here, there], -1)))
        return state, LstmMemory(text, text_mask, hidden, cell)


class LstmNetwork(AgentNetwork):
    """Navigation and help-request decoders of the baseline."""

    def __init__(self, config: TrainingConfig, words: int, feature_size: int) -> None:
        super().__init__()
        h, self.action_size = config.hidden_size, action_size(feature_size)
        self.navigation = LstmStateNetwork(config, words, feature_size, self.action_size, 0)
        self.action_in = nn.Linear(self.action_size, h)
        self.action_out = nn.Linear(h, 1)
        self.help = LstmStateNetwork(config, words, feature_size, config.ask_embedding, SLOTS)
        self.ask_embedding = nn.Embedding(3, config.ask_embedding)
        self.ask_out = nn.Linear(h, 2)

    def scores_of(self, state: Tensor, actions: Tensor) -> Tensor:
        return self.action_out(state[:, None] * self.action_in(actions))[..., 0]

    def asking(self, state: Tensor) -> tuple[Tensor, None]:
        return self.ask_out(state), None

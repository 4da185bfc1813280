"""The two networks of HANNA, dissertation appendix D.2: where to go, and when to ask.

B agents, A navigation actions, h hidden size, D visual feature size, n steps so far plus one (a memory opens with zero
vectors). Each line carries the number of the equation it computes. What differs from the text, and why, is said at the
line; what dissertation and program do differently was decided so (docs/sources.md, by its numbers):
  * an agent's inter-task memory is reset when *its own* task changes (text; the program resets the
    whole batch; S23), so results do not depend on the batch;
  * the navigation score is the bilinear form of D.18, with biases (S24);
  * reasons are three independent sigmoids, as loss 4.14 needs (D.20 prints a softmax; S25);
  * the help-request network compares only with past steps at which it asked (S26).
"""

import dataclasses
from dataclasses import dataclass
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from embodied.agents.common.tensors import Rows
from embodied.agents.hanna.attention import (
    REQUEST,
    SLOTS,
    DotAttend,
    FeedForward,
    IncTime,
    MultiAttend,
    Percept,
    SelfAttend,
    TextEncoder,
    action_size,
    sim_attend,
    slot_distribution,
    target_similarity,
)
from embodied.agents.learners.hanna import TrainingConfig
from embodied.interface import VIEWS

SHORT = 12
"""Words up to which an instruction is encoded with the short ones."""


@dataclass(frozen=True, eq=False)
class NetworkMemory(Rows):
    """State that one network carries from step to step, for B agents. Keys and values are projected."""

    text_keys: Tensor
    text_values: Tensor
    """(B, L, h) M^text, with `text_mask` (B, L) bool."""
    text_mask: Tensor
    inter_state: Tensor
    """(B, h) h_{t-1}^inter."""
    inter_keys: Tensor
    inter_values: Tensor
    """(B, n, h) M^inter; entry 0 stands for the zero vectors."""
    inter_mask: Tensor
    """(B, n) bool, entries since the agent's task changed, and entry 0."""
    local_time: Tensor
    global_time: Tensor
    """(B, h)."""
    intra_keys: Tensor
    intra_values: Tensor
    """(B, n, h) M^intra for SELFATTEND."""
    intra_inputs: Tensor
    intra_states: Tensor
    """(B, n, h) the same memory, not projected, for SIMATTEND."""
    similar_mask: Tensor
    """(B, n - 1) bool, which entries but the newest SIMATTEND may consider."""


@dataclass(frozen=True, eq=False)
class Scores:
    """Outputs of both networks for one step."""

    navigation: Tensor
    """(B, A) logits, -inf where there is no action."""
    ask: Tensor
    """(B, 2) logits of DO_NOTHING and REQUEST."""
    reasons: Tensor | None
    """(B, 3) logits of the conditions lost, uncertain_wrong, never_asked; None without them."""


class StateNetwork(nn.Module):
    """Text-encoding, inter-task and intra-task components: everything but the last layer."""

    def __init__(
        self, config: TrainingConfig, words: int, feature_size: int, previous_size: int, extra_size: int
    ) -> None:
        """`previous_size` is that of a_{t-1}, `extra_size` that of P^nav (37) or 0."""
        super().__init__()
        c, h, d = config, config.hidden_size, feature_size
        self.config = config
        self.text_encoder = TextEncoder(words, h, c.self_heads, c.dropout)
        self.local_time = IncTime(h, h)
        self.global_time = IncTime(2 * h, h)
        self.scene_attend = DotAttend(h, d, h)
        self.inter_in = nn.Linear(d + previous_size + VIEWS, h)
        self.inter_attend = SelfAttend(h, c.self_heads, c.dropout)
        self.text_attend = MultiAttend(h, c.text_heads, c.dropout)
        self.text_feed = FeedForward(h, c.dropout)
        self.current_attend = DotAttend(h, d, h)
        self.target_attend = DotAttend(h, d, h)
        self.intra_in = nn.Linear(h + 2 * d + VIEWS + extra_size, h)
        self.intra_attend = SelfAttend(h, c.self_heads, c.dropout)
        self.intra_feed = FeedForward(h, c.dropout)
        self.gate = nn.Linear(2 * h, h)

    def start(self, batch: int, length: int) -> NetworkMemory:
        """The memory of `batch` agents before their first step, for instructions of `length` words."""
        like = self.inter_in.weight
        zero = like.new_zeros(batch, self.config.hidden_size)
        seen = torch.ones(batch, 1, dtype=torch.bool, device=like.device)
        inter_keys, inter_values = self.inter_attend.empty(batch, like)
        intra_keys, intra_values = self.intra_attend.empty(batch, like)
        return NetworkMemory(
            text_keys=zero[:, None].expand(-1, length, -1),
            text_values=zero[:, None].expand(-1, length, -1),
            text_mask=seen.expand(-1, length),
            inter_state=zero,
            inter_keys=inter_keys,
            inter_values=inter_values,
            inter_mask=seen,
            local_time=zero,
            global_time=zero,
            intra_keys=intra_keys,
            intra_values=intra_values,
            intra_inputs=zero[:, None],
            intra_states=zero[:, None],
            similar_mask=seen[:, :0],
        )

    def forward(
        self, m: NetworkMemory, percept: Percept, delta: Tensor, previous: Tensor, extra: Tensor, similar: Tensor
    ) -> tuple[Tensor, NetworkMemory]:
        """One step.

        Args:
          m: memory after the step before.
          percept: what B agents see.
          delta: (B, 36) target similarity.
          previous: (B, p) a_{t-1}.
          extra: (B, e) further inputs of D.15.
          similar: (B,) bool, whether SIMATTEND may consider the step before this one.

        Returns:
          h_t^intra (B, h) and the memory after this step.
        """
        m = self._read(m, percept)
        m = self._reset(m, percept.new_task) if self.config.reset_inter_task else m

        local_time = self.local_time(m.local_time)  # (B, h) D.1
        global_time = self.global_time(torch.cat([local_time, m.global_time], -1))  # (B, h) D.2

        scene = self.scene_attend(m.inter_state, percept.current)  # (B, D) c^inter, D.8
        inter_in = self.inter_in(torch.cat([scene, previous, delta], -1)) + local_time  # (B, h) q^inter, D.7
        inter, inter_keys = self.inter_attend(inter_in, m.inter_keys, m.inter_values, m.inter_mask)  # (B, h) D.6

        read = self.text_attend(inter, m.text_keys, m.text_values, m.text_mask)  # (B, h) tilde c^text, D.10
        decoded = self.text_feed(read)  # (B, h) c^text, D.9
        here = self.current_attend(decoded, percept.current)  # (B, D) c^cur, D.11
        there = self.target_attend(decoded, percept.target)  # (B, D) c^tgt, D.12

        intra_in = self.intra_in(torch.cat([decoded, here, there, delta, extra], -1)) + global_time  # q^intra, D.15
        seen = torch.ones_like(m.intra_keys[..., 0], dtype=torch.bool)  # (B, n): the whole episode
        attended, intra_keys = self.intra_attend(intra_in, m.intra_keys, m.intra_values, seen)
        tentative = self.intra_feed(attended)  # (B, h) bar h^intra, D.13
        similar_mask = torch.cat([m.similar_mask, similar[:, None]], 1)  # (B, n)
        state = tentative
        if self.config.similarity_attention:
            past = sim_attend(intra_in, m.intra_inputs, m.intra_states, similar_mask)  # (B, h) tilde h^intra, D.14
            beta = torch.sigmoid(self.gate(torch.cat([tentative, past], -1)))  # (B, h) D.17
            state = tentative - beta * past  # (B, h) D.16

        return state, dataclasses.replace(
            m,
            inter_state=inter,
            inter_keys=inter_keys,
            inter_values=self.inter_attend.append_value(m.inter_values, inter),
            inter_mask=torch.cat([m.inter_mask, seen[:, :1]], 1),
            local_time=local_time,
            global_time=global_time,
            intra_keys=intra_keys,
            intra_values=self.intra_attend.append_value(m.intra_values, state),
            intra_inputs=torch.cat([m.intra_inputs, intra_in[:, None]], 1),
            intra_states=torch.cat([m.intra_states, state[:, None]], 1),
            similar_mask=similar_mask,
        )

    def _read(self, m: NetworkMemory, percept: Percept) -> NetworkMemory:
        """M^text read anew for the agents whose instruction changed (D.5).

        Short and long instructions are encoded apart, because padding costs as much as words.
        """
        lengths = (percept.tokens != 0).sum(1)
        keys, values = m.text_keys, m.text_values
        for alike in (lengths <= SHORT, lengths > SHORT):
            if len(rows := (percept.new_task & alike).nonzero()[:, 0]):
                width = int(lengths[rows].max())
                text = self.text_encoder(percept.tokens[rows, :width])  # (k, width, h)
                wide = (0, 0, 0, keys.shape[1] - width)
                keys = keys.index_copy(0, rows, F.pad(self.text_attend.key(text), wide))
                values = values.index_copy(0, rows, F.pad(self.text_attend.value(text), wide))
        return dataclasses.replace(m, text_keys=keys, text_values=values, text_mask=percept.tokens != 0)

    @staticmethod
    def _reset(m: NetworkMemory, who: Tensor) -> NetworkMemory:
        """Inter-task state, memory and local time back to zero for the agents in `who` (B,)."""
        keep = ~who[:, None]
        opening = torch.arange(m.inter_mask.shape[1], device=who.device) == 0
        return dataclasses.replace(
            m,
            inter_state=m.inter_state * keep,
            local_time=m.local_time * keep,
            inter_mask=m.inter_mask & (keep | opening),
        )


class AgentNetwork(nn.Module):
    """Navigation policy and help-request policy: two networks that share nothing. Subclasses supply both, the
    embedding of requests and what is read from the networks' states."""

    action_size: int
    navigation: Any
    help: Any
    ask_embedding: nn.Embedding

    def scores_of(self, state: Tensor, actions: Tensor) -> Tensor:
        """(B, A) logits of navigation actions, by state (B, h) and actions (B, A, E)."""
        raise NotImplementedError

    def asking(self, state: Tensor) -> tuple[Tensor, Tensor | None]:
        """(B, 2) logits of DO_NOTHING and REQUEST, and (B, 3) of reasons, by state (B, h)."""
        raise NotImplementedError

    def start(self, batch: int, length: int) -> tuple[Any, Any]:
        """Memories of both networks before the first step of `batch` agents."""
        return self.navigation.start(batch, length), self.help.start(batch, length)

    def forward(self, memory: tuple[Any, Any], percept: Percept) -> tuple[Scores, tuple[Any, Any]]:
        """One step of B agents; no gradient flows from asking into navigation."""
        delta = target_similarity(percept.current, percept.target)  # (B, 36)
        everywhere, asked = torch.ones_like(percept.new_task), percept.previous_ask == REQUEST
        nothing = percept.current.new_zeros(len(delta), 0)
        state, walking = self.navigation(memory[0], percept, delta, percept.previous_action, nothing, everywhere)
        logits = self.scores_of(state, percept.actions).masked_fill(~percept.action_mask, -torch.inf)
        slots = slot_distribution(logits.detach(), percept.action_slots)  # (B, 37) P^nav
        before = self.ask_embedding(percept.previous_ask)
        state, asking = self.help(memory[1], percept, delta, before, slots, asked)
        return Scores(logits, *self.asking(state)), (walking, asking)


class HannaNetwork(AgentNetwork):
    """The networks of appendix D.2."""

    def __init__(self, config: TrainingConfig, words: int, feature_size: int) -> None:
        """
        Args:
          words: vocabulary size; word 0 is padding.
          feature_size: D, what the visual encoder gives per view.
        """
        super().__init__()
        self.config, self.action_size = config, action_size(feature_size)
        h, e = config.hidden_size, config.navigation_embedding
        self.navigation = StateNetwork(config, words, feature_size, self.action_size, 0)
        self.action_out = nn.Linear(h, e)
        self.action_in = nn.Linear(self.action_size, e)
        self.help = StateNetwork(config, words, feature_size, config.ask_embedding, SLOTS)
        self.ask_embedding = nn.Embedding(3, config.ask_embedding)
        if config.predict_reasons:
            self.reason_out = nn.Linear(h, 3)
            self.ask_out = nn.Linear(3, 2)
        else:
            self.ask_out = nn.Linear(h, 2)
        # An agent that asks at every second step hears a new text each time and learns to walk by none.
        self.ask_out.bias.data = torch.tensor([1.0, -1.0])  # one request in eight chances (docs/sources.md, S30)

    def scores_of(self, state: Tensor, actions: Tensor) -> Tensor:
        action = self.action_in(actions)  # (B, A, e) W^act E^nav
        return torch.einsum("be,bae->ba", self.action_out(state), action)  # (B, A) D.18

    def asking(self, state: Tensor) -> tuple[Tensor, Tensor | None]:
        reasons = self.reason_out(state) if self.config.predict_reasons else None  # (B, 3) D.20
        return self.ask_out(state if reasons is None else reasons), reasons  # (B, 2) D.19

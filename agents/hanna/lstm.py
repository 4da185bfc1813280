"""The LSTM encoder-decoder baseline of Table 4.6, after Wang et al. (2019c), with the same interface as HannaNetwork.

It predicts no reasons, is trained without the curiosity loss, and its recurrent state is never
reset within an episode.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from embodied.agents.common.tensors import Rows
from embodied.agents.hanna.attention import SLOTS, DotAttend, Percept, action_size
from embodied.agents.hanna.network import AgentNetwork
from embodied.agents.learners.hanna import TrainingConfig
from embodied.interface import VIEWS


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

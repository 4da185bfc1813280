"""Networks of ILIAD that write, word by word or letter by letter: an LSTM that attends to what was read.

B data points, S places of what was read, T numbers that are written, h hidden size, V numbers to
choose from; 0 is padding everywhere.
"""

import torch
from torch import Tensor, nn

from embodied.agents.common.tensors import Choice, Remembered

PAD = 0


class Attention(nn.Module):
    """'General' attention: softmax(q^T W m) m."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.key = nn.Linear(size, size, bias=False)

    def remember(self, values: Tensor, mask: Tensor) -> Remembered:
        return Remembered(values, self.key(values), mask)

    def forward(self, queries: Tensor, memory: Remembered) -> Tensor:
        """(B, T, h) queries to (B, T, h) contexts."""
        scores = torch.bmm(queries, memory.keys.transpose(1, 2))
        weights = scores.masked_fill(~memory.mask[:, None], -torch.inf).softmax(-1)
        return torch.bmm(weights, memory.values)


class AttentiveWriter(nn.Module):
    """An LSTM that writes numbers one by one and attends to memories after every step."""

    def __init__(self, numbers: int, width: int, size: int, memories: int) -> None:
        super().__init__()
        self.embed = nn.Embedding(numbers, width)
        self.lstm = nn.LSTM(width, size, batch_first=True)
        self.attend = nn.ModuleList(Attention(size) for _ in range(memories))
        self.combine = nn.Linear((1 + memories) * size, size)
        self.out = nn.Linear(size, numbers)

    def remember(self, which: int, values: Tensor, mask: Tensor) -> Remembered:
        """The content of memory number `which`: (B, S, h) values, (B, S) bool which of them are there."""
        attention = self.attend[which]
        assert isinstance(attention, Attention)
        return attention.remember(values, mask)

    def forward(self, before: Tensor, state: tuple[Tensor, Tensor], memories: list[Remembered]) -> tuple[Tensor, tuple]:
        """Logits (B, T, V) after each of the numbers `before` (B, T), and the state after the last."""
        hidden, state = self.lstm(self.embed(before), state)
        contexts = [attend(hidden, m) for attend, m in zip(self.attend, memories)]
        return self.out(torch.tanh(self.combine(torch.cat([hidden, *contexts], -1)))), state


class Bridge(nn.Module):
    """From what one LSTM ended with to what the next begins with."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.both = nn.Linear(size, 2 * size)

    def forward(self, last: Tensor) -> tuple[Tensor, Tensor]:
        hidden, cell = torch.tanh(self.both(last)).chunk(2, -1)
        return hidden[None].contiguous(), cell[None].contiguous()


@torch.no_grad()
def write(
    writer: AttentiveWriter,
    state: tuple[Tensor, Tensor],
    memories: list[Remembered],
    choose: Choice,
    longest: int,
    stop: int,
    copies: int = 1,
) -> Tensor:
    """(copies B, at most `longest`) numbers, `stop` last unless cut, padded; the copies of a row stand one behind the
    other. Padding is never written before the end.

    Rows that have ended are carried along only until they are half of all: leaving them out costs a copy.
    """
    if copies > 1:
        rows = torch.arange(len(memories[0].mask)).repeat_interleave(copies)
        state, memories = (state[0][:, rows], state[1][:, rows]), [m.select(rows) for m in memories]
    count = memories[0].mask.shape[0]
    written = torch.zeros((count, longest), dtype=torch.int64)
    rows, number = torch.arange(count), torch.full((count,), stop)
    going = torch.ones(count, dtype=torch.bool)
    for t in range(longest):
        logits, state = writer(number[:, None], state, memories)
        logits = logits[:, 0]
        logits[:, PAD] = -torch.inf
        number = choose(logits, rows, t)
        written[rows[going], t] = number[going]
        going = going & (number != stop)
        left = int(going.sum())
        if left == 0:
            return written[:, : t + 1]
        if 2 * left <= len(rows):
            kept = going.nonzero()[:, 0]
            rows, number, going = rows[kept], number[kept], going[kept]
            state = state[0][:, kept].contiguous(), state[1][:, kept].contiguous()
            memories = [m.select(kept) for m in memories]
    return written


def likelihood_loss(logits: Tensor, written: Tensor) -> Tensor:
    """Negative log-likelihood of the numbers written, averaged over rows."""
    present = written != PAD
    return nn.functional.cross_entropy(logits[present], written[present], reduction="sum") / len(written)


def before(written: Tensor, start: int) -> Tensor:
    """The number before each number."""
    return torch.cat([torch.full_like(written[:, :1], start), written[:, :-1]], 1)


def last(states: Tensor, mask: Tensor) -> Tensor:
    """(B, h): the state at the last place of each row that is not padding."""
    return states[torch.arange(len(states)), mask.sum(1) - 1]

"""HARI's networks: the execution policy (a Transformer), the intention policy and its critic (LSTMs); appendix E.
HARI's agents on disk: the execution policy alone, or with the intention policy that learned to use it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn

from embodied.agents.common.tensors import Rows
from embodied.agents.common.weights import load_into, load_weights, save_weights, seeded
from embodied.agents.hari.words import SIZES, FeatureWords, Inputs
from embodied.agents.learners.hari import ExecutionConfig, IntentionConfig
from embodied.records import Identity

INTENTIONS = ("cur", "goal", "sub", "do", "done")
"""A-bar of 4.3.3.2, in the order of the intention policy's outputs."""
DEPTHS = 4
"""Stack sizes that `knows_stack` tells apart; larger ones count as the largest."""
SHOWN = 8
"""Probabilities of moves that the intention policy is shown."""


@dataclass(frozen=True, eq=False)
class EncodedDescriptions(Rows):
    """B descriptions as the encoder reads them."""

    rows: Tensor
    """(B, M, h)."""
    present: Tensor
    """(B, M) bool: False for padding."""

    def upto(self, width: int) -> EncodedDescriptions:
        """The same with no more than `width` rows, where the others are padding."""
        return EncodedDescriptions(self.rows[:, :width], self.present[:, :width])


def transformer(size: int, layers: int, heads: int, dropout: float) -> nn.TransformerEncoder:
    """Layers with pre-normalisation, each with random weights of its own, and a last norm."""
    layer = lambda: nn.TransformerEncoderLayer(size, heads, 4 * size, dropout, batch_first=True, norm_first=True)
    encoder = nn.TransformerEncoder(layer(), layers, nn.LayerNorm(size), enable_nested_tensor=False)
    encoder.layers = nn.ModuleList(layer() for _ in range(layers))
    return encoder


class ExecutionNetwork(nn.Module):
    """pi-hat: (b^s_{t-1}, d^s, d^g) -> b^s_t and a distribution over moves.

    "We adapt the V&L BERT architecture": an encoder reads each description by itself, a decoder attends from the
    previous hidden vector over both. What the text leaves open and is decided here (docs/sources.md, S75): moves are
    scored by the product of b^s_t with the embedding of the feature set that an assistant would use for them, so that
    "go north" and the neighbour to the north are near each other from the start.
    """

    def __init__(self, config: ExecutionConfig, names: int) -> None:
        """`names`: how many words it knows."""
        super().__init__()
        h = config.hidden_size
        self.names = nn.Embedding(names, h, padding_idx=0)
        self.others = nn.ModuleList(nn.Embedding(n, h, padding_idx=0) for n in SIZES)
        for table in (self.names, *self.others):
            nn.init.normal_(table.weight, std=h**-0.5)
            with torch.no_grad():
                table.weight[0].zero_()
        self.angles = nn.Linear(4, h, bias=False)
        self.encoder = transformer(h, config.layers, config.heads, config.dropout)
        self.decoder = transformer(h, config.layers, config.heads, config.dropout)
        self.roles = nn.Parameter(torch.randn(3, h) * h**-0.5)
        """Which of the three a row is: the belief, of d^s, of d^g."""
        self.shared = nn.Embedding(3, h)
        """True where a row's name, or all of it, stands in the other description, too (docs/sources.md, S80)."""
        nn.init.normal_(self.shared.weight, std=h**-0.5)
        self.first = nn.Parameter(torch.zeros(h))
        """b^s_0."""
        self.query = nn.Linear(h, h)
        self.key = nn.Linear(h, h)
        self.norm = nn.LayerNorm(h)

    def begin(self, batch: int) -> Tensor:
        """(B, h): b^s_0."""
        return self.first.expand(batch, -1)

    def forward(
        self,
        before: Tensor,
        inputs: Inputs,
        state: EncodedDescriptions | None = None,
        goal: EncodedDescriptions | None = None,
    ) -> tuple[Tensor, Tensor]:
        """One step.

        Args:
          before: (B, h) b^s of the move before.
          state: d^s as `encode` made it, where that has been done before; None encodes `inputs.state`.
          goal: d^g likewise; both may be padded further than `inputs`.

        Returns:
          (B, h) b^s_t, and (B, C + 1) log-probabilities of the moves, stopping last; -inf where not allowed.
        """
        device = before.device
        state = state or self.encode(torch.from_numpy(inputs.state).to(device))  # (B, S, h)
        goal = (goal or self.encode(torch.from_numpy(inputs.goal).to(device))).upto(inputs.goal.shape[1])  # (B, G, h)
        state_shared, goal_shared = (
            self.shared(torch.from_numpy(x).to(device)) for x in (inputs.state_shared, inputs.goal_shared)
        )
        state_rows = state.rows + self.roles[1] + state_shared
        goal_rows = goal.rows + self.roles[2] + goal_shared
        rows = torch.cat([(before + self.roles[0])[:, None], state_rows, goal_rows], 1)  # (B, 1 + S + G, h)
        there = torch.ones_like(state.present[:, :1])
        present = torch.cat([there, state.present, goal.present], 1)
        belief = self.norm(self.decoder(rows, src_key_padding_mask=~present)[:, 0])  # (B, h)
        moves, angles, allowed = (torch.from_numpy(x).to(device) for x in (inputs.moves, inputs.angles, inputs.allowed))
        keys = self.key(self.embed(moves) + self.angles(angles))  # (B, C + 1, h)
        scores = torch.einsum("bh,bch->bc", self.query(belief), keys) / math.sqrt(keys.shape[-1])
        return belief, scores.masked_fill(~allowed, -torch.inf).log_softmax(-1)

    def encode(self, rows: Tensor) -> EncodedDescriptions:
        """(B, M, 5) int64 of descriptions, each of one row or more -> what the encoder makes of them."""
        present = rows[..., 1] != 0
        return EncodedDescriptions(self.encoder(self.embed(rows), src_key_padding_mask=~present), present)

    def embed(self, rows: Tensor) -> Tensor:
        """(..., 5) int64 -> (..., h): "sum all the embeddings into a single vector"."""
        parts = [table(rows[..., k + 1]) for k, table in enumerate(self.others)]
        return self.names(rows[..., 0]) + torch.stack(parts).sum(0)


class RecurrentHead(nn.Module):
    """An LSTM over what the execution policy thinks: psi with five outputs, V with one.

    "The input of this model is the execution policy's model outputs, b^s_t and p_t, and the
    embedding of the previously taken action" (appendix E). p_t has as many entries as there are
    moves; here it is the probability of stopping and the `SHOWN` largest of moving, in descending order.
    """

    def __init__(self, belief: int, hidden: int, outputs: int, *, knows_stack: bool) -> None:
        super().__init__()
        self.knows_stack = knows_stack
        self.last = nn.Embedding(1 + len(INTENTIONS), hidden // 4)
        """Of the intention before; 0 at the beginning."""
        extra = DEPTHS if knows_stack else 0
        self.cell = nn.LSTMCell(belief + 1 + SHOWN + hidden // 4 + extra, hidden)
        self.out = nn.Linear(hidden, outputs)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def begin(self, batch: int) -> Tensor:
        """(2, B, hidden): nothing has been thought."""
        return self.out.weight.new_zeros(2, batch, self.cell.hidden_size)

    def forward(
        self, belief: Tensor, shown: Tensor, last: Tensor, depth: Tensor, memory: Tensor
    ) -> tuple[Tensor, Tensor]:
        """One step.

        Args:
          belief: (B, h) b^s_t.
          shown: (B, 1 + SHOWN) p_t, see `shown_probabilities`.
          last: (B,) int64, 0 or 1 + the intention before.
          depth: (B,) int64, goals on the stack, at least 1.
          memory: what this returned before.

        Returns:
          (B, outputs), and the memory.
        """
        parts = [belief, shown, self.last(last)]
        if self.knows_stack:
            parts.append(nn.functional.one_hot((depth - 1).clamp(0, DEPTHS - 1), DEPTHS).to(belief.dtype))
        memory = torch.stack(self.cell(torch.cat(parts, -1), memory.unbind()))
        return self.out(memory[0]), memory


def shown_probabilities(log_moves: Tensor) -> Tensor:
    """(B, 1 + SHOWN): the probability of stopping, then those of moving from the largest on.

    Args:
      log_moves: (B, C + 1) log-probabilities, stopping last.
    """
    p = log_moves.exp()
    moves = p[:, :-1].sort(-1, descending=True).values[:, :SHOWN]
    return torch.cat([p[:, -1:], nn.functional.pad(moves, (0, SHOWN - moves.shape[1]))], -1)


HARI_REMEDY = "train it again with `embodied train hari`"


@dataclass(frozen=True)
class HariAbout:
    """Metadata beside the weights in a file."""

    names: tuple[str, ...]
    """The words that the policies know."""

    execution: ExecutionConfig
    intention: IntentionConfig | None = None
    """None for an execution policy alone."""


@dataclass(frozen=True, eq=False)
class Executor:
    """A trained execution policy with the words it knows."""

    network: ExecutionNetwork
    words: FeatureWords
    config: ExecutionConfig


@dataclass(frozen=True, eq=False)
class HariAgent:
    """An execution policy and the intention policy that was trained on it."""

    executor: Executor
    actor: RecurrentHead
    config: IntentionConfig


def new_executor(config: ExecutionConfig, words: FeatureWords) -> Executor:
    """Random weights that follow from the seed."""
    with seeded(config.seed):
        return Executor(ExecutionNetwork(config, len(words)), words, config)


def new_heads(config: IntentionConfig, belief: int) -> tuple[RecurrentHead, RecurrentHead]:
    """Actor psi and critic V with random weights that follow from the seed."""
    with seeded(config.seed):
        actor = RecurrentHead(belief, config.hidden_size, len(INTENTIONS), knows_stack=config.knows_stack)
        return actor, RecurrentHead(belief, config.hidden_size, 1, knows_stack=config.knows_stack)


def save(made: Executor | HariAgent, path: Path, identity: Identity | None = None) -> None:
    """Write an execution policy, or an agent with its own, and what it was trained with, atomically."""
    agent = made if isinstance(made, HariAgent) else None
    executor = made.executor if isinstance(made, HariAgent) else made
    parts = nn.ModuleDict({"execution": executor.network} | ({"actor": agent.actor} if agent else {}))
    about = HariAbout(executor.words.names, executor.config, agent.config if agent else None)
    save_weights(path, "hari", parts.state_dict(), about, identity)


def load_executor(path: Path) -> Executor:
    """The execution policy of a file of `save`.

    Raises:
      FileNotFoundError, ValueError: missing, damaged or of another format.
    """
    tensors, about = load_weights(path, "hari", HariAbout, HARI_REMEDY)
    executor = new_executor(about.execution, FeatureWords(about.names))
    load_into(executor.network, _of("execution", tensors), path)
    executor.network.eval()
    return executor


def load_agent(path: Path) -> HariAgent:
    """Load an agent that `save` wrote.

    Raises:
      FileNotFoundError, ValueError: missing, damaged, of another format, or an execution policy alone.
    """
    tensors, about = load_weights(path, "hari", HariAbout, HARI_REMEDY)
    config = about.intention
    if config is None:
        raise ValueError(
            f"{path} holds an execution policy alone; teach it to ask: "
            f"`embodied train hari intention --execution {path}`"
        )
    executor = load_executor(path)
    actor, _ = new_heads(config, executor.config.hidden_size)
    load_into(actor, _of("actor", tensors), path)
    actor.eval()
    return HariAgent(executor, actor, config)


def _of(part: str, tensors: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    return {k.removeprefix(f"{part}."): v for k, v in tensors.items() if k.startswith(f"{part}.")}

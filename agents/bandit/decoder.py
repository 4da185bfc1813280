"""The decoder's way along words that are known (Eq A.3 to A.5), with its gradient by hand.

It computes what `network.EncoderDecoder.step` does word by word, and nothing behind a sentence's end:
sampled translations of one batch differ much in length. By hand because automatic differentiation of many
small steps takes most of a small translator's time; gradients that are sums over words (of weights) are
made once, by one product.

B sentences, S source words, h hidden size. The N known words are *packed*: all first words, then all second
ones and so on, in each step the longest sentence first, so that a step's words continue the foremost of
the step before.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable


@dataclass(frozen=True, eq=False)
class WordPacking:
    """How the words of B sentences of up to T words are packed."""

    order: Tensor
    """(B,) the sentences by falling length."""
    counts: tuple[int, ...]
    """How many sentences have a word t; falling."""
    places: Tensor
    """(N,) of the packed words in the flat (B, T)."""

    def steps(self) -> Iterator[tuple[int, int, int]]:
        """(first packed word of step t - 1, first of step t, how many of step t)."""
        before = at = 0
        for count in self.counts:
            yield before, at, count
            before, at = at, at + count


def packing(known: Tensor) -> WordPacking:
    """Of the words that are True in `known` (B, T) bool; every sentence begins with one and has no gap."""
    lengths = known.sum(1)
    order = lengths.argsort(descending=True, stable=True)
    step, rank = known[order].t().nonzero(as_tuple=True)
    return WordPacking(order, tuple(known.sum(0).tolist()), order[rank] * known.shape[1] + step)


@dataclass(frozen=True, eq=False)
class _Walk:
    """What the way there leaves for the way back, of each packed word."""

    entered: Tensor
    """(N, 2h) h^dec and tilde h^dec before it."""
    gates: Tensor
    """(N, 4h) enter, forget, leave, content."""
    cells: Tensor
    """(N, h) after it."""
    squashed: Tensor
    """(N, h) tanh of the cells."""
    combined: Tensor
    """(N, 2h) tilde h^dec after it, and the context."""
    weights: Tensor
    """(N, S) of attention."""
    outputs: Tensor
    """(N, h) h^dec."""


class Outputs(torch.autograd.Function):
    """h^dec of each packed word."""

    @staticmethod
    def forward(ctx: Any, packed: WordPacking, mask: Tensor, *tensors: Tensor) -> Tensor:
        """
        Args:
          mask: (B, S) bool, False on padding of the source.
          tensors: what the words before add to the gates (N, 4h); states and keys (B, S, h); hidden and cell (B, h);
            weights of the gates (4h, 2h) and of `combine` (h, 2h).

        Returns:
          (N, h).
        """
        word_gates, states, keys, hidden, cell, gates, combine = tensors
        order = packed.order
        states, keys, hidden, cell = states[order], keys[order], hidden[order], cell[order]
        padding = torch.zeros(mask.shape, dtype=states.dtype).masked_fill(~mask[order], -torch.inf)
        empty = lambda width: states.new_empty(len(word_gates), width)
        size = states.shape[2]
        widths = (2 * size, 4 * size, size, size, 2 * size, mask.shape[1], size)
        walk = _Walk(*(empty(width) for width in widths))
        begin = torch.cat([torch.zeros_like(hidden), hidden], 1)
        _walk(walk, packed, word_gates, states, keys, padding, (begin, cell), (gates.t(), combine.t()))
        ctx.walk, ctx.packed = walk, packed
        ctx.save_for_backward(states, keys, cell, gates, combine)
        return walk.outputs

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        states, keys, cell, gates, combine = ctx.saved_tensors
        of_words, *of_rows, of_gates, of_combine = _back(
            ctx.walk, ctx.packed, gradients[0], states, keys, cell, gates, combine
        )
        put = lambda x: torch.empty_like(x).index_copy_(0, ctx.packed.order, x)
        return None, None, of_words, *map(put, of_rows), of_gates, of_combine


def _walk(
    walk: _Walk,
    packed: WordPacking,
    word_gates: Tensor,
    states: Tensor,
    keys: Tensor,
    padding: Tensor,
    begin: tuple[Tensor, Tensor],
    weights: tuple[Tensor, Tensor],
) -> None:
    size = states.shape[2]
    for before, at, k in packed.steps():
        now, last = slice(at, at + k), slice(before, before + k)
        entered, cell = walk.entered[now], walk.cells[last]
        if at:
            torch.cat([walk.outputs[last], walk.combined[last, :size]], 1, out=entered)
        else:
            entered[:], cell = begin[0][:k], begin[1][:k]
        into = torch.addmm(word_gates[now], entered, weights[0])  # A.5, with input feeding
        opened = torch.sigmoid(into[:, : 3 * size], out=walk.gates[now, : 3 * size])
        content = torch.tanh(into[:, 3 * size :], out=walk.gates[now, 3 * size :])
        enter, forget, leave = opened.chunk(3, -1)
        cell = torch.mul(forget, cell, out=walk.cells[now]).addcmul_(enter, content)
        hidden = torch.mul(leave, torch.tanh(cell, out=walk.squashed[now]), out=walk.combined[now, :size])
        scores = torch.baddbmm(padding[:k, :, None], keys[:k], hidden[:, :, None])[..., 0]  # h_t^T W_a h_s
        looking = torch.softmax(scores, -1, out=walk.weights[now])
        walk.combined[now, size:] = torch.bmm(looking[:, None], states[:k])[:, 0]  # A.4
        torch.mm(walk.combined[now], weights[1], out=walk.outputs[now]).tanh_()  # A.3


def _back(
    walk: _Walk,
    packed: WordPacking,
    given: Tensor,
    states: Tensor,
    keys: Tensor,
    begin: Tensor,
    gates: Tensor,
    combine: Tensor,
) -> tuple[Tensor, ...]:
    """Gradients of word gates, states, keys, hidden, cell (by falling length), and of both weights."""
    size = states.shape[2]
    slope = _slopes(walk, packed, begin)
    leaving = slope[:, 2 * size : 3 * size]
    through = walk.gates[:, 2 * size : 3 * size] * (1 - walk.squashed.square())
    bent = 1 - walk.outputs.square()
    of_gates, of_combined = torch.empty_like(walk.gates), torch.empty_like(bent)
    of_states, of_keys = torch.zeros_like(states), torch.zeros_like(keys)
    of_cell, of_entered = torch.zeros_like(begin), states.new_zeros(len(begin), 2 * size)
    for _, at, k in reversed(list(packed.steps())):
        now = slice(at, at + k)
        of_sum = torch.add(given[now], of_entered[:k, :size], out=of_combined[now]).mul_(bent[now])
        both = of_sum @ combine
        of_context, looking = both[:, None, size:], walk.weights[now]
        of_score = torch.bmm(states[:k], of_context.transpose(1, 2))[..., 0].mul_(looking)
        of_score = of_score.addcmul_(looking, of_score.sum(-1, keepdim=True), value=-1)[:, None]
        of_states[:k].addcmul_(looking[:, :, None], of_context)
        of_keys[:k].addcmul_(of_score.transpose(1, 2), walk.combined[now, None, :size])
        of_hidden = torch.bmm(of_score, keys[:k])[:, 0].add_(both[:, :size]).add_(of_entered[:k, size:])
        cell = of_cell[:k].addcmul_(of_hidden, through[now])
        into = of_gates[now]
        torch.mul(slope[now].view(k, 4, size), cell[:, None], out=into.view(k, 4, size))
        torch.mul(leaving[now], of_hidden, out=into[:, 2 * size : 3 * size])
        cell.mul_(walk.gates[now, size : 2 * size])
        torch.mm(into, gates, out=of_entered[:k])
    of_weights = of_gates.t() @ walk.entered, of_combined.t() @ walk.combined
    return of_gates, of_states, of_keys, of_entered[:, size:].contiguous(), of_cell, *of_weights


def _slopes(walk: _Walk, packed: WordPacking, begin: Tensor) -> Tensor:
    """(N, 4h): what a change of each gate's input changes, of the cell but for `leave`, which changes tilde h^dec."""
    size = begin.shape[1]
    enter, forget, leave, content = walk.gates.chunk(4, -1)
    before = torch.cat([begin[: packed.counts[0]], *(walk.cells[b : b + k] for b, at, k in packed.steps() if at)])
    slope = walk.gates * (1 - walk.gates)
    slope[:, :size] *= content
    slope[:, size : 2 * size] *= before
    slope[:, 2 * size : 3 * size] *= walk.squashed
    slope[:, 3 * size :] = enter * (1 - content.square())
    return slope

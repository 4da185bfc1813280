"""Who describes walks: a describer with an executor (3.2.4.1), or the people who word routes here.

The describer of NAV (Figure C.4) reads a walk and writes; who follows is agents.vln.policy's follower. B walks, T
steps, E size of a view's features and direction, h hidden size.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from embodied.agents.common.tensors import Choice, Remembered, greedy_choice, sampled_choice
from embodied.agents.common.vocabulary import END_NUMBER
from embodied.agents.hanna.attention import DotAttend, FeedForward, MultiAttend
from embodied.agents.iliad.nav.student import NavEyes, NavStudent, Track
from embodied.agents.iliad.nav.world import RADIUS, NavWalk, NavWorld, Trip
from embodied.agents.iliad.protocol import NOTHING, DescribingNetworks, one_request
from embodied.agents.iliad.writing import AttentiveWriter, Bridge, before, write
from embodied.interface import SeenPlace
from embodied.kinds.metrics import sdtw


class WalkDescriber(nn.Module):
    """p(words | walk): one Transformer layer over the steps, read with attention (docs/sources.md, S104)."""

    def __init__(self, words: int, size: int, heads: int, seen: int, horizon: int) -> None:
        super().__init__()
        self.look = DotAttend(seen, seen, size)
        self.enter, self.time = nn.Linear(2 * seen, size), nn.Embedding(horizon, size)
        self.relate, self.feed = MultiAttend(size, heads, 0.0), FeedForward(size, 0.0)
        self.first = Bridge(size)
        self.writer = AttentiveWriter(words, size, size, memories=1)

    def read(self, views: Tensor, actions: Tensor, mask: Tensor) -> tuple[tuple[Tensor, Tensor], list[Remembered]]:
        """(B, T, 36, E) panoramas, (B, T, E) actions taken there, (B, T) which there are: what is written from."""
        b, t = mask.shape
        looked = self.look(actions.flatten(0, 1), views.flatten(0, 1)).view(b, t, -1)
        x = torch.relu(self.enter(torch.cat([actions, looked], -1))) + self.time.weight[:t]
        x = self.feed(self.relate(x, self.relate.key(x), self.relate.value(x), mask))
        mean = (x * mask[..., None]).sum(1) / mask.sum(1, keepdim=True)
        return self.first(mean), [self.writer.remember(0, x, mask)]

    def forward(self, views: Tensor, actions: Tensor, mask: Tensor, written: Tensor) -> Tensor:
        """Logits (B, W, V) before each of the given words (B, W)."""
        return self.writer(before(written, END_NUMBER), *self.read(views, actions, mask))[0]

    @torch.no_grad()
    def write(
        self, views: Tensor, actions: Tensor, mask: Tensor, choose: Choice, longest: int, copies: int = 1
    ) -> Tensor:
        """(copies B, at most `longest`) words; the copies of one description stand one behind the other."""
        return write(self.writer, *self.read(views, actions, mask), choose, longest, END_NUMBER, copies)


THRESHOLD = 0.5
"""Tau of Eq 3.15 and 3.16, of SDTW (C.1.1)."""
LONGEST_DESCRIPTION = 50
"""Words of a description."""


def performance(world: NavWorld, trip: Trip, path: Sequence[int], wanted: Sequence[int]) -> float:
    """perf: SDTW of two walks in the house of a trip."""
    return sdtw(tuple(path), tuple(wanted), world.graph(trip), RADIUS)


def arrives(world: NavWorld, trip: Trip, path: Sequence[int], wanted: Sequence[int]) -> bool:
    """True where a walk ends within RADIUS of where another one does (docs/sources.md, S141)."""
    return bool(world.graph(trip).distance[path[-1], wanted[-1]] <= RADIUS + 1e-9)


def encoded_walks(eyes: NavEyes, trips: Sequence[Trip], walks: Sequence[NavWalk]) -> tuple[Tensor, Tensor, Tensor]:
    """Inputs of a describer: (B, T, 36, E) panoramas, (B, T, E) actions taken there, (B, T) which there are."""
    tracks, views, actions = [Track(eyes, t) for t in trips], [], []
    longest = max(len(w.steps) for w in walks)
    mask = torch.tensor([[t < len(w.steps) for t in range(longest)] for w in walks])
    for t in range(longest):
        seen = eyes.see(tracks)
        numbers = [k.number(w.steps[t]) if t < len(w.steps) else 0 for k, w in zip(tracks, walks)]
        views.append(seen.views)
        actions.append(F.pad(seen.actions, (0, 0, 1, 0))[torch.arange(len(walks)), torch.tensor(numbers)])  # 0 to stop
        for track, number in zip(tracks, numbers):
            track.go(number)
    return torch.stack(views, 1), torch.stack(actions, 1), mask


class LearnedNavTeacher(DescribingNetworks):
    """Eq 3.15 and 3.16 with two networks."""

    longest = LONGEST_DESCRIPTION

    def __init__(self, world: NavWorld, describer: WalkDescriber, executor: NavStudent, candidates: int) -> None:
        super().__init__(candidates)
        self.world, self.describer, self.executor, self.eyes = world, describer.eval(), executor, executor.eyes

    def spoken_of(self, task: Trip, execution: NavWalk) -> bool:
        return True

    def near_optimal(self, task: Trip, execution: NavWalk) -> bool:
        return performance(self.world, task, execution.nodes, task.path) >= THRESHOLD

    def candidates_of(
        self, tasks: Sequence[Trip], executions: Sequence[NavWalk], uniforms: np.ndarray | None = None
    ) -> list[list[str]]:
        copies = 1 if uniforms is None else uniforms.shape[1]
        choose = greedy_choice if uniforms is None else sampled_choice(uniforms.reshape(-1, LONGEST_DESCRIPTION))
        numbers = self.describer.write(
            *encoded_walks(self.eyes, tasks, executions), choose, LONGEST_DESCRIPTION, copies
        )
        drawn = self.eyes.vocabulary.texts(numbers.tolist())
        return [list(dict.fromkeys(drawn[k * copies : (k + 1) * copies])) for k in range(len(tasks))]

    def fits(self, cases: Sequence[tuple[Trip, NavWalk, str]]) -> list[bool]:
        done = self.executor.greedy([trip for trip, _, _ in cases], [d or NOTHING for _, _, d in cases])
        return [arrives(self.world, trip, e.nodes, walk.nodes) for (trip, walk, _), e in zip(cases, done)]


class GrammarNavTeacher:
    """A second teacher: the grammar that words routes here describes every walk, truly."""

    def __init__(self, world: NavWorld, places: Mapping[str, SeenPlace], wording: Callable[..., str]) -> None:
        self.world, self.places, self.wording = world, places, wording

    def describe(
        self, tasks: Sequence[Trip], executions: Sequence[NavWalk], *, rng: np.random.Generator
    ) -> list[str | None]:
        return [self._one(trip, walk, rng=rng) for trip, walk in zip(tasks, executions, strict=True)]

    def _one(self, trip: Trip, walk: NavWalk, *, rng: np.random.Generator) -> str | None:
        if performance(self.world, trip, walk.nodes, trip.path) >= THRESHOLD:
            return one_request(trip, rng=rng)
        if len(walk.nodes) < 2:
            return None
        return self.wording(self.places[trip.world], walk.nodes, trip.start.yaw, rng=rng)

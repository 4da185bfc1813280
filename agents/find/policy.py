"""FindPolicy: explores a house; weighs all untried ways on its map and all places to stop at, and goes there.

As planners over topological maps do (DUET, Chen et al. 2022), it decides among everything it has seen, not only among
what is beside it; a decision is carried out before the next one is taken. The map (WayMap) holds the places it has
seen in one episode and the ways between them, known again by what they look like.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from embodied.agents.common.tensors import Chooser, choose_greedily, padded, side_by_side
from embodied.agents.common.vocabulary import Vocabulary
from embodied.agents.find.network import SeekNetwork
from embodied.agents.hanna.topological_map import SAME_PLACE, matches
from embodied.agents.vision.features import FeatureBank
from embodied.geometry import wrap
from embodied.interface import Action, Actions, Move, Observation, Observations, Open, Rngs, Situation, Situations, Stop
from embodied.policies.baselines import fewest_moves

ALIKE = 0.05
"""Radians by which two directions of one way may differ."""


def directions(o: Observation) -> np.ndarray:
    """(n,) in which absolute direction each candidate lies, radians."""
    return o.candidates.bearing + o.turn * math.pi / 6


@dataclass
class Spot:
    """One place on the map."""

    ways: np.ndarray
    """(n,) absolute directions of the ways that begin here, radians."""
    leads: list[int | None]
    """The spot at which each way ends; None for a way that was not tried."""

    def goes(self, ways: np.ndarray) -> bool:
        """True if its ways go in these directions."""
        if len(ways) != len(self.ways):
            return False
        return bool((np.abs(wrap(self.ways[:, None] - ways)).min(0) <= ALIKE).all())

    def way(self, direction: float) -> int | None:
        """The way in a direction; None without one."""
        off = np.abs(wrap(self.ways - direction))
        best = int(off.argmin())
        return best if off[best] <= ALIKE else None


@dataclass
class WayMap:
    """Owns what one episode knows of its house; spots are numbered as they were met."""

    spots: list[Spot] = field(default_factory=list)
    here: int = 0
    _looks: np.ndarray | None = None
    _begun: tuple[int, int] | None = None

    def arrive(self, o: Observation, panorama: np.ndarray) -> bool:
        """Note where a step begins; whether the spot is new.

        Args:
          panorama: (36, D) features, by which a spot is known again; zeros are never known.
        """
        ways = directions(o)
        if self.spots and self._begun is None:  # it has opened a door
            return False
        known = self._known(panorama, ways)
        new = known is None
        if known is None:
            known = len(self.spots)
            self.spots.append(Spot(ways, [None] * len(ways)))
            self._looks = panorama[None] if self._looks is None else np.concatenate([self._looks, panorama[None]])
        if self._begun is not None:
            origin, way = self._begun
            self.spots[origin].leads[way] = known
            back = self.spots[known].way(float(self.spots[origin].ways[way]) + math.pi)
            if back is not None:
                self.spots[known].leads[back] = origin
        self.here, self._begun = known, None
        return new

    def leave(self, way: int) -> None:
        """Note that the step ends along a way of this spot."""
        self._begun = self.here, way

    def reach(self) -> dict[int, tuple[int, int | None]]:
        """How many known moves lead from here to each spot, and along which way they begin."""
        known = lambda spot: ((way, end) for way, end in enumerate(self.spots[spot].leads) if end is not None)
        return fewest_moves(self.here, known)

    def _known(self, panorama: np.ndarray, ways: np.ndarray) -> int | None:
        """The spot that looks the same, of those whose ways go in the same directions."""
        alike = [k for k, spot in enumerate(self.spots) if spot.goes(ways)]
        if not alike or self._looks is None:
            return None
        mean = (self._looks.sum((0, 1)) + panorama.sum(0)) / ((len(self._looks) + 1) * len(panorama))
        scores = matches(panorama, self._looks[alike], mean, turned=False)
        best = int(scores.argmax())
        return alike[best] if scores[best] >= SAME_PLACE else None


STOP = -1
"""Stands for a way where an option is to stop."""
WORDS = 12
"""Of a request that are read."""
LONG = 40.0
"""Steps that count as a long time."""
CERTAIN = 0.5
"""Metres by which an option must be nearer to be much the better lesson."""


@dataclass(frozen=True, eq=False)
class Decision:
    """A decision with its options, and the teacher's label."""

    options: np.ndarray
    """(m, 2) int64 spots and ways."""
    facts: np.ndarray
    """(m, FACTS) float32."""
    wanted: np.ndarray
    """(m,) float32, how likely each option should be."""


@dataclass
class Search:
    """Owns what one episode has seen and decided."""

    request: np.ndarray
    map: WayMap = field(default_factory=WayMap)
    seen: list[Tensor] = field(default_factory=list)
    """(36, D) features of each spot, as the network sees them."""
    views: list[np.ndarray] = field(default_factory=list)
    """(n,) view of each way of each spot."""
    ways: list[np.ndarray] = field(default_factory=list)
    """(n,) logits of the ways of each spot."""
    stops: list[float] = field(default_factory=list)
    """Logit of stopping at each spot."""
    plan: tuple[int, int] | None = None
    """The option that is being carried out."""
    nodes: list[int] = field(default_factory=list)
    """Node of each spot: known to teachers only."""
    ends: list[tuple[int, ...]] = field(default_factory=list)
    """Node at the end of each way of each spot, as `nodes`."""
    right: list[tuple[bool, np.ndarray]] = field(default_factory=list)
    """Labels: whether stopping at each spot is right, and (n,) how likely each of its ways should be, as `nodes`."""
    decisions: list[Decision] = field(default_factory=list)
    """All so far, where a teacher watches."""

    def options(self) -> np.ndarray:
        """(m, 2) int64: stopping at each spot, and each way that was not tried."""
        stop = [(k, STOP) for k in range(len(self.map.spots))]
        ways = [(k, w) for k, s in enumerate(self.map.spots) for w, end in enumerate(s.leads) if end is None]
        return np.array(stop + ways, dtype=np.int64)


def facts(options: np.ndarray, steps: np.ndarray, time: int) -> np.ndarray:
    """(m, FACTS) float32: is it to stop; how far is its spot, and that for stopping; and how late it is, and how much
    was seen, for stopping."""
    stop = options[:, 1] == STOP
    seen = np.log1p(np.count_nonzero(stop))
    return np.stack([stop, steps / 10, stop * steps / 10, stop * time / LONG, stop * seen], 1).astype(np.float32)


@dataclass(frozen=True, eq=False)
class FindPolicy:
    """A trained (or training) agent that finds things."""

    scorer: SeekNetwork
    vocabulary: Vocabulary
    bank: FeatureBank
    """Features for the network."""
    looks: FeatureBank
    """Features by which places are recognised."""
    choose: Chooser = choose_greedily

    def act(self, observations: Observations, memory: Any, *, rngs: Rngs) -> tuple[Actions, dict[int, Search]]:
        """One step of every running episode; see embodied.interface.Policy."""
        return self.play(observations, [None] * len(observations), memory, rngs=rngs)

    def play(
        self, observations: Observations, situations: Situations, memory: dict[int, Search] | None, *, rngs: Rngs
    ) -> tuple[Actions, dict[int, Search]]:
        """One step of every running episode; a teacher labels decisions where it has `situations`."""
        running = [(i, o) for i, o in enumerate(observations) if o is not None]
        memory = memory or {i: Search(self.vocabulary.encode(o.instruction, WORDS)) for i, o in running}
        looks = self.looks.gather([o.sight for _, o in running]).float().numpy()
        fresh = [(i, o) for (i, o), look in zip(running, looks, strict=True) if memory[i].map.arrive(o, look)]
        self._score([(memory[i], o) for i, o in fresh])
        for i, _ in fresh:
            if (s := situations[i]) is not None:
                memory[i].nodes.append(s.pose.node)
                memory[i].ends.append(s.candidate_nodes)
                costs = left_after(s.pose.node, s.candidate_nodes, s)
                memory[i].right.append((s.pose.node in s.targets, wanted(costs)))
        actions: Actions = [None] * len(observations)
        for i, o in running:
            actions[i] = self._next(memory[i], o, situations[i], rngs[i])
        return actions, memory

    def _score(self, fresh: Sequence[tuple[Search, Observation]]) -> None:
        if not fresh:
            return
        seen = self.bank.gather([o.sight for _, o in fresh]).float()
        views = padded([o.candidates.view for _, o in fresh])
        with torch.no_grad():
            ways, stops = self.scorer(seen, torch.from_numpy(np.stack([s.request for s, _ in fresh])), views)
        for (search, o), row, way, stop in zip(fresh, seen, ways.numpy(), stops.tolist(), strict=True):
            search.seen.append(row)
            search.views.append(o.candidates.view)
            search.ways.append(way[: len(o.candidates)])
            search.stops.append(stop)

    def _next(self, search: Search, o: Observation, situation: Situation | None, rng: np.random.Generator) -> Action:
        """Go on with the plan, or make one."""
        reach = search.map.reach()
        if search.plan is None or search.plan[0] not in reach:
            search.plan = self._decide(search, o, situation, reach, rng)
        spot, way = search.plan
        towards = reach[spot][1]
        if towards is not None:  # another spot, which is reached along a way
            way = towards
        elif way == STOP:
            return Stop()
        turned = directions(o) - search.map.spots[search.map.here].ways[way]
        if (chosen := int(np.cos(turned).argmax())) in o.can_open:
            return Open(chosen)
        if towards is None:
            search.plan = None
        search.map.leave(way)
        return Move(chosen)

    def _decide(
        self,
        search: Search,
        o: Observation,
        situation: Situation | None,
        reach: dict[int, tuple[int, int | None]],
        rng: np.random.Generator,
    ) -> tuple[int, int]:
        options = search.options()
        options = options[[int(k) in reach for k in options[:, 0]]]
        steps = np.array([reach[int(k)][0] for k in options[:, 0]], dtype=np.float32)
        known = facts(options, steps, o.time)
        looks = np.array([search.stops[k] if w == STOP else search.ways[k][w] for k, w in options.tolist()])
        logits = looks + known @ self.scorer.price.weight.detach().numpy()[0]
        if situation is not None:
            costs = costs_of(search, options, situation)
            search.decisions.append(Decision(options, known, wanted(costs)))
            if np.isfinite(costs).any():  # who learns walks on where stopping is wrong
                logits = np.where(np.isfinite(costs), logits, -np.inf)
        weights = np.exp(logits - logits.max())
        spot, way = options[self.choose(weights / weights.sum(), rng)].tolist()
        return spot, way


def left_after(node: int, ends: Sequence[int], situation: Situation) -> np.ndarray:
    """(n,) metres to go from a node over each of its neighbours to the nearest goal."""
    distance = np.asarray(situation.world.graph.distance)
    return distance[node, list(ends)] + distance[list(ends)][:, list(situation.targets)].min(1)


def costs_of(search: Search, options: np.ndarray, situation: Situation) -> np.ndarray:
    """(m,) metres still to go after each option, the way there included; infinite for stopping at a wrong place."""
    back = np.asarray(situation.world.graph.distance)[situation.pose.node]
    onward = [left_after(node, ends, situation) for node, ends in zip(search.nodes, search.ends, strict=True)]
    there = lambda k, w: onward[k][w] if w != STOP else 0.0 if search.nodes[k] in situation.targets else np.inf
    return np.array([back[search.nodes[k]] + there(k, w) for k, w in options.tolist()])


def wanted(costs: np.ndarray) -> np.ndarray:
    """(m,) float32: how likely options of these costs should be."""
    weights = np.exp((costs.min() - costs) / CERTAIN)
    return (weights / weights.sum()).astype(np.float32)


def imitation_loss(scorer: SeekNetwork, searches: Sequence[Search]) -> tuple[Tensor, Tensor]:
    """The loss, and the share of decisions that the teacher would take too.

    The loss is the cross-entropy of all decisions with what the teacher wants, and, since decisions alone teach slowly,
    that of the ways of each spot among themselves and of stopping at it, each averaged.
    """
    spots = [(s, k) for s in searches for k in range(len(s.seen))]
    seen = torch.stack([s.seen[k] for s, k in spots])
    request = torch.from_numpy(np.stack([s.request for s, _ in spots]))
    ways, stops = scorer(seen, request, padded([s.views[k] for s, k in spots]))
    here = torch.tensor([s.right[k][0] for s, k in spots])
    loss = F.binary_cross_entropy_with_logits(stops, here.float())
    loss = loss + entropy(ways, [s.right[k][1] for s, k in spots])[0]

    flat = torch.cat([ways, stops[:, None]], 1)  # the last is STOP
    first = np.cumsum([0, *(len(s.seen) for s in searches)])
    cases = [(begin, d) for begin, s in zip(first, searches) for d in s.decisions]
    rows = padded([d.options[:, 0] + begin for begin, d in cases])
    columns = padded([d.options[:, 1] % flat.shape[1] for _, d in cases])
    facts_of, _ = side_by_side([torch.from_numpy(d.facts) for _, d in cases])
    decided, right = entropy(flat[rows, columns] + scorer.price(facts_of)[..., 0], [d.wanted for _, d in cases])
    return loss + decided, right


def entropy(logits: Tensor, goals: Sequence[np.ndarray]) -> tuple[Tensor, Tensor]:
    """Mean cross-entropy of (N, M) logits with distributions over the first of them, and how often the likeliest is
    the same."""
    goal, there = side_by_side([torch.from_numpy(g) for g in goals])
    logs = logits[:, : goal.shape[1]].masked_fill(~there, -1e4).log_softmax(-1)
    return -(goal * logs).sum(-1).mean(), (logs.argmax(-1) == goal.argmax(-1)).float().mean()

"""Trail: the map that an agent draws of where it has been, from what it saw and which way it walked; and MapPolicy, a
HANNA agent that goes by it, besides by its networks.

The likeliest move of an agent that misread its words leads to and fro between the same few places. With a trail it
knows which of its moves lead towards where it has been, under the words that it still follows, and how often it was
there; never more than it has walked itself. A place is known again by its panorama; the way back lies opposite the way
there. Who is shown the panorama of where to go knows in the same manner when it is there, and, if it has been there
before, which way leads there.

Places are known again by what they look like: nothing here knows which place is which, two panoramas are of one place
if their features match. Features less the mean of what was seen of the house are compared by the cosine of their 36
views, at the best of 12 rotations, since a picture does not tell which way is north.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from embodied.agents.hanna.attention import action_index
from embodied.agents.hanna.policy import HannaMemory, HannaPolicy, Steering
from embodied.interface import TURNS, VIEWS, Action, Actions, Mode, Move, Observation, Observations, Rngs, Situations
from embodied.policies.baselines import fewest_moves
from embodied.teachers.shortest import shortest_of

UNLIKELY = 1e-6
"""Added to what is thought of an untried way, so that one that seems impossible is tried in the end."""
SAME_PLACE, SAME_PICTURE = 0.55, 0.42
"""Least matches, cosines, at which two panoramas are of one place: of the agent's own, whose headings it knows, and of
another day and hour, through a noisy camera. They suit the shipped encoder: the second has nearly the best F1 in
validation houses, the first is above its best, 0.44, so that places are not merged; `encoder_compact` wants 0.68 and
0.58."""


@dataclass(frozen=True, eq=False)
class PlaceMap:
    """The places that one episode has seen so far, numbered as they were met, and the pictures it was shown."""

    panoramas: np.ndarray = field(default_factory=lambda: np.zeros((0, VIEWS, 1), np.float32))
    """(k, 36, D) features of each place, as first seen."""
    pictures: np.ndarray = field(default_factory=lambda: np.zeros((0, VIEWS, 1), np.float32))
    """(p, 36, D) features of each picture, rows that it does not show are zero."""

    @property
    def mean(self) -> np.ndarray:
        """(D,) of all that was seen of the house: what its places have in common does not tell them apart."""
        return self.panoramas.mean((0, 1))

    def seen(self, panorama: np.ndarray) -> tuple[PlaceMap, int]:
        """The map with the place of a panorama (36, D), and its number."""
        wider = dataclasses.replace(self, panoramas=_append(self.panoramas, panorama))
        known = wider._known(self.panoramas, panorama, turned=False)
        return (wider, len(self.panoramas)) if known is None else (self, known)

    def shown(self, picture: np.ndarray) -> tuple[PlaceMap, int]:
        """The map with a picture (36, D), and its number; one that shows the same as another is that one."""
        known = self._known(self.pictures, picture, turned=True)
        if known is not None:
            return self, known
        return dataclasses.replace(self, pictures=_append(self.pictures, picture)), len(self.pictures)

    def find(self, picture: int) -> tuple[int | None, np.ndarray]:
        """The place where a picture was taken, None where it is not on the map, and the match (k,) of every place."""
        scores = matches(self.pictures[picture], self.panoramas, self.mean)
        best = int(scores.argmax())
        return (best if scores[best] >= SAME_PICTURE else None), scores

    def _known(self, among: np.ndarray, one: np.ndarray, *, turned: bool) -> int | None:
        if not len(among):
            return None
        scores = matches(one, among, self.mean, turned=turned)
        best = int(scores.argmax())
        return best if scores[best] >= SAME_PLACE else None


def matches(picture: np.ndarray, panoramas: np.ndarray, mean: np.ndarray, *, turned: bool = True) -> np.ndarray:
    """(k,) how well a picture matches each of several panoramas: the mean cosine of the views that it shows.

    Args:
      picture: (36, D); views that it does not show are zero.
      panoramas: (k, 36, D).
      mean: (D,) taken from all that is not zero.
      turned: at the best of 12 rotations; else as it is, between panoramas whose headings are known.
    """
    shown = np.flatnonzero(picture.any(-1))
    if not len(shown):
        return np.zeros(len(panoramas), np.float32)
    cosines = _unit(picture[shown], mean) @ _unit(panoramas, mean).transpose(0, 2, 1)  # (k, shown, 36)
    turns = np.arange(TURNS if turned else 1)[:, None]
    columns = shown // TURNS * TURNS + (shown + turns) % TURNS  # (12, shown)
    return cosines[:, np.arange(len(shown)), columns].mean(-1).max(-1)


def _unit(features: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Features less the mean, of length one; zeros stay zero."""
    centred = (features - mean) * features.any(-1, keepdims=True)
    return centred / np.maximum(np.linalg.norm(centred, axis=-1, keepdims=True), 1e-6)


def _append(features: np.ndarray, one: np.ndarray) -> np.ndarray:
    return np.concatenate([features, one[None]]) if len(features) else one[None]


@dataclass(frozen=True)
class Trail:
    """Knowledge of one episode of its way so far; directions are views, 0..35, which keep neighbours apart by 30
    degrees only: whatever lies in the same view as a place that was visited counts as leading there (docs/sources.md,
    S36)."""

    map: PlaceMap = field(default_factory=PlaceMap)
    """Features of the places; their numbers are meant below."""
    place: int = 0
    """The place where the agent takes itself to be."""
    picture: int | None = None
    """Which of the pictures that it was shown it is looking for."""
    goal: int | None = None
    """The place where that picture was taken; None without one, or where it is not on the map."""
    match: float | None = None
    """How well the picture matches what is seen here."""
    leads: Mapping[tuple[int, int], int] = field(default_factory=dict)
    """The place to which the last move in a view from a place led, in either direction."""
    visits: Mapping[tuple[int, str], int] = field(default_factory=dict)
    """How many steps began at a place under these words."""
    thoughts: Mapping[tuple[str, int | None, int], Mapping[int, float]] = field(default_factory=dict)
    """How likely the ways in each view seemed to lead on, under words and picture, from a place."""
    begun: tuple[int, int] | None = None
    """The last move, which led to where the next step begins."""

    def here(self, observation: Observation, panorama: np.ndarray, picture: np.ndarray | None = None) -> Trail:
        """The trail when a step begins: where the agent is, where the last move led, and one visit more.

        Args:
          panorama, picture: (36, D) features of what is around it and of what it is shown.
        """
        places, place = self.map.seen(panorama)
        shown = goal = match = None
        if picture is not None:
            places, shown = places.shown(picture)
            goal, scores = places.find(shown)
            match = float(scores[place])
        leads = dict(self.leads)
        if self.begun is not None:
            origin, view = self.begun
            leads[self.begun] = place
            leads[place, opposite(view)] = origin
        key = place, observation.instruction
        visits = {**self.visits, key: self.visits.get(key, 0) + 1}
        return dataclasses.replace(
            self, map=places, place=place, picture=shown, goal=goal, match=match, leads=leads, visits=visits, begun=None
        )

    def left(self, observation: Observation, action: Action | None) -> Trail:
        """The trail when a step ends with `action`."""
        if not isinstance(action, Move):
            return self
        return dataclasses.replace(self, begun=(self.place, int(observation.candidates.view[action.candidate])))

    def times(self, observation: Observation) -> np.ndarray:
        """(n,) how often the agent was, under these words, where each candidate's view is known to lead."""
        o = observation
        ends = [self.leads.get((self.place, view)) for view in o.candidates.view.tolist()]
        return np.array([0 if end is None else self.visits.get((end, o.instruction), 0) for end in ends])

    def thinking(self, observation: Observation, moves: np.ndarray) -> Trail:
        """The trail with what is thought here of the ways that lead on, under these words and this picture.

        Args:
          moves: (n,) probabilities of the candidates; those in one view add up.
        """
        o = observation
        ways = {int(view): float(moves[o.candidates.view == view].sum()) for view in np.unique(o.candidates.view)}
        key = o.instruction, self.picture, self.place
        return dataclasses.replace(self, thoughts={**self.thoughts, key: ways})

    def ways(self) -> dict[int, tuple[int, int | None]]:
        """How many known moves lead from here to every place on the trail, and the view in which they begin."""
        roads: dict[int, list[tuple[int, int]]] = {}
        for (origin, view), end in self.leads.items():
            roads.setdefault(origin, []).append((view, end))
        return fewest_moves(self.place, lambda place: roads.get(place, ()))

    def untried(self, observation: Observation, back: float) -> int | None:
        """The view in which the way begins to the best of all ways that were not tried yet, by what was thought of them
        under these words and this picture, times `back` for each move that lies between; None without one."""
        ways, quest = self.ways(), (observation.instruction, self.picture)
        best, chosen = 0.0, None
        for (words, image, place), thought in self.thoughts.items():
            if (words, image) != quest or place not in ways:
                continue
            steps, first = ways[place]
            for view, probability in thought.items():
                worth = (probability + UNLIKELY) * back**steps
                if worth > best and (place, view) not in self.leads:
                    best, chosen = worth, view if first is None else first
        return chosen


def weigh_by_image(
    trail: Trail, observation: Observation, weights: np.ndarray, search: float = 0.0
) -> tuple[np.ndarray, bool]:
    """`weights` of an agent that goes by the image of where to go, if it is shown one: it stops where it recognises
    what the image shows and nowhere else, and walks straight to it where it has been there.

    Args:
      weights: (n + 1,) of the actions, stop first.
      search: on its main task, an agent that has not been there takes the best way that it has not tried yet, be it
        from where it was before: as Trail.untried has it, with `back`; 0: it does not search.

    Returns:
      The same anew, and whether the agent knows where it has to go, so that it need not ask.
    """
    o, n = observation, len(observation.candidates)
    if trail.picture is None:
        return weights, False
    if trail.goal == trail.place:
        return np.append(1.0, np.zeros(n)), True
    moves = np.where(np.arange(n + 1) > 0, weights, 0.0)
    towards = lambda view: moves * np.append(False, o.candidates.view == view)
    _, way = (0, None) if trail.goal is None else trail.ways().get(trail.goal, (0, None))
    if towards(way).any():
        return towards(way), True
    if search and o.mode is Mode.MAIN:
        on = towards(trail.untried(o, search))
        if on.any():
            return on, False
    return (moves if moves.any() else weights), False


def opposite(view: int) -> int:
    """The view behind: half a turn on, and as far below the horizon as the other is above."""
    turn, tilt = view % TURNS, view // TURNS
    return (turn + TURNS // 2) % TURNS + (VIEWS // TURNS - 1 - tilt) * TURNS


@dataclass(frozen=True, eq=False)
class MapMemory:
    """State that the policy carries between steps."""

    networks: HannaMemory | None = None
    trails: Mapping[int, Trail] = field(default_factory=dict)
    """The way of each episode so far, by its place in the batch."""


@dataclass(frozen=True, eq=False)
class MapPolicy:
    """A HANNA policy with a topological map, which is not learned."""

    policy: HannaPolicy
    revisit_weight: float = 1.0
    """A move's weight for each time the agent was, under the same words, where it knows the move to lead."""
    use_goal_image: bool = False
    """Go by the image of where to go, if one is shown (hanna.topological_map.weigh_by_image)."""
    frontier_discount: float = 0.0
    """How it looks for what the image shows; see hanna.topological_map.weigh_by_image."""

    def changed(self, **settings: Any) -> MapPolicy:
        """The same with other settings, of its own or of the policy in it."""
        own = {f.name for f in dataclasses.fields(self)} & settings.keys()
        policy = dataclasses.replace(self.policy, **{k: v for k, v in settings.items() if k not in own})
        return dataclasses.replace(self, policy=policy, **{k: settings[k] for k in own})

    def act(
        self,
        observations: Observations,
        memory: MapMemory | None,
        *,
        rngs: Rngs,
        imposed: Sequence[int | None] | None = None,
    ) -> tuple[Actions, MapMemory]:
        """One step of every running episode; see embodied.interface.Policy and HannaPolicy.act."""
        memory = memory or MapMemory()
        trails = self._arrived(memory.trails, observations)

        def steer(position: int, o: Observation, moves: np.ndarray) -> Steering:
            trail = trails[position]
            weights = moves * np.append(1.0, self.revisit_weight ** trail.times(o))
            if not self.use_goal_image:
                return Steering(weights, match=trail.match)
            trails[position] = trail.thinking(o, moves[1:])
            return Steering(*weigh_by_image(trails[position], o, weights, self.frontier_discount), trail.match)

        actions, networks = self.policy.act(
            observations, memory.networks, rngs=rngs, steer=steer if trails else None, imposed=imposed
        )
        left = {i: trail.left(o, actions[i]) for i, trail in trails.items() if (o := observations[i]) is not None}
        return actions, MapMemory(networks, left)

    def _arrived(self, trails: Mapping[int, Trail], observations: Observations) -> dict[int, Trail]:
        """The trails when a step begins, by what the agents see; none where no rule goes by them."""
        running = [(i, o) for i, o in enumerate(observations) if o is not None]
        if not running or (self.revisit_weight == 1 and not self.use_goal_image):
            return {}
        bank = self.policy.bank
        current = bank.gather([o.sight for _, o in running]).cpu().numpy()
        target = bank.gather([o.target for _, o in running]).cpu().numpy()
        return {
            i: trails.get(i, Trail(PlaceMap())).here(o, panorama, None if o.target is None else picture)
            for (i, o), panorama, picture in zip(running, current, target, strict=True)
        }


@dataclass(frozen=True, eq=False)
class PerfectInterpretation:
    """The skyline of Table 4.3: the teacher walks whenever an instruction is followed.

    Asking, and walking on the main task, are still the agent's own.
    """

    policy: MapPolicy

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: MapMemory | None, *, rngs: Rngs
    ) -> tuple[Actions, MapMemory]:
        imposed = [None if s is None or s.mode is Mode.MAIN else action_index(shortest_of(s)) for s in situations]
        return self.policy.act(observations, memory, rngs=rngs, imposed=imposed)

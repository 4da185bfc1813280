"""How well pictures are recognised that were taken at another time: precision, recall and AUC in houses never seen.

An agent has walked through a house; a helper shows a picture of one of its places. Which of the places that it saw is
it, if any? It is told by the thresholds of the shipped encoder (agents.hanna.recognition), chosen by `threshold`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.stats

from embodied.agents.hanna.recognition import Likeness, matches
from embodied.agents.vision.capture import captured_path
from embodied.agents.vision.config import CAPTURE_CONDITIONS
from embodied.agents.vision.drawn import pictures_of
from embodied.agents.vision.features import feature_path, load_features
from embodied.datasets.store import Dataset
from embodied.evaluation.tables import Samples
from embodied.navigation.graph import NavGraph
from embodied.seeds import stream

AGAIN = "again"
"""Pictures that are the agent's own panoramas through a robot's camera, whose headings it knows."""
WALKS, MOVES = 12, 15
"""Walks through each house, and moves of each: what the agent has seen when it is shown a picture."""
RINGS = ((0.0, 2.0), (2.0, 4.0), (4.0, np.inf))
"""From how far to how far the places are, in metres along the graph, that the right one is told from."""
RECOGNITION_MEASURES = (
    "right place first",
    "precision",
    "recall",
    "AUC",
    *(f"AUC {low:g} to {high:g} m" for low, high in RINGS),
    "best threshold",
)


@dataclass(frozen=True, eq=False)
class Query:
    """One picture shown after one walk."""

    house: str
    scores: np.ndarray
    """(k,) of the places on the map."""
    distance: np.ndarray
    """(k,) metres along the graph from where the picture was taken; 0 is the place itself."""

    @property
    def known(self) -> bool:
        """True if the place is on the map."""
        return bool((self.distance == 0).any())

    @property
    def best(self) -> float:
        return float(self.scores.max())

    @property
    def right(self) -> bool:
        return bool(self.distance[self.scores.argmax()] == 0)


def walk(graph: NavGraph, start: int, *, rng: np.random.Generator) -> list[int]:
    """The places of a random walk that goes back only where it must."""
    nodes = [start]
    for _ in range(MOVES):
        ways = sorted(int(u) for u in graph.neighbours(nodes[-1]))
        onward = [v for v in ways if v not in nodes[-2:]] or ways
        nodes.append(onward[int(rng.integers(len(onward)))])
    return nodes


def queries(name: str, graph: NavGraph, own: np.ndarray, shown: np.ndarray, *, turned: bool = True) -> Iterator[Query]:
    """Pictures of all places of a house, shown after walks that differ.

    Args:
      own, shown: (n, 36, D) features of what the agent sees and of the pictures.
      turned: pictures do not tell their heading.
    """
    distance = np.asarray(graph.distance)
    for k in range(WALKS):
        rng = stream(0, "walk", name, k)
        seen = sorted(set(walk(graph, int(rng.integers(len(own))), rng=rng)))
        known = own[seen].astype(np.float32)
        mean = known.mean((0, 1))
        for node, picture in enumerate(shown.astype(np.float32)):
            yield Query(name, matches(picture, known, mean, turned=turned), distance[node, seen])


def auc(positive: np.ndarray, negative: np.ndarray) -> float:
    """Chance that a match of the same place is above one of two places."""
    if not len(positive) or not len(negative):
        return float("nan")
    return float(scipy.stats.mannwhitneyu(positive, negative).statistic / len(positive) / len(negative))


def precision_recall(asked: Sequence[Query], least: float) -> tuple[float, float]:
    """Of the places that are recognised the share that is right, and of those on the map the share that is recognised
    rightly."""
    predicted = [q for q in asked if q.best >= least]
    right = sum(q.right for q in predicted)
    return right / max(len(predicted), 1), right / max(sum(q.known for q in asked), 1)


def threshold(asked: Sequence[Query]) -> float:
    """The match, in hundredths, from which on places count as the same: of best F1, the middle of equals."""

    def f1(least: float) -> float:
        p, r = precision_recall(asked, least)
        return 2 * p * r / max(p + r, 1e-9)

    grid = np.arange(0.0, 1.0, 0.01)
    scores = np.array([f1(x) for x in grid])
    best = np.flatnonzero(scores >= scores.max() - 1e-9)
    return float(grid[best[len(best) // 2]])


def recognised(data: Dataset, split: str, shown: str, encoder: str, picture_kind: str | None) -> dict[str, Samples]:
    """COLUMNS over all places of a split's houses; shares of pictures, the others one value per house.

    Args:
      shown: AGAIN, or when the pictures were taken, one of CAPTURE_CONDITIONS.
      encoder: its digest.
    """
    asked, own = list[Query](), shown == AGAIN
    for name in data.names(split):
        drawn, graph = pictures_of(data, name, picture_kind), data.place(name).graph
        seen, _ = load_features(feature_path(data.folder / "features", encoder, name, drawn), encoder=encoder)
        path = captured_path(data, name, CAPTURE_CONDITIONS["camera" if own else shown], encoder, drawn)
        asked += queries(name, graph, seen, load_features(path, encoder=encoder)[0], turned=not own)
    least = Likeness()
    return measured(asked, least.place if own else least.view if shown.endswith("view") else least.picture)


def measured(asked: Sequence[Query], least: float) -> dict[str, Samples]:
    """COLUMNS, where a match of `least` is the same place."""
    known, recognised_queries = [q for q in asked if q.known], [q for q in asked if q.best >= least]
    by_house = {h: [q for q in asked if q.house == h] for h in sorted({q.house for q in asked})}

    def each(queries: Sequence[Query], least: float = -np.inf) -> Samples:
        right = tuple(float(q.right and q.best >= least) for q in queries)
        return Samples(right, tuple(q.house for q in queries), share=True)

    def told(low: float, high: float) -> Samples:
        values = []
        for some in by_house.values():
            scores, metres = np.concatenate([q.scores for q in some]), np.concatenate([q.distance for q in some])
            values.append(auc(scores[metres == 0], scores[(metres > low) & (metres <= high)]))
        return Samples(tuple(values), tuple(by_house))

    rings = [told(*ring) for ring in ((0.0, np.inf), *RINGS)]
    best = Samples(tuple(threshold(some) for some in by_house.values()), tuple(by_house))
    return dict(
        zip(
            RECOGNITION_MEASURES, (each(known), each(recognised_queries), each(known, least), *rings, best), strict=True
        )
    )

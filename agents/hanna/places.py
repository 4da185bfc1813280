"""How well pictures are recognised that were taken at another time: precision, recall and AUC in houses never seen.

    python -m agents.hanna.places --validation VAL --data TEST --pictures fast-matte --out docs/results/data

An agent has walked through a house; a helper shows a picture of one of its places. Which of the places that it saw is
it, if any? Thresholds are those of the validation houses at which F1 is best.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.stats

from agents.common.shipped import SHIPPED_ENCODER
from agents.hanna.recognition import matches
from agents.vision.drawn import pictures_of
from agents.vision.encoder import load_encoder
from agents.vision.features import feature_path, load_features
from agents.vision.occasions import OCCASIONS, shown_path
from assets.cache import write_json
from embodied.datasets.store import Dataset
from embodied.evaluation.tables import estimate
from embodied.navigation.graph import NavGraph
from embodied.seeds import stream

WALKS, MOVES = 12, 15
"""Walks through each house, and moves of each: what the agent has seen when it is shown a picture."""
RINGS = ((0.0, 2.0), (2.0, 4.0), (4.0, np.inf))
"""From how far to how far the places are, in metres along the graph, that the right one is told from."""
SPLITS = ("val_unseen", "test_unseen")


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
        """Whether the place is on the map."""
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
    found = [q for q in asked if q.best >= least]
    right = sum(q.right for q in found)
    return right / max(len(found), 1), right / max(sum(q.known for q in asked), 1)


def threshold(asked: Sequence[Query]) -> float:
    """The match, in hundredths, from which on places count as the same: of best F1, the middle of equals."""

    def f1(least: float) -> float:
        p, r = precision_recall(asked, least)
        return 2 * p * r / max(p + r, 1e-9)

    grid = np.arange(0.0, 1.0, 0.01)
    scores = np.array([f1(x) for x in grid])
    best = np.flatnonzero(scores >= scores.max() - 1e-9)
    return float(grid[best[len(best) // 2]])


def facts(asked: Sequence[Query], least: float) -> dict[str, dict[str, float | int | None]]:
    """The columns of one row, shares in per cent."""
    scores, distance = np.concatenate([q.scores for q in asked]), np.concatenate([q.distance for q in asked])
    same = scores[distance == 0]
    known = [q for q in asked if q.known]
    houses = sorted({q.house for q in asked})
    out: dict[str, dict[str, float | int | None]] = {}

    def put(key: str, value: float, per_house: Sequence[float] = (), n: int | None = None) -> None:
        half = estimate(list(per_house), houses).half if len(per_house) > 1 else None
        out[key] = {"mean": round(value, 4), "half_width": None if half is None else round(half, 4), "n": n}

    first = [100.0 * q.right for q in known]
    by = estimate(first, [q.house for q in known])
    out["first"] = {"mean": round(by.mean, 2), "half_width": round(by.half, 2), "n": by.n}
    p, r = precision_recall(asked, least)
    each = [precision_recall([q for q in asked if q.house == h], least) for h in houses]
    put("precision", 100 * p, [100 * a for a, _ in each], sum(q.best >= least for q in asked))
    put("recall", 100 * r, [100 * b for _, b in each], len(known))
    put("auc", auc(same, scores[distance > 0]), n=len(scores))
    for low, high in RINGS:
        put(f"auc_{low:g}", auc(same, scores[(distance > low) & (distance <= high)]))
    put("threshold", least)
    return out


Asked = Mapping[str, list[Query]]


def ask(data: Dataset, splits: Sequence[str], quality: str | None, houses: int | None = None) -> Asked:
    """Queries by occasion, of all of OCCASIONS whose features are there for every house; 'again' are the agent's own
    panoramas through a camera, with their headings."""
    encoder, out = load_encoder(SHIPPED_ENCODER).digest, dict[str, list[Query]]()
    for name in dict.fromkeys(n for s in splits for n in data.names(s)[:houses]):
        drawn, graph = pictures_of(data, name, quality), data.place(name).graph
        own, _ = load_features(feature_path(data.folder / "features", encoder, name, drawn), encoder=encoder)
        for word, occasion in OCCASIONS.items():
            path = shown_path(data, name, occasion, encoder, drawn)
            if path.exists():
                shown = load_features(path, encoder=encoder)[0]
                out.setdefault(word, []).extend(queries(name, graph, own, shown))
                if word == "camera":
                    out.setdefault("again", []).extend(queries(name, graph, own, shown, turned=False))
    return out


COLUMNS = (
    {"key": "first", "title": "right place first, of those on the map", "unit": "%"},
    {"key": "precision", "title": "precision", "unit": "%"},
    {"key": "recall", "title": "recall", "unit": "%"},
    {"key": "auc", "title": "AUC", "unit": ""},
    {"key": "auc_0", "title": "AUC against places within 2 m", "unit": ""},
    {"key": "auc_2", "title": "AUC against places 2 to 4 m away", "unit": ""},
    {"key": "auc_4", "title": "AUC against places farther away", "unit": ""},
    {"key": "threshold", "title": "threshold, of validation houses", "unit": ""},
)


def thresholds(asked: Asked) -> dict[str, float]:
    """By what is shown: the agent's own panoramas, panoramas of another time, single views."""
    pooled = {
        "own": asked.get("again", []),
        "panorama": [
            q
            for word, some in asked.items()
            if word.startswith(("day", "later")) and kind_of(word) == "panorama"
            for q in some
        ],
        "view": [q for word, some in asked.items() if kind_of(word) == "view" for q in some],
    }
    return {kind: threshold(some) for kind, some in pooled.items() if some}


def kind_of(word: str) -> str:
    return "own" if word == "again" else "view" if word.endswith("view") else "panorama"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--validation", type=Path, required=True, help="data set whose unseen houses choose thresholds")
    parser.add_argument("--data", type=Path, help="data set in whose houses they are judged; without it none are")
    parser.add_argument("--pictures", help="how the pictures are drawn, as `embodied features --pictures`")
    parser.add_argument("--validation-splits", nargs="+", default=SPLITS, help="of whose houses (default: both unseen)")
    parser.add_argument("--split", nargs="+", default=["test_unseen"], help="of whose houses (default: test_unseen)")
    parser.add_argument("--houses", type=int, help="of the first so many houses of each split (default: all)")
    parser.add_argument("--table", default="sight-places", help="name of the table (default: %(default)s)")
    parser.add_argument("--out", type=Path, default=Path("docs/results/data"))
    args = parser.parse_args()

    chosen = thresholds(ask(Dataset(args.validation), args.validation_splits, args.pictures))
    print(f"thresholds {chosen}")
    judged = args.data or args.validation
    asked = ask(Dataset(judged), args.split if args.data else args.validation_splits, args.pictures, args.houses)
    rows = [
        {"label": word, "values": facts(some, chosen[kind_of(word)]), "printed": {}} for word, some in asked.items()
    ]
    houses = len({q.house for some in asked.values() for q in some})
    table = {
        "table": args.table,
        "title": "Recognising pictures that were taken at another time",
        "paper": None,
        "command": f"python -m agents.hanna.places --validation VAL --data TEST --pictures {args.pictures} "
        f"--split {' '.join(args.split)} --out docs/results/data",
        "identity": {"data": Dataset(judged).digest, "validation": Dataset(args.validation).digest},
        "settings": f"{houses} houses used for no training (data seed {Dataset(judged).config.seed}), "
        f"pictures {args.pictures or 'of the data set'}; "
        f"{WALKS} walks of {MOVES} moves in each",
        "columns": COLUMNS,
        "rows": rows,
        "notes": ["'again': the agent's own panoramas through a robot's camera, compared without turning."],
    }
    for row in rows:
        print(row["label"], {k: v["mean"] for k, v in row["values"].items()})  # type: ignore[attr-defined]
    if args.data:
        write_json(args.out / f"{args.table}.json", table, indent=1)


if __name__ == "__main__":
    main()

"""A policy of your own, judged beside the baselines on a small data set.

    python examples/own_policy.py --data data/find_flats

The policy below takes, at every place, the way out that it has taken least, and stops after twelve steps. It knows only
what an `Observation` holds, and what it remembers travels in its memory. Without --data a data set of small flats is
built first, which takes about a minute.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from assets.cache import default_cache
from embodied.datasets.build import DatasetConfig, build_dataset
from embodied.datasets.store import Dataset
from embodied.evaluation.evaluate import agent, evaluate
from embodied.evaluation.tables import markdown
from embodied.interface import Action, Move, Observation, Sight, Stop


class LeastTried:
    """Takes the way out that it has taken least at this place; stops after `patience` steps, wherever that is."""

    def __init__(self, patience: int = 12) -> None:
        self.patience = patience

    def act(
        self, observations: Sequence[Observation | None], memory: object | None, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[list[Action | None], object]:
        """One action per running episode; position i always belongs to the same one."""
        tried = memory if isinstance(memory, list) else [Counter() for _ in observations]
        actions = [None if o is None else self.one(o, tried[i], rngs[i]) for i, o in enumerate(observations)]
        return actions, tried

    def one(self, o: Observation, tried: Counter[tuple[Sight, int]], rng: np.random.Generator) -> Action:
        """`tried` counts the views left through, by what was seen around the agent: a place it recognises."""
        if o.time >= self.patience or not len(o.candidates):
            return Stop()
        counts = [tried[o.sight, int(view)] for view in o.candidates.view]
        best = [k for k, n in enumerate(counts) if n == min(counts)]
        chosen = best[int(rng.integers(len(best)))]
        tried[o.sight, int(o.candidates.view[chosen])] += 1
        return Move(chosen)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path("data/find_flats"))
    args = parser.parse_args()

    if not (args.data / "dataset.json").exists():
        build_dataset(DatasetConfig("find", "tiny", area=(45.0, 60.0)), args.data, default_cache())
    data = Dataset(args.data)
    agents = {name: agent("find", name) for name in ("random walk", "forward 10", "shortest")}
    rows = evaluate(data.split("test_unseen"), {"least tried": LeastTried(), **agents})
    print(markdown(rows, ("success", "spl", "navigation error", "steps")))


if __name__ == "__main__":
    main()

"""A policy of your own, judged beside the baselines on a small data set.

    python examples/own_policy.py --data data/find_flats

The policy below goes on without turning back, and stops after twelve steps. It knows only what an `Observation` holds,
and what it remembers travels in its memory. Without --data a data set of small flats is built first, which takes about
a minute.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from assets.cache import default_cache
from embodied.datasets.build import DatasetConfig, build_dataset
from embodied.datasets.store import Dataset
from embodied.evaluation.evaluate import agent, evaluate
from embodied.evaluation.tables import markdown
from embodied.interface import TURNS, Action, Move, Observation, Stop


class Onward:
    """Goes anywhere but back where it came from, while there is another way; stops after `patience` steps."""

    def __init__(self, patience: int = 12) -> None:
        self.patience = patience

    def act(
        self, observations: Sequence[Observation | None], memory: object | None, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[list[Action | None], object]:
        """One action per running episode; position i always belongs to the same one."""
        came = memory if isinstance(memory, dict) else {}
        return [None if o is None else self.one(o, i, came, rngs[i]) for i, o in enumerate(observations)], came

    def one(self, o: Observation, i: int, came: dict[int, int], rng: np.random.Generator) -> Action:
        """`came` holds, for each episode that has moved, the turn of the view that looks back."""
        if o.time >= self.patience or not len(o.candidates):
            return Stop()
        turns = o.candidates.view % TURNS
        onward = np.flatnonzero(turns != came.get(i, -1))
        chosen = int(rng.choice(onward if len(onward) else np.arange(len(turns))))
        came[i] = int(turns[chosen] + TURNS // 2) % TURNS
        return Move(chosen)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path("data/find_flats"))
    args = parser.parse_args()

    if not (args.data / "dataset.json").exists():
        build_dataset(DatasetConfig("find", "tiny", area=(45.0, 60.0)), args.data, default_cache())
    data = Dataset(args.data)
    agents = {name: agent("find", name) for name in ("random walk", "forward 10", "shortest")}
    rows = evaluate(data.split("test_unseen"), {"onward": Onward(), **agents})
    print(markdown(rows, ("success", "spl", "navigation error", "steps")))


if __name__ == "__main__":
    main()

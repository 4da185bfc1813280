"""How fast the stand-in for MatterSim is, beside the compiled one where somebody built it.

    python -m embodied.bench.mattersim CONNECTIVITY [--beside BUILD]

CONNECTIVITY is a folder that `embodied export` wrote; BUILD holds a compiled upstream MatterSim. Three loops, batch
100, one process: `raw` turns and asks for the states; `walk` reads the navigable locations and goes to the first;
`read` turns and reads every field of every state.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from embodied import mattersim
from embodied.seeds import stream

BATCH, STEPS, REPEATS = 100, 200, 5
FIELDS = ("scanId", "step", "heading", "elevation", "viewIndex")


def simulator(module: Any, folder: Path, *, discrete: bool) -> Any:
    """A batch of agents, each at an included viewpoint of one of the folder's scans."""
    sim = module.Simulator()
    sim.setNavGraphPath(str(folder))
    sim.setRenderingEnabled(False)
    sim.setDiscretizedViewingAngles(discrete)
    sim.setCameraResolution(640, 480)
    sim.setCameraVFOV(math.radians(60))
    sim.setBatchSize(BATCH)
    sim.initialize()
    rng, scans = stream(0, "bench", "mattersim"), (folder / "scans.txt").read_text().split()
    ids = {s: included(folder / f"{s}_connectivity.json") for s in scans}
    where = [scans[k] for k in rng.integers(len(scans), size=BATCH)]
    viewpoints = [ids[s][int(rng.integers(len(ids[s])))] for s in where]
    sim.newEpisode(where, viewpoints, rng.uniform(0, 6, BATCH).tolist(), [0.0] * BATCH)
    return sim


def included(path: Path) -> list[str]:
    return [item["image_id"] for item in json.loads(path.read_text()) if item["included"]]


def turns() -> list[tuple[list[int], list[int], list[int]]]:
    """Actions that stay and turn or tilt by a step, or not at all."""
    signs = stream(0, "bench", "mattersim", "turns").integers(-1, 2, (STEPS, 2, BATCH)).tolist()
    return [([0] * BATCH, heading, elevation) for heading, elevation in signs]


def raw(sim: Any, actions: list) -> None:
    for action in actions:
        sim.makeAction(*action)
        sim.getState()


def walk(sim: Any, actions: list) -> None:
    for _, heading, elevation in actions:
        index = [min(1, len(s.navigableLocations) - 1) for s in sim.getState()]
        sim.makeAction(index, heading, elevation)


def read(sim: Any, actions: list) -> None:
    for action in actions:
        sim.makeAction(*action)
        for state in sim.getState():
            for field in FIELDS:
                getattr(state, field)
            for v in (state.location, *state.navigableLocations):
                _ = v.viewpointId, v.rel_heading, v.rel_elevation, v.rel_distance


LOOPS: dict[str, Callable[[Any, list], None]] = {"raw": raw, "walk": walk, "read": read}


def agent_steps(loop: Callable[[Any, list], None], sim: Any) -> float:
    """Agent-steps a second, the best of REPEATS runs after one to warm up."""
    actions, best = turns(), 0.0
    for _ in range(REPEATS + 1):
        began = time.perf_counter()
        loop(sim, actions)
        best = max(best, STEPS * BATCH / (time.perf_counter() - began))
    return best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("connectivity", type=Path)
    parser.add_argument("--beside", type=Path, metavar="BUILD", help="folder of a compiled MatterSim")
    args = parser.parse_args()
    modules = {"embodied": mattersim.module("upstream")}
    if args.beside:
        sys.path.insert(0, str(args.beside))
        modules["compiled"] = importlib.import_module("MatterSim")
    print("| module | angles | " + " | ".join(LOOPS) + " |\n|---|---|" + "---|" * len(LOOPS))
    for name, module in modules.items():
        for discrete in (True, False):
            speeds = [agent_steps(f, simulator(module, args.connectivity, discrete=discrete)) for f in LOOPS.values()]
            angles = "discretized" if discrete else "continuous"
            print(f"| {name} | {angles} | " + " | ".join(f"{s:,.0f}" for s in speeds) + " |")


if __name__ == "__main__":
    main()

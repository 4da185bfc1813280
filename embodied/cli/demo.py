"""From a seed to a recorded walk, in one command.

Generates a furnished house, draws the panorama of every viewpoint, lets an agent walk the
navigation graph to the object it is asked for, and records the episode for Rerun.
"""

from __future__ import annotations

import argparse
import contextlib
import time
from collections.abc import Iterator
from pathlib import Path

from embodied.cli.common import add_cache, add_json, add_packs, catalogue_of, note, show
from embodied.cli.recording import add_sinks, sinks_of

SEED = 3
"""The demo house: a flat that is lit and drawn in a few minutes on two cores."""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--seed", type=int, default=SEED, help="which house (default: %(default)s)")
    parser.add_argument("--task", type=int, default=0, help="which of the house's tasks (default: %(default)s)")
    parser.add_argument("--size", type=int, default=384, help="side of a panorama's cube face in pixels (default: %(default)s)")
    parser.add_argument("--quality", choices=("unlit", "baked"), default="baked", help="unlit is drawn at once (default: baked)")
    parser.add_argument("--out", type=Path, default=Path("out/demo"), metavar="DIR", help="folder to write (default: %(default)s)")
    add_sinks(parser)
    add_cache(parser)
    add_packs(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    from embodied.env import HelpEnv
    from embodied.generate import generate_house
    from embodied.language import People
    from embodied.metrics import navigation_error, spl, success
    from embodied.plan import save_plan
    from embodied.policies import Shortest
    from embodied.rollout import rollout
    from embodied.tasks.find import find_pool, find_task
    from embodied.world import open_world
    from viz.blueprint import episode_blueprint
    from viz.recording import record
    from viz.sinks import open_recording

    catalogue, timings = catalogue_of(args), {}
    with timed("house", timings):
        house = generate_house(args.seed, catalogue=catalogue)
    args.out.mkdir(parents=True, exist_ok=True)
    house.save(args.out / "house.json")
    with open_world(house, catalogue, args.cache, size=args.size, quality=args.quality) as world:
        note(f"{house.name}: {len(house.rooms)} rooms, {len(house.placements)} objects, {len(world.graph.ids)} viewpoints")
        save_plan(house, args.out / "plan.png", graph=world.graph)
        with timed("panoramas", timings):
            world.render_all(progress=True)
        task = find_task(find_pool(world, seed=args.seed), args.task, seed=args.seed, language=People())
        note(f"the agent is asked: “{task.request}”")
        sinks = sinks_of(args, args.out / "episode.rrd")
        with timed("recording", timings), open_recording(
            sinks, episode_blueprint(house), name=task.request, properties=texts(world.fingerprint)
        ) as recording:
            frames = list(rollout(lambda: HelpEnv({world.name: world}), Shortest(), [task], seed=args.seed, agent="shortest path"))
            for _ in record(recording, world, task, (f.step for f in frames)):
                pass
        episode = frames[-1].episode
        facts = {
            "request": task.request, "success": success(episode, world.graph), "spl": round(spl(episode, world.graph), 3),
            "navigation_error_m": round(navigation_error(episode, world.graph), 2), "steps": len(episode.steps),
            "recording": str(sinks.rrd), "recording_mib": round(sinks.rrd.stat().st_size / 2**20, 1),
            "plan": str(args.out / "plan.png"), "seconds": timings, "renderer": world.fingerprint["renderer"],
        }
    show(args, facts, f"{'found' if facts['success'] else 'not found'} after {facts['steps']} steps, SPL {facts['spl']}\n"
                      f"floor plan  {facts['plan']}\nrecording   {facts['recording']} ({facts['recording_mib']} MiB); "
                      f"look at it with: .venv/bin/rerun {facts['recording']}")
    return 0


@contextlib.contextmanager
def timed(name: str, seconds: dict[str, float]) -> Iterator[None]:
    """Write down how long the body took under `name`."""
    start = time.perf_counter()
    yield
    seconds[name] = round(time.perf_counter() - start, 1)
    note(f"[{seconds[name]:6.1f} s] {name}")


def texts(fingerprint: dict) -> dict[str, str]:
    """A fingerprint with every value as text, as recordings keep it."""
    return {k: str(v) for k, v in fingerprint.items()}

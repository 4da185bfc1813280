"""Roll out an agent on tasks of one house, off-screen, into videos and recordings.

The camera of --video moves smoothly between viewpoints: this is a 3D scene, not a set of
photographs. With several episodes, %d in a file name stands for the number of the episode.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from embodied.cli.common import add_cache, add_json, add_packs, bar, catalogue_of, fetch, show
from embodied.cli.options import add_pictures, face, house_folder, whole
from embodied.cli.recording import add_sinks, add_video, film, viewers_of
from embodied.render.photograph import CAMERAS
from embodied.render.pictures import DRAWN, PictureSettings

if TYPE_CHECKING:
    from embodied.interface import Agent
    from embodied.world import World

AGENTS = ("shortest", "random", "forward10")


def add(parser: argparse.ArgumentParser) -> None:
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--house", type=house_folder, metavar="DIR", help="folder that `embodied house` wrote")
    where.add_argument("--seed", type=int, default=0, help="or generate a house from this seed (default: %(default)s)")
    parser.add_argument("--agent", choices=AGENTS, default="shortest", help="the agent (default: %(default)s)")
    parser.add_argument("--episodes", type=whole(), default=1, metavar="N", help="play N tasks (default: %(default)s)")
    add_pictures(parser, DRAWN, "normal")
    parser.add_argument(
        "--size", type=face, default=384, help="side of a panorama's cube face in pixels (default: %(default)s)"
    )
    add_video(parser)
    parser.add_argument(
        "--camera", choices=CAMERAS, default="ideal", help="camera of videos and recordings (default: %(default)s)"
    )
    add_sinks(parser)
    add_cache(parser)
    add_packs(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    with viewers_of(args) as viewers:
        return roll_out(args, viewers)


def roll_out(args: argparse.Namespace, viewers: tuple[str, ...]) -> int:
    """Play, film and record; recordings also go to `viewers`."""
    from embodied.envs.base import HelpEnv
    from embodied.evaluation.metrics import PER_EPISODE
    from embodied.evaluation.rollout import play
    from embodied.language import People
    from embodied.render.photograph import PhotoCamera
    from embodied.tasks.find import find_pool, find_task
    from viz.recording import Pictures, record_episode
    from viz.sinks import Sinks

    camera = PhotoCamera(args.camera, args.seed)
    with world_of(args) as world:
        fetch(world.catalogue, world.house)
        pool = find_pool(world, seed=args.seed)
        if args.episodes > len(pool):
            raise ValueError(
                f"house {world.name!r} has {len(pool)} tasks, asked for {args.episodes}; choose fewer or a larger house"
            )
        tasks = [find_task(pool, i, seed=args.seed, language=People()) for i in range(args.episodes)]
        episodes = play(
            lambda: HelpEnv({world.name: world}),
            policy_of(args.agent),
            bar(tasks, "episodes", "episode"),
            seed=args.seed,
            agent=args.agent,
        )
        rows = []
        for number, episode in enumerate(episodes):
            row: dict[str, object] = {"task": episode.task.id, "request": episode.task.request}
            row |= {name: float(f(episode, world.graph)) for name, f in PER_EPISODE.items()}
            if args.video:
                path = numbered(args.video, number, args.episodes)
                row["video"] = str(film(world, episode, path, tuple(args.video_size), camera))
            if args.rrd or viewers:
                rrd = numbered(args.rrd, number, args.episodes) if args.rrd else None
                watch = lambda steps: bar(steps, "recording", "step")
                record_episode(world, episode, Sinks(rrd, viewers), pictures=Pictures(camera=camera), watch=watch)
                row["recording"] = str(rrd or ", ".join(viewers))
            rows.append(row)
        facts = {
            "agent": args.agent,
            "seed": args.seed,
            "world": world.name,
            "renderer": world.fingerprint,
            "camera": args.camera,
            "episodes": rows,
        }
    lines = [f"{r['task']}  {'ok  ' if r['success'] else 'miss'} SPL {r['spl']:.2f}  {r['request']}" for r in rows]
    show(args, facts, "\n".join(lines))
    return 0


def world_of(args: argparse.Namespace) -> World:
    """The world of --house, or of the generated house of --seed."""
    from embodied.generate import generate_house
    from embodied.world import open_folder, open_world

    catalogue, pictures = catalogue_of(args), PictureSettings(args.size, args.pictures)
    if args.house:
        return open_folder(args.house, catalogue, args.cache, pictures)
    house = generate_house(args.seed, catalogue=catalogue)
    return open_world(house, catalogue, args.cache, pictures)


def policy_of(name: str) -> Agent:
    """The policy behind an --agent word."""
    from embodied.policies.baselines import Forward10, RandomWalk, Shortest

    return {"shortest": Shortest, "random": RandomWalk, "forward10": Forward10}[name]()


def numbered(path: Path, number: int, total: int) -> Path:
    """`path` with the episode's number in it: where %d stands, else before the suffix."""
    if total == 1 and "%d" not in path.name:
        return path
    name = path.name if "%d" in path.name else f"{path.stem}-%d{path.suffix}"
    return path.with_name(name.replace("%d", str(number)))

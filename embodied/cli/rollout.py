"""Run an agent on tasks of one house, and write videos and recordings.

The camera of --video moves smoothly between viewpoints. With several episodes, %d in a file name stands for the number
of the episode.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from embodied.cli.common import Furnished, Printed, bar, catalogue_of, check_machine, fetch, note, show
from embodied.options import Count, CubeFace, HouseFolder, Option, OutputRrd, drawn_as, file_ending_in, video_side
from embodied.render.photograph import CAMERAS
from embodied.render.pictures import DRAWN, parse_pictures

if TYPE_CHECKING:
    import numpy as np

    from embodied.interface import Episode
    from embodied.render.photograph import PhotoCamera
    from embodied.world import World


Side = Annotated[int, Option(video_side, "PIXELS")]
VIDEO_ANGLE = 1.2
"""Vertical field of view of videos, radians."""


@dataclass(frozen=True, kw_only=True)
class Viewers:
    """Recording."""

    rrd: OutputRrd | None = None
    """Write the Rerun recording here."""
    connect: Annotated[str | None, Option(metavar="URL")] = None
    """Send to a running viewer, which `rerun` or, for browsers, `rerun --serve-web` starts, e.g.
    rerun+http://127.0.0.1:9876/proxy."""


@dataclass(frozen=True, kw_only=True)
class Filmed:
    video: Annotated[Path | None, Option(file_ending_in(".mp4"), "MP4")] = None
    """Write what the agent sees and what is said as a video."""
    video_size: tuple[Side, Side] = (480, 640)
    """Height and width of the video in pixels, both even."""


def check_viewer(args: Viewers) -> None:
    """Refuse a viewer that is not there, before the work begins."""
    if args.connect is not None:
        from embodied.viz.sinks import check_connected

        check_connected(args.connect)


def film(world: World, episode: Episode, path: Path, size: tuple[int, int], camera: PhotoCamera | None = None) -> Path:
    """Write what the agent saw as a video with smooth motion and the dialogue; returns the path."""
    from embodied.viz.video import film_episode

    def frame(number: int, c: np.ndarray) -> np.ndarray:
        rgb = world.renderer.view(c[:3], c[3], c[4], VIDEO_ANGLE, size).rgb
        if camera is None or not camera.traits:
            return rgb
        return camera.photographed(rgb, VIDEO_ANGLE, "frame", number, light=world.darkness(c[:3]))

    frames = film_episode(world.graph, episode, frame, path, size, lambda track: bar(track, "video", "frame"))
    note(f"{path}: {frames} frames")
    return path


AGENTS = ("shortest", "random", "forward10")
"""As in embodied.policies.baselines, which --help should not import."""


@dataclass(frozen=True, kw_only=True)
class RolloutOptions(Filmed, Viewers, Furnished, Printed):
    house: HouseFolder | None = None
    """Folder that `embodied house` wrote (default: a house generated from --seed)."""
    seed: int = 0
    """Random seed of the house and its tasks."""
    agent: Annotated[str, Option(words=AGENTS)] = "shortest"
    """The agent."""
    episodes: Count = 1
    """Play N tasks."""
    pictures: Annotated[str, drawn_as(DRAWN)] = "normal"
    """How the house is drawn."""
    size: CubeFace = 384
    """Side of a panorama's cube face in pixels."""
    camera: Annotated[str, Option(words=CAMERAS)] = "ideal"
    """Camera of videos and recordings."""


def run(args: RolloutOptions) -> None:
    from embodied.envs.base import HelpEnv
    from embodied.evaluation.evaluate import play
    from embodied.generate import generate_house
    from embodied.kinds.metrics import PER_EPISODE
    from embodied.language import People
    from embodied.policies.baselines import WITHOUT_LEARNING
    from embodied.render.photograph import PhotoCamera
    from embodied.tasks.goals import find_pool, find_task
    from embodied.viz.recording import PictureSizes, record_episode
    from embodied.viz.sinks import Sinks
    from embodied.world import open_folder, open_world

    check_machine("unlit" if args.house else args.pictures)  # a house may be lit already
    check_viewer(args)
    camera = PhotoCamera(args.camera, args.seed)
    catalogue, drawn = catalogue_of(args), parse_pictures(args.pictures, args.size)
    if args.house:
        opened = open_folder(args.house, catalogue, args.cache, drawn)
    else:
        opened = open_world(generate_house(args.seed, catalogue=catalogue), catalogue, args.cache, drawn)
    with opened as world:
        fetch(catalogue, world.house)
        pool = find_pool(world, seed=args.seed)
        if args.episodes > len(pool):
            raise ValueError(
                f"house {world.name!r} has {len(pool)} tasks, asked for {args.episodes}; choose fewer or a larger house"
            )
        tasks = [find_task(pool, i, seed=args.seed, language=People()) for i in range(args.episodes)]
        watched, agent = bar(tasks, "episodes", "episode"), WITHOUT_LEARNING[args.agent]()
        episodes = play(lambda: HelpEnv({world.name: world}), agent, watched, seed=args.seed, agent=args.agent)
        rows = []
        for number, episode in enumerate(episodes):
            row: dict[str, object] = {"task": episode.task.id, "request": episode.task.request}
            row |= {name: float(f(episode, world.graph)) for name, f in PER_EPISODE.items()}
            if args.video:
                path = numbered(args.video, number, args.episodes)
                row["video"] = str(film(world, episode, path, args.video_size, camera))
            if args.rrd or args.connect:
                sinks = Sinks(args.rrd and numbered(args.rrd, number, args.episodes), args.connect)
                watch = lambda steps: bar(steps, "recording", "step")
                record_episode(world, episode, sinks, pictures=PictureSizes(camera=camera), watch=watch)
                row["recording"] = str(sinks.rrd or args.connect)
            rows.append(row)
        facts = {"agent": args.agent, "seed": args.seed, "world": world.name, "renderer": world.fingerprint}
        facts |= {"camera": args.camera, "episodes": rows}
    lines = [f"{r['task']}  {'ok  ' if r['success'] else 'miss'} SPL {r['spl']:.2f}  {r['request']}" for r in rows]
    show(args, facts, "\n".join(lines))


def numbered(path: Path, number: int, total: int) -> Path:
    """`path` with the episode's number in it: where %d stands, else before the suffix."""
    if total == 1 and "%d" not in path.name:
        return path
    name = path.name if "%d" in path.name else f"{path.stem}-%d{path.suffix}"
    return path.with_name(name.replace("%d", str(number)))

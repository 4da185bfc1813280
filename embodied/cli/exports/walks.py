"""Walks, drives and episodes with what is seen on the way, for published learners, and goals of `goat` data."""

import functools
from dataclasses import dataclass
from typing import Annotated, Any

from embodied.cli.common import bar, show
from embodied.cli.exports import OfData, register_export
from embodied.options import Cached, Count, InputPath, Option, drawn_as, not_negative, video_side
from embodied.render.pictures import PICTURES


@dataclass(frozen=True, kw_only=True)
class WalkOptions(OfData, Cached):
    """Continuous walks of an expert in `vln` data: images, actions, instructions."""

    split: str = "train"
    """The split whose tasks are walked."""
    tasks: Count | None = None
    """Walk the first N tasks (default: all)."""
    action_noise: Annotated[float, Option(not_negative, "SHARE")] = 0.0
    """Share of the actions that are random; the stored action is always the expert's, as in DAgger."""
    width: Annotated[int, Option(video_side, "PIXELS")] = 256
    """Width and height of the pictures."""
    depth: bool = False
    """Also write videos of depth (lerobot-vlnce)."""


def run_walks(form: str, args: WalkOptions) -> None:
    from embodied.datasets.habitat import route_episodes
    from embodied.datasets.store import dataset_of
    from embodied.datasets.vlnce import export_walks
    from embodied.envs.continuous import CameraConfig
    from embodied.gym.drive import chosen_worlds

    data = dataset_of(args.data, "vln")
    worlds, _ = chosen_worlds(data=args.data, split=args.split, cache=args.cache)
    walks = route_episodes(data.tasks(args.split), worlds)[: args.tasks]
    how: dict[str, Any] = {"action_noise": args.action_noise, "split": args.split, "depth": args.depth}
    how |= {"seed": data.config.seed, "camera": CameraConfig(args.width, args.width)}
    steps = export_walks(form, args.out, walks, worlds, watch=lambda e: bar(e, "walks", "walk"), **how)
    for world in worlds.values():
        world.close()
    facts = {"walks": len(walks), "steps": steps, "out": str(args.out)}
    show(args, facts, f"{len(walks)} walks, {steps} steps in {args.out}")


@dataclass(frozen=True, kw_only=True)
class GoatOptions(OfData):
    """Tasks of `goat` data as GOAT-Bench's files: sequences of goals with viewpoints, descriptions and images."""

    split: str = "test_unseen"
    """The split that is written."""


def run_goat(args: GoatOptions) -> None:
    from embodied.datasets.habitat import write_goat
    from embodied.datasets.store import dataset_of

    data = dataset_of(args.data, "goat")
    files = write_goat(args.out, args.split, data.tasks(args.split), data.split(args.split).worlds)
    show(args, {"files": len(files), "out": str(args.out)}, f"{len(files)} files in {args.out}")


register_export("goat", GoatOptions, run_goat)
for _form in ("vlnce", "lerobot-vlnce"):
    register_export(_form, WalkOptions, functools.partial(run_walks, _form))


@dataclass(frozen=True, kw_only=True)
class DriveOptions(OfData, Cached):
    """Drives of an expert on wheels to points, as LeRobot data (v3.0), in the houses of any data set."""

    split: str = "train"
    """The split whose houses are driven in."""
    drives: Count = 100
    """Drive N times, as often in each house."""
    action_noise: Annotated[float, Option(not_negative, "SHARE")] = 0.0
    """Share of the commands that are random; the stored command is always the expert's, as in DAgger."""
    pictures: Annotated[str | None, drawn_as(PICTURES)] = None
    """How houses are drawn (default: as the data set's pictures are)."""
    size: Annotated[int, Option(video_side, "PIXELS")] = 128
    """Side of the pictures."""


def run_drives(args: DriveOptions) -> None:
    from embodied.datasets.store import Dataset
    from embodied.gym.drive import make
    from embodied.gym.lerobot import DriveForLeRobot
    from embodied.gym.lerobot.drives import export_drives

    seen: dict[str, Any] = {"height": args.size, "width": args.size, "observations": ("rgb",)}
    houses: dict[str, Any] = {"data": args.data, "split": args.split, "cache": args.cache, "pictures": args.pictures}
    env = DriveForLeRobot(make(**houses, **seen))
    watch = functools.partial(bar, name="drives", unit="drive")
    seed = Dataset(args.data).config.seed
    steps = export_drives(env, args.out, args.drives, seed=seed, action_noise=args.action_noise, watch=watch)
    env.close()
    facts = {"drives": args.drives, "steps": steps, "out": str(args.out)}
    show(args, facts, f"{args.drives} drives, {steps} steps in {args.out}")


register_export("lerobot-drive", DriveOptions, run_drives)


@dataclass(frozen=True, kw_only=True)
class LeRobotOptions(OfData):
    """Episodes as a LeRobot data set (v3.0)."""

    episodes: tuple[InputPath, ...] = ()
    """Episodes (.jsonl) of `embodied evaluate` (default: --agent plays the tasks of --split)."""
    agent: Annotated[str | None, Option(metavar="NAME")] = None
    """Who plays: an agent of `embodied evaluate` that needs no training and no pictures (default: an expert, which asks
    where the kind of task has help)."""
    split: str | None = None
    """The split whose tasks are played (default: train)."""
    tasks: Count | None = None
    """Play the first N tasks (default: all)."""
    size: Annotated[int, Option(video_side, "PIXELS")] = 224
    """Side of the pictures."""
    depth: bool = False
    """Also write videos of depth."""


def run_lerobot(args: LeRobotOptions) -> None:
    from embodied.datasets.lerobot import export_lerobot
    from embodied.datasets.store import Dataset
    from embodied.evaluation.evaluate import play
    from embodied.interface import Episode
    from embodied.kinds.metrics import success
    from embodied.records import load_lines

    data = Dataset(args.data)
    name = args.agent or data.task_kind.expert
    chosen = {"--agent": args.agent, "--split": args.split, "--tasks": args.tasks}
    if args.episodes and (twice := [option for option, value in chosen.items() if value is not None]):
        raise ValueError(f"--episodes says who played which tasks; leave {' and '.join(twice)} out")
    known = [*data.task_kind.baselines]
    if name not in known:
        raise ValueError(
            f"--agent is {name!r}; of {data.kind!r} use one of {known}, or export the --episodes that "
            "`embodied evaluate --out` wrote of any other"
        )
    if args.episodes:
        episodes = [e for path in args.episodes for e in load_lines(path, Episode)]
        for episode in episodes:
            data.place_of(episode)
    else:
        whole_split = data.split(args.split or "train")
        tasks = whole_split.tasks[: args.tasks]
        episodes = play(whole_split.make_env, data.task_kind.agent(name), tasks, seed=data.config.seed, agent=name)

    succeeded = lambda episode: success(episode, data.place(episode.task.world).graph) > 0
    watched, size = bar(episodes, "episodes", "episode"), (args.size, args.size)
    steps = export_lerobot(data, args.out, watched, succeeded=succeeded, size=size, depth=args.depth)
    text = f"{len(episodes)} episodes, {steps} steps in {args.out}: "
    text += f"LeRobotDataset('{args.out.name}', root='{args.out}')"
    show(args, {"episodes": len(episodes), "steps": steps, "out": str(args.out)}, text)


register_export("lerobot", LeRobotOptions, run_lerobot)

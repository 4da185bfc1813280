"""Episodes with video, poses, actions and instructions, for `LeRobotDataset`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from embodied.cli.common import bar, show
from embodied.cli.exports import Export, OfData, register_export
from embodied.options import Count, InputPath, Option, video_side


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
    from embodied.datasets.lerobot import RecordedCamera, export_lerobot
    from embodied.datasets.store import Dataset
    from embodied.evaluation.rollout import play
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
    watched, camera = bar(episodes, "episodes", "episode"), RecordedCamera(args.size, args.size)
    steps = export_lerobot(data, args.out, watched, succeeded=succeeded, camera=camera, depth=args.depth)
    text = (
        f"{len(episodes)} episodes, {steps} steps in {args.out}: LeRobotDataset('{args.out.name}', root='{args.out}')"
    )
    show(args, {"episodes": len(episodes), "steps": steps, "out": str(args.out)}, text)


register_export(Export("lerobot", LeRobotOptions, run_lerobot))

"""Continuous walks of an expert in `vln` data, for LeRobot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from embodied.cli.common import bar, show
from embodied.cli.exports import Export, OfData, register_export
from embodied.options import Cached, Count, Option, not_negative, video_side


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
    """Also write videos of depth."""


def run_walks(args: WalkOptions) -> None:
    from embodied.datasets.habitat import route_episodes
    from embodied.datasets.store import dataset_of
    from embodied.datasets.vlnce import export_walks
    from embodied.envs.continuous import CameraConfig
    from embodied.gym.drive import data_worlds

    data = dataset_of(args.data, "vln")
    worlds = data_worlds(args.data, args.split, args.cache, None)
    walks = route_episodes(data.tasks(args.split), worlds)[: args.tasks]
    how: dict[str, Any] = {"action_noise": args.action_noise, "depth": args.depth}
    how |= {"seed": data.config.seed, "camera": CameraConfig(args.width, args.width)}
    steps = export_walks(args.out, walks, worlds, watch=lambda e: bar(e, "walks", "walk"), **how)
    for world in worlds.values():
        world.close()
    facts = {"walks": len(walks), "steps": steps, "out": str(args.out)}
    show(args, facts, f"{len(walks)} walks, {steps} steps in {args.out}")


register_export(Export("lerobot-vlnce", WalkOptions, run_walks))

"""Continuous walks of an expert in `vln` data, for published learners, and goals of `goat` data."""

from __future__ import annotations

import functools
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
    """Also write videos of depth (lerobot-vlnce)."""


def run_walks(form: str, args: WalkOptions) -> None:
    from embodied.datasets.habitat import route_episodes
    from embodied.datasets.store import dataset_of
    from embodied.datasets.vlnce import export_walks
    from embodied.envs.continuous import CameraConfig
    from embodied.gym.drive import data_worlds

    data = dataset_of(args.data, "vln")
    worlds = data_worlds(args.data, args.split, args.cache, None)
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


register_export(Export("goat", GoatOptions, run_goat))
for _form in ("vlnce", "lerobot-vlnce"):
    register_export(Export(_form, WalkOptions, functools.partial(run_walks, _form)))

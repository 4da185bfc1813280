"""Continuous walks of an expert in `vln` data, as published learners read them: images, actions, instructions."""

from __future__ import annotations

import contextlib
import dataclasses
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
    width: Annotated[int | None, Option(video_side, "PIXELS")] = None
    """Width of the pictures (default: that of the program)."""
    depth: bool = False
    """Also write videos of depth (lerobot-vlnce)."""


def run_walks(form: str, preset: str, args: WalkOptions) -> None:
    from embodied.datasets.habitat import route_episodes
    from embodied.datasets.store import dataset_of
    from embodied.datasets.vlnce import export_walks
    from embodied.gym.continuous import PRESETS
    from embodied.gym.drive import data_worlds
    from embodied.locks import locked

    data = dataset_of(args.data, "vln")
    body, camera = PRESETS[preset]
    width = args.width or camera.width
    camera = dataclasses.replace(camera, height=2 * round(camera.height * width / camera.width / 2), width=width)
    whole = form == "lerobot-vlnce"  # written under another name; the others are written file by file
    with contextlib.nullcontext() if whole else locked(args.out):
        worlds = data_worlds(args.data, args.split, args.cache, None)
        walks = route_episodes(data.tasks(args.split), worlds)[: args.tasks]
        how: dict[str, Any] = {"action_noise": args.action_noise, "split": args.split, "depth": args.depth}
        how["watch"] = functools.partial(bar, name="walks", unit="walk")
        steps = export_walks(form, args.out, walks, worlds, seed=data.config.seed, body=body, camera=camera, **how)
        for world in worlds.values():
            world.close()
    facts = {"walks": len(walks), "steps": steps, "out": str(args.out)}
    show(args, facts, f"{len(walks)} walks, {steps} steps in {args.out}")


for _form, _preset in {
    "vlnce": "vlnce",
    "streamvln": "streamvln",
    "uninavid": "uninavid",
    "internnav": "streamvln",
    "lerobot-vlnce": "vlnce",
}.items():  # with the body and camera of embodied.gym.continuous.PRESETS
    register_export(Export(_form, WalkOptions, functools.partial(run_walks, _form, _preset)))

"""Drives of an expert on wheels, for policies of LeRobot in Drive-v0."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Annotated, Any

from embodied.cli.common import bar, show
from embodied.cli.exports import Export, OfData, register_export
from embodied.options import Cached, Count, Option, drawn_as, not_negative, video_side
from embodied.render.pictures import PICTURES


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

    seen: dict[str, Any] = {
        "height": args.size,
        "width": args.size,
        "observations": ("rgb",),
        "pictures": args.pictures,
    }
    env = DriveForLeRobot(make(data=args.data, split=args.split, cache=args.cache, **seen))
    watch = functools.partial(bar, name="drives", unit="drive")
    seed = Dataset(args.data).config.seed
    steps = export_drives(env, args.out, args.drives, seed=seed, action_noise=args.action_noise, watch=watch)
    env.close()
    facts = {"drives": args.drives, "steps": steps, "out": str(args.out)}
    show(args, facts, f"{args.drives} drives, {steps} steps in {args.out}")


register_export(Export("lerobot-drive", DriveOptions, run_drives))

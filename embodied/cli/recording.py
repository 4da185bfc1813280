"""Options that say where a recording goes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from embodied.cli.common import bar, note
from embodied.options import Option, OutputRrd, file_ending_in, video_side

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


def viewers_of(args: Viewers) -> tuple[str, ...]:
    """The viewers that the options name; ask before the work begins."""
    if args.connect is None:
        return ()
    from embodied.viz.sinks import checked_viewer

    return (checked_viewer(args.connect),)


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

"""Options that say where a recording goes."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
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
    spawn: bool = False
    """Open the Rerun viewer, which needs a screen, and watch live."""
    connect: Annotated[str | None, Option(metavar="URL")] = None
    """Send to a running viewer, e.g. rerun+http://127.0.0.1:9876/proxy."""
    serve: bool = False
    """Serve the web viewer, watch in the browser, end with Ctrl-C."""
    bind: Annotated[str, Option(metavar="ADDRESS")] = "127.0.0.1"
    """Address on which --serve listens; the default is this machine only, 0.0.0.0 lets everybody look and write."""


@dataclass(frozen=True, kw_only=True)
class Filmed:
    video: Annotated[Path | None, Option(file_ending_in(".mp4"), "MP4")] = None
    """Write what the agent sees and what is said as a video."""
    video_size: tuple[Side, Side] = (480, 640)
    """Height and width of the video in pixels, both even."""


@contextlib.contextmanager
def viewers_of(args: Viewers) -> Iterator[tuple[str, ...]]:
    """The viewers that the options ask for; open them before the work begins. --serve goes on until Ctrl-C."""
    if not (args.spawn or args.connect is not None or args.serve):
        yield ()
        return
    from embodied import gl
    from embodied.viz.sinks import open_viewers

    with open_viewers(spawn=args.spawn, connect=args.connect, serve=args.serve, bind=args.bind) as viewers:
        if args.spawn and gl.available() and gl.info().software:
            note(
                "this machine draws by software: the native viewer is slow, and fills memory with some drivers; "
                "better --serve"
            )
        yield viewers


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

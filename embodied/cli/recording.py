"""Options that say where a recording goes."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from embodied.cli.common import bar, note
from embodied.cli.options import file_ending_in, video_side

if TYPE_CHECKING:
    import numpy as np

    from embodied.interface import Episode
    from embodied.render.photograph import PhotoCamera
    from embodied.world import World

VIDEO_ANGLE = 1.2
"""Vertical field of view of videos, radians."""


def add_sinks(parser: argparse.ArgumentParser, default: str | None = None) -> None:
    """--rrd, --spawn, --connect, --serve.

    Args:
      default: what --rrd is when it is not given, for the help text.
    """
    group = parser.add_argument_group("recording")
    group.add_argument(
        "--rrd",
        type=file_ending_in(".rrd"),
        metavar="FILE",
        help="write the Rerun recording here" + (f" (default: {default})" if default else ""),
    )
    add_viewers(group)


def add_viewers(group: argparse._ActionsContainer) -> None:
    """--spawn, --connect, --serve."""
    group.add_argument(
        "--spawn", action="store_true", help="open the Rerun viewer, which needs a screen, and watch live"
    )
    group.add_argument(
        "--connect", metavar="URL", help="send to a running viewer, e.g. rerun+http://127.0.0.1:9876/proxy"
    )
    group.add_argument(
        "--serve", action="store_true", help="serve the web viewer, watch in the browser, end with Ctrl-C"
    )
    group.add_argument(
        "--bind",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="where --serve listens (default: %(default)s, this machine only; 0.0.0.0 lets everybody look and write)",
    )


@contextlib.contextmanager
def viewers_of(args: argparse.Namespace) -> Iterator[tuple[str, ...]]:
    """The viewers that the options ask for; open them before the work begins. --serve goes on until Ctrl-C."""
    if not (args.spawn or args.connect is not None or args.serve):
        yield ()
        return
    from embodied import gl
    from viz.sinks import open_viewers

    with open_viewers(spawn=args.spawn, connect=args.connect, serve=args.serve, bind=args.bind) as viewers:
        if args.spawn and gl.info().software:
            note(
                "this machine draws by software: the native viewer is slow, and fills memory with some drivers; "
                "better --serve"
            )
        yield viewers


def add_video(parser: argparse.ArgumentParser) -> None:
    """The options of `film`."""
    parser.add_argument(
        "--video",
        type=file_ending_in(".mp4"),
        metavar="MP4",
        help="write what the agent sees and what is said as a video",
    )
    parser.add_argument(
        "--video-size",
        type=video_side,
        nargs=2,
        default=(480, 640),
        metavar=("H", "W"),
        help="pixels of the video, both even (default: 480 640)",
    )


def film(world: World, episode: Episode, path: Path, size: tuple[int, int], camera: PhotoCamera | None = None) -> Path:
    """Write what the agent saw as a video with smooth motion and the dialogue; returns the path."""
    from viz.video import film_episode

    def frame(number: int, c: np.ndarray) -> np.ndarray:
        rgb = world.renderer.view(c[:3], c[3], c[4], VIDEO_ANGLE, size).rgb
        if camera is None or not camera.traits:
            return rgb
        return camera.photographed(rgb, VIDEO_ANGLE, "frame", number, light=world.darkness(c[:3]))

    frames = film_episode(world.graph, episode, frame, path, size, lambda track: bar(track, "video", "frame"))
    note(f"{path}: {frames} frames")
    return path

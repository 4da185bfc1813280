"""Off-screen rollouts as video, with smooth camera motion between the nodes of the graph."""

import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import av
import numpy as np
from PIL import Image, ImageDraw

from embodied.assets.cache import atomic_path
from embodied.geometry import wrap
from embodied.house.floor_plan import font
from embodied.interface import Episode, Pose
from embodied.language.plain_language import detokenized
from embodied.navigation.graph import NavGraph

FPS = 24
WALK = 1.1
"""Metres per second."""
TURN = np.deg2rad(100.0)
"""Radians per second."""


PAUSE, SPEECH = 0.4, 2.2
"""Seconds of standing still at a pose, and where somebody has just spoken."""


def camera_track(
    positions: np.ndarray, poses: Sequence[Pose], pauses: Sequence[float] | None = None
) -> list[np.ndarray]:
    """The camera at every frame of a walk through `poses`.

    It turns towards the next node, walks there, then turns to the pose's own angles; every
    stretch starts and ends at rest (smoothstep).

    Args:
      positions: (n, 3) node positions, metres.
      poses: the poses in order, the start first.
      pauses: seconds of standing still at each pose; PAUSE where not given.

    Returns:
      One (frames, 5) float64 per pose, the way to it and the pause at it: x, y, z, yaw, pitch.
    """
    pauses = [PAUSE] * len(poses) if pauses is None else pauses
    here = np.array([*positions[poses[0].node], poses[0].yaw, poses[0].pitch])
    track = [np.tile(here, (max(int(pauses[0] * FPS), 1), 1))]
    for pose, pause in zip(poses[1:], pauses[1:], strict=True):
        stretch = []
        there = positions[pose.node]
        step = there[:2] - here[:2]
        if np.hypot(*step) > 1e-6:
            ahead = here.copy()
            ahead[3] = here[3] + wrap(np.arctan2(step[1], step[0]) - here[3])
            ahead[4] = 0.0
            stretch.append(_ease(here, ahead))
            here = np.array([*there, ahead[3], 0.0])
            stretch.append(_ease(ahead, here))
        final = here.copy()
        final[3], final[4] = here[3] + wrap(pose.yaw - here[3]), pose.pitch
        track.append(np.concatenate([*stretch, _ease(here, final), np.tile(final, (int(pause * FPS), 1))]))
        here = final
    return track


def _ease(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Frames from a (left out) to b, slow at both ends."""
    seconds = max(np.linalg.norm(b[:3] - a[:3]) / WALK, abs(b[3] - a[3]) / TURN, abs(b[4] - a[4]) / TURN)
    t = np.linspace(0, 1, int(np.ceil(seconds * FPS)) + 1)[1:, None]
    return a + (b - a) * (t * t * (3 - 2 * t))


def film_episode(
    graph: NavGraph,
    episode: Episode,
    draw: Callable[[int, np.ndarray], np.ndarray],
    path: Path,
    size: tuple[int, int],
    watch: Callable[[list[tuple[str, np.ndarray]]], Iterable[tuple[str, np.ndarray]]] = iter,
) -> int:
    """Film what the agent saw, with smooth motion and, below, the request and the assistant's words; the frame count.

    Args:
      draw: the picture of frame number i, from its camera x, y, z, yaw, pitch: (height, width, 3) uint8.
      size: height and width, both even.
      watch: wraps the frames (a progress bar).
    """
    spoken = [s.reply is not None for s in episode.steps]
    track = camera_track(
        graph.positions,
        [episode.task.start, *(s.next_pose for s in episode.steps)],
        [SPEECH, *(SPEECH if line else PAUSE for line in spoken)],
    )
    frames = [(words, at) for words, stretch in zip(_captions(episode), track, strict=True) for at in stretch]
    return write_video(path, (captioned(draw(i, c), text) for i, (text, c) in enumerate(watch(frames))), size)


def _captions(episode: Episode) -> list[str]:
    """The captions at the start and after each step: the request, the question, or what the assistant answered."""
    captions = [f"Task: {episode.task.request}"]
    for step, after in zip(episode.steps, (*(s.instruction for s in episode.steps[1:]), None), strict=True):
        if step.reply is not None and step.reply.text:
            captions.append(f"Agent asks. Assistant: {step.reply.text}")
        elif after == step.instruction or after is None:
            captions.append(captions[-1].removeprefix("Agent asks. "))
        else:
            captions.append(f"Task: {episode.task.request}" if after == episode.task.request else f"Assistant: {after}")
    if episode.ended == "stop":
        captions[-1] = f"Agent stops. {captions[-1]}"
    return [detokenized(words) for words in captions]


def captioned(rgb: np.ndarray, caption: str) -> np.ndarray:
    """A copy of the frame with at most three lines of text on a dark band at its lower edge."""
    height, width = rgb.shape[:2]
    size = max(height / 30, 9.0)
    letters = font(size)
    lines = textwrap.wrap(caption, max(int(width / letters.getlength("n") * 1.05), 10))[:3] or [""]
    band = int(size * (1.35 * len(lines) + 0.7))
    frame = Image.fromarray(rgb)
    frame.paste(frame.crop((0, height - band, width, height)).point(lambda v: v * 0.3), (0, height - band))
    ImageDraw.Draw(frame).multiline_text(
        (size * 0.7, height - band + size * 0.4), "\n".join(lines), font=letters, fill="white", spacing=size * 0.25
    )
    return np.asarray(frame)


def write_video(path: Path, frames: Iterator[np.ndarray], size: tuple[int, int]) -> int:
    """Encode RGB frames as H.264 in an .mp4 that appears complete or not at all; their number.

    Args:
      frames: (height, width, 3) uint8 each.
      size: height and width, both even.
    """
    if size[0] % 2 or size[1] % 2:
        raise ValueError(f"a video needs an even height and width, got {size}")
    count = 0
    with atomic_path(Path(path)) as temporary, av.open(str(temporary), "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=FPS, options={"crf": "21", "preset": "veryfast"})
        stream.height, stream.width, stream.pix_fmt = size[0], size[1], "yuv420p"
        for frame in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")))
            count += 1
        container.mux(stream.encode(None))
    return count

"""Off-screen rollouts as video, with smooth camera motion between the nodes of the graph."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import av
import cv2
import numpy as np

from assets.cache import atomic_path
from embodied.geometry import wrap
from embodied.interface import Pose

FPS = 24
WALK = 1.1
"""Metres per second."""
TURN = np.deg2rad(100.0)
"""Radians per second."""


def camera_track(positions: np.ndarray, poses: Sequence[Pose], pause: float = 0.4) -> np.ndarray:
    """The camera at every frame of a walk through `poses`.

    It turns towards the next node, walks there, then turns to the pose's own angles; every
    stretch starts and ends at rest (smoothstep).

    Args:
      positions: (n, 3) node positions, metres.
      poses: the poses in order, the start first.
      pause: seconds of standing still at each pose.

    Returns:
      (frames, 5) float64: x, y, z, yaw, pitch.
    """
    here = np.array([*positions[poses[0].node], poses[0].yaw, poses[0].pitch])
    track = [np.tile(here, (max(int(pause * FPS), 1), 1))]
    for pose in poses[1:]:
        there = positions[pose.node]
        step = there[:2] - here[:2]
        if np.hypot(*step) > 1e-6:
            ahead = here.copy()
            ahead[3] = here[3] + wrap(np.arctan2(step[1], step[0]) - here[3])
            ahead[4] = 0.0
            track.append(_ease(here, ahead))
            here = np.array([*there, ahead[3], 0.0])
            track.append(_ease(ahead, here))
        final = here.copy()
        final[3], final[4] = here[3] + wrap(pose.yaw - here[3]), pose.pitch
        track += [_ease(here, final), np.tile(final, (int(pause * FPS), 1))]
        here = final
    return np.concatenate(track)


def _ease(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Frames from a (left out) to b, slow at both ends."""
    seconds = max(np.linalg.norm(b[:3] - a[:3]) / WALK, abs(b[3] - a[3]) / TURN, abs(b[4] - a[4]) / TURN)
    n = int(np.ceil(seconds * FPS))
    t = np.linspace(0, 1, n + 1)[1:, None]
    return a + (b - a) * (t * t * (3 - 2 * t))


def captioned(rgb: np.ndarray, caption: str) -> np.ndarray:
    """A copy of the frame with a line of text on a dark band at its lower edge."""
    frame = rgb.copy()
    height = frame.shape[0]
    band = max(height // 14, 22)
    frame[height - band :] = (frame[height - band :] * 0.35).astype(np.uint8)
    scale = band / 42
    cv2.putText(
        frame,
        caption.encode("ascii", "replace").decode(),
        (10, height - band // 3),
        cv2.FONT_HERSHEY_SIMPLEX,
        scale,
        (255, 255, 255),
        1,
        cv2.LINE_AA,
    )
    return frame


def write_video(path: Path, frames: Iterator[np.ndarray], size: tuple[int, int], fps: int = FPS) -> int:
    """Encode RGB frames as H.264 in an .mp4 that appears complete or not at all.

    Args:
      path: where to write.
      frames: (height, width, 3) uint8 each.
      size: height and width, both even.
      fps: frames per second.

    Returns:
      The number of frames.
    """
    if size[0] % 2 or size[1] % 2:
        raise ValueError(f"a video needs an even height and width, got {size}")
    count = 0
    with atomic_path(Path(path)) as temporary, av.open(str(temporary), "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=fps, options={"crf": "21", "preset": "veryfast"})
        stream.height, stream.width, stream.pix_fmt = size[0], size[1], "yuv420p"
        for frame in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")))
            count += 1
        container.mux(stream.encode(None))
    return count

"""Marks in pictures: objects that HARI's assistant spoke of, and that an agent recognises."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from embodied.assistants.descriptions import spoken_of
from embodied.house.house import Placement
from embodied.interface import Feature, Intention, Place, Pose, Step
from embodied.render.panorama import Recognised

COLOUR, FOUND = (255, 160, 30), (60, 220, 255)
Marked = tuple[Feature, Placement]


def log_described(recording: rr.RecordingStream, world: Place, step: Step, height: int) -> None:
    """The objects of the reply to `step`: around the agent in its panorama (CUR), or where it is to go (GOAL, SUB).

    What was marked before goes, so that the marks are always those of the last reply.

    Args:
      height: of the panorama that is shown, pixels.
    """
    here, there = _marked(world, step)
    at = panorama_pixels(world, step.pose, [p for _, p in here], height)
    recording.log(
        "view/panorama/described",
        rr.Points2D(at, labels=[label(f) for f, _ in here], show_labels=True, radii=3.0, colors=COLOUR),
    )
    recording.log("task/described", boxes([p for _, p in there], [label(f) for f, _ in there], COLOUR))


def log_recognised(recording: rr.RecordingStream, objects: Sequence[Recognised], pose: Pose, height: int) -> None:
    """Draw what an agent recognises around it, in its panorama.

    Args:
      height: of the panorama that is shown, pixels.
    """
    at = pixels_towards(np.array([f.yaw for f in objects]), np.array([f.pitch for f in objects]), pose, height)
    names = [f"{f.name.replace('_', ' ')} {f.probability:.0%}" for f in objects]
    recording.log("view/panorama/recognised", rr.Points2D(at, labels=names, show_labels=True, radii=3.0, colors=FOUND))


def boxes(things: Sequence[Placement], labels: Sequence[str], colour: tuple[int, int, int]) -> rr.Boxes3D:
    """Boxes around things, a little larger than they are."""
    return rr.Boxes3D(
        centers=np.array([middle(p) for p in things]).reshape(-1, 3),
        half_sizes=np.array([p.size for p in things]).reshape(-1, 3) / 2 + 0.05,
        rotation_axis_angles=[rr.RotationAxisAngle(axis=(0, 0, 1), radians=p.yaw) for p in things],
        labels=labels,
        colors=colour,
        radii=0.012,
    )


def _marked(world: Place, step: Step) -> tuple[list[Marked], list[Marked]]:
    """Draw what the reply to `step` said of the agent's place, and of where it is to go."""
    reply = step.reply
    if reply is None or reply.description is None:
        return [], []
    if reply.intention is Intention.CUR:
        return spoken_of(world, step.pose.node, reply.description), []
    node = step.targets[0] if reply.subtask is None else reply.subtask.target
    return [], spoken_of(world, node, reply.description)


def label(feature: Feature) -> str:
    """The label of an object: its name and how far it is in whole metres."""
    return f"{feature.name.replace('_', ' ')} ({feature.distance} m)"


def middle(placement: Placement) -> np.ndarray:
    """(3,) metres: the middle of what is placed."""
    return np.add(placement.position, (0.0, 0.0, placement.size[2] / 2))


def panorama_pixels(world: Place, pose: Pose, placements: list[Placement], height: int) -> np.ndarray:
    """(n, 2) pixels, column and row, of the middles of some things in a panorama of (height, 2 height).

    Its middle column is the agent's gaze, as embodied.viz.recording.log_sight turns it.
    """
    offset = np.array([middle(p) for p in placements]).reshape(-1, 3) - world.graph.positions[pose.node]
    yaw = np.arctan2(offset[:, 1], offset[:, 0])
    return pixels_towards(yaw, np.arctan2(offset[:, 2], np.hypot(offset[:, 0], offset[:, 1])), pose, height)


def pixels_towards(yaw: np.ndarray, pitch: np.ndarray, pose: Pose, height: int) -> np.ndarray:
    """(n, 2) pixels as `panorama_pixels`, of directions (n,) and (n,) in radians."""
    column = (np.pi - (yaw - pose.yaw)) % (2 * np.pi) * height / np.pi
    return np.stack([column, (np.pi / 2 - pitch) * height / np.pi], axis=1)

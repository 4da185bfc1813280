"""Targets of a recording, a file, a running viewer, or both, and how viewers lay it out."""

import contextlib
import socket
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumn

from embodied.assets.cache import atomic_path
from embodied.errors import UnableError
from embodied.house.house import House
from embodied.interface import Ask, Episode
from embodied.kinds.task_kind import kind_named
from embodied.render.pictures import PictureSettings

APPLICATION = "embodied"
PORT = 9876
"""Rerun's own, on which viewers and servers listen."""

LOCAL = f"rerun+http://127.0.0.1:{PORT}/proxy"
"""A viewer on this machine."""

VIEWER_SECONDS = 60.0
"""Seconds that a viewer may take to accept the last of a recording."""

FOOTER = b"RRF2FOOT"
"""The bytes 12 before the end of a .rrd file that was finished (Rerun 0.41)."""


@dataclass(frozen=True)
class Sinks:
    """Targets of one recording; both are served."""

    rrd: Path | None = None
    """File to write; it appears complete or not at all."""
    viewer: str | None = None
    """URL of a running viewer or server."""


def check_connected(url: str) -> None:
    """Refuse the URL of a viewer that does not run, before any work is done.

    Raises:
      ValueError: no URL of a viewer.
      UnableError: nobody listens.
    """
    parts = urlsplit(url)
    if parts.scheme not in ("rerun", "rerun+http", "rerun+https") or not parts.hostname:
        raise ValueError(f"--connect should be the URL of a running viewer such as {LOCAL}, got {url!r}")
    if not listens(parts.hostname, parts.port or PORT):
        raise UnableError(
            f"no viewer listens at {url}; start one with `rerun` (on a screen) or `rerun --serve-web` (for browsers)"
        )


@contextlib.contextmanager
def open_recording(
    sinks: Sinks, blueprint: rrb.Blueprint, *, name: str, properties: dict[str, str]
) -> Iterator[rr.RecordingStream]:
    """A recording stream connected to `sinks`, flushed and closed at the end.

    Args:
      blueprint: the layout a viewer shows it with.
      properties: fingerprint of renderer, device and versions, kept inside the recording.

    Raises:
      OSError: the file could not be written to its end, or a viewer went away.
    """
    rr.set_strict_mode(True)  # a call that cannot be logged is an error, not a warning
    recording = rr.RecordingStream(APPLICATION)
    with contextlib.ExitStack() as stack:
        outputs: list[rr.GrpcSink | rr.FileSink] = [rr.GrpcSink(sinks.viewer)] if sinks.viewer else []
        file = None
        if sinks.rrd is not None:
            file = stack.enter_context(atomic_path(Path(sinks.rrd)))
            outputs.append(rr.FileSink(str(file)))
        if outputs:
            recording.set_sinks(*outputs, default_blueprint=blueprint)
        if sinks.viewer:  # an earlier recording's layout would stay otherwise
            recording.send_blueprint(blueprint, make_active=True)
        recording.send_recording_name(name)
        if properties:
            recording.send_property("fingerprint", rr.AnyValues(drop_untyped_nones=True, **properties))
        yield recording
        try:
            recording.flush(timeout_sec=VIEWER_SECONDS)
        except RuntimeError as e:
            raise OSError(
                f"the recording could not be sent or written to its end ({e}); free some disk space, or look "
                "whether the viewer still runs, and run again"
            ) from e
        recording.disconnect()
        if file is not None and file.read_bytes()[-12:-4] != FOOTER:
            raise OSError(f"{sinks.rrd} could not be written to its end; free some disk space and run again")


def listens(host: str, port: int) -> bool:
    """Tells whether a connection is accepted within three seconds."""
    try:
        socket.create_connection((host, port), timeout=3.0).close()
    except OSError:
        return False
    return True


LIGHT = {"unlit": "without light", "fast": "lit, fast", "normal": "lit", "traced": "lit, ray-traced"}
"""How a house is drawn, for people."""


def sees_title(seen: PictureSettings | None) -> str:
    """Name of the picture along the agent's gaze: how it is drawn, or that the agent looks at none."""
    if seen is None:
        return "Ahead of the agent, which looks at no pictures"
    return f"What the agent sees: {LIGHT.get(seen.word, seen.word)}"


def blueprint_of(house: House, episode: Episode, seen: PictureSettings | None = None) -> rrb.Blueprint:
    """The layout for a finished episode: the house in 3D on the left, what the agent sees and hears on the right, plots
    below; with an assistant's image and probabilities where it has them.

    Args:
      house: decides where the eye starts.
      seen: how the pictures are drawn that the agent looks at; None if it looks at none.
    """
    kind, steps = kind_named(episode.task.kind), episode.steps
    dialogue = kind.story.dialogue or any(isinstance(s.action, Ask) for s in steps)
    target = any(s.reply is not None and s.reply.image is not None for s in steps)
    thought = any(s.action.thought is not None and s.action.thought.asks for s in steps)
    stack, monocular = kind.story.goal_stack, kind.monocular
    world = _house_view(house)
    ahead = rrb.Spatial2DView(origin="/agent/camera/image", name=sees_title(seen))
    around = "Around it, which it does not see" if monocular else "Panorama, gaze in the middle"
    panorama = rrb.Spatial2DView(origin="/view/panorama", name=around)
    sent = [rrb.Spatial2DView(origin="/view/target", name="Image of where to go")] if target else []
    doing = rrb.TextDocumentView(origin="/text/instruction", name="Doing now")
    texts = [rrb.TextDocumentView(origin="/text/request", name="Request"), doing]
    if stack:
        texts = [doing, rrb.TextDocumentView(origin="/text/goals", name="Goals, what counts now first")]
    plots = _plots(thought, stack, budget=episode.budget is not None)
    rows: list[rrb.Container | rrb.View] = [rrb.Horizontal(ahead, *sent), panorama, rrb.Horizontal(*texts)]
    rows += [rrb.TextDocumentView(origin="/text/dialogue", name="Dialogue")] if dialogue else []
    right = rrb.Vertical(*rows, row_shares=[5, 3, 2, 3][: len(rows)])
    body, *others = (TextLogColumn(kind, visible=kind == "Body") for kind in ("Body", "EntityPath", "LogLevel"))
    columns = rrb.archetypes.TextLogColumns(text_log_columns=[body, *others])
    events = rrb.TextLogView(origin="/events", name="Events", columns=columns)
    below = rrb.Horizontal(*plots, events, column_shares=[*[2] * len(plots), 3])
    left = rrb.Vertical(world, below, row_shares=[3, 1])
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[3, 2]),
        rrb.TimePanel(state="collapsed", timeline="step", fps=1.5, play_state="playing"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
    )


def _house_view(house: House) -> rrb.Spatial3DView:
    """The house in 3D, seen from above its southern side."""
    corners = np.array([c for r in house.rooms for c in r.polygon])
    low, high = corners.min(axis=0), corners.max(axis=0)
    centre, span = (low + high) / 2, float(max(high - low))
    position, target = (centre[0], centre[1] - 0.75 * span, 1.05 * span), (*centre, 0.0)
    eye = rrb.EyeControls3D(position=position, look_target=target, eye_up=(0, 0, 1))
    contents = [f"+ /{part}/**" for part in ("house", "graph", "agent", "task", "people")]
    how: dict[str, Any] = {"eye_controls": eye, "background": (245, 246, 248), "line_grid": False}
    return rrb.Spatial3DView(origin="/", name="House", contents=contents, **how)


def _plots(probabilities: bool, cost: bool, *, budget: bool) -> list[rrb.View]:
    """Distance and mode over time, how likely asking was, and what it has cost so far."""
    series = rrb.TimeSeriesView
    low, high = rrb.PlotLegend(rrb.Corner2D.LeftBottom), rrb.PlotLegend(rrb.Corner2D.LeftTop)
    plots: list[rrb.View] = [
        series(origin="/plot/distance", name="Metres to go", plot_legend=low),
        rrb.StateTimelineView(origin="/mode", name="Mode"),
    ]
    if probabilities:
        axis, name = rrb.ScalarAxis(range=(0.0, 1.0)), "Probability of asking"
        plots.append(series(origin="/plot/probability", name=name, axis_y=axis, plot_legend=high))
    if cost:
        plots.append(series(origin="/plot/cost", name="Cost so far"))
    if budget:
        plots.append(series(origin="/plot/budget", name="Requests left"))
    return plots

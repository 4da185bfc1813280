"""Targets of a recording: a file, running viewers, or several of them."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import rerun as rr
import rerun.blueprint as rrb

from embodied.assets.cache import atomic_path
from embodied.errors import UnableError

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
    """Targets of one recording; all that are set are served."""

    rrd: Path | None = None
    """File to write; it appears complete or not at all."""
    viewers: tuple[str, ...] = ()
    """URLs of running viewers and servers."""


def checked_viewer(url: str) -> str:
    """The URL of a running viewer, for `Sinks.viewers`; what cannot be watched is said before any work is done.

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
    return url


@contextlib.contextmanager
def open_recording(
    sinks: Sinks, blueprint: rrb.Blueprint, *, name: str, properties: dict[str, str]
) -> Iterator[rr.RecordingStream]:
    """A recording stream connected to `sinks`, flushed and closed at the end.

    Args:
      sinks: where it goes.
      blueprint: the layout a viewer shows it with.
      name: what the viewer calls it.
      properties: fingerprint of renderer, device and versions, kept inside the recording.

    Raises:
      OSError: the file could not be written to its end, or a viewer went away.
    """
    rr.set_strict_mode(True)  # a call that cannot be logged is an error, not a warning
    recording = rr.RecordingStream(APPLICATION)
    with contextlib.ExitStack() as stack:
        outputs: list[rr.GrpcSink | rr.FileSink] = [rr.GrpcSink(url) for url in sinks.viewers]
        file = None
        if sinks.rrd is not None:
            file = stack.enter_context(atomic_path(Path(sinks.rrd)))
            outputs.append(rr.FileSink(str(file)))
        if outputs:
            recording.set_sinks(*outputs, default_blueprint=blueprint)
        if sinks.viewers:  # an earlier recording's layout would stay otherwise
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

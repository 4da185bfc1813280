"""Where a recording goes: a file, a running viewer, a new viewer, the browser, or several of them."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from assets.cache import atomic_path

APPLICATION = "embodied"
MEMORY_LIMIT = "1GiB"
"""What a viewer or server that we start may keep before it drops the oldest data."""

FOOTER = b"RRF2FOOT"
"""What stands 12 bytes before the end of a .rrd file that was finished (Rerun 0.41)."""


@dataclass(frozen=True)
class Sinks:
    """Where to send a recording; all that are set are served."""

    rrd: Path | None = None
    """File to write; it appears complete or not at all."""
    spawn: bool = False
    """Open the native viewer."""
    connect: str | None = None
    """URL of a running viewer, e.g. rerun+http://127.0.0.1:9876/proxy."""
    serve: bool = False
    """Serve the web viewer and keep serving until Ctrl-C."""


@contextlib.contextmanager
def open_recording(sinks: Sinks, blueprint: rrb.Blueprint, *, name: str, properties: dict[str, str]) -> Iterator[rr.RecordingStream]:
    """A recording stream connected to `sinks`, flushed and closed at the end.

    Args:
      sinks: where it goes.
      blueprint: the layout a viewer starts with.
      name: what the viewer calls it.
      properties: fingerprint of renderer, device and versions, kept inside the recording.

    Raises:
      OSError: the file could not be written to its end.
    """
    rr.set_strict_mode(True)  # a call that cannot be logged is an error, not a warning
    recording = rr.RecordingStream(APPLICATION)
    with contextlib.ExitStack() as stack:
        outputs, file = [], None
        if sinks.rrd is not None:
            file = stack.enter_context(atomic_path(Path(sinks.rrd)))
            outputs.append(rr.FileSink(str(file)))
        if sinks.spawn:
            rr.spawn(connect=False, memory_limit=MEMORY_LIMIT, server_memory_limit=MEMORY_LIMIT)
            outputs.append(rr.GrpcSink())
        if sinks.connect is not None:
            outputs.append(rr.GrpcSink(sinks.connect))
        if sinks.serve:
            url = recording.serve_grpc(default_blueprint=blueprint, server_memory_limit=MEMORY_LIMIT)
            rr.serve_web_viewer(open_browser=False, connect_to=url)
        if outputs and not sinks.serve:
            recording.set_sinks(*outputs, default_blueprint=blueprint)
        recording.send_recording_name(name)
        if properties:
            recording.send_property("fingerprint", rr.AnyValues(**properties))
        yield recording
        try:
            recording.flush()
        except RuntimeError as e:
            raise OSError(f"the recording could not be sent or written to its end ({e}); free some disk space, or look "
                          "whether the viewer still runs, and run again") from e
        if sinks.serve:
            _keep_serving()
        recording.disconnect()
        if file is not None and file.read_bytes()[-12:-4] != FOOTER:
            raise OSError(f"{sinks.rrd} could not be written to its end; free some disk space and run again")


def open_viewer(rrd: Path) -> None:
    """Open a recording in the native viewer."""
    rr.init(APPLICATION, spawn=True)
    rr.log_file_from_path(rrd)


def _keep_serving() -> None:
    print("serving the recording at http://127.0.0.1:9090; Ctrl-C ends it", flush=True)
    with contextlib.suppress(KeyboardInterrupt):
        while True:
            time.sleep(1.0)

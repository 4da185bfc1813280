"""Targets of a recording: a file, a running viewer, a new viewer, the browser, or several of them."""

from __future__ import annotations

import contextlib
import functools
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote, urlsplit

import rerun as rr
import rerun.blueprint as rrb
import rerun_cli

from embodied.assets.cache import atomic_path, write_json
from embodied.errors import UnableError

APPLICATION = "embodied"
LIMITS = ("--memory-limit", "1GiB", "--server-memory-limit", "1GiB")
"""Memory that a viewer or server that we start may keep before it drops the oldest data."""

EVERYWHERE = "0.0.0.0"
"""All addresses of this machine."""

PORT, WEB_PORT = 9876, 9090
"""Rerun's own: where viewers and servers listen for recordings, where a browser finds the web viewer."""

HERE = "127.0.0.1"
"""The address to listen on unless another is given: nobody on other machines can look or write."""

VIEWER_SECONDS = 60.0
"""Seconds that a viewer may take to accept the last of a recording."""

MAGIC = b"RRF"
"""The first bytes of a .rrd file, before the number of its format."""
FOOTER = b"RRF2FOOT"
"""The bytes 12 before the end of a .rrd file that was finished (Rerun 0.41)."""


@dataclass(frozen=True)
class Sinks:
    """Targets of one recording; all that are set are served."""

    rrd: Path | None = None
    """File to write; it appears complete or not at all."""
    viewers: tuple[str, ...] = ()
    """URLs of running viewers and servers, as `open_viewers` gives them."""


@contextlib.contextmanager
def open_viewers(
    *, spawn: bool = False, connect: str | None = None, serve: bool = False, bind: str = HERE
) -> Iterator[tuple[str, ...]]:
    """URLs for `Sinks.viewers`; what cannot be watched is said before any work is done.

    Args:
      spawn: open the native viewer; it stays open afterwards. One that runs already is used.
      connect: URL of a running viewer, e.g. rerun+http://127.0.0.1:9876/proxy.
      serve: serve the web viewer while the body runs, and then until Ctrl-C.
      bind: address of this machine to serve at; all but the default lets others look and write.

    Raises:
      ValueError: `connect` is no URL of a viewer.
      UnableError: no screen, nobody listens, or the ports are taken.
    """
    urls = []
    if connect is not None:
        urls.append(_checked(connect))
    if spawn:
        urls.append(_spawned())
    if not serve:
        yield tuple(dict.fromkeys(urls))
        return
    with _serve(bind):
        print(f"watch in a browser: {page(bind)}", flush=True)
        yield tuple(dict.fromkeys([*urls, _url(PORT)]))
        print(f"still served at {page(bind)}; Ctrl-C ends it", flush=True)
        with contextlib.suppress(KeyboardInterrupt):
            while True:
                time.sleep(1.0)


def page(bind: str) -> str:
    """Address of the web viewer for a browser."""
    host = HERE if bind == EVERYWHERE else bind
    return f"http://{host}:{WEB_PORT}/?url={quote(_url(PORT, host), safe='')}"


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


def check_recording(rrd: Path) -> None:
    """Refuse what is no recording; warn of one that was cut short.

    Raises:
      ValueError: another kind of file.
    """
    with open(rrd, "rb") as f:
        begin, end = f.read(4), f.seek(0, os.SEEK_END)
        f.seek(max(0, end - 12))
        footer = f.read(8)
    if not begin.startswith(MAGIC):
        raise ValueError(f"{rrd} is no recording of Rerun; make one with `embodied demo` or `embodied rollout --rrd`")
    if footer != FOOTER:
        print(f"warning: {rrd} was cut short or changed; its last moments may be missing", file=sys.stderr)


def open_file(rrd: Path, *, serve: bool = False, bind: str = HERE) -> None:
    """Show a .rrd file in the native viewer, or serve it to browsers; returns when that is closed or stopped.

    Raises:
      UnableError: there is no screen, or the viewer could not be started.
    """
    check_recording(rrd)
    command = [viewer_program(), str(Path(rrd).absolute()), "--bind", bind, *LIMITS]  # never an option
    if serve:
        _warn_of(bind)
        _refuse_taken(bind)
        command += ["--serve-web", "--port", str(PORT), "--web-viewer-port", str(WEB_PORT)]
        print(f"watch in a browser: {page(bind)}; Ctrl-C ends it", flush=True)
    else:
        _need_screen()
        command += ["--port", "auto"]
    status = 0
    with contextlib.suppress(KeyboardInterrupt):  # reaches the viewer as well
        status = subprocess.run(command, check=False, stdout=subprocess.DEVNULL, env=viewer_environment()).returncode
    if status:
        raise UnableError(
            f"the Rerun viewer ended with status {status}; look at what it wrote above, or use --serve and a browser"
        )


def send_file(rrd: Path, viewers: tuple[str, ...]) -> None:
    """Send a .rrd file to running viewers.

    Raises:
      OSError: it could not be sent to its end.
    """
    for url in viewers:
        recording = rr.RecordingStream(APPLICATION)
        recording.set_sinks(rr.GrpcSink(url))
        recording.log_file_from_path(rrd)
        try:
            recording.flush(timeout_sec=VIEWER_SECONDS)
        except RuntimeError as e:
            raise OSError(f"{rrd} could not be sent to {url} ({e}); look whether the viewer still runs") from e
        recording.disconnect()


def _url(port: int, host: str = HERE) -> str:
    return f"rerun+http://{host}:{port}/proxy"


def _checked(url: str) -> str:
    """`url`, if a viewer listens there."""
    parts = urlsplit(url)
    if parts.scheme not in ("rerun", "rerun+http", "rerun+https") or not parts.hostname:
        raise ValueError(f"--connect should be the URL of a running viewer such as {_url(PORT)}, got {url!r}")
    if not listens(parts.hostname, parts.port or PORT):
        raise UnableError(
            f"no viewer listens at {url}; start one with `rerun` (on a screen) or `rerun --serve-web` (for browsers)"
        )
    return url


def _spawned() -> str:
    """The URL of the native viewer: the one that runs already, else a new one, which outlives this program."""
    if not listens(HERE, PORT):
        _need_screen()
        viewer = _started("--bind", HERE, "--port", str(PORT), "--expect-data-soon")
        _wait_for(viewer, HERE, (PORT,), "use --serve and a browser, or --rrd and a file")
    return _url(PORT)


def _warn_of(bind: str) -> None:
    if bind != HERE:
        print(f"warning: everybody who reaches {bind} can look at what is served and send data to it", file=sys.stderr)


@contextlib.contextmanager
def _serve(bind: str) -> Iterator[None]:
    """A server for recordings and the web viewer's page, both at the address `bind`, while the body runs."""
    _refuse_taken(bind)
    _warn_of(bind)
    ports = ["--port", str(PORT), "--web-viewer-port", str(WEB_PORT)]
    server = _started("--serve-web", "--bind", bind, *ports)
    try:
        reached = HERE if bind == EVERYWHERE else bind
        _wait_for(server, reached, (PORT, WEB_PORT), f"look whether {bind} is an address of this machine")
        yield
    finally:
        server.terminate()
        server.wait()


def _started(*options: str) -> subprocess.Popen:
    """A viewer or server in a session of its own: Ctrl-C is for us."""
    return subprocess.Popen(
        [viewer_program(), *options, *LIMITS],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        env=viewer_environment(),
    )


def _wait_for(program: subprocess.Popen, host: str, ports: tuple[int, ...], remedy: str) -> None:
    """Wait until `program` listens at every one of `ports`: the page's port opens after the recordings'.

    Raises:
      UnableError: it ended, or does not listen after a minute.
    """
    until = time.monotonic() + VIEWER_SECONDS
    while not all(listens(host, p) for p in ports):
        if program.poll() is not None or time.monotonic() > until:
            program.kill()
            raise UnableError(f"the Rerun viewer could not be started (status {program.poll()}); {remedy}")
        time.sleep(0.1)


def viewer_program() -> str:
    """The viewer that came with rerun-sdk, whatever PATH says."""
    return str(Path(rerun_cli.__file__).parent / ("rerun.exe" if sys.platform == "win32" else "rerun"))


def viewer_environment() -> dict[str, str]:
    """The variables of a viewer that we start: it reads its settings from a folder where its statistics are off."""
    return {**os.environ, "XDG_CONFIG_HOME": _quiet_settings().name}


@functools.cache
def _quiet_settings() -> tempfile.TemporaryDirectory[str]:
    """Removed when the program ends; viewers read it when they begin."""
    folder = tempfile.TemporaryDirectory(prefix="embodied-viewer-")
    file = Path(folder.name) / "rerun" / "analytics.json"
    where = {"config_file_path": str(file), "data_dir_path": str(file.parent)}
    write_json(file, {"analytics_enabled": False, "analytics_id": "", "metadata": {}, **where})
    return folder


def _need_screen() -> None:
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise UnableError(
            "there is no screen here (neither DISPLAY nor WAYLAND_DISPLAY is set) to open the Rerun viewer on; "
            "use --serve and a browser, --connect URL with a viewer elsewhere, or --rrd FILE"
        )


def _refuse_taken(bind: str) -> None:
    for port in (PORT, WEB_PORT):
        if listens(HERE if bind == EVERYWHERE else bind, port):
            raise UnableError(
                f"port {port} is taken; end the program that uses it, or send to it with --connect {_url(port)} "
                "if it is a viewer"
            )


def listens(host: str, port: int) -> bool:
    """Tells whether a connection is accepted within three seconds."""
    try:
        socket.create_connection((host, port), timeout=3.0).close()
    except OSError:
        return False
    return True

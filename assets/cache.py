"""The on-disk cache: content-keyed, written atomically, safe to delete at any time."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import re
import shutil
import socket
import tempfile
import time
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

_MACHINE = re.sub(r"[^\w]", "", socket.gethostname()) or "here"
_DRAFT = re.compile(r"\..+\.(?P<machine>\w+)-(?P<pid>\d+)\.")


DAMAGED = (ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)
"""What reading a damaged .npz archive may raise, besides errors of the operating system: cut short, flipped in its
directory (another compression, encrypted, another name) or in its content."""


def default_cache() -> Path:
    """EMBODIED_CACHE if set, else the user's cache folder; only command lines call this."""
    chosen = os.environ.get("EMBODIED_CACHE")
    if chosen:
        return Path(chosen).expanduser()
    base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(base).expanduser() / "embodied"


def digest(*parts: object) -> str:
    """Hex SHA-256 over the canonical JSON of `parts` (bytes and paths are hashed by content)."""
    h = hashlib.sha256()
    for part in parts:
        if isinstance(part, Path):
            h.update(b"path:" + hashlib.sha256(part.read_bytes()).digest())
        elif isinstance(part, bytes):
            h.update(b"bytes:" + hashlib.sha256(part).digest())
        else:
            h.update(b"json:" + json.dumps(part, sort_keys=True, separators=(",", ":")).encode())
    return h.hexdigest()


@contextlib.contextmanager
def atomic_path(path: Path, *, sync: bool = True) -> Iterator[Path]:
    """A temporary sibling of `path` that replaces it only if the body succeeds.

    A reader therefore sees the old file, no file or the whole new file; Ctrl-C, a full disk or
    an exception leaves nothing half-written behind. What a killed process left in the folder is
    removed on the way.

    Args:
      sync: False does not wait for the disk; for the many small files that are checked when read.

    Raises:
      OSError: the disk is full, the folder may not be written, ...; its `filename` is `path`.
    """
    with _named(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        sweep(path.parent)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=draft_prefix(path.name), suffix=path.suffix)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            if sync:
                with open(temporary, "rb") as f:
                    os.fsync(f.fileno())
            os.chmod(temporary, 0o644)
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def _named(path: Path) -> Iterator[None]:
    """Errors of the operating system about no file, or about an unfinished one, speak of `path`."""
    try:
        yield
    except OSError as e:
        unnamed = e.filename is None or Path(os.fsdecode(e.filename)).name.startswith(f".{path.name}.")
        if e.errno is None or not unnamed:
            raise
        raise OSError(e.errno, e.strerror or os.strerror(e.errno), str(path)) from e


def draft_prefix(name: str) -> str:
    """How the name of the unfinished `name` begins; it tells which process of which machine makes it."""
    return f".{name}.{_MACHINE}-{os.getpid()}."


def abandoned(draft: Path) -> bool:
    """Whether `draft` was left unfinished by a process that is no more.

    Whether a process of another machine lives cannot be known; its draft is taken for abandoned
    when nobody has touched it for a day.
    """
    maker = _DRAFT.match(draft.name)
    if maker is None:
        return False
    if maker["machine"] == _MACHINE:
        return not alive(int(maker["pid"]))
    return time.time() - draft.stat().st_mtime > 86_400


def alive(pid: int) -> bool:
    """Whether a process of this number runs on this machine."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return True


@functools.lru_cache(maxsize=1024)
def sweep(folder: Path) -> None:
    """Remove what killed processes left unfinished in `folder`; once per folder and process."""
    for draft in sorted(folder.glob(".*")):
        with contextlib.suppress(OSError):  # another process may sweep, too
            if abandoned(draft):
                shutil.rmtree(draft) if draft.is_dir() else draft.unlink()


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` to `path` atomically."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def write_json(path: Path, value: object, indent: int | None = None) -> None:
    """Write `value` as JSON to `path` atomically."""
    write_bytes(path, (json.dumps(value, indent=indent) + "\n").encode())

"""The on-disk cache: content-keyed, written atomically, safe to delete at any time."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path


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
    an exception leaves nothing half-written behind.

    Args:
      sync: False does not wait for the disk; for the many small files that are checked when read.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=path.suffix)
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


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` to `path` atomically."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def write_json(path: Path, value: object, indent: int | None = None) -> None:
    """Write `value` as JSON to `path` atomically."""
    write_bytes(path, (json.dumps(value, indent=indent) + "\n").encode())

"""One writer per folder: a lock that says whose it is and ends with its process, however that ends."""

import contextlib
import errno
import fcntl
import json
import logging
import os
import socket
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from embodied.assets.cache import sweep
from embodied.errors import UnableError

LOCK = ".embodied.lock"
"""Name of the file in a folder that somebody writes to."""
CANNOT = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS)
"""Errors of disks that know no locks."""
log = logging.getLogger(__name__)


class LockedError(UnableError):
    """Another process writes to the folder."""


@contextlib.contextmanager
def locked(folder: Path, *, wait: bool = False) -> Iterator[None]:
    """Hold `folder`, which is made if missing, for writing while the body runs.

    The lock is the operating system's (flock), so it is gone when its process is, also after a kill; what is written
    into the file is for people. What killed processes left unfinished in the folder is removed.

    Args:
      wait: until whoever holds it is done, instead of raising LockedError.

    Raises:
      LockedError: another process holds it; the message names process, machine and command.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / LOCK
    handle = _take(path, wait)
    try:
        sweep.cache_clear()
        sweep(folder)
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(handle)


def _take(path: Path, wait: bool) -> int:
    """The descriptor of the locked file `path`, with this process written into it."""
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
        try:
            _flock(handle, path, wait)
            if _is_same(handle, path):  # else its holder removed it between open and lock
                os.ftruncate(handle, 0)
                os.pwrite(handle, json.dumps(_myself()).encode(), 0)
                return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)


def _flock(handle: int, path: Path, wait: bool) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        if not wait:
            raise LockedError(
                f"{path.parent} is being written by {_holder(path)}; wait for it, end it, or choose another folder"
            ) from None
        log.warning("%s is being written by %s; waiting for it", path.parent, _holder(path))
        fcntl.flock(handle, fcntl.LOCK_EX)
    except OSError as e:
        if e.errno not in CANNOT:
            raise
        log.warning("%s: this disk knows no locks (%s); see to it that nobody else writes there", path.parent, e)


def _is_same(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), os.lstat(path))
    except FileNotFoundError:
        return False


def _myself() -> dict[str, object]:
    since, command = time.strftime("%Y-%m-%d %H:%M:%S"), " ".join(sys.argv)[:500]
    return {"pid": os.getpid(), "host": socket.gethostname(), "since": since, "command": command}


def _holder(path: Path) -> str:
    """Who holds the lock, in words."""
    try:
        who = json.loads(path.read_text(encoding="utf-8"))
        return f"process {who['pid']} on {who['host']} since {who['since']} ({who['command']})"
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return "another process"

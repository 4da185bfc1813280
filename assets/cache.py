"""The on-disk cache: content-keyed, written atomically, safe to delete at any time."""

import contextlib
import fcntl
import functools
import hashlib
import json
import logging
import os
import shutil
import tempfile
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

log = logging.getLogger(__name__)
DRAFTS = ".embodied-unfinished-"
"""How folders of unfinished files begin; what makes them ours is the mark in them."""
MARK = ".mark"
DAMAGED = (
    ValueError, KeyError, EOFError, RuntimeError, MemoryError, SyntaxError, tokenize.TokenError, zipfile.BadZipFile,
    zlib.error,
)  # fmt: skip
"""Errors in reading a damaged .npz archive, besides errors of the operating system: cut short, flipped in its
directory (another compression, encrypted, another name), in its content, or in the size that an array says to have."""


def default_cache() -> Path:
    """The cache folder: EMBODIED_CACHE if set, else the user's, else, for somebody without a home, one in the folder
    for temporary files; only command lines call this.

    EMBODIED_CACHE may be a list, as PATH is one: what the later folders hold is read from there, and all is written
    to the first.

    Examples:
      >>> folder = embodied.default_cache()
    """
    first, *others = (
        os.environ.get("EMBODIED_CACHE") or f"{os.environ.get('XDG_CACHE_HOME') or '~/.cache'}/embodied"
    ).split(os.pathsep)
    try:
        cache = Path(first).expanduser()
    except RuntimeError:  # neither HOME nor an entry in the list of users
        cache = Path(tempfile.gettempdir()) / f"embodied-{os.getuid()}"
    for other in filter(None, others):
        try:
            link(Path(other).expanduser(), cache, frozenset({os.path.realpath(cache)}))
        except (OSError, RuntimeError) as e:
            log.warning("EMBODIED_CACHE names %s, which is left out: %s", other, e)
    return cache


def link(shared: Path, cache: Path, above: frozenset[str] = frozenset()) -> None:
    """Let `cache` hold symbolic links to those files of `shared` that it lacks; hidden files are left out.

    Args:
      above: real paths of folders that are not entered again, so that links that lead back are none.

    Raises:
      OSError: `shared` cannot be read, or `cache` not be written.
    """
    real = os.path.realpath(shared)
    if real in above:
        return
    with os.scandir(shared) as entries:
        inside = [e for e in entries if not e.name.startswith(".")]
    if inside:
        cache.mkdir(parents=True, exist_ok=True)
    for entry in inside:
        if entry.is_dir():
            link(Path(entry.path), cache / entry.name, above | {real})
        elif not os.path.lexists(cache / entry.name):
            with contextlib.suppress(FileExistsError):  # another process links, too
                os.symlink(os.path.abspath(entry.path), cache / entry.name)


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
    """A path of the same name in a private folder beside `path`, which becomes `path` only if the body succeeds.

    A reader therefore sees the old file, no file or the whole new file; Ctrl-C, a full disk or an exception leaves
    nothing half-written behind. What a killed process left in the folder is removed on the way.

    Args:
      sync: False does not wait for the disk; for the many small files that are checked when read.

    Raises:
      OSError: the disk is full, the folder may not be written, ...; its `filename` is `path`.
    """
    path = Path(path)
    with _named(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        sweep(path.parent)
        with drafts(path.parent) as private:
            temporary = private / path.name
            yield temporary
            if sync:
                with open(temporary, "rb") as f:
                    os.fsync(f.fileno())
            os.replace(temporary, path)


@contextlib.contextmanager
def _named(path: Path) -> Iterator[None]:
    """Errors of the operating system about no file, or about an unfinished one, speak of `path`."""
    try:
        yield
    except OSError as e:
        inside = e.filename is not None and any(p.startswith(DRAFTS) for p in Path(os.fsdecode(e.filename)).parts)
        if e.errno is None or not (e.filename is None or inside):
            raise
        raise OSError(e.errno, e.strerror or os.strerror(e.errno), str(path)) from e


@contextlib.contextmanager
def drafts(folder: Path) -> Iterator[Path]:
    """A private folder in `folder` for what is unfinished; it is removed with all that is left in it.

    It holds a mark, locked as long as its maker lives: so everybody on this machine, in other containers too, can
    tell what was abandoned, and nothing else is ever taken for it.
    """
    private = Path(tempfile.mkdtemp(prefix=DRAFTS, dir=folder))
    try:
        handle = os.open(private / MARK, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o600)
        try:
            with contextlib.suppress(OSError):  # a disk without locks: nobody will sweep it
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                os.write(handle, _mark_of(handle))
            yield private
        finally:
            os.close(handle)
    finally:
        shutil.rmtree(private, ignore_errors=True)


def _mark_of(handle: int) -> bytes:
    """The content of the mark: words, and the number of the file itself, so that a copy is none."""
    return f"unfinished files of the program embodied, {os.fstat(handle).st_ino}\n".encode()


def abandoned(private: Path) -> bool:
    """True where `private` is a folder of `drafts` whose maker is no more."""
    if private.is_symlink() or not private.is_dir():
        return False
    try:
        handle = os.open(private / MARK, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return os.read(handle, 200) == _mark_of(handle)
    except OSError:  # its maker lives, or the disk knows no locks
        return False
    finally:
        os.close(handle)


@functools.lru_cache(maxsize=1024)
def sweep(folder: Path) -> None:
    """Remove what killed processes left unfinished in `folder`; once per folder and process."""
    for private in sorted(folder.glob(f"{DRAFTS}*")):
        if abandoned(private):
            shutil.rmtree(private, ignore_errors=True)  # another process may sweep, too


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` to `path` atomically."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def write_json(path: Path, value: object, indent: int | None = None) -> None:
    """Write `value` as JSON to `path` atomically."""
    write_bytes(path, (json.dumps(value, indent=indent) + "\n").encode())

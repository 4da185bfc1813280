"""Show the size of the cache by kind of content, and remove old files.

Everything in the cache can be made again. --prune DAYS removes what nobody has read for so many days, --clear KIND all
products of a kind (assets, light, panoramas ...). EMBODIED_CACHE may name several folders, separated as in PATH: files
are read from all of them and written to the first, so that a group can share a read-only one.
"""

import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from embodied.cli.common import Printed, show
from embodied.options import Cached, Option, whole

CACHE_FOLDERS = (
    *("assets", "materials", "collision", "landscapes", "light"),
    *("panoramas", "sightings", "semantic", "paths", "days"),
)
"""Folders that the program makes in a cache; nothing else in it is counted or removed."""


@dataclass(frozen=True, kw_only=True)
class CacheOptions(Cached, Printed):
    prune: Annotated[int | None, Option(whole(), "DAYS")] = None
    """Remove files that nobody has read for DAYS days."""
    clear: tuple[Annotated[str, Option(words=CACHE_FOLDERS)], ...] = ()
    """Remove all files of these kinds."""


def run(args: CacheOptions) -> None:
    for kind in args.clear:
        if (args.cache / kind).is_dir() and not (args.cache / kind).is_symlink():
            shutil.rmtree(args.cache / kind)
    if args.prune is not None:
        before = time.time() - 86_400 * args.prune
        for path in files(args.cache):
            if max(path.lstat().st_atime, path.lstat().st_mtime) < before:
                path.unlink(missing_ok=True)
    counts = {kind: measured(args.cache / kind) for kind in CACHE_FOLDERS}
    total = sum(size for _, size in counts.values())
    lines = [f"{kind:<12} {size / 2**20:9.1f} MiB in {n} files" for kind, (n, size) in counts.items() if n]
    kinds = {k: {"files": n, "bytes": s} for k, (n, s) in counts.items()}
    facts = {"cache": str(args.cache), "bytes": total, "kinds": kinds}
    show(args, facts, "\n".join([*lines, f"{'together':<12} {total / 2**20:9.1f} MiB in {args.cache}"]))


def files(cache: Path) -> list[Path]:
    """The program's files in a cache, those it only links to included; folders that are links are somebody else's."""
    own = [cache / kind for kind in CACHE_FOLDERS if not (cache / kind).is_symlink()]
    return [p for folder in own for p in sorted(folder.rglob("*")) if p.is_symlink() or p.is_file()]


def measured(folder: Path) -> tuple[int, int]:
    """How many files of its own a folder holds, and their bytes."""
    own = [p.stat().st_size for p in folder.rglob("*") if p.is_file() and not p.is_symlink()]
    return len(own), sum(own)

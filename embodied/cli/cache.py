"""Show how large the cache is, by what it holds, and make room in it.

Everything in the cache can be made again. `--prune DAYS` removes what nobody has read for so many days, `--clear KIND`
one kind of products (assets, light, panoramas ...) as a whole. EMBODIED_CACHE may name several folders, separated as in
PATH: files are read from all of them and written to the first, so that a group can share one that is read-only.
"""

from __future__ import annotations

import argparse
import shutil
import time
from pathlib import Path

from embodied.cli.common import add_cache, add_json, show
from embodied.cli.options import whole

KINDS = ("assets", "materials", "collision", "landscapes", "light", "panoramas", "sightings", "semantic", "nav_paths")
"""Folders that the program makes in a cache; nothing else in it is counted or removed."""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--prune", type=whole(), metavar="DAYS", help="remove files that nobody has read for DAYS days")
    parser.add_argument("--clear", choices=KINDS, nargs="+", default=[], help="remove all files of these kinds")
    add_cache(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    for kind in args.clear:
        if (args.cache / kind).is_dir() and not (args.cache / kind).is_symlink():
            shutil.rmtree(args.cache / kind)
    if args.prune is not None:
        before = time.time() - 86_400 * args.prune
        for path in files(args.cache):
            if max(path.lstat().st_atime, path.lstat().st_mtime) < before:
                path.unlink(missing_ok=True)
    counts = {kind: measured(args.cache / kind) for kind in KINDS}
    total = sum(size for _, size in counts.values())
    lines = [f"{kind:<12} {size / 2**20:9.1f} MiB in {n} files" for kind, (n, size) in counts.items() if n]
    facts = {
        "cache": str(args.cache),
        "bytes": total,
        "kinds": {k: {"files": n, "bytes": s} for k, (n, s) in counts.items()},
    }
    show(args, facts, "\n".join([*lines, f"{'together':<12} {total / 2**20:9.1f} MiB in {args.cache}"]))
    return 0


def files(cache: Path) -> list[Path]:
    """The program's files in a cache, those it only links to included."""
    return [p for kind in KINDS for p in sorted((cache / kind).rglob("*")) if p.is_symlink() or p.is_file()]


def measured(folder: Path) -> tuple[int, int]:
    """How many files of its own a folder holds, and their bytes."""
    own = [p.stat().st_size for p in folder.rglob("*") if p.is_file() and not p.is_symlink()]
    return len(own), sum(own)

"""Open a recording in the Rerun viewer, or list the episodes of a run."""

from __future__ import annotations

import argparse
from pathlib import Path


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("run_folder", type=Path, metavar="RUN", help="a .rrd file, or a folder with episodes.jsonl")


def run(args: argparse.Namespace) -> int:
    import rerun as rr

    if args.run_folder.suffix == ".rrd":
        if not args.run_folder.exists():
            raise FileNotFoundError(f"{args.run_folder} does not exist; make one with `embodied demo` or `embodied rollout --rrd`")
        rr.init("embodied", spawn=True)
        rr.log_file_from_path(args.run_folder)
        return 0
    raise ValueError(f"{args.run_folder} is neither a .rrd file nor a run folder")

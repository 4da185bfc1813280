"""Parquet tables and a card, for `datasets.load_dataset`."""

from __future__ import annotations

from dataclasses import dataclass

from embodied.cli.common import show
from embodied.cli.exports import Export, OfData, register_export
from embodied.options import InputPath


@dataclass(frozen=True, kw_only=True)
class ParquetOptions(OfData):
    """Houses, tasks, routes and episodes as Parquet tables, with a data-set card."""

    episodes: tuple[InputPath, ...] = ()
    """Episodes (.jsonl) to write as tables, too."""


def run_parquet(args: ParquetOptions) -> None:
    from embodied.datasets.parquet import export_parquet
    from embodied.datasets.store import Dataset
    from embodied.locks import locked

    with locked(args.out):
        files = export_parquet(Dataset(args.data), args.out, args.episodes)
    show(args, {"files": len(files), "out": str(args.out)}, f"{len(files)} files in {args.out}; README.md is its card")


register_export(Export("parquet", ParquetOptions, run_parquet))

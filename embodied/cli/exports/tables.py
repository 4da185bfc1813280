"""Data sets as folders for published programs, as Parquet tables, and as questions for models of videos."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from embodied.agents.options import Encoded
from embodied.cli.common import note, show
from embodied.cli.exports import OfData, register_export
from embodied.datasets.folders import PROGRAMS
from embodied.options import Count, InputPath, Option

if TYPE_CHECKING:
    import numpy as np

    from embodied.datasets.store import Dataset

WIDTH = 2048
"""The length of a feature that the published programs are written for."""


@dataclass(frozen=True, kw_only=True)
class ProgramOptions(OfData, Encoded):
    """A folder to copy into the published program.

    `duet` is for VLN-DUET and HAMT, `r2r` for EnvDrop and Recurrent-VLN-BERT, too; `matterport` holds graphs and
    skyboxes for the Matterport3D simulator. README-embodied.md in the folder says which version, what goes where, and
    which lines a current PyTorch needs changed. `python -m embodied.mattersim` then runs the programs without a
    compiled simulator.
    """

    features: bool = False
    """Also write the features of `embodied features`."""
    pad: Count = WIDTH
    """Pad features with zeros to N numbers, the length that the programs expect."""


def run_program(program: str, args: ProgramOptions) -> None:
    from embodied.datasets.folders import export_folder
    from embodied.datasets.store import Dataset
    from embodied.locks import locked

    data = Dataset(args.data)
    features = feature_rows(data, args) if args.features else None
    if features is None and program != "matterport":
        note("no features are written; the program needs them: add --features")
    with locked(args.out):
        files = export_folder(program, data, args.out, features)
    facts = {"program": program, "files": len(files), "out": str(args.out), "readme": str(files[-1])}
    show(args, facts, f"{len(files)} files for {program} in {args.out}; read {files[-1].name} there")


def feature_rows(data: Dataset, args: ProgramOptions) -> Iterator[tuple[str, str, np.ndarray]]:
    """(house, viewpoint id, (36, D) features in our order) of every viewpoint, filled up to --pad.

    Raises:
      FileNotFoundError: a house has no features of this encoder.
      ValueError: features are longer than --pad.
    """
    import numpy as np

    from embodied.agents.vision.encoder import load_encoder
    from embodied.agents.vision.features import feature_path, load_features
    from embodied.agents.vision.run import pictures_of
    from embodied.datasets.folders import names_of

    encoder = load_encoder(args.encoder)
    drawn = {name: pictures_of(data, name, args.pictures) for name in names_of(data)}
    files = {name: feature_path(data.folder / "features", encoder.digest, name, how) for name, how in drawn.items()}

    def read(name: str) -> tuple[tuple[str, ...], np.ndarray]:
        place, pictures = data.place(name), drawn[name]
        features = load_features(files[name], encoder=encoder.digest, source=place.house.digest, pictures=pictures)
        n = features.shape[2]
        if n > args.pad:
            raise ValueError(f"{files[name]} holds features of {n} numbers, --pad is {args.pad}; raise it")
        return place.graph.ids, np.pad(features.astype(np.float32), ((0, 0), (0, 0), (0, args.pad - n)))

    for name in [n for n, file in files.items() if not file.exists()][:1] or list(files)[:1]:
        read(name)
    return ((name, key, rows) for name in files for key, rows in zip(*read(name), strict=True))


for _name in PROGRAMS:
    register_export(_name, ProgramOptions, functools.partial(run_program, _name))


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


register_export("parquet", ParquetOptions, run_parquet)


@dataclass(frozen=True, kw_only=True)
class VqaExportOptions(OfData):
    """Questions of `embodied dataset vqa` with videos or pictures of their walks, for other programs."""

    form: Annotated[str, Option(words=("vsi", "llava", "sat", "openeqa"))] = "vsi"
    """VSI-Bench's rows as Parquet, with scene facts and a task for lmms-eval (vsi), LLaVA's conversations (llava),
    SAT's rows of pictures (sat), or OpenEQA's questions with episode histories (openeqa)."""


def run_vqa(args: VqaExportOptions) -> None:
    """Write all splits."""
    from embodied.datasets.vqa.build import VqaData
    from embodied.datasets.vqa.formats import FORMATS

    data = VqaData(args.data)
    for split in data.about["counts"]:
        FORMATS[args.form](data, data.questions(split), args.out, split)
    show(args, {"out": str(args.out)}, f"questions as {args.form} in {args.out}")


register_export("vqa", VqaExportOptions, run_vqa)

"""Data sets as folders for published programs, as Parquet tables, and as questions for models of videos."""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from string import Template
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

    from embodied.agents.vision.drawn import pictures_of
    from embodied.agents.vision.encoder import load_encoder
    from embodied.agents.vision.features import feature_path, load_features
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


FPS = 4
"""Of a video."""


@dataclass(frozen=True, kw_only=True)
class VqaExportOptions(OfData):
    """Questions of `embodied dataset vqa` with videos of their walks, for other programs."""

    form: Annotated[str, Option(words=("vsi", "llava"))] = "vsi"
    """VSI-Bench's rows as Parquet, with a task for lmms-eval (vsi), or LLaVA's conversations (llava)."""


def run_vqa(args: VqaExportOptions) -> None:
    """Write <split>.parquet or .jsonl, the videos where VSI-Bench's scorer looks for them (HF_HOME is the folder), and
    lmms-eval's files."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from embodied.assets.cache import atomic_path, write_bytes
    from embodied.datasets.vqa.build import VqaData
    from embodied.datasets.vqa.types import TYPES

    data, videos = VqaData(args.data), Path("vsibench/embodied")
    readmes = Path(__file__).parents[2] / "datasets/readmes"
    names = ("id", "dataset", "scene_name", "question_type", "question", "options", "ground_truth")
    values = lambda q: (q.id, "embodied", q.walk, q.type, q.text, q.prompt.split("\n")[2:-1] or None, q.letter)
    turns = lambda q: [{"from": "human", "value": f"<image>\n{q.prompt}"}, {"from": "gpt", "value": q.letter}]
    about = lambda q: {"id": q.id, "video": f"{videos / q.walk}.mp4", "data_source": f"embodied {q.type}"}
    for split in data.about["counts"]:
        questions, facts = data.questions(split), {"FOLDER": args.out.resolve(), "SPLIT": split, "TYPES": [*TYPES]}
        for walk in sorted({q.walk for q in questions}):
            write_video(data.frames(walk), args.out / videos / f"{walk}.mp4")
        if args.form == "llava":
            lines = (json.dumps({**about(q), "conversations": turns(q)}) + "\n" for q in questions)
            write_bytes(args.out / f"{split}.jsonl", "".join(lines).encode())
            continue
        for file, name in (("lmms_task", f"embodied_vsi_{split}.yaml"), ("lmms_utils", "utils.py")):
            text = Template((readmes / f"{file}.txt").read_text(encoding="utf-8"))
            write_bytes(args.out / "lmms_eval" / name, text.substitute(facts).encode())
        with atomic_path(args.out / f"{split}.parquet") as temporary:
            pq.write_table(pa.Table.from_pylist([dict(zip(names, values(q))) for q in questions]), temporary)
    show(args, {"out": str(args.out)}, f"questions as {args.form} in {args.out}")


def write_video(frames: list[Path], path: Path) -> None:
    """Write pictures as MP4."""
    import av

    from embodied.assets.cache import atomic_path
    from embodied.datasets.vqa.walks import read_frame

    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary, av.open(str(temporary), "w", format="mp4") as container:
        pictures, stream = [read_frame(f) for f in frames], container.add_stream("libx264", rate=FPS)
        (stream.height, stream.width), stream.pix_fmt = pictures[0].shape[:2], "yuv420p"
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        container.mux(stream.encode())


register_export("vqa", VqaExportOptions, run_vqa)

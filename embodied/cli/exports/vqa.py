"""Questions about houses with videos of their walks, as VSI-Bench and LLaVA have them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Annotated

from embodied.cli.common import show
from embodied.cli.exports import Export, OfData, register_export
from embodied.options import Option

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

    data, videos, readmes = (
        VqaData(args.data),
        Path("vsibench/embodied"),
        Path(__file__).parents[2] / "datasets/readmes",
    )
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


register_export(Export("vqa", VqaExportOptions, run_vqa))

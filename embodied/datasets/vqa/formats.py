"""Questions in the formats of VSI-Bench, LLaVA, SAT and OpenEQA."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

import cv2
import numpy as np

from embodied.assets.cache import atomic_path, write_bytes
from embodied.datasets.vqa.build import VqaData
from embodied.datasets.vqa.scoring import VqaQuestion
from embodied.datasets.vqa.types import TYPES
from embodied.datasets.vqa.walks import read_frame
from embodied.geometry import rectangle, rotation
from embodied.house.house import House

FPS, PICTURES = 4, 8
"""Frames a second of a video; pictures of a row of SAT."""
VIDEOS = Path("vsibench/embodied")
"""Folder in which VSI-Bench's scorer looks for videos, if HF_HOME is what is written."""
READMES = Path(__file__).parents[1] / "readmes"
CATEGORIES = {
    "openness": "object state recognition",
    "change": "object state recognition",
    "visibility": "object recognition",
    **dict.fromkeys(("support", "containment", "person_room"), "object localization"),
}
"""OpenEQA's, by type; all others are spatial understanding."""
Questions = Sequence[VqaQuestion]


def write_vsi(data: VqaData, questions: Questions, out: Path, split: str) -> None:
    """<split>.parquet and meta_info_<split>.json of VSI-Bench, videos, and a task for lmms-eval."""
    write_videos(data, questions, out)
    names = ("id", "dataset", "scene_name", "question_type", "question", "options", "ground_truth")
    values = lambda q: (q.id, "embodied", q.walk, q.type, q.text, q.prompt.split("\n")[2:-1] or None, q.letter)
    write_parquet([dict(zip(names, values(q))) for q in questions], out / f"{split}.parquet")
    write_bytes(out / f"meta_info_{split}.json", json.dumps(scene_facts(data, questions)).encode())
    about = {"FOLDER": out.resolve(), "SPLIT": split, "TYPES": [*TYPES]}
    for file, name in (("lmms_task", f"embodied_vsi_{split}.yaml"), ("lmms_utils", "utils.py")):
        text = Template((READMES / f"{file}.txt").read_text(encoding="utf-8"))
        write_bytes(out / "lmms_eval" / name, text.substitute(about).encode())


def write_llava(data: VqaData, questions: Questions, out: Path, split: str) -> None:
    """<split>.jsonl of LLaVA's conversations, and videos."""
    write_videos(data, questions, out)
    turns = lambda q: [{"from": "human", "value": f"<image>\n{q.prompt}"}, {"from": "gpt", "value": q.letter}]
    about = lambda q: {"id": q.id, "video": f"{VIDEOS / q.walk}.mp4", "data_source": f"embodied {q.type}"}
    lines = (json.dumps({**about(q), "conversations": turns(q)}) + "\n" for q in questions)
    write_bytes(out / f"{split}.jsonl", "".join(lines).encode())


def write_sat(data: VqaData, questions: Questions, out: Path, split: str) -> None:
    """<split>.parquet of SAT: pictures of a walk, a question with answers to choose from, and the right one."""
    names = ("image_bytes", "question", "answers", "question_type", "correct_answer")
    pictures = {q.walk: [f.read_bytes() for f in data.frames(q.walk, PICTURES)] for q in questions}
    values = lambda q: (pictures[q.walk], q.text, q.options, q.type, q.answer)
    write_parquet([dict(zip(names, values(q))) for q in questions if q.options], out / f"{split}.parquet")


def write_openeqa(data: VqaData, questions: Questions, out: Path, split: str) -> None:
    """open-eqa-<split>.json of OpenEQA, and frames/<episode history>/NNNNN-rgb.png."""
    names = ("question", "answer", "category", "question_id", "episode_history")
    text = lambda q: f"{q.text} ({', '.join(q.options)})" if q.options else q.text
    kind = lambda q: CATEGORIES.get(q.type, "spatial understanding")
    rows = [dict(zip(names, (text(q), q.answer, kind(q), q.id, f"embodied/{q.walk}"))) for q in questions]
    for walk in sorted({q.walk for q in questions}):
        for k, file in enumerate(data.frames(walk)):
            png = cv2.imencode(".png", read_frame(file))[1].tobytes()
            write_bytes(out / f"frames/embodied/{walk}/{k:05d}-rgb.png", png)
    write_bytes(out / f"open-eqa-{split}.json", json.dumps(rows, indent=1).encode())


FORMATS: Mapping[str, Callable[[VqaData, Questions, Path, str], None]] = {
    f.__name__.removeprefix("write_"): f for f in (write_vsi, write_llava, write_sat, write_openeqa)
}


def scene_facts(data: VqaData, questions: Questions) -> dict[str, dict[str, Any]]:
    """VSI-Bench's meta_info by walk: floor in square metres, and counts and boxes of all objects by class, metres."""
    facts = {}
    for walk in sorted({q.walk for q in questions}):
        house = House.load(data.frames(walk)[0].parents[1] / "house.json")
        boxes: dict[str, list[dict[str, Any]]] = {}
        for p in house.placements:
            flat, low, high = rectangle(*p.position[:2], *p.size[:2], p.yaw), p.position[2], p.position[2] + p.size[2]
            axes = np.eye(3)
            axes[:2, :2] = rotation(p.yaw).T
            box = {"centroid": [*p.position[:2], (low + high) / 2], "axesLengths": p.size}
            box |= {"normalizedAxes": axes.ravel().tolist(), "min": [*np.min(flat, 0).tolist(), low]}
            boxes.setdefault(p.object_class, []).append(box | {"max": [*np.max(flat, 0).tolist(), high]})
        counts = {name: len(some) for name, some in boxes.items()}
        area = sum(house.floor(r).area for r in house.rooms)
        facts[walk] = {"room_size": area, "object_counts": counts, "object_bbox": boxes}
    return facts


def write_parquet(rows: list[dict[str, Any]], path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    with atomic_path(path) as temporary:
        pq.write_table(pa.Table.from_pylist(rows), temporary)


def write_videos(data: VqaData, questions: Questions, out: Path) -> None:
    """The walks as MP4."""
    import av

    for walk in sorted({q.walk for q in questions}):
        path, pictures = out / VIDEOS / f"{walk}.mp4", [read_frame(f) for f in data.frames(walk)]
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as temporary, av.open(str(temporary), "w", format="mp4") as container:
            stream = container.add_stream("libx264", rate=FPS)
            (stream.height, stream.width), stream.pix_fmt = pictures[0].shape[:2], "yuv420p"
            for picture in pictures:
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
            container.mux(stream.encode())

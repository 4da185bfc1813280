"""Episodes as a LeRobot data set of format v3.0, which `LeRobotDataset(NAME, root=FOLDER)` of Hugging Face reads.

  meta/info.json                          features, sizes, paths
  meta/stats.json                         least, most, mean, deviation and quantiles of every feature
  meta/tasks.parquet                      every instruction that was heard, by number
  meta/episodes/chunk-000/file-000.parquet    where an episode lies in tables and videos, and whose it is
  data/chunk-000/file-000.parquet         one row per step
  videos/observation.images.view/chunk-000/file-000.mp4    one frame per step, many episodes after one another

A frame is what the agent sees before it acts, cut from the panorama that the data set holds. The task of a step is
the instruction that it hears then, so that an assistant's words appear where they were said. Written from the
published description of the format (huggingface.co/docs/lerobot, LeRobotDataset v3.0).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from assets.cache import drafts, sweep, write_bytes, write_json
from embodied.datasets.checks import DatasetError
from embodied.geometry import wrap
from embodied.interface import Ask, Episode, Place, Pose, Step, Stop
from embodied.render.panorama import Panorama
from embodied.render.panorama_file import PanoramaFile

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset

VERSION = "v3.0"
FPS = 2
"""Steps per second: nothing happens between them, but the format counts seconds."""
CAMERA = "observation.images.view"
STATE = ("x", "y", "z", "yaw", "pitch")
"""observation.state: the pose before the action; metres in the house's frame, radians."""
ACTION = ("forward", "left", "up", "turn", "tilt", "ask", "stop")
"""action: how the pose changes in the agent's own frame (metres, radians, left positive); whether it asked, stopped."""
FILE_MB, CHUNK = 100, 1000
"""Size after which a new file is begun, and files in a chunk, as LeRobot has them."""
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
PATHS = {
    "data": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
    "video": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
}
COLUMNS: Mapping[str, tuple[pa.DataType, tuple[str, ...] | None]] = {
    "observation.state": (pa.list_(pa.float32(), len(STATE)), STATE),
    "action": (pa.list_(pa.float32(), len(ACTION)), ACTION),
    "next.done": (pa.bool_(), None),
    "next.success": (pa.bool_(), None),
    "timestamp": (pa.float32(), None),
    "frame_index": (pa.int64(), None),
    "episode_index": (pa.int64(), None),
    "index": (pa.int64(), None),
    "task_index": (pa.int64(), None),
}
"""Of one step: type, and names where it is a vector."""
DTYPES = {pa.float32(): "float32", pa.int64(): "int64", pa.bool_(): "bool"}


@dataclass(frozen=True)
class RecordedCamera:
    """How the agent's view is framed."""

    height: int = 224
    """Pixels; even, as videos want it."""
    width: int = 224
    vfov: float = math.radians(60.0)
    """Vertical field of view, radians."""

    def __post_init__(self) -> None:
        if self.height % 2 or self.width % 2 or min(self.height, self.width) < 16:
            raise ValueError(f"a video needs even sides of at least 16 pixels, got {self.height} x {self.width}")


def export_lerobot(
    data: Dataset,
    folder: Path,
    episodes: Iterable[Episode],
    *,
    succeeded: Callable[[Episode], bool],
    camera: RecordedCamera = RecordedCamera(),
) -> int:
    """Write episodes that were played in a data set's houses; returns how many steps they have.

    Args:
      folder: new or empty; it appears when it is whole.
      succeeded: whether an episode reached its goal (`next.success` of its last step).

    Raises:
      ValueError: the folder is not empty, there is no episode, or one of no step.
      DatasetError: an episode of another data set's house, or a house without pictures.
    """
    folder = Path(folder)
    if folder.exists() and any(folder.iterdir()):
        raise ValueError(f"{folder} is not empty; choose another folder for the LeRobot data set")
    folder.parent.mkdir(parents=True, exist_ok=True)
    sweep(folder.parent)
    with drafts(folder.parent) as private:
        draft = private / folder.name
        draft.mkdir()
        writer = _Writer(draft, camera)
        for episode in episodes:
            place = data.place_of(episode)
            writer.add(episode, place, _pictures(data, episode.task.world), succeeded)
        steps = writer.finish(data)
        if folder.exists():
            folder.rmdir()
        draft.rename(folder)
    return steps


def _pictures(data: Dataset, name: str) -> Path:
    if data.drawn_pictures(name) is None:
        raise DatasetError(
            f"{data.folder} has no pictures of {name!r}; draw them with `embodied dataset {data.kind} --out "
            f"{data.folder} ... --pictures fast`"
        )
    return data.folder / "houses" / name / "panoramas.pano"


def state(pose: Pose, place: Place) -> np.ndarray:
    """(5,) float32, STATE."""
    return np.array([*place.graph.positions[pose.node], pose.yaw, pose.pitch], np.float32)


def action(step: Step, place: Place) -> np.ndarray:
    """(7,) float32, ACTION: the next pose seen from this one."""
    before, after = (place.graph.positions[p.node] for p in (step.pose, step.next_pose))
    (dx, dy, dz), yaw = after - before, step.pose.yaw
    forward, left = dx * math.cos(yaw) + dy * math.sin(yaw), dy * math.cos(yaw) - dx * math.sin(yaw)
    turn, tilt = float(wrap(step.next_pose.yaw - yaw)), step.next_pose.pitch - step.pose.pitch
    asked, stopped = isinstance(step.action, Ask), isinstance(step.action, Stop)
    return np.array([forward, left, dz, turn, tilt, asked, stopped], np.float32)


class _Writer:
    """Owns the files of a data set that is being written."""

    def __init__(self, folder: Path, camera: RecordedCamera) -> None:
        self._folder, self._camera = folder, camera
        self._video = _Video(folder, camera)
        self._rows: list[dict[str, np.ndarray]] = []
        self._colours: list[np.ndarray] = []
        self._tasks: dict[str, int] = {}
        self._episodes: list[dict[str, Any]] = []
        self._steps = 0

    def add(self, episode: Episode, place: Place, pictures: Path, succeeded: Callable[[Episode], bool]) -> None:
        """One more episode."""
        n, number = len(episode.steps), len(self._episodes)
        if n == 0:
            raise ValueError(f"the episode of {episode.task.id!r} has no step; leave it out")
        done = np.arange(n) == n - 1
        rows = {
            "observation.state": np.stack([state(s.pose, place) for s in episode.steps]),
            "action": np.stack([action(s, place) for s in episode.steps]),
            "next.done": done,
            "next.success": done & succeeded(episode),
            "timestamp": (np.arange(n) / FPS).astype(np.float32),
            "frame_index": np.arange(n),
            "episode_index": np.full(n, number),
            "index": self._steps + np.arange(n),
            "task_index": np.array([self._tasks.setdefault(s.instruction, len(self._tasks)) for s in episode.steps]),
        }
        with PanoramaFile(pictures) as file:
            frames = [seen(file, s.pose, self._camera) for s in episode.steps]
        where, colours = self._video.add(frames), _colours(frames)
        numbers = {name: _statistics(np.asarray(rows[name], np.float64)) for name in COLUMNS}
        self._episodes.append(
            {
                "episode_index": number,
                "tasks": list(dict.fromkeys(s.instruction for s in episode.steps)),
                "length": n,
                "dataset_from_index": self._steps,
                "dataset_to_index": self._steps + n,
                "data/chunk_index": 0,
                "data/file_index": 0,
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
                **where,
                "embodied/task": episode.task.id,
                "embodied/house": episode.task.world,
                "embodied/agent": episode.agent,
                **_flat({**numbers, CAMERA: _statistics_of_colours(colours)}),
            }
        )
        self._rows.append(rows)
        self._colours.append(colours)
        self._steps += n

    def finish(self, data: Dataset) -> int:
        """Everything but the videos; returns the number of steps."""
        if not self._episodes:
            raise ValueError("there are no episodes to write; give files that hold some")
        self._video.close()
        rows = {name: np.concatenate([r[name] for r in self._rows]) for name in COLUMNS}
        table = pa.table({name: _column(rows[name], kind) for name, (kind, _) in COLUMNS.items()})
        _save(self._folder / PATHS["data"].format(chunk_index=0, file_index=0), table)
        numbers = {name: _statistics(np.asarray(rows[name], np.float64)) for name in COLUMNS}
        statistics = {**numbers, CAMERA: _statistics_of_colours(sum(self._colours[1:], self._colours[0]))}
        write_json(self._folder / "meta" / "stats.json", statistics, indent=1)
        _save(self._folder / "meta" / "tasks.parquet", _table_of_tasks(list(self._tasks)))
        _save(
            self._folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet", pa.Table.from_pylist(self._episodes)
        )
        write_json(self._folder / "meta" / "info.json", self._info(data), indent=1)
        write_bytes(self._folder / "README.md", _card(data, len(self._episodes), self._steps).encode())
        return self._steps

    def _info(self, data: Dataset) -> dict[str, Any]:
        features: dict[str, Any] = {CAMERA: self._video.feature()}
        for name, (kind, names) in COLUMNS.items():
            dtype = DTYPES[kind.value_type if names else kind]
            features[name] = {"dtype": dtype, "shape": [len(names)] if names else [1], "names": names and list(names)}
        return {
            "codebase_version": VERSION,
            "robot_type": f"embodied {data.kind}",
            "total_episodes": len(self._episodes),
            "total_frames": self._steps,
            "total_tasks": len(self._tasks),
            "chunks_size": CHUNK,
            "data_files_size_in_mb": FILE_MB,
            "video_files_size_in_mb": FILE_MB,
            "fps": FPS,
            "splits": {"train": f"0:{len(self._episodes)}"},
            "data_path": PATHS["data"],
            "video_path": PATHS["video"],
            "features": features,
        }


class _Video:
    """Owns the video file that is being written; episodes stand in it one after another."""

    def __init__(self, folder: Path, camera: RecordedCamera) -> None:
        self._folder, self._camera = folder, camera
        self._number = -1
        self._container: Any = None
        self._frames = 0

    def add(self, frames: Sequence[np.ndarray]) -> dict[str, Any]:
        """Append frames, (h, w, 3) uint8 each; returns where they lie, as the table of episodes says it."""
        if self._container is None or self._path().stat().st_size > FILE_MB * 2**20:
            self._begin()
        start = self._frames
        for rgb in frames:
            frame = av.VideoFrame.from_ndarray(rgb, "rgb24")
            frame.pts, frame.time_base = self._frames, Fraction(1, FPS)
            for packet in self._stream.encode(frame):
                self._container.mux(packet)
            self._frames += 1
        return {
            f"videos/{CAMERA}/chunk_index": self._number // CHUNK,
            f"videos/{CAMERA}/file_index": self._number % CHUNK,
            f"videos/{CAMERA}/from_timestamp": start / FPS,
            f"videos/{CAMERA}/to_timestamp": self._frames / FPS,
        }

    def close(self) -> None:
        if self._container is not None:
            for packet in self._stream.encode():
                self._container.mux(packet)
            self._container.close()
            self._container = None

    def feature(self) -> dict[str, Any]:
        """What info.json says of the pictures."""
        c = self._camera
        facts = {"height": c.height, "width": c.width, "codec": "h264", "pix_fmt": "yuv420p", "is_depth_map": False}
        facts |= {"fps": FPS, "channels": 3}
        info = {**{f"video.{k}": v for k, v in facts.items()}, "has_audio": False}
        names = ["height", "width", "channels"]
        return {"dtype": "video", "shape": [c.height, c.width, 3], "names": names, "info": info}

    def _path(self) -> Path:
        chunk, file = divmod(self._number, CHUNK)
        return self._folder / PATHS["video"].format(video_key=CAMERA, chunk_index=chunk, file_index=file)

    def _begin(self) -> None:
        self.close()
        self._number, self._frames = self._number + 1, 0
        self._path().parent.mkdir(parents=True, exist_ok=True)
        self._container = av.open(str(self._path()), "w")
        # a key frame every second one, so that any step is decoded at once; no frames out of order
        self._stream = self._container.add_stream("libx264", rate=FPS, options={"crf": "18", "g": "2", "bf": "0"})
        self._stream.width, self._stream.height, self._stream.pix_fmt = (
            self._camera.width,
            self._camera.height,
            "yuv420p",
        )


def seen(file: PanoramaFile, pose: Pose, camera: RecordedCamera) -> np.ndarray:
    """(h, w, 3) uint8: what an agent at `pose` has before its eyes."""
    colours_only = Panorama(file.rgb(pose.node), *(np.empty((6, file.size, 0)),) * 2)
    return colours_only.view_rgb(pose.yaw, pose.pitch, camera.vfov, (camera.height, camera.width))


def _column(values: np.ndarray, kind: pa.DataType) -> pa.Array:
    """(n,) or (n, k) values as an Arrow array."""
    if values.ndim == 1:
        return pa.array(values, kind)
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel(), kind.value_type), values.shape[1])


def _save(path: Path, table: pa.Table) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path, compression="snappy")


def _table_of_tasks(tasks: Sequence[str]) -> pa.Table:
    """Instructions by number; for pandas the words are the index, as LeRobot looks them up."""
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks, pa.string())})
    column = lambda name, kind, numpy: {
        "name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None,
    }  # fmt: skip
    index = {"name": None, "field_name": None, "pandas_type": "unicode", "numpy_type": "object", "metadata": None}
    about = {
        "index_columns": ["task"],
        "column_indexes": [index],
        "columns": [column("task_index", "int64", "int64"), column("task", "unicode", "object")],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.2.0",
    }
    return table.replace_schema_metadata({b"pandas": json.dumps(about).encode()})


# Statistics ---------------------------------------------------------------------------------------


def _statistics(values: np.ndarray) -> dict[str, list]:
    """Of (n,) or (n, k) values: per number of a vector."""
    values = values.reshape(len(values), -1)
    found = {"min": values.min(0), "max": values.max(0), "mean": values.mean(0), "std": values.std(0)}
    found |= {name: np.quantile(values, q, axis=0) for name, q in QUANTILES.items()}
    return {**{name: v.tolist() for name, v in found.items()}, "count": [len(values)]}


def _colours(frames: Sequence[np.ndarray]) -> np.ndarray:
    """(4, 256) int64: how often each value of red, green and blue occurs; at the start of row 3, how many frames."""
    counts = [np.bincount(np.stack([f[..., c] for f in frames]).ravel(), minlength=256) for c in range(3)]
    return np.stack([*counts, np.eye(1, 256, dtype=np.int64)[0] * len(frames)])


def _statistics_of_colours(counts: np.ndarray) -> dict[str, list]:
    """Of what `_colours` counted: values in [0, 1], shaped (3, 1, 1)."""
    colours, values = counts[:3], np.arange(256) / 255.0
    total = colours.sum(1)
    mean = colours @ values / total
    deviation = np.sqrt(np.maximum(colours @ values**2 / total - mean**2, 0.0))
    share = np.cumsum(colours, axis=1) / total[:, None]
    at = lambda q: values[(share >= q).argmax(1)]
    found = {"min": at(1e-12), "max": values[255 - (colours[:, ::-1] > 0).argmax(1)], "mean": mean, "std": deviation}
    found |= {name: at(q) for name, q in QUANTILES.items()}
    return {**{name: v.reshape(3, 1, 1).tolist() for name, v in found.items()}, "count": [int(counts[3, 0])]}


def _flat(statistics: Mapping[str, Mapping[str, list]]) -> dict[str, list]:
    return {f"stats/{name}/{what}": v for name, found in statistics.items() for what, v in found.items()}


def _card(data: Dataset, episodes: int, steps: int) -> str:
    return f"""---
license: apache-2.0
task_categories:
- robotics
tags:
- LeRobot
configs:
- config_name: default
  data_files: data/*/*.parquet
---

{episodes} episodes ({steps} steps) of agents in generated, lit houses: {data.kind} tasks of the data set
{data.digest[:16]} (seed {data.config.seed}), written by `embodied export lerobot`.

LeRobotDataset {VERSION}, {FPS} frames a "second": a frame is what the agent sees before a step
(`{CAMERA}`), `observation.state` its pose ({", ".join(STATE)}; metres and
radians, z up), `action` how the pose changes in its own frame
({", ".join(ACTION)}), the task of a frame the instruction that
it hears at that moment. `meta/episodes` says which task, house and agent.
"""

"""Episodes as a LeRobot data set of format v3.0, which `LeRobotDataset(NAME, root=FOLDER)` of Hugging Face reads.

  meta/info.json                          features, sizes, paths
  meta/stats.json                         least, most, mean, deviation and quantiles of every feature
  meta/tasks.parquet                      every instruction that was heard, by number
  meta/episodes/chunk-000/file-000.parquet    where an episode lies in tables and videos, and whose it is
  data/chunk-000/file-000.parquet         one row per step
  videos/observation.images.view/chunk-000/file-000.mp4    one frame per step, many episodes after one another

A frame is what the agent sees before it acts, cut from the panorama that the data set holds. The task of a step is the
instruction that it hears then, so that an assistant's words appear where they were said; they are events of the frame,
too (`language_events`). HARI's descriptions of places are put into words. Depth is a video of 12 bits, as LeRobot 0.6
quantises it. Written from the published description of the format (huggingface.co/docs/lerobot, LeRobotDataset v3.0).
"""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from embodied.action_spaces import doors_in
from embodied.assets.cache import default_cache, write_bytes, write_json
from embodied.assets.catalogue import load_catalogue
from embodied.assistants.descriptions import described
from embodied.datasets.build import whole_folder
from embodied.datasets.checks import DatasetError
from embodied.datasets.folders import filled
from embodied.geometry import wrap
from embodied.interface import Ask, Close, Episode, Intention, Mode, Open, Place, Pose, Step, Stop
from embodied.navigation.doors import place_named, seen_name
from embodied.render.panorama import Panorama
from embodied.render.panorama_file import PanoramaFile

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset

VERSION = "v3.0"
FPS = 2
"""Steps per second: nothing happens between them, but the format counts seconds."""
CAMERA = "observation.images.view"
DEPTH = "observation.images.depth"
EVENTS = "language_events"
CALLS = pa.field("tool_calls", pa.list_(pa.json_() if hasattr(pa, "json_") else pa.string()))
TEXTS = [pa.field(name, pa.string(), nullable=name != "role") for name in ("role", "content", "style", "camera")]
EVENT = pa.struct([*TEXTS, CALLS])
"""Words at a frame: an assistant's are an 'interjection'."""
NEAREST, FARTHEST, SHIFT, CODES = 0.01, 10.0, 3.5, 4095
"""Depth videos: metres of the least and the largest code, metres added before the logarithm, the largest code."""
RECORDED_VFOV = math.radians(60.0)
"""Vertical field of view, radians."""
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
Columns = Mapping[str, tuple[pa.DataType, tuple[str, ...] | None]]
STEP_COLUMNS: Columns = {
    "observation.state": (pa.list_(pa.float32(), len(STATE)), STATE),
    "action": (pa.list_(pa.float32(), len(ACTION)), ACTION),
    **dict.fromkeys(("next.done", "next.success"), (pa.bool_(), None)),
    "timestamp": (pa.float32(), None),
    **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), (pa.int64(), None)),
}
"""Of one step: type, and names where it is a vector."""
MOST_CANDIDATES = 24
"""Candidates that a row has room for; graphs of houses have at most a dozen neighbours at a node."""
GRAPH_COLUMNS: Columns = {
    **STEP_COLUMNS,
    "candidates": (
        pa.list_(pa.float32(), 3 * MOST_CANDIDATES),
        tuple(f"{axis}_{k}" for k in range(MOST_CANDIDATES) for axis in ("forward", "left", "up")),
    ),
    "candidate": (pa.int64(), None),
}
"""Besides, of walks on a graph: where the agent can go, in its own frame (metres, zero behind the last), and which it
chose, or opened, -1 for none. By their names LeRobot takes them for neither observations nor actions of a policy."""
DTYPES = {pa.float32(): "float32", pa.int64(): "int64", pa.bool_(): "bool"}


def export_lerobot(
    data: Dataset,
    folder: Path,
    episodes: Iterable[Episode],
    *,
    succeeded: Callable[[Episode], bool],
    size: tuple[int, int] = (224, 224),
    depth: bool = False,
) -> int:
    """Write episodes that were played in a data set's houses; returns how many steps they have.

    Args:
      folder: new or empty; it appears when it is whole.
      succeeded: whether an episode reached its goal (`next.success` of its last step).
      size: height and width of the pictures, both even.
      depth: also write videos of depth.

    Raises:
      ValueError: the folder is not empty, there is no episode, one of no step, or a video cannot have this size.
      DatasetError: an episode of another data set's house, or a house without pictures.
    """
    names = (*ACTION, "open", "close") if data.task_kind.opens_doors else ACTION
    columns: Columns = {**GRAPH_COLUMNS, "action": (pa.list_(pa.float32(), len(names)), names)}
    with whole_folder(folder) as draft:
        writer = Writer(draft, size, columns, depth=depth)
        for episode in episodes:
            _add(writer, episode, data, len(names), succeeded)
        return writer.finish(f"embodied {data.kind}", "lerobot", data)


def _panoramas(data: Dataset, episode: Episode) -> Iterator[Panorama]:
    """Panoramas that were seen at each step, doors and furniture as they were."""
    name, place = episode.task.world, data.place_of(episode)
    if (drawn := data.drawn_pictures(name)) is None:
        raise DatasetError(
            f"{data.folder} has no pictures of {name!r}; draw them with `embodied dataset {data.kind} --out "
            f"{data.folder} ... --pictures fast`"
        )
    world = functools.cache(lambda: data.open_world(name, load_catalogue(), default_cache(), drawn))
    with PanoramaFile(data.panoramas(name)) as file:
        for node, (closed, _) in zip(episode.nodes, doors_in(episode, place.graph)):
            seen = seen_name(place.house, place.graph, node, closed)
            yield file.read(node) if seen == name else place_named({name: world()}, seen).panorama(node)


def state(pose: Pose, place: Place) -> np.ndarray:
    """(5,) float32, STATE."""
    return np.array([*place.graph.positions[pose.node], pose.yaw, pose.pitch], np.float32)


def action(step: Step, place: Place) -> np.ndarray:
    """(9,) float32, ACTION, the next pose seen from this one, and whether it opened or closed something."""
    yaw, pitch = step.next_pose.yaw - step.pose.yaw, step.next_pose.pitch - step.pose.pitch
    moved = offsets(step.pose, (step.next_pose.node,), place)[0]
    did = [isinstance(step.action, kind) for kind in (Ask, Stop, Open, Close)]
    return np.array([*moved, float(wrap(yaw)), pitch, *did], np.float32)


def offsets(pose: Pose, nodes: Sequence[int], place: Place) -> np.ndarray:
    """(n, 3) metres ahead, to the left and up, from a pose to nodes."""
    positions = place.graph.positions
    dx, dy, dz = (positions[list(nodes)] - positions[pose.node]).T
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    return np.stack([dx * cos + dy * sin, dy * cos - dx * sin, dz], 1)


def candidates(step: Step, place: Place) -> np.ndarray:
    """(3 MOST_CANDIDATES,) float32, as GRAPH_COLUMNS.

    Raises:
      ValueError: more than MOST_CANDIDATES candidates.
    """
    offsets_of_all, nodes = np.zeros((MOST_CANDIDATES, 3), np.float32), step.candidate_nodes
    if len(nodes) > MOST_CANDIDATES:
        raise ValueError(f"a step has {len(nodes)} candidates; a LeRobot data set has room for {MOST_CANDIDATES}")
    if nodes:
        offsets_of_all[: len(nodes)] = offsets(step.pose, nodes, place)
    return offsets_of_all.ravel()


def _add(writer: Writer, episode: Episode, data: Dataset, actions: int, succeeded: Callable[[Episode], bool]) -> None:
    """One more episode, with so many numbers of its actions."""
    if not episode.steps:
        raise ValueError(f"the episode of {episode.task.id!r} has no step; leave it out")
    place = data.place_of(episode)
    rows = {
        "observation.state": np.stack([state(s.pose, place) for s in episode.steps]),
        "action": np.stack([action(s, place)[:actions] for s in episode.steps]),
        "candidates": np.stack([candidates(s, place) for s in episode.steps]),
        "candidate": np.array([getattr(s.action, "candidate", -1) for s in episode.steps]),
    }
    frames, depths = list[np.ndarray](), list[np.ndarray]()
    for s, panorama in zip(episode.steps, _panoramas(data, episode), strict=True):
        frames.append(panorama.view_rgb(*(how := (s.pose.yaw, s.pose.pitch, RECORDED_VFOV, writer.size))))
        depths += [panorama.view(*how)[1].astype(np.float32)] if writer.depth else []
    words, replies = spoken(episode.steps)
    facts = {"embodied/task": episode.task.id, "embodied/house": episode.task.world, "embodied/agent": episode.agent}
    writer.add(rows, frames, depths, words, replies, succeeded(episode), facts)


def spoken(steps: Sequence[Step]) -> tuple[list[str], list[str]]:
    """Words that say what to do at each step, and an assistant's words there, '' for none."""
    words, replies, nearer = [], [], ""
    for s in steps:
        nearer = nearer if s.mode is Mode.SUB else ""
        words.append(nearer or s.instruction)
        replies.append((s.reply and s.reply.text) or "")
        if s.reply and s.reply.description:
            replies[-1] = described(s.reply.description, s.pose if s.reply.intention is Intention.CUR else None)
            nearer = replies[-1] if s.reply.intention is Intention.SUB else nearer
    return words, replies


class Writer:
    """Owns the files of a data set that is being written."""

    def __init__(
        self,
        folder: Path,
        size: tuple[int, int],
        columns: Columns = STEP_COLUMNS,
        *,
        key: str = CAMERA,
        fps: int = FPS,
        depth: bool = False,
    ) -> None:
        if size[0] % 2 or size[1] % 2 or min(size) < 16:
            raise ValueError(f"a video needs even sides of at least 16 pixels, got {size[0]} x {size[1]}")
        self._folder, self._columns, self._fps = folder, columns, fps
        self.size, self.depth = size, depth
        self._videos = [_Video(folder, size, key, fps)]
        if depth:
            self._videos.append(_Video(folder, size, DEPTH, fps, depth=True))
        self._rows: list[dict[str, np.ndarray]] = []
        self._said: list[str] = []
        self._counts: list[Any] = [0 for _ in self._videos]
        self._tasks: dict[str, int] = {}
        self._episodes: list[dict[str, Any]] = []
        self._steps = 0

    def add(
        self,
        rows: Mapping[str, np.ndarray],
        frames: Sequence[np.ndarray],
        depths: Sequence[np.ndarray],
        words: Sequence[str],
        replies: Sequence[str],
        success: bool,
        facts: Mapping[str, Any],
    ) -> None:
        """One more episode of n steps.

        Args:
          rows: the columns that are not LeRobot's own, (n, k) each.
          frames, depths: (h, w, 3) uint8; (h, w) float32 metres, where depth is written.
          words: what the agent is to do, by step.
          replies: an assistant's words by step; '' for none.
          facts: columns of its row in the table of episodes.
        """
        n, number = len(words), len(self._episodes)
        done = np.arange(n) == n - 1
        whole = {
            **rows,
            "next.done": done,
            "next.success": done & success,
            "timestamp": (np.arange(n) / self._fps).astype(np.float32),
            "frame_index": np.arange(n),
            "episode_index": np.full(n, number),
            "index": self._steps + np.arange(n),
            "task_index": np.array([self._tasks.setdefault(text, len(self._tasks)) for text in words]),
        }
        where: dict[str, Any] = {}
        numbers = {name: _statistics(np.asarray(whole[name], np.float64)) for name in self._columns}
        for k, (video, pictures) in enumerate(zip(self._videos, (frames, depths), strict=False)):
            where |= video.add(pictures)
            counts = _histogram(pictures, video.depth)
            numbers[video.key] = _statistics_of_counts(counts, n, video.depth)
            self._counts[k] += counts
        row = {"episode_index": number, "tasks": list(dict.fromkeys(words)), "length": n}
        row |= {"dataset_from_index": self._steps, "dataset_to_index": self._steps + n}
        row |= {f"{part}/{index}": 0 for part in ("data", "meta/episodes") for index in ("chunk_index", "file_index")}
        stats = {f"stats/{name}/{what}": v for name, values in numbers.items() for what, v in values.items()}
        self._episodes.append({**row, **where, **facts, **stats})
        self._rows.append(whole)
        self._said += replies
        self._steps += n

    def finish(self, robot: str, card: str, data: Dataset | None = None) -> int:
        """Everything but the videos; returns the number of steps.

        Args:
          robot: who moves.
          card: name of the text of README.md in readmes/, of which some speak of `data`.
        """
        if not self._episodes:
            raise ValueError("there are no episodes to write; give files that hold some")
        rows = {name: np.concatenate([r[name] for r in self._rows]) for name in self._columns}
        columns = {name: pa.array([*rows[name]], kind) for name, (kind, _) in self._columns.items()}
        table = pa.table({**columns, EVENTS: _events(self._said)})
        _save(self._folder / PATHS["data"].format(chunk_index=0, file_index=0), table)
        statistics = {name: _statistics(np.asarray(rows[name], np.float64)) for name in self._columns}
        for video, counts in zip(self._videos, self._counts, strict=True):
            video.close()
            statistics[video.key] = _statistics_of_counts(counts, self._steps, video.depth)
        write_json(self._folder / "meta" / "stats.json", statistics, indent=1)
        _save(self._folder / "meta" / "tasks.parquet", _table_of_tasks(list(self._tasks)))
        table = pa.Table.from_pylist(self._episodes)
        _save(self._folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet", table)
        write_json(self._folder / "meta" / "info.json", self._info(robot), indent=1)
        counted = f"{len(self._episodes)} episodes ({self._steps} steps)"
        write_bytes(self._folder / "README.md", filled(card, data, COUNT=counted).encode())
        return self._steps

    def _info(self, robot: str) -> dict[str, Any]:
        features: dict[str, Any] = {video.key: video.feature() for video in self._videos}
        for name, (kind, names) in self._columns.items():
            dtype = DTYPES[kind.value_type if names else kind]
            features[name] = {"dtype": dtype, "shape": [len(names)] if names else [1], "names": names and list(names)}
        features[EVENTS] = {"dtype": "language", "shape": [1], "names": None}
        episodes, size = len(self._episodes), {"data_files_size_in_mb": FILE_MB, "video_files_size_in_mb": FILE_MB}
        about = {"codebase_version": VERSION, "robot_type": robot, "total_episodes": episodes}
        about |= {"total_frames": self._steps, "total_tasks": len(self._tasks), "chunks_size": CHUNK, **size}
        about |= {"fps": self._fps, "splits": {"train": f"0:{episodes}"}}
        return {**about, "data_path": PATHS["data"], "video_path": PATHS["video"], "features": features}


def _events(replies: Sequence[str]) -> pa.Array:
    """A list of EVENT for each step: what an assistant says there, '' for nothing."""
    texts = [text for text in replies if text]
    n = len(texts)
    kinds = [EVENT.field(k) for k in range(EVENT.num_fields)]
    words = [pa.array(["assistant"] * n, pa.string()), pa.array(texts, pa.string())]
    words += [pa.array(["interjection"] * n, pa.string()), *(pa.nulls(n, k.type) for k in kinds[3:])]
    ends = np.cumsum([0, *(bool(text) for text in replies)])
    return pa.ListArray.from_arrays(pa.array(ends, pa.int32()), pa.StructArray.from_arrays(words, fields=kinds))


class _Video:
    """Owns the video file that is being written; episodes stand in it one after another."""

    def __init__(self, folder: Path, size: tuple[int, int], key: str, fps: int, *, depth: bool = False) -> None:
        self._folder, self._size, self._fps = folder, size, fps
        self.key, self.depth = key, depth
        self._number = -1
        self._container: Any = None
        self._frames = 0

    def add(self, frames: Sequence[np.ndarray]) -> dict[str, Any]:
        """Append frames, (h, w, 3) uint8 or metres; returns where they lie, as the table of episodes says it."""
        path = self._path()  # not there until the encoder lets go of the first frames
        if self._container is None or (path.exists() and path.stat().st_size > FILE_MB * 2**20):
            self._begin()
        start = self._frames
        for picture in frames:
            if self.depth:
                frame = av.VideoFrame.from_ndarray(depth_codes(picture), "gray12le")
            else:
                frame = av.VideoFrame.from_ndarray(picture, "rgb24")
            frame.pts, frame.time_base = self._frames, Fraction(1, self._fps)
            self._container.mux(self._stream.encode(frame))
            self._frames += 1
        return {
            f"videos/{self.key}/chunk_index": self._number // CHUNK,
            f"videos/{self.key}/file_index": self._number % CHUNK,
            f"videos/{self.key}/from_timestamp": start / self._fps,
            f"videos/{self.key}/to_timestamp": self._frames / self._fps,
        }

    def close(self) -> None:
        if self._container is not None:
            self._container.mux(self._stream.encode())
            self._container.close()
            self._container = None

    def feature(self) -> dict[str, Any]:
        """The description of the pictures in info.json."""
        codec, pixels, channels = ("hevc", "gray12le", 1) if self.depth else ("h264", "yuv420p", 3)
        height, width = self._size
        facts: dict[str, Any] = {"height": height, "width": width, "codec": codec, "pix_fmt": pixels}
        facts |= {"fps": self._fps, "channels": channels}
        if self.depth:
            facts |= {"depth_min": NEAREST, "depth_max": FARTHEST, "shift": SHIFT, "use_log": True}
        info = {**{f"video.{k}": v for k, v in facts.items()}, "is_depth_map": self.depth, "has_audio": False}
        if self.depth:
            info["depth_unit"] = "mm"
        names = ["height", "width", "channels"]
        return {"dtype": "video", "shape": [height, width, channels], "names": names, "info": info}

    def _path(self) -> Path:
        chunk, file = divmod(self._number, CHUNK)
        return self._folder / PATHS["video"].format(video_key=self.key, chunk_index=chunk, file_index=file)

    def _begin(self) -> None:
        self.close()
        self._number, self._frames = self._number + 1, 0
        self._path().parent.mkdir(parents=True, exist_ok=True)
        self._container = av.open(str(self._path()), "w")
        # a key frame every second one, so that any step is decoded at once; no frames out of order
        colours = "libx264", "yuv420p", {"crf": "18", "g": "2", "bf": "0"}
        metres = "hevc", "gray12le", {"x265-params": "lossless=1:keyint=2:bframes=0:log-level=error"}
        codec, pixels, options = metres if self.depth else colours
        self._stream = self._container.add_stream(codec, rate=self._fps, options=options)
        (self._stream.height, self._stream.width), self._stream.pix_fmt = self._size, pixels


def depth_codes(metres: np.ndarray) -> np.ndarray:
    """(h, w) uint16 of 12 bits: depth on a logarithmic scale, near things finer, as LeRobot 0.6 decodes it."""
    low, high = math.log(NEAREST + SHIFT), math.log(FARTHEST + SHIFT)
    clipped = np.clip(metres, NEAREST, FARTHEST)
    return np.rint((np.log(clipped + SHIFT) - low) / (high - low) * CODES).astype(np.uint16)


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


def _statistics(values: np.ndarray) -> dict[str, list]:
    """Of (n,) or (n, k) values: per number of a vector."""
    values = values.reshape(len(values), -1)
    numbers = {"min": values.min(0), "max": values.max(0), "mean": values.mean(0), "std": values.std(0)}
    numbers |= {name: np.quantile(values, q, axis=0) for name, q in QUANTILES.items()}
    return {**{name: v.tolist() for name, v in numbers.items()}, "count": [len(values)]}


def _histogram(pictures: Sequence[np.ndarray], depth: bool) -> np.ndarray:
    """(channels, bins) int64: how often each value of red, green and blue occurs, or each millimetre of depth."""
    values, bins = np.stack(pictures), 256
    if depth:
        values, bins = np.rint(1000 * np.clip(values, NEAREST, FARTHEST))[..., None], round(1000 * FARTHEST) + 1
    channels = np.moveaxis(values, -1, 0).astype(np.int64 if depth else np.uint8)
    return np.stack([np.bincount(c.ravel(), minlength=bins) for c in channels])


def _statistics_of_counts(shown: np.ndarray, frames: int, depth: bool) -> dict[str, list]:
    """Of `_histogram`s of so many frames: values in [0, 1] or millimetres, shaped (channels, 1, 1)."""
    values = np.arange(shown.shape[1]) / (1.0 if depth else 255.0)
    total = shown.sum(1)
    mean = shown @ values / total
    deviation = np.sqrt(np.maximum(shown @ values**2 / total - mean**2, 0.0))
    share = np.cumsum(shown, axis=1) / total[:, None]
    at = lambda q: values[(share >= q).argmax(1)]
    last = shown.shape[1] - 1 - (shown[:, ::-1] > 0).argmax(1)
    numbers = {"min": at(1e-12), "max": values[last], "mean": mean, "std": deviation}
    numbers |= {name: at(q) for name, q in QUANTILES.items()}
    return {**{name: v.reshape(-1, 1, 1).tolist() for name, v in numbers.items()}, "count": [frames]}

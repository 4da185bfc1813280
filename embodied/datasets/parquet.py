"""A data set as Parquet tables with a card, which `datasets.load_dataset(FOLDER, "tasks")` of Hugging Face reads.

  houses/<split>.parquet     one row per house: name, digest, rooms, objects, its JSON and its navigation graph
  tasks/<split>.parquet      one row per task, its record as JSON beside the columns
  routes/<split>.parquet     one row per route that an assistant may describe
  episodes/<name>.parquet    one row per episode of the files that are given
  README.md                  the card: what it is, how large, how made, its fields, what it is not

The column `record` holds the record as embodied.records writes it, so that nothing is lost.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from embodied.assets.cache import atomic_path, write_bytes
from embodied.datasets.checks import DatasetError
from embodied.datasets.folders import filled
from embodied.interface import Ask, Close, Episode, Move, Open
from embodied.records import load_lines, to_json

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset

TEXT, WHOLE, REAL = pa.string(), pa.int32(), pa.float64()
NODES = pa.list_(WHOLE)
Columns = Mapping[str, tuple[pa.DataType, Callable[..., object]]]
"""Name to type, and how a row's value is read."""
HOUSES: Columns = {
    "name": (TEXT, lambda p: p.house.name),
    "digest": (TEXT, lambda p: p.house.digest),
    "area_m2": (REAL, lambda p: round(float(p.house.area), 2)),
    "storeys": (WHOLE, lambda p: len(p.house.storeys)),
    "rooms": (pa.list_(TEXT), lambda p: [r.kind for r in p.house.rooms]),
    "objects": (pa.list_(TEXT), lambda p: [x.object_class for x in p.house.placements]),
    "viewpoints": (pa.list_(TEXT), lambda p: list(p.graph.ids)),
    "room_of_viewpoint": (pa.list_(TEXT), lambda p: [p.house.room_by_id[r].kind for r in p.graph.room_of_node]),
    "positions": (pa.list_(pa.list_(REAL)), lambda p: np.asarray(p.graph.positions).tolist()),
    "edges": (pa.list_(NODES), lambda p: np.asarray(p.graph.edges).tolist()),
    "record": (TEXT, lambda p: p.house.to_json()),
}
"""Of a place."""
TASKS: Columns = {
    "id": (TEXT, lambda t, p: t.id),
    "kind": (TEXT, lambda t, p: t.kind),
    "house": (TEXT, lambda t, p: t.world),
    "request": (TEXT, lambda t, p: t.request),
    "start_node": (WHOLE, lambda t, p: t.start.node),
    "start_turn": (WHOLE, lambda t, p: t.start.turn),
    "start_tilt": (WHOLE, lambda t, p: t.start.tilt),
    "object_class": (TEXT, lambda t, p: getattr(t.goal, "object_class", None)),
    "room_kind": (TEXT, lambda t, p: getattr(t.goal, "room_kind", None)),
    "placements": (pa.list_(TEXT), lambda t, p: getattr(t.goal, "placements", None)),
    "route": (TEXT, lambda t, p: getattr(t.goal, "route", None)),
    "path": (NODES, lambda t, p: getattr(t.goal, "path", None)),
    "goal_nodes": (NODES, lambda t, p: list(t.goal_nodes)),
    "shortest_m": (REAL, lambda t, p: float(min(p.graph.distance[t.start.node, g] for g in t.goal_nodes))),
    "radius": (REAL, lambda t, p: t.radius),
    "horizon": (WHOLE, lambda t, p: t.horizon),
    "budget": (REAL, lambda t, p: t.budget),
    "record": (TEXT, lambda t, p: to_json(t)),
}
"""Of a task and its place; what its goal does not have is null."""
ROUTES: Columns = {
    "id": (TEXT, lambda r, house: r.id),
    "house": (TEXT, lambda r, house: house),
    "path": (NODES, lambda r, house: list(r.path)),
    "turn": (WHOLE, lambda r, house: r.turn),
    "tilt": (WHOLE, lambda r, house: r.tilt),
    "instruction": (TEXT, lambda r, house: r.instruction),
    "heard_in": (TEXT, lambda r, house: r.split),
    "record": (TEXT, lambda r, house: to_json(r)),
}
"""Of a route and the name of its house."""
EPISODES: Columns = {
    "task": (TEXT, lambda e: e.task.id),
    "house": (TEXT, lambda e: e.task.world),
    "agent": (TEXT, lambda e: e.agent),
    "seed": (pa.int64(), lambda e: e.seed),
    "ended": (TEXT, lambda e: e.ended),
    "nodes": (NODES, lambda e: list(e.nodes)),
    "actions": (pa.list_(TEXT), lambda e: [_said(s.action) for s in e.steps]),
    "instructions": (pa.list_(TEXT), lambda e: [s.instruction for s in e.steps]),
    "replies": (pa.list_(TEXT), lambda e: [(s.reply.text or "") if s.reply else "" for s in e.steps]),
    "requests": (WHOLE, lambda e: e.requests),
    "record": (TEXT, lambda e: to_json(e)),
}
"""Of an episode."""
PARQUET_TABLES: Mapping[str, Columns] = {"houses": HOUSES, "tasks": TASKS, "routes": ROUTES, "episodes": EPISODES}
ROW_GROUP = 1000
"""Rows of a row group."""


def export_parquet(data: Dataset, folder: Path, episodes: Sequence[Path] = ()) -> list[Path]:
    """Write a data set, and episodes played in it, as Parquet with a card; returns the files.

    Args:
      episodes: files of episodes (JSON Lines), each a table of its own name.

    Raises:
      RecordError: a file that does not hold episodes.
      DatasetError: episodes that were played elsewhere.
      ValueError: two files that would become one table.
    """
    folder, files = Path(folder), []
    tables = {Path(p): re.sub(r"\W+", "_", Path(p).stem) for p in episodes}
    if twice := [str(p) for p, n in tables.items() if list(tables.values()).count(n) > 1]:
        raise ValueError(f"{' and '.join(twice)} would become one table; give the files different names")
    for path in tables:  # all of them are good before any is written
        for _ in _played(data, path):
            pass
    for split in data.splits:
        names = data.names(split)
        files.append(_write(folder, "houses", split, ((data.place(n),) for n in names)))
        files.append(_write(folder, "tasks", split, ((t, data.place(t.world)) for t in data.tasks(split))))
        if data.task_kind.routes:
            files.append(_write(folder, "routes", split, ((r, n) for n in names for r in data.routes(n))))
    for path, name in tables.items():
        files.append(_write(folder, "episodes", name, ((e,) for e in _played(data, path))))
    write_bytes(folder / "README.md", card(data, [f.relative_to(folder) for f in files]).encode())
    return [*files, folder / "README.md"]


def _played(data: Dataset, path: Path) -> Iterator[Episode]:
    """The episodes in a file, each of which was played in this data set."""
    for number, episode in enumerate(load_lines(path, Episode), 1):
        try:
            data.place_of(episode)
        except DatasetError as e:
            raise DatasetError(f"{path}:{number}: {e}") from e
        yield episode


def _said(action: object) -> str:
    """'move 2', 'open 2', 'ask help' or 'stop'."""
    if isinstance(action, Move | Open | Close):
        return f"{type(action).__name__.lower()} {action.candidate}"
    return f"ask {action.intention.value}" if isinstance(action, Ask) else "stop"


def _write(folder: Path, table: str, name: str, items: Iterable[tuple[object, ...]]) -> Path:
    """A table of items, each given to the columns of its kind."""
    path, columns = folder / table / f"{name}.parquet", PARQUET_TABLES[table]
    path.parent.mkdir(parents=True, exist_ok=True)
    schema = pa.schema([(column, kind) for column, (kind, _) in columns.items()])
    rows = ({column: read(*item) for column, (_, read) in columns.items()} for item in items)
    with atomic_path(path) as temporary, pq.ParquetWriter(temporary, schema, compression="zstd") as writer:
        while group := list(itertools.islice(rows, ROW_GROUP)):
            writer.write_table(pa.Table.from_pylist(group, schema=schema))
    return path


def card(data: Dataset, files: Sequence[Path]) -> str:
    """The card of the data set, with the front matter that Hugging Face reads."""
    tables = sorted({f.parts[0] for f in files}, key=list(PARQUET_TABLES).index)
    configs = "\n".join(
        f"- config_name: {t}\n"
        + ("  default: true\n" if t == "tasks" else "")
        + "  data_files:\n"
        + "\n".join(f"  - split: {f.stem}\n    path: {f.as_posix()}" for f in files if f.parts[0] == t)
        for t in tables
    )
    return filled(
        "card",
        data,
        CONFIGS=configs,
        FIELDS="\n".join(f"| `{t}` | {', '.join(f'`{n}`' for n in PARQUET_TABLES[t])} |" for t in tables),
        AREA="{:g} to {:g}".format(*data.config.area),
        LANGUAGE=data.config.language,
        SIZE=size_category(sum(row.tasks for row in data.index.splits.values())),
    )


def size_category(rows: int) -> str:
    """Hugging Face's word for a number of rows."""
    for limit, word in ((1000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K")):
        if rows < limit:
            return word
    return "100K<n<1M"

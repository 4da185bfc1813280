"""A data set as Parquet tables with a card, which `datasets.load_dataset(FOLDER, "tasks")` of Hugging Face reads.

  houses/<split>.parquet     one row per house: name, digest, rooms, objects, its JSON and its navigation graph
  tasks/<split>.parquet      one row per task, its record as JSON beside the columns
  routes/<split>.parquet     one row per route that an assistant may describe
  episodes/<name>.parquet    one row per episode of the files that are given
  README.md                  the card: what it is, how large, how made, its fields, what it is not

The column `record` holds the record as embodied.records writes it, so that nothing is lost.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from assets.cache import atomic_path, write_bytes
from embodied.datasets.checks import DatasetError
from embodied.interface import Ask, Episode, FindObject, FollowRoute, Move, Route, Task
from embodied.records import load_lines, to_json

if TYPE_CHECKING:
    from embodied.datasets.store import Dataset, StoredPlace

TEXT, WHOLE, REAL = pa.string(), pa.int32(), pa.float64()
NODES = pa.list_(WHOLE)
HOUSES = pa.schema(
    [
        ("name", TEXT),
        ("digest", TEXT),
        ("area_m2", REAL),
        ("storeys", WHOLE),
        ("rooms", pa.list_(TEXT)),
        ("objects", pa.list_(TEXT)),
        ("viewpoints", pa.list_(TEXT)),
        ("room_of_viewpoint", pa.list_(TEXT)),
        ("positions", pa.list_(pa.list_(REAL))),
        ("edges", pa.list_(NODES)),
        ("record", TEXT),
    ]
)
TASKS = pa.schema(
    [
        ("id", TEXT),
        ("kind", TEXT),
        ("house", TEXT),
        ("request", TEXT),
        ("start_node", WHOLE),
        ("start_turn", WHOLE),
        ("start_tilt", WHOLE),
        ("object_class", TEXT),
        ("room_kind", TEXT),
        ("placements", pa.list_(TEXT)),
        ("route", TEXT),
        ("path", NODES),
        ("goal_nodes", NODES),
        ("shortest_m", REAL),
        ("radius", REAL),
        ("horizon", WHOLE),
        ("budget", REAL),
        ("record", TEXT),
    ]
)
ROUTES = pa.schema(
    [
        ("id", TEXT),
        ("house", TEXT),
        ("path", NODES),
        ("turn", WHOLE),
        ("tilt", WHOLE),
        ("instruction", TEXT),
        ("heard_in", TEXT),
        ("record", TEXT),
    ]
)
EPISODES = pa.schema(
    [
        ("task", TEXT),
        ("house", TEXT),
        ("agent", TEXT),
        ("seed", pa.int64()),
        ("ended", TEXT),
        ("nodes", NODES),
        ("actions", pa.list_(TEXT)),
        ("instructions", pa.list_(TEXT)),
        ("replies", pa.list_(TEXT)),
        ("requests", WHOLE),
        ("record", TEXT),
    ]
)
SCHEMAS: Mapping[str, pa.Schema] = {"houses": HOUSES, "tasks": TASKS, "routes": ROUTES, "episodes": EPISODES}
BATCH = 1000
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
        files += [
            _write(folder / "houses" / f"{split}.parquet", HOUSES, (house_row(data.place(n)) for n in names)),
            _write(
                folder / "tasks" / f"{split}.parquet",
                TASKS,
                (task_row(t, data.place(t.world)) for t in data.tasks(split)),
            ),
        ]
        if data.kind in ("hanna", "vln"):
            files.append(
                _write(
                    folder / "routes" / f"{split}.parquet",
                    ROUTES,
                    (route_row(r, n) for n in names for r in data.routes(n)),
                )
            )
    for path, name in tables.items():
        files.append(_write(folder / "episodes" / f"{name}.parquet", EPISODES, _played(data, path)))
    write_bytes(folder / "README.md", card(data, [f.relative_to(folder) for f in files]).encode())
    return [*files, folder / "README.md"]


def house_row(place: StoredPlace) -> dict[str, object]:
    house, graph = place.house, place.graph
    return {
        "name": house.name,
        "digest": house.digest,
        "area_m2": round(float(house.area), 2),
        "storeys": len(house.storeys),
        "rooms": [r.kind for r in house.rooms],
        "objects": [p.object_class for p in house.placements],
        "viewpoints": list(graph.ids),
        "room_of_viewpoint": [house.room_by_id[r].kind for r in graph.room_of_node],
        "positions": np.asarray(graph.positions).tolist(),
        "edges": np.asarray(graph.edges).tolist(),
        "record": house.to_json(),
    }


def task_row(task: Task, place: StoredPlace) -> dict[str, object]:
    goal = task.goal
    sought = (
        {"object_class": goal.object_class, "room_kind": goal.room_kind, "placements": list(goal.placements)}
        if (isinstance(goal, FindObject))
        else {}
    )
    route = {"route": goal.route, "path": list(goal.path)} if isinstance(goal, FollowRoute) else {}
    return {
        "id": task.id,
        "kind": task.kind,
        "house": task.world,
        "request": task.request,
        "start_node": task.start.node,
        "start_turn": task.start.turn,
        "start_tilt": task.start.tilt,
        **sought,
        **route,
        "goal_nodes": list(task.goal_nodes),
        "shortest_m": float(min(place.graph.distance[task.start.node, g] for g in task.goal_nodes)),
        "radius": task.radius,
        "horizon": task.horizon,
        "budget": task.budget,
        "record": to_json(task),
    }


def route_row(route: Route, house: str) -> dict[str, object]:
    return {
        "id": route.id,
        "house": house,
        "path": list(route.path),
        "turn": route.turn,
        "tilt": route.tilt,
        "instruction": route.instruction,
        "heard_in": route.split,
        "record": to_json(route),
    }


def episode_row(episode: Episode) -> dict[str, object]:
    return {
        "task": episode.task.id,
        "house": episode.task.world,
        "agent": episode.agent,
        "seed": episode.seed,
        "ended": episode.ended,
        "nodes": list(episode.nodes),
        "actions": [_said(s.action) for s in episode.steps],
        "instructions": [s.instruction for s in episode.steps],
        "replies": [(s.reply.text or "") if s.reply else "" for s in episode.steps],
        "requests": episode.requests,
        "record": to_json(episode),
    }


def _played(data: Dataset, path: Path) -> Iterator[dict[str, object]]:
    """Rows of the episodes in a file, each of which was played in this data set."""
    for number, episode in enumerate(load_lines(path, Episode), 1):
        try:
            data.place_of(episode)
        except DatasetError as e:
            raise DatasetError(f"{path}:{number}: {e}") from e
        yield episode_row(episode)


def _said(action: object) -> str:
    """'move 2', 'ask help' or 'stop'."""
    if isinstance(action, Move):
        return f"move {action.candidate}"
    return f"ask {action.intention.value}" if isinstance(action, Ask) else "stop"


def _write(path: Path, schema: pa.Schema, rows: Iterable[Mapping[str, object]]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary, pq.ParquetWriter(temporary, schema, compression="zstd") as writer:
        for group in _groups(rows):
            writer.write_table(pa.Table.from_pylist(group, schema=schema))
    return path


def _groups(rows: Iterable[Mapping[str, object]]) -> Iterator[list[Mapping[str, object]]]:
    group: list[Mapping[str, object]] = []
    for row in rows:
        group.append(row)
        if len(group) == BATCH:
            yield group
            group = []
    if group:
        yield group


def card(data: Dataset, files: Sequence[Path]) -> str:
    """The card of the data set, with the front matter that Hugging Face reads."""
    text = (Path(__file__).parent / "readmes" / "card.md").read_text(encoding="utf-8")
    tables = sorted({f.parts[0] for f in files}, key=list(SCHEMAS).index)
    configs = "\n".join(
        f"- config_name: {t}\n"
        + ("  default: true\n" if t == "tasks" else "")
        + "  data_files:\n"
        + "\n".join(f"  - split: {f.stem}\n    path: {f.as_posix()}" for f in files if f.parts[0] == t)
        for t in tables
    )
    fields = "\n".join(f"| `{t}` | {', '.join(f'`{n}`' for n in SCHEMAS[t].names)} |" for t in tables)
    facts = {
        "CONFIGS": configs,
        "KIND": data.kind,
        "SEED": str(data.config.seed),
        "DIGEST": data.digest[:16],
        "TABLE": data.table().strip(),
        "FIELDS": fields,
        "AREA": "{:g} to {:g}".format(*data.config.area),
        "LANGUAGE": data.config.language,
        "SIZE": size_category(sum(row.tasks for row in data.index.splits.values())),
    }
    return re.sub(r"\$([A-Z]+)\$", lambda m: facts[m.group(1)], text)


def size_category(rows: int) -> str:
    """Hugging Face's word for a number of rows."""
    for limit, word in ((1000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K")):
        if rows < limit:
            return word
    return "100K<n<1M"

"""Records as JSON, and the one place where JSON is read and checked: tasks, routes, steps, episodes, settings.

Any frozen dataclass, enum, tuple, mapping or small array can be written; where a field may hold
several records, the object carries its class name under 'is'. What is read has the types of its
fields, finite numbers, no unknown, missing or repeated fields, and keeps the ranges of RULES.
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import importlib.metadata
import json
import platform
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from assets.cache import write_bytes
from embodied import interface
from embodied.distribution import DISTRIBUTION

T = typing.TypeVar("T")


class RecordError(ValueError):
    """A line that is not the record it should be."""


def to_json(record: object) -> str:
    """One line of canonical JSON (sorted keys, no blanks)."""
    return json.dumps(_plain(record), sort_keys=True, separators=(",", ":"), allow_nan=False)


def from_json(kind: type[T], text: str | bytes) -> T:
    """Read what `to_json` wrote.

    Raises:
      RecordError: not JSON, or not such a record; says where.
    """
    return from_plain(kind, parse(text, f"a {kind.__name__}"))


def from_plain(kind: type[T], value: object, where: str | None = None) -> T:
    """The record of type `kind` that `value`, as JSON gives it, describes.

    Raises:
      RecordError: it is none; says which field, what was expected and what came.
    """
    return _build(kind, value, where or kind.__name__)


def parse(text: str | bytes, what: str = "a record") -> object:
    """`text` as JSON, strictly: no NaN, no field twice, not deeper than Python can follow.

    Raises:
      RecordError: says what was expected.
    """
    try:
        return json.loads(text, object_pairs_hook=_object, parse_constant=_no_number)
    except (ValueError, RecursionError) as e:
        shown = text[:60].decode(errors="replace") if isinstance(text, bytes) else text[:60]
        raise RecordError(f"expected {what} as JSON, got {shown!r} ({e})") from e


def read_json(path: Path) -> dict[str, typing.Any]:
    """The object of a JSON file, its fields unchecked.

    Raises:
      RecordError: names the file.
    """
    value = parse_file(path)
    if not isinstance(value, dict):
        raise RecordError(f"{path} should hold one JSON object, got {_shown(value)}")
    return value


def load_json(path: Path, kind: type[T]) -> T:
    """The record of a JSON file.

    Raises:
      RecordError: names the file.
    """
    try:
        return from_plain(kind, parse(Path(path).read_bytes(), f"a {kind.__name__}"))
    except RecordError as e:
        raise RecordError(f"{path}: {e}") from e


def parse_file(path: Path) -> object:
    """What a JSON file holds, whatever it is; raises RecordError with the file's name."""
    try:
        return parse(Path(path).read_bytes(), "a file")
    except RecordError as e:
        raise RecordError(f"{path}: {e}") from e


def _object(pairs: list[tuple[str, object]]) -> dict[str, object]:
    value = dict(pairs)
    if len(value) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"the field {next(n for n in names if names.count(n) > 1)!r} stands there twice")
    return value


def _no_number(text: str) -> typing.NoReturn:
    raise ValueError(f"{text} is no JSON")


def save_lines(path: Path, records: Iterable[object]) -> int:
    """Write records as JSON Lines, atomically; returns how many."""
    lines = [to_json(r) for r in records]
    write_bytes(Path(path), "".join(line + "\n" for line in lines).encode())
    return len(lines)


def load_lines(path: Path, kind: type[T]) -> Iterator[T]:
    """The records of a JSON Lines file.

    Raises:
      RecordError: names the file and the line.
    """
    return read_lines(Path(path).read_bytes(), kind, path)


def read_lines(data: bytes, kind: type[T], path: Path) -> Iterator[T]:
    """The records in the content of the JSON Lines file `path`; see `load_lines`."""
    for number, line in enumerate(data.splitlines(), 1):
        try:
            yield from_json(kind, line)
        except RecordError as e:
            raise RecordError(f"{path}:{number}: {e}") from e


def episodes_file(split: str, agent: str) -> str:
    """Name of the file with one agent's episodes on one split: 'episodes_val_seen_learned_no_ask.jsonl'."""
    return f"episodes_{split}_{agent.replace(',', '').replace(' ', '_')}.jsonl"


def fingerprint(**facts: object) -> dict[str, object]:
    """What a run depends on: versions of Python and of the libraries that compute, the machine, and `facts`."""
    versions = {"embodied": importlib.metadata.version(DISTRIBUTION)}
    versions |= {name: importlib.metadata.version(name) for name in ("numpy", "scipy", "shapely", "mujoco")}
    machine = f"{platform.machine()} {platform.system()}"
    return {"python": platform.python_version(), "versions": versions, "machine": machine, **facts}


def _plain(value: object) -> object:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: _plain(getattr(value, f.name)) for f in _fields(type(value))}
        return {"is": type(value).__name__, **fields} if type(value) in _choices() else fields
    if isinstance(value, enum.Enum):
        return value.value
    if isinstance(value, np.ndarray):
        return np.round(value.astype(float), 6).tolist()
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        return value.item()
    return value


@functools.cache
def _fields(kind: type) -> tuple[dataclasses.Field, ...]:
    return dataclasses.fields(kind)


@functools.cache
def _hints(kind: type) -> dict[str, object]:
    return typing.get_type_hints(kind)


@functools.cache
def _choices() -> tuple[type, ...]:
    """Records that share a field with others, so that their name must be written."""
    return (*typing.get_args(interface.Goal), *typing.get_args(interface.Action))


# Reading ----------------------------------------------------------------------------------------


LARGEST = 1e12
"""Numbers beyond this are no measure of anything here."""


def _build(kind: typing.Any, value: object, where: str) -> typing.Any:
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        return _build_choice(args, value, where)
    if origin is tuple:
        return _build_tuple(args, value, where)
    if origin is not None and issubclass(origin, Mapping):
        if not isinstance(value, dict):
            raise RecordError(f"{where} should be an object, got {_shown(value)}")
        return {k: _build(args[1], v, f"{where}.{k}") for k, v in value.items()}
    if kind is np.ndarray:
        return _build_array(value, where)
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        try:
            return kind(value)
        except ValueError as e:
            raise RecordError(f"{where} should be one of {[m.value for m in kind]}, got {_shown(value)}") from e
    if dataclasses.is_dataclass(kind):
        return _build_record(typing.cast(type, kind), value, where)
    if kind in (int, float) and isinstance(value, (int, float)) and not isinstance(value, bool):
        if not abs(value) <= LARGEST:  # NaN too
            raise RecordError(f"{where} should be a number of at most {LARGEST:g}, got {_shown(value)}")
        value = float(value) if kind is float else value
    if not isinstance(kind, type) or type(value) is not kind:
        raise RecordError(f"{where} should be {getattr(kind, '__name__', kind)}, got {_shown(value)}")
    return value


def _build_tuple(args: tuple[typing.Any, ...], value: object, where: str) -> tuple:
    if not isinstance(value, list):
        raise RecordError(f"{where} should be a list, got {_shown(value)}")
    kinds = args[:1] * len(value) if len(args) == 2 and args[1] is Ellipsis else args
    if len(kinds) != len(value):
        raise RecordError(f"{where} should be a list of {len(kinds)}, got {_shown(value)}")
    return tuple(_build(k, v, f"{where}[{i}]") for i, (k, v) in enumerate(zip(kinds, value, strict=True)))


def _build_array(value: object, where: str) -> np.ndarray:
    try:
        array = np.array(value, dtype=np.float32)
    except (ValueError, TypeError, OverflowError) as e:
        raise RecordError(f"{where} should be an array of numbers, got {_shown(value)}") from e
    if not isinstance(value, list) or not np.isfinite(array).all():
        raise RecordError(f"{where} should be an array of finite numbers, got {_shown(value)}")
    return array


def _build_choice(args: tuple[typing.Any, ...], value: object, where: str) -> typing.Any:
    if value is None and type(None) in args:
        return None
    some = [a for a in args if a is not type(None)]
    records: list[type] = [a for a in some if isinstance(a, type) and dataclasses.is_dataclass(a)]
    if len(records) < 2:
        return _build(some[0], value, where)
    named = value.get("is") if isinstance(value, dict) else None
    for a in records:
        if a.__name__ == named:
            return _build(a, value, where)
    raise RecordError(f"{where} should be one of {[a.__name__ for a in records]} by its 'is', got {_shown(value)}")


def _build_record(kind: type, value: object, where: str) -> typing.Any:
    if not isinstance(value, dict):
        raise RecordError(f"{where} should be an object, got {_shown(value)}")
    names = {f.name: f for f in _fields(kind)}
    unknown = sorted(set(value) - set(names) - {"is"})
    missing = sorted(
        n
        for n, f in names.items()
        if n not in value and f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING
    )
    if unknown or missing:
        raise RecordError(f"{where}: unknown fields {unknown}, missing fields {missing}; it may hold {list(names)}")
    if "is" in value and value["is"] != kind.__name__:
        raise RecordError(f"{where} should be a {kind.__name__}, it says that it is {_shown(value['is'])}")
    hints = _hints(kind)
    try:
        record = kind(**{n: _build(hints[n], value[n], f"{where}.{n}") for n in names if n in value})
    except RecordError:
        raise
    except ValueError as e:  # of a record that checks itself
        raise RecordError(f"{where}: {e}") from e
    if kind in RULES and (wrong := RULES[kind](record)):
        raise RecordError(f"{where}: {wrong}")
    return record


def _shown(value: object) -> str:
    """A value for a message, cut where it is long."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an int of thousands of digits
        text = f"a {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."


def _angles(turn: int, tilt: int) -> str | None:
    if not 0 <= turn < interface.TURNS or not -1 <= tilt <= 1:
        return f"turn should be 0 to {interface.TURNS - 1} and tilt -1 to 1, got {turn} and {tilt}"
    return None


def _nodes(*nodes: int) -> str | None:
    return None if all(n >= 0 for n in nodes) else f"nodes are counted from 0, got {_shown(list(nodes))}"


def _task(t: interface.Task) -> str | None:
    if not t.goal_nodes:
        return "goal_nodes should name at least one node"
    if t.radius < 0 or t.horizon < 1 or (t.budget is not None and t.budget < 0):
        return f"radius, horizon and budget should be at least 0, 1 and 0, got {t.radius}, {t.horizon} and {t.budget}"
    return _nodes(*t.goal_nodes)


def _route(r: interface.Route) -> str | None:
    return _angles(r.turn, r.tilt) or (_nodes(*r.path) if r.path else "path should hold at least one node")


def _feature(f: interface.Feature) -> str | None:
    if f.kind not in ("object", "room", "action") or f.distance < 0:
        return f"a feature is an object, a room or an action at a distance of at least 0, got {f}"
    return _angles(f.horizontal, f.vertical)


def _step(s: interface.Step) -> str | None:
    if isinstance(s.action, interface.Move) and s.action.candidate >= len(s.candidate_nodes):
        return f"a move to candidate {s.action.candidate} of {len(s.candidate_nodes)}"
    return _nodes(*s.targets, *s.candidate_nodes)


def _episode(e: interface.Episode) -> str | None:
    if e.ended not in ("stop", "limit"):
        return f"ended should be 'stop' or 'limit', got {e.ended!r}"
    at = [e.task.start, *(s.next_pose for s in e.steps)]
    broken = [i for i, (s, pose) in enumerate(zip(e.steps, at)) if s.pose != pose]
    if broken:
        return f"step {broken[0]} begins elsewhere than the one before ended"
    return None if e.budget is None or e.budget >= 0 else f"budget should be at least 0, got {e.budget}"


RULES: Mapping[type, Callable[[typing.Any], str | None]] = {
    interface.Pose: lambda p: _angles(p.turn, p.tilt) or _nodes(p.node),
    interface.Viewpoint: lambda v: _nodes(v.node),
    interface.FollowRoute: lambda g: _nodes(*g.path) if g.path else "path should hold at least one node",
    interface.Task: _task,
    interface.Route: _route,
    interface.Feature: _feature,
    interface.Move: lambda m: None if m.candidate >= 0 else f"candidate should be at least 0, got {m.candidate}",
    interface.Step: _step,
    interface.Episode: _episode,
}
"""What is wrong with a record whose fields have the right types, in words; None for nothing."""

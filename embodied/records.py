"""The records of play as JSON: tasks, routes, steps and episodes, one object per line.

Any frozen dataclass, enum, tuple, mapping or small array of `embodied.interface` can be written;
where a field may hold several records, the object carries its class name under 'is'.
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
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from assets.cache import write_bytes
from embodied import DISTRIBUTION, interface

T = typing.TypeVar("T")


class RecordError(ValueError):
    """A line that is not the record it should be."""


def to_json(record: object) -> str:
    """One line of canonical JSON (sorted keys, no blanks)."""
    return json.dumps(_plain(record), sort_keys=True, separators=(",", ":"), allow_nan=False)


def from_json(kind: type[T], text: str) -> T:
    """Read what `to_json` wrote.

    Raises:
      RecordError: not JSON, or not such a record; says where.
    """
    try:
        return _build(kind, json.loads(text), kind.__name__)
    except json.JSONDecodeError as e:
        raise RecordError(f"expected a {kind.__name__} as JSON, got {text[:60]!r} ({e})") from e


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
    with open(path, encoding="utf-8") as f:
        for number, line in enumerate(f, 1):
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
    if dataclasses.is_dataclass(value):
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
    return typing.get_type_hints(kind, vars(interface))


@functools.cache
def _choices() -> tuple[type, ...]:
    """Records that share a field with others, so that their name must be written."""
    return (*typing.get_args(interface.Goal), *typing.get_args(interface.Action))


def _build(kind: object, value: object, where: str) -> typing.Any:
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if kind is None or kind is type(None):
        return None
    if origin in (types.UnionType, typing.Union):
        return _build_choice(args, value, where)
    if origin is tuple:
        items = args[:1] * len(value) if len(args) == 2 and args[1] is Ellipsis else args
        if not isinstance(value, list) or len(items) != len(value):
            raise RecordError(f"{where} should be a list of {len(items)}, got {value!r}")
        return tuple(_build(k, v, f"{where}[{i}]") for i, (k, v) in enumerate(zip(items, value, strict=True)))
    if origin is not None and issubclass(origin, Mapping):
        return {k: _build(args[1], v, f"{where}.{k}") for k, v in value.items()}
    if kind is np.ndarray:
        return np.array(value, dtype=np.float32)
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        try:
            return kind(value)
        except ValueError as e:
            raise RecordError(f"{where} should be one of {[m.value for m in kind]}, got {value!r}") from e
    if dataclasses.is_dataclass(kind):
        return _build_record(kind, value, where)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(kind, type) or type(value) is not kind:
        raise RecordError(f"{where} should be {getattr(kind, '__name__', kind)}, got {value!r}")
    return value


def _build_choice(args: tuple[object, ...], value: object, where: str) -> typing.Any:
    if value is None and type(None) in args:
        return None
    some = [a for a in args if a is not type(None)]
    if isinstance(value, dict) and "is" in value:
        named = [a for a in some if getattr(a, "__name__", "") == value["is"]]
        if not named:
            raise RecordError(f"{where} should be one of {[a.__name__ for a in some]}, got {value['is']!r}")
        return _build(named[0], value, where)
    return _build(some[0], value, where)


def _build_record(kind: type, value: object, where: str) -> typing.Any:
    if not isinstance(value, dict):
        raise RecordError(f"{where} should be an object, got {value!r}")
    names = {f.name: f for f in _fields(kind)}
    unknown = sorted(set(value) - set(names) - {"is"})
    missing = sorted(
        n
        for n, f in names.items()
        if n not in value and f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING
    )
    if unknown or missing:
        raise RecordError(f"{where}: unknown fields {unknown}, missing fields {missing}; it may hold {list(names)}")
    hints = _hints(kind)
    return kind(**{n: _build(hints[n], value[n], f"{where}.{n}") for n in names if n in value})

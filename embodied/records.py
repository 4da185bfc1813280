"""Records as JSON: tasks, routes, steps, episodes, settings; they are read by embodied.assets.json_file. And the
identity of what is made of them.

Any frozen dataclass, enum, tuple, mapping or small array can be written; where a field may hold
several records, the object carries its class name under 'is'.
"""

import dataclasses
import enum
import functools
import importlib.metadata
import json
import platform
import typing
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from embodied import interface
from embodied.assets.cache import digest, write_bytes, write_json
from embodied.assets.closure import code_digest
from embodied.assets.json_file import (
    RECORD_RULES,
    RecordError,
    T,
    from_json,
    from_plain,
    load_json,
    parse,
    parse_file,
    read_json,
    shown,
)
from embodied.software import DISTRIBUTION

CHOICES = (*typing.get_args(interface.Goal), *typing.get_args(interface.Action))
"""Records that share a field with others, so that their name must be written."""
WIDEST = 100.0
"""Largest radius of a goal, metres: that of a large building."""
__all__ = ["RecordError", "from_json", "from_plain", "load_json", "parse", "parse_file", "read_json"]


def to_json(record: object) -> str:
    """One line of canonical JSON (sorted keys, no blanks)."""
    return json.dumps(_plain(record), sort_keys=True, separators=(",", ":"), allow_nan=False)


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
    safe = agent.replace(",", "").replace(" ", "_").replace("/", "%2F").replace(":", "%3A")
    return f"episodes_{split}_{safe}.jsonl"


def fingerprint(**facts: object) -> dict[str, object]:
    """All that a run depends on: versions of Python and of the libraries that compute, the machine, and `facts`."""
    versions = {"embodied": importlib.metadata.version(DISTRIBUTION)}
    versions |= {name: importlib.metadata.version(name) for name in ("numpy", "scipy", "shapely", "mujoco-core")}
    machine = f"{platform.machine()} {platform.system()}"
    return {"python": platform.python_version(), "versions": versions, "machine": machine, **facts}


def _plain(value: object) -> object:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        held = [(f, getattr(value, f.name)) for f in _fields(type(value))]
        fields = {f.name: _plain(x) for f, x in held if not f.metadata.get("unless_default") or x != f.default}
        return {"is": type(value).__name__, **fields} if type(value) in CHOICES else fields
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


def _angles(turn: int, tilt: int) -> str | None:
    if not 0 <= turn < interface.TURNS or not -1 <= tilt <= 1:
        return f"turn should be 0 to {interface.TURNS - 1} and tilt -1 to 1, got {turn} and {tilt}"
    return None


def _nodes(*nodes: int) -> str | None:
    return None if all(n >= 0 for n in nodes) else f"nodes are counted from 0, got {shown(list(nodes))}"


def _task(t: interface.Task) -> str | None:
    if not t.goal_nodes:
        return "goal_nodes should name at least one node"
    if t.radius < 0 or t.horizon < 1 or (t.budget is not None and t.budget < 0):
        return f"radius, horizon and budget should be at least 0, 1 and 0, got {t.radius}, {t.horizon} and {t.budget}"
    if t.radius > WIDEST:
        return f"radius should be at most {WIDEST:g} m, which no house is wide, got {t.radius:g}"
    return _nodes(*t.goal_nodes)


def _route(r: interface.Route) -> str | None:
    return _angles(r.turn, r.tilt) or (_nodes(*r.path) if r.path else "path should hold at least one node")


def _feature(f: interface.Feature) -> str | None:
    if f.kind not in ("object", "room", "action") or f.distance < 0:
        return f"a feature is an object, a room or an action at a distance of at least 0, got {f}"
    return _angles(f.horizontal, f.vertical)


def _candidate(a: interface.Move | interface.Open | interface.Close) -> str | None:
    return None if a.candidate >= 0 else f"candidate should be at least 0, got {a.candidate}"


def _step(s: interface.Step) -> str | None:
    if (chosen := getattr(s.action, "candidate", -1)) >= len(s.candidate_nodes):
        return f"a move to candidate {chosen} of {len(s.candidate_nodes)}"
    return _nodes(*s.targets, *s.candidate_nodes)


def _episode(e: interface.Episode) -> str | None:
    if e.ended not in ("stop", "limit"):
        return f"ended should be 'stop' or 'limit', got {e.ended!r}"
    at = [e.task.start, *(s.next_pose for s in e.steps)]
    broken = [i for i, (s, pose) in enumerate(zip(e.steps, at)) if s.pose != pose]
    if broken:
        return f"step {broken[0]} begins elsewhere than the one before ended"
    return None if e.budget is None or e.budget >= 0 else f"budget should be at least 0, got {e.budget}"


RECORD_RULES |= {
    interface.Pose: lambda p: _angles(p.turn, p.tilt) or _nodes(p.node),
    interface.Viewpoint: lambda v: _nodes(v.node),
    interface.FollowRoute: lambda g: _nodes(*g.path) if g.path else "path should hold at least one node",
    interface.Task: _task,
    interface.Route: _route,
    interface.Feature: _feature,
    interface.Move: _candidate,
    interface.Open: _candidate,
    interface.Close: _candidate,
    interface.Step: _step,
    interface.Episode: _episode,
}


Identity = Mapping[str, Any]
"""All that a finished thing depends on, written beside it and compared before it is believed: settings, digests of data
and of weights that were begun with, and the digest of the code (`makers` and all that they import)."""
CODE, MAKERS = "code", "makers"
"""The parts of an identity that say which code made a thing."""


def identity_of(*makers: str, **parts: object) -> dict[str, Any]:
    """The identity of what the modules `makers` make of `parts`, which may be settings, digests, numbers or texts."""
    plain = json.loads(to_json(parts))
    return plain | ({MAKERS: list(makers), CODE: code_digest(*makers)} if makers else {})


def key_of(identity: Identity, without: Collection[str] = (CODE, MAKERS)) -> str:
    """Twelve hex digits that differ where identities do; by default the code does not count."""
    return digest({k: v for k, v in identity.items() if k not in without})[:12]


def differences(before: Identity, now: Identity, may_change: Collection[str] = (CODE, MAKERS)) -> list[str]:
    """Differences, as 'settings.batch 6 -> 5', sorted; parts and settings named in `may_change` do not count."""
    old, new = _flat(before, may_change), _flat(now, may_change)
    return [f"{k} {old.get(k)!r} -> {new.get(k)!r}" for k in sorted({*old, *new}) if old.get(k) != new.get(k)]


def write_finished(path: Path, identity: Identity, body: Mapping[str, object]) -> None:
    """Write a finished thing with its identity, atomically."""
    write_json(Path(path), {"identity": identity, **body}, indent=1)


def read_finished(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Identity and body of what `write_finished` wrote.

    Raises:
      FileNotFoundError.
      RecordError: damaged, or without an identity; names the file.
    """
    body = read_json(Path(path))
    identity = body.pop("identity", None)
    if not isinstance(identity, dict):
        raise RecordError(f"{path} has no identity, so nobody can tell what it belongs to; delete it")
    return identity, body


def finished(path: Path, identity: Identity, may_change: Collection[str] = ()) -> dict[str, Any] | None:
    """The body of a finished thing, if it belongs to `identity`; None where it is missing or belongs to another.

    Raises:
      RecordError: damaged; names the file.
    """
    if not Path(path).exists():
        return None
    stored, body = read_finished(path)
    return None if differences(stored, identity, may_change) else body


def _flat(value: object, without: Collection[str], name: str = "") -> dict[str, object]:
    """Leaves of nested objects by dotted name."""
    if not isinstance(value, Mapping):
        return {name: value}
    leaves: dict[str, object] = {}
    for key, inner in value.items():
        if key not in without:
            leaves |= _flat(inner, without, f"{name}.{key}" if name else str(key))
    return leaves

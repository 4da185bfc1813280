"""Identity: what a finished thing depends on, written beside it and compared before it is believed.

An identity is a JSON object: settings, digests of data and of weights that were begun with, and the digest of the code
(`makers` and all that they import). A result is believed where its identity is the one that it would have now.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from embodied.assets.cache import digest, write_json
from embodied.assets.closure import code_digest
from embodied.records import RecordError, read_json, to_json

Identity = Mapping[str, Any]
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

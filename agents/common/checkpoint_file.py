"""Checkpoint files: what decides how a run goes on, written atomically, refused if damaged or of another kind."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import torch

from assets.cache import write_bytes


class CheckpointError(ValueError):
    """A checkpoint that cannot be continued: says what was expected, what came and what to do."""


def write_checkpoint(path: Path, kind: str, body: Mapping[str, object]) -> None:
    """Write `path` atomically; an interruption leaves the checkpoint before it.

    Args:
      kind: name and version of what is in it, checked on reading.
      body: tensors, state_dicts, numbers, texts and containers of them.
    """
    whole = io.BytesIO()
    torch.save({"format": kind, **body}, whole)
    write_bytes(Path(path), whole.getvalue())


def read_checkpoint(path: Path, kind: str, fields: Collection[str] = ()) -> dict[str, Any]:
    """What `write_checkpoint` wrote.

    Args:
      fields: what it should hold.

    Raises:
      CheckpointError: truncated, changed, of another kind or version, or without a field.
    """
    wrong = None
    try:
        with zipfile.ZipFile(path) as z:  # torch does not look at the checksums itself
            if (bad := z.testzip()) is None:
                body = torch.load(path, map_location="cpu", weights_only=True)
            else:
                wrong = f"{bad} does not fit its checksum"
    except OSError:
        raise
    except Exception as e:  # a damaged file raises one of half a dozen kinds
        wrong = str(e)
    if wrong is not None:
        raise CheckpointError(
            f"{path}: cannot be read ({wrong}); it was changed or cut short, delete it to begin again"
        )
    if not isinstance(body, dict) or body.get("format") != kind:
        found = body.get("format") if isinstance(body, dict) else type(body).__name__
        raise CheckpointError(f"{path}: format {found!r}, this version reads {kind!r}; begin a new run")
    if lost := sorted({*fields} - set(body)):
        raise CheckpointError(f"{path}: {lost} are missing; delete it to begin again")
    return body


def refuse_changes(
    path: Path, before: Mapping[str, object], now: Mapping[str, object], may_change: Collection[str] = ()
) -> None:
    """Refuse to go on with other settings than a run began with.

    Raises:
      CheckpointError: names each setting that changed, with both values.
    """
    changed = sorted(k for k in {*before, *now} if before.get(k) != now.get(k) and k not in may_change)
    if changed:
        pairs = ", ".join(f"{k} {before.get(k)!r} -> {now.get(k)!r}" for k in changed)
        raise CheckpointError(
            f"{path}: settings changed since this run began ({pairs}); restore them or use another run folder"
        )

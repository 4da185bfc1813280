"""The one checkpoint format: what decides how a run goes on, with the identity of the run, refused if it is another's.

A checkpoint is a PyTorch file of tensors, numbers and texts (nothing is unpickled) with a digest of all it holds.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Protocol

import torch
from torch import Tensor

from embodied.assets.cache import write_bytes
from embodied.identity import CODE, MAKERS, Identity, differences

CHECKPOINT_FORMAT = "embodied-checkpoint-2"
FIELDS = ("identity", "progress", "sums", "history", "parts")


class CheckpointError(ValueError):
    """A checkpoint that cannot be continued: says what was expected, what came and what to do."""


class Stateful(Protocol):
    """A network, an optimizer or a schedule."""

    def state_dict(self) -> dict[str, Any]: ...
    def load_state_dict(self, state_dict: Any, /) -> Any: ...


def write_checkpoint(path: Path, body: Mapping[str, object]) -> None:
    """Write the FIELDS of a run atomically; an interruption leaves the checkpoint before it."""
    whole = io.BytesIO()
    torch.save({"format": CHECKPOINT_FORMAT, "digest": _digest(body), **body}, whole)
    write_bytes(Path(path), whole.getvalue())


def read_checkpoint(path: Path) -> dict[str, Any]:
    """The contents that `write_checkpoint` wrote.

    Raises:
      CheckpointError: truncated, changed, of another format, or with numbers that are none.
    """
    wrong = None
    try:
        with zipfile.ZipFile(path) as z:  # torch does not look at the checksums itself
            if any(entry.compress_type != zipfile.ZIP_STORED for entry in z.infolist()):  # a little may become a lot
                wrong = "it is compressed, torch writes none that are"
            elif (bad := z.testzip()) is None:
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
    if not isinstance(body, dict) or body.pop("format", None) != CHECKPOINT_FORMAT:
        raise CheckpointError(f"{path}: not a checkpoint of format {CHECKPOINT_FORMAT!r}; begin a new run")
    contents = body.pop("digest", None)
    if set(body) != set(FIELDS) or contents != _digest(body):
        raise CheckpointError(f"{path}: its contents do not fit its digest; it was changed, delete it to begin again")
    if not all(torch.isfinite(t).all() for t in _tensors(body["parts"]) if t.is_floating_point()):
        raise CheckpointError(f"{path}: holds numbers that are not finite; delete it to begin again")
    return body


def restore(
    path: Path, identity: Identity, parts: Mapping[str, Stateful], may_change: Collection[str] = ()
) -> dict[str, Any]:
    """Put the checkpoint of a run into its `parts`, and return its FIELDS.

    Args:
      may_change: names of settings that may differ without changing what was learned so far.

    Raises:
      CheckpointError: damaged, of a run of another identity (other code is no reason), or of other parts.
    """
    body = read_checkpoint(path)
    if changed := differences(body["identity"], identity, (*may_change, CODE, MAKERS)):
        raise CheckpointError(
            f"{path}: settings changed since this run began ({', '.join(changed)}); restore them or use another "
            "run folder"
        )
    if set(body["parts"]) != set(parts):
        raise CheckpointError(f"{path}: holds {sorted(body['parts'])}, this run has {sorted(parts)}; begin a new run")
    for name, part in parts.items():
        try:
            part.load_state_dict(body["parts"][name])
        except (RuntimeError, ValueError, KeyError, TypeError) as e:
            what = " ".join(str(e).split())
            raise CheckpointError(f"{path}: {name} is another's ({what:.200}); begin a new run") from e
    return body


def _digest(body: Mapping[str, object]) -> str:
    """Over names, numbers and tensors."""
    h = hashlib.sha256()
    _feed(h, {k: body[k] for k in sorted(body)})
    return h.hexdigest()


def _feed(h: Any, value: object) -> None:
    if isinstance(value, Tensor):
        flat = value.detach().cpu().contiguous()
        h.update(f"{flat.dtype}{tuple(flat.shape)}".encode() + flat.numpy().tobytes())
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            h.update(f"{key!r}:".encode())
            _feed(h, inner)
    elif isinstance(value, (list, tuple)):
        h.update(f"[{len(value)}]".encode())
        for inner in value:
            _feed(h, inner)
    else:
        h.update(json.dumps(value, default=repr).encode())


def _tensors(value: object) -> list[Tensor]:
    if isinstance(value, Tensor):
        return [value]
    inner = value.values() if isinstance(value, Mapping) else value if isinstance(value, (list, tuple)) else ()
    return [t for v in inner for t in _tensors(v)]

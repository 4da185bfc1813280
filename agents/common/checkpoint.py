"""The one checkpoint format: what decides how a run goes on, with the identity of the run, refused if it is another's.

A checkpoint is a PyTorch file of tensors, numbers and texts; nothing is unpickled.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Protocol

import torch

from embodied.assets.cache import write_bytes
from embodied.records import CODE, MAKERS, Identity, differences

CHECKPOINT_FORMAT = "embodied-checkpoint-3"
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
    torch.save({"format": CHECKPOINT_FORMAT, **body}, whole)
    write_bytes(Path(path), whole.getvalue())


def read_checkpoint(path: Path) -> dict[str, Any]:
    """The contents that `write_checkpoint` wrote.

    Raises:
      CheckpointError: truncated, changed, or of another format.
    """
    try:
        with zipfile.ZipFile(path) as z:  # torch does not look at the checksums itself
            if (damaged := z.testzip()) is not None:
                raise ValueError(f"{damaged} does not fit its checksum")
        body = torch.load(path, map_location="cpu", weights_only=True)
    except OSError:
        raise
    except Exception as e:  # a damaged file raises one of half a dozen kinds
        raise CheckpointError(
            f"{path}: cannot be read ({e}); it was changed or cut short, delete it to begin again"
        ) from e
    if not isinstance(body, dict) or body.pop("format", None) != CHECKPOINT_FORMAT or set(body) != set(FIELDS):
        raise CheckpointError(f"{path}: not a checkpoint of format {CHECKPOINT_FORMAT!r}; begin a new run")
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

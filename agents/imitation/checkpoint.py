"""Checkpoints: everything that decides what comes next in a run, written atomically, refused if another run's."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import torch

from agents.imitation.agent_file import TrainedAgent
from agents.imitation.loop import Progress
from agents.tensor_file import put
from assets.cache import write_bytes
from embodied.records import from_json, from_plain


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


def save_run(
    path: Path, kind: str, agent: TrainedAgent, optimizer: torch.optim.Optimizer, progress: Progress, pictures: str = ""
) -> None:
    """Write the state of a run that trains `agent`, atomically; an interruption leaves the checkpoint before it.

    Args:
      pictures: how the pictures were drawn that it learns from; '' leaves that out.
    """
    body = {
        "config": agent.config.to_json(),
        "encoder": agent.encoder_digest,
        "vocabulary": list(agent.vocabulary.words),
        "network": agent.network.state_dict(),
        "optimizer": optimizer.state_dict(),
        "progress": vars(progress),
        **({"pictures": pictures} if pictures else {}),
    }
    write_checkpoint(path, kind, body)


def load_run(
    path: Path,
    kind: str,
    agent: TrainedAgent,
    optimizer: torch.optim.Optimizer,
    may_change: Collection[str],
    pictures: str = "",
) -> Progress:
    """Put a run back into `agent` and `optimizer` and say where it was.

    Args:
      may_change: settings that may differ without changing what was learned so far.
      pictures: as in `save_run`.

    Raises:
      CheckpointError: truncated, of another version, or of a run with other settings, another
        vocabulary, another encoder or other pictures.
    """
    fields = ("encoder", "vocabulary", "config", "network", "optimizer", "progress")
    body = read_checkpoint(Path(path), kind, fields)
    if body["encoder"] != agent.encoder_digest:
        raise CheckpointError(
            f"{path}: this run learned from encoder {body['encoder'][:12]}, the data set has features of "
            f"{agent.encoder_digest[:12]}; use the same data set and encoder, or another run folder"
        )
    if body.get("pictures", pictures) != pictures:
        raise CheckpointError(
            f"{path}: this run learned from pictures {body['pictures']}, the data set has {pictures}; "
            "say --quality, or use another run folder"
        )
    if tuple(body["vocabulary"]) != agent.vocabulary.words:
        raise CheckpointError(f"{path}: the data set has other words than this run began with; use another run folder")
    before, now = from_json(type(agent.config), body["config"]), agent.config
    refuse_changes(path, vars(before), vars(now), may_change)
    put(agent.network, body["network"], path)
    optimizer.load_state_dict(body["optimizer"])
    return from_plain(Progress, body["progress"], f"{path}: progress")

"""Tensors with what they are, in one .safetensors file that notices when a byte of it was changed."""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Mapping
from pathlib import Path

import safetensors
import safetensors.torch
from torch import Tensor, nn

from embodied.assets.cache import write_bytes

CHECKSUM = "checksum"
"""Name of the entry that holds `checksum_of` all else."""


def save_tensors(path: Path, tensors: Mapping[str, Tensor], about: Mapping[str, str]) -> None:
    """Write `tensors` and what they are, atomically.

    Raises:
      OSError: the disk is full, ...; names `path`.
    """
    whole = {k: v.detach().cpu().contiguous() for k, v in tensors.items()}
    metadata = {**about, CHECKSUM: checksum_of(whole, about)}
    write_bytes(Path(path), _sorted(safetensors.torch.save(whole, metadata=metadata)))


def _sorted(file: bytes) -> bytes:
    """A .safetensors file with its metadata in order, so that equal tensors are equal files."""
    (size,) = struct.unpack("<Q", file[:8])
    header = json.loads(file[8 : 8 + size])
    header["__metadata__"] = dict(sorted(header["__metadata__"].items()))
    text = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + file[8 + size :]


def load_tensors(path: Path, form: str, remedy: str) -> tuple[dict[str, Tensor], dict[str, str]]:
    """The contents that `save_tensors` wrote.

    Args:
      form: which about["format"] can be read.
      remedy: how such a file is made, for messages.

    Raises:
      FileNotFoundError, OSError.
      ValueError: truncated, of another format, or changed since it was written.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist; name another file, or {remedy}")
    tensors = read_weights(path)
    with safetensors.safe_open(path, "pt") as f:
        about = dict(f.metadata() or {})
    if about.get("format") != form:
        raise ValueError(f"{path}: format {about.get('format')!r}, this version reads {form!r}; {remedy}")
    if about.pop(CHECKSUM, None) != checksum_of(tensors, about):
        raise ValueError(f"{path}: its contents do not fit its checksum, somebody or something changed it; {remedy}")
    return tensors, about


def read_weights(path: Path) -> dict[str, Tensor]:
    """Tensors of a .safetensors file.

    Raises:
      ValueError: the file is truncated, or of another kind.
    """
    try:
        return safetensors.torch.load_file(path)
    except safetensors.SafetensorError as e:
        raise ValueError(f"{path}: cannot be read as weights ({e}); train it again") from e


def checksum_of(tensors: Mapping[str, Tensor], about: Mapping[str, str]) -> str:
    """Hex SHA-256 over names, types, shapes and bytes of tensors and over `about`."""
    h = hashlib.sha256(json.dumps(dict(about), sort_keys=True).encode())
    for name, tensor in sorted(tensors.items()):
        h.update(json.dumps([name, str(tensor.dtype), list(tensor.shape)]).encode())
        h.update(tensor.cpu().contiguous().numpy().tobytes())
    return h.hexdigest()


def load_into(network: nn.Module, tensors: Mapping[str, Tensor], path: Path) -> None:
    """Give `network` the weights `tensors`, which were read from `path`.

    Raises:
      ValueError: they are another network's.
    """
    try:
        network.load_state_dict(tensors)
    except RuntimeError as e:
        what = " ".join(str(e).split())
        raise ValueError(f"{path}: these are not the weights of its settings ({what:.200}); make it again") from e

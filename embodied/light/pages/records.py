"""Records of arrays as .npz files."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from embodied.assets.cache import DAMAGED, write_bytes
from embodied.assets.decoding import open_arrays

T = TypeVar("T")
LEVEL = 1
"""Of zlib: the default takes five times as long for files that are a tenth smaller."""


def packed(arrays: Mapping[str, np.ndarray]) -> bytes:
    """Bytes as np.savez_compressed writes them, at `LEVEL`."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=LEVEL) as archive:
        for name, a in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as f:
                np.lib.format.write_array(f, np.asanyarray(a), allow_pickle=False)
    return out.getvalue()


def save_record(record: Any, path: Path) -> None:
    """Write a dataclass of arrays."""
    write_bytes(path, packed({x.name: getattr(record, x.name) for x in fields(record)}))


def load_record(kind: type[T], path: Path) -> T | None:
    """Read what `save_record` wrote; None when absent, cut short or of another shape."""
    try:
        with open_arrays(path) as z:
            return kind(**{x.name: z[x.name] for x in fields(kind)})  # type: ignore[arg-type]  # a dataclass
    except (OSError, *DAMAGED):
        return None

"""Procedural, physically scaled, seamlessly tileable materials and their colours on disk."""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path

import cv2
import numpy as np

from embodied.assets.cache import atomic_path, digest, write_json
from embodied.assets.closure import code_digest
from embodied.assets.json_file import read_json
from embodied.assets.materials import maps
from embodied.assets.materials.maps import Maps
from embodied.assets.materials.registry import MATERIALS, PAINTERS, Material, painters_of
from embodied.assets.records import Finish

__all__ = ["MATERIALS", "Maps", "Material", "finish", "make_maps"]
IMAGE, NOTE = "color.png", "maps.json"
"""The colours of a material on disk, and what vouches for them."""


def make_maps(key: str) -> Maps:
    """The maps of material `key`, the same on every call and machine (up to float rounding)."""
    material = _material(key)
    words = np.frombuffer(hashlib.sha256(key.encode()).digest(), dtype="<u4")
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence(words.tolist())))
    return material.draw(material.pixels, rng=rng)


@functools.cache
def finish(key: str, cache: Path) -> Finish:
    """The Finish of material `key`, its picture written below `cache` if it is not there yet.

    Raises:
      ValueError: an unknown key.
    """
    material = _material(key)
    folder = Path(cache) / "materials" / fingerprint(key)[:24]
    mean = _read_mean(folder)
    if mean is None:
        mean = _write(folder, make_maps(key))
    return Finish(
        color=(*mean["color"], 1.0),
        texture=str(folder / IMAGE),
        roughness=mean["roughness"],
        metallic=material.metallic,
        specular=material.specular,
        tile=material.tile,
        detail=material.detail,
    )


def _material(key: str) -> Material:
    if key not in MATERIALS:
        near = [k for k in MATERIALS if k.split("/")[0] == key.split("/")[0]] or sorted(
            {k.split("/")[0] for k in MATERIALS}
        )
        raise ValueError(f"unknown material {key!r}; expected one of {near}")
    return MATERIALS[key]


@functools.cache
def fingerprint(key: str) -> str:
    """Hex digest of all that the maps of `key` depend on: what its recipe is told and the code that it runs.

    The package is left out of the code's closure, because it imports every painter, and the table of all materials,
    of which the recipe is a line.
    """
    material = _material(key)
    modules = {maps.__name__, *(PAINTERS[name].__module__ for name in painters_of(material.maps))}
    code = code_digest(*sorted(modules), without=(__name__, "embodied.assets.data"))
    return digest(key, material.pixels, material.tile, dict(material.maps), code)


def _read_mean(folder: Path) -> dict | None:
    """The note of `_write`, or None unless the picture is whole."""
    try:
        mean = read_json(folder / NOTE)
        numbers = [*mean["color"], mean["roughness"]]
        sane = len(numbers) == 4 and all(isinstance(n, float) and 0 <= n <= 1 for n in numbers)
        return mean if sane and (folder / IMAGE).stat().st_size == mean["bytes"] else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _write(folder: Path, maps: Maps) -> dict:
    """Write the picture and then the note that vouches for it."""
    image = np.ascontiguousarray(np.round(maps.color[..., ::-1] * 255).astype(np.uint8))
    with atomic_path(folder / IMAGE) as temporary:
        if not cv2.imwrite(str(temporary), image, [cv2.IMWRITE_PNG_COMPRESSION, 3]):
            raise OSError(f"could not write {folder / IMAGE}; free some disk space and run again")
        size = temporary.stat().st_size
    mean = {
        "bytes": size,
        "color": [round(float(c), 4) for c in maps.color.reshape(-1, 3).mean(0)],
        "roughness": round(maps.roughness, 4),
    }
    write_json(folder / NOTE, mean)
    return mean

"""Procedural, physically scaled, seamlessly tileable materials and their maps on disk."""

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
from embodied.assets.materials.maps import Maps, normal_map
from embodied.assets.materials.material import ROLES, Material, detail_of
from embodied.assets.materials.registry import MATERIALS, PAINTERS, painters_of
from embodied.assets.records import Finish

__all__ = ["MATERIALS", "ROLES", "Maps", "Material", "finish", "make_maps", "of_role"]
IMAGES = ("color.png", "normal.png", "roughness.png")
"""The maps of a material on disk."""


def of_role(role: str) -> tuple[Material, ...]:
    """All materials of a role, sorted by key.

    Raises:
      ValueError: an unknown role.
    """
    if role not in ROLES:
        raise ValueError(f"unknown material role {role!r}; use one of {ROLES}")
    return tuple(m for m in MATERIALS.values() if role in m.roles)


def make_maps(key: str) -> Maps:
    """The maps of material `key`, the same on every call and machine (up to float rounding)."""
    material = _material(key)
    words = np.frombuffer(hashlib.sha256(key.encode()).digest(), dtype="<u4")
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence(words.tolist())))
    return material.recipe(material.pixels, material.tile, rng=rng)


@functools.cache
def finish(key: str, cache: Path) -> Finish:
    """The Finish of material `key`, its maps written below `cache` if they are not there yet.

    Raises:
      ValueError: an unknown key.
    """
    material = _material(key)
    folder = Path(cache) / "materials" / fingerprint(key)[:24]
    mean = _read_mean(folder)
    if mean is None:
        mean = _write(folder, make_maps(key), material.tile)
    return Finish(
        color=(*mean["color"], 1.0),
        texture=str(folder / "color.png"),
        normal_map=str(folder / "normal.png"),
        roughness_map=str(folder / "roughness.png"),
        roughness=mean["roughness"],
        metallic=material.metallic,
        specular=material.specular,
        tile=material.tile,
        detail=detail_of(material),
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
    modules = {maps.__name__, *(PAINTERS[name].__module__ for name in painters_of(material.told))}
    code = code_digest(*sorted(modules), without=(__name__, "embodied.assets.data"))
    return digest(key, material.pixels, material.tile, dict(material.told), code)


def _read_mean(folder: Path) -> dict | None:
    """The note of `_write`, or None unless all three maps are whole."""
    note = folder / "maps.json"
    try:
        mean = read_json(note)
        sizes = {name: (folder / name).stat().st_size for name in IMAGES}
        numbers = [*mean["color"], mean["roughness"]]
        whole = (
            sizes == mean["bytes"] and len(numbers) == 4 and all(isinstance(n, float) and 0 <= n <= 1 for n in numbers)
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return mean if whole else None


def _write(folder: Path, maps: Maps, tile: float) -> dict:
    """Write the three PNGs and then the note that vouches for them."""
    images = (
        np.round(maps.color[..., ::-1] * 255).astype(np.uint8),
        normal_map(maps.height, tile)[..., ::-1],
        np.round(maps.roughness * 255).astype(np.uint8),
    )
    sizes = {}
    for name, image in zip(IMAGES, images, strict=True):
        with atomic_path(folder / name) as temporary:
            if not cv2.imwrite(str(temporary), np.ascontiguousarray(image), [cv2.IMWRITE_PNG_COMPRESSION, 3]):
                raise OSError(f"could not write {folder / name}; free some disk space and run again")
            sizes[name] = temporary.stat().st_size
    mean = {
        "bytes": sizes,
        "color": [round(float(c), 4) for c in maps.color.reshape(-1, 3).mean(0)],
        "roughness": round(float(maps.roughness.mean()), 4),
    }
    write_json(folder / "maps.json", mean)
    return mean

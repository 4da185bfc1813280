"""Procedural, physically scaled, seamlessly tileable materials and their colours on disk."""

import functools
import hashlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import cv2
import numpy as np

from embodied.assets import rows
from embodied.assets.cache import atomic_path, digest, write_json
from embodied.assets.closure import code_digest
from embodied.assets.json_file import RecordError, from_plain, read_json
from embodied.assets.materials import art, maps, mineral, surface, textile, wood
from embodied.assets.materials.maps import Canvas, Maps
from embodied.assets.records import DETAILS, Finish
from embodied.assets.rows import Row

PAINTERS = rows.made_in(art, maps, mineral, surface, textile, wood)
"""Painters that a row may name with "by", as '<module>.<name>': recipes, and layouts, motifs and cloths for them."""


@dataclass(frozen=True, eq=False)
class Material:
    """A procedural material."""

    key: str
    """'<maker>/<variant>'."""
    family: str
    """Its matter: 'wood', 'tile', 'carpet', 'paint', 'wallpaper', 'stone', 'fabric', 'metal', ..."""
    name: str
    """'oak planks', 'sage green paint'."""
    colours: tuple[str, ...]
    materials: tuple[str, ...]
    tile: float
    """Side of the square the maps cover, metres."""
    pixels: int
    """Side of the maps."""
    maps: Mapping[str, Any]
    """Description of what draws them: {"by": painter, argument: value, ...}."""
    specular: float = 0.5
    metallic: float = 0.0
    detail: str | None = None
    """The detail that it shows from nearby, one of embodied.assets.records.DETAILS; None for what is smooth."""

    def __post_init__(self) -> None:
        rules = {
            "'tile' should be a length from 0.01 to 10 metres": 0.01 <= self.tile <= 10,
            "'pixels' should be a whole number from 64 to 4096": 64 <= self.pixels <= 4096,
            f"'detail' should be one of {DETAILS}": self.detail in (None, *DETAILS),
            "'specular' and 'metallic' should be numbers from 0 to 1": min(self.specular, self.metallic) >= 0
            and max(self.specular, self.metallic) <= 1,
        }
        recipe_of(self.maps)
        if wrong := [rule for rule, holds in rules.items() if not holds]:
            raise ValueError(wrong[0])

    def draw(self, n: int, *, rng: np.random.Generator) -> Maps:
        """The maps, n pixels wide."""
        return recipe_of(self.maps)(Canvas(n, self.tile, rng))


def read_materials(where: str, table: Row) -> Mapping[str, Material]:
    """The materials of a table {"groups": [...]} by key, keys sorted.

    Raises:
      RecordError: a field that is unknown, missing, or holds what it should not; a key twice.
    """
    materials: dict[str, Material] = {}
    for group in table["groups"]:
        shared = {name: value for name, value in group.items() if name != "rows"}
        for key, row in group["rows"].items():
            if key in materials:
                raise RecordError(f"{where}: {key!r} stands there twice; give one of them another key")
            whole = {"key": key} | rows.merged(shared, row, deep=("maps",))
            materials[key] = from_plain(Material, whole, f"{where}: {key!r}")
    return MappingProxyType(dict(sorted(materials.items())))


def recipe_of(described: Mapping[str, Any]) -> Callable[..., Any]:
    """The meaning of {"by": painter, argument: value, ...}: a function that knows these arguments, or the record of
    a class; values may be such objects themselves, lists become tuples.

    Raises:
      ValueError: an unknown painter, an argument it does not take.
    """
    arguments = dict(described)
    name = arguments.pop("by", None)
    if name not in PAINTERS:
        raise ValueError(f'its maps should have a "by" out of {", ".join(sorted(PAINTERS))}, got {name!r}')
    painter = PAINTERS[name]
    taken = [p.name for p in inspect.signature(painter).parameters.values()]
    if unknown := sorted(set(arguments) - set(taken)):
        raise ValueError(f"{name} does not take {unknown}; it takes {taken}")
    values = {argument: _value(value) for argument, value in arguments.items()}
    return painter(**values) if isinstance(painter, type) else functools.partial(painter, **values)


def painters_of(recipe: object) -> set[str]:
    """Every painter that a recipe of the table names."""
    if isinstance(recipe, dict):
        return {recipe["by"]}.union(*(painters_of(value) for value in recipe.values()))
    return set()


def _value(value: Any) -> Any:
    if isinstance(value, dict):
        return recipe_of(value)
    return tuple(_value(v) for v in value) if isinstance(value, list) else value


MATERIALS: Mapping[str, Material] = read_materials("materials.json", rows.read_json(rows.DATA / "materials.json"))
"""Every material by key, keys sorted."""


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

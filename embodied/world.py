"""World: a house with its navigation graph and what is seen from every node, drawn when asked and kept on disk."""

from __future__ import annotations

import functools
import importlib.metadata
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Self

from tqdm import tqdm

from assets.cache import digest
from embodied import gl
from embodied.house.house import House
from embodied.house.validation import load_house
from embodied.navigation.graph import NavGraph, build_graph
from embodied.render.classic import Renderer
from embodied.render.panorama import Panorama
from embodied.render.panorama_file import PanoramaFile, PanoramaFileError, write_panoramas
from embodied.render.sightings import FACE, Sighting, SightingTable, load_table, save_table, sightings_table
from embodied.scene.house_meshes import Part, house_parts, owners
from embodied.scene.lit_pages import LitPages

if TYPE_CHECKING:
    from assets.catalogue import Catalogue
    from embodied.interface import Sight
    from embodied.light import Bake
    from embodied.light.reference import Tracer

QUALITIES = ("unlit", "baked", "glossy", "reference")
TRACED = ("glossy", "reference")
"""Qualities whose panoramas are ray-traced; everything else, free cameras too, is drawn by a Renderer."""
SIZES = (8, 4096)
"""Sides of a cube face that can be drawn, pixels."""
KEPT = 8
"""Decoded panoramas held in memory; one of 512 pixels takes 18 MB."""
log = logging.getLogger(__name__)
ROOT = Path(__file__).resolve().parent.parent
PICTURE_SOURCES = (
    "assets/**/*.py",
    "assets/data/*.json",
    "embodied/light/*.py",
    "embodied/house/house.py",
    "embodied/scene/*.py",
    "embodied/render/*.py",
)
"""Files that decide what a picture shows; a cached picture made by other versions of them is not used."""


class World:
    """Owns, while open, a renderer (made on first need) and the panorama file (where there is one)."""

    def __init__(
        self,
        house: House,
        catalogue: Catalogue,
        graph: NavGraph,
        cache: Path,
        *,
        size: int = 256,
        quality: str = "unlit",
        backend: str = "classic",
        light: str = "normal",
        file: Path | None = None,
    ) -> None:
        """See `open_world`."""
        if quality not in QUALITIES:
            raise ValueError(f"quality {quality!r} is unknown; use one of {QUALITIES}")
        if not SIZES[0] <= size <= SIZES[1]:  # said now, not after the house was lit
            raise ValueError(f"size is {size} pixels; a cube face needs {SIZES[0]} to {SIZES[1]}")
        self.house, self.catalogue, self.graph, self.cache = house, catalogue, graph, Path(cache)
        self.size, self.quality, self.backend, self.light = size, quality, backend, light
        self._path = file
        self._renderer: Renderer | None = None
        self._tracer: Tracer | None = None
        self._file: PanoramaFile | None = None
        self._refused = self._progress = False
        self._recent = functools.lru_cache(maxsize=KEPT)(self._load)

    @property
    def name(self) -> str:
        return self.house.name

    @functools.cached_property
    def parts(self) -> tuple[Part, ...]:
        """Everything visible in the house, as meshes."""
        return house_parts(self.house, self.catalogue)

    @functools.cached_property
    def owners(self) -> tuple[str, ...]:
        """Instance id i + 1 belongs to owners[i]."""
        return owners(self.house)

    @functools.cached_property
    def _origin(self) -> dict[str, object]:
        """What the world's geometry depends on."""
        return {
            "house": self.house.digest,
            "nodes": digest(self.graph.positions.tolist()),
            "mujoco": importlib.metadata.version("mujoco"),
            "code": code_digest(),
        }

    @functools.cached_property
    def fingerprint(self) -> dict[str, object]:
        """All that the panoramas depend on, and what draws them."""
        light = None if self.quality == "unlit" else self.light
        return self._origin | {
            "size": self.size,
            "quality": self.quality,
            "backend": self.backend,
            "light": light,
            "renderer": str(gl.info()),
        }

    @functools.cached_property
    def path(self) -> Path:
        """Where the panoramas of this world are, or will be, on disk."""
        return self._path or self.cache / "panoramas" / f"{digest(self.fingerprint)[:32]}.pano"

    @property
    def lit(self) -> LitPages | None:
        """The house with its baked light painted on; None for unlit worlds. Bakes on first use."""
        return None if self.quality == "unlit" else self._bake.lit

    @property
    def renderer(self) -> Renderer:
        """The renderer of this world, for pictures from anywhere; opened on first use."""
        if self._renderer is None:
            baked = self.quality != "unlit"
            self._renderer = Renderer(
                self.house,
                self.catalogue,
                quality="baked" if baked else "unlit",
                backend=self.backend,
                size=self.size,
                lit=self._bake.lit if baked else None,
            )
        return self._renderer

    @functools.cached_property
    def _bake(self) -> Bake:
        from embodied import light  # late: loads the path tracer

        if not self._progress:
            return light.bake(self.house, self.catalogue, self.cache, self.light)
        with light.progress_bar() as tell:
            return light.bake(self.house, self.catalogue, self.cache, self.light, progress=tell)

    @property
    def _source(self) -> Renderer | Tracer:
        """What draws the panoramas."""
        if self.quality not in TRACED:
            return self.renderer
        if self._tracer is None:
            from embodied.light.reference import Tracer  # late: loads the path tracer

            self._tracer = Tracer(self._bake, self.house, quality=self.quality, size=self.size)
        return self._tracer

    def panorama(self, node: int) -> Panorama:
        """The panorama of a node: from the file where it is there, else drawn now."""
        if not 0 <= node < len(self.graph.positions):
            raise IndexError(f"world {self.name!r} has the nodes 0 to {len(self.graph.positions) - 1}, not {node}")
        return self._recent(node)

    def sightings(self, node: int) -> tuple[Sighting, ...]:
        """The objects that can be seen from a node, the largest in view first. Needs no panoramas."""
        return self._sightings.at(node, self.house)

    def node_of(self, sight: Sight) -> int:
        """The node behind a sight; for renderers and recordings, never for a policy.

        Raises:
          ValueError: the sight is of another world.
        """
        if sight._world != self.name:
            raise ValueError(f"this sight is of world {sight._world!r}, not of {self.name!r}; pass it to its own world")
        return sight._node

    def render_all(self, progress: bool = False) -> Path:
        """Draw the panoramas of all nodes into the file, unless a whole one is there; returns its path."""
        self._progress = progress
        file = self._open_file()
        if file is not None and (damaged := file.damaged()):
            log.warning("%s: %s of its pictures are damaged; drawing again", self.path, len(damaged))
            file.close()
            file = self._file = None
        if file is None:
            write_panoramas(self.path, self._draw_all(progress), self.fingerprint)
            self._refused = False
            self._recent.cache_clear()
        return self.path

    def close(self) -> None:
        """Free the renderer and the file; a later use opens them again."""
        if self._renderer is not None:
            self._renderer.close()
        self._renderer = self._tracer = None
        if self._file is not None:
            self._file.close()
            self._file = None
        self._recent.cache_clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _load(self, node: int) -> Panorama:
        file = self._open_file()
        return self._source.panorama(self.graph.positions[node]) if file is None else file.read(node)

    def _draw_all(self, progress: bool) -> Iterator[Panorama]:
        source = self._source
        for position in tqdm(self.graph.positions, "panoramas", disable=not progress, unit="node"):
            yield source.panorama(position)

    def _open_file(self) -> PanoramaFile | None:
        """The panorama file, if it is whole and of this very world."""
        if self._file is None and not self._refused and self.path.exists():
            self._refused = True
            try:
                file = PanoramaFile(self.path)
            except PanoramaFileError as e:
                log.warning("%s", e)
                return None
            if file.meta != self.fingerprint:
                log.warning("%s was made from another house or by another version; drawing again", self.path)
                file.close()
                return None
            self._file, self._refused = file, False
        return self._file

    @functools.cached_property
    def _sightings(self) -> SightingTable:
        path = self.cache / "sightings" / f"{digest(self._origin, FACE)[:32]}.npz"
        table = load_table(path)
        if table is None:
            with Renderer(self.house, self.catalogue, size=FACE) as renderer:
                table = sightings_table(
                    [renderer.seen(p, FACE) for p in self.graph.positions], len(self.house.placements)
                )
            save_table(path, table)
        return table


def open_world(
    house: House,
    catalogue: Catalogue,
    cache: Path,
    *,
    graph: NavGraph | None = None,
    size: int = 256,
    quality: str = "unlit",
    backend: str = "classic",
    light: str = "normal",
) -> World:
    """A world over `house`; nothing is drawn until asked for.

    Args:
      catalogue: where meshes and materials come from.
      cache: folder for what is expensive; may be deleted at any time.
      graph: the navigation graph; built when not given.
      size: side of a cube face, pixels.
      quality: 'unlit', 'baked', 'glossy' or 'reference'.
      backend: 'classic' or 'filament'.
      light: name of the light settings that the baked qualities use, one of embodied.light.QUALITIES.
    """
    graph = graph or build_graph(house, catalogue)
    return World(house, catalogue, graph, cache, size=size, quality=quality, backend=backend, light=light)


def open_folder(
    folder: Path,
    catalogue: Catalogue,
    cache: Path,
    *,
    size: int = 256,
    quality: str = "unlit",
    backend: str = "classic",
    light: str = "normal",
) -> World:
    """The world of a folder that `embodied house` wrote; its panoramas go to panoramas.pano there."""
    folder = Path(folder)
    if not (folder / "house.json").exists():
        raise FileNotFoundError(f"{folder} holds no house.json; make one with `embodied house --seed 7 --out {folder}`")
    house = load_house(folder / "house.json", catalogue)
    graph = build_graph(house, catalogue)
    return World(
        house,
        catalogue,
        graph,
        cache,
        size=size,
        quality=quality,
        backend=backend,
        light=light,
        file=folder / "panoramas.pano",
    )


@functools.cache
def code_digest() -> str:
    """Hex digest of the sources that decide what a picture shows."""
    files = sorted({f for pattern in PICTURE_SOURCES for f in ROOT.glob(pattern)})
    return digest(*(f.read_bytes() for f in files))[:16]

"""Light a house once: from House to a folder of pages that renderers show and tracers read.

A bake lives in `<cache>/light/<key>`, where the key is made of the house's digest, all its parts with their meshes and
materials, the settings and the code that bakes (`embodied.light.settings.light_code`). Its files are
`embodied.light.files`'; an interrupted bake goes on where it stopped.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
import os
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from tqdm import tqdm

from assets.cache import digest, write_json
from assets.catalogue import Catalogue
from assets.records import DETAILS, Finish
from embodied.house.house import WEATHERS, House, Sky
from embodied.light import tone
from embodied.light.atlas import Atlas, Page, atlas_of, coarsened, things_of
from embodied.light.backend import device, rest, warn
from embodied.light.colours import ColourMaps
from embodied.light.compose import Composer, Solved, page_of
from embodied.light.emitters import in_the_open, lamps_of
from embodied.light.files import (
    Bake,
    StaleBake,
    facts_of,
    kept_light,
    open_bake,
    page_files,
    reopened,
    same_atlas,
    write_jpeg,
    write_lamps,
    write_meshes,
    write_page,
)
from embodied.light.memory import Memory
from embodied.light.radiosity import space_of, with_env
from embodied.light.settings import QUALITIES, Settings, light_code, settings_of
from embodied.light.sites import sites_of
from embodied.light.sky import outdoors as outdoors_of
from embodied.light.solve import Luxels, Problem, Radiosity, luxels_of, solve, with_glow
from embodied.light.surroundings import Outside, daylit, dome_mesh, outside_of
from embodied.light.tone import expose
from embodied.light.unwrap import areas_of
from embodied.locks import locked
from embodied.scene.house_meshes import house_parts, owners
from embodied.scene.lit_pages import LitMesh
from embodied.scene.part import Part
from embodied.seeds import stream

Progress = Callable[[str, float], None]


SECONDS = {"fast": 1.0, "normal": 2.5, "high": 8.0}
"""Of one core per square metre of a house, by quality, with LLVM and furniture that is new to the cache."""
SCALAR_FACTOR = 10.0
"""How much longer it takes without LLVM."""
MOST_CORES = 8
"""More shorten it little."""
STAGES = {
    "unwrapping": (0.0, 0.2),
    "direct light": (0.2, 0.4),
    "bounces": (0.4, 0.65),
    "smoothing": (0.65, 0.75),
    "pages": (0.75, 1.0),
    "done": (1.0, 1.0),
}
"""Where each stage lies on the progress bar: its rough share of a bake's time."""


def duration(house: House, quality: str) -> str:
    """About how long `bake` takes on this machine, in words."""
    cores = min(os.cpu_count() or 1, MOST_CORES)
    slower = SCALAR_FACTOR if device() == "scalar" else 1.0
    seconds = slower * house.area * SECONDS[quality] / cores
    return f"about {math.ceil(seconds / 60)} minutes" if seconds > 60 else "about a minute"


@contextlib.contextmanager
def progress_bar(*, shown: bool = True) -> Iterator[Progress]:
    """A bar on stderr for `bake`; silent where stderr is no terminal, or without `shown`."""
    with tqdm(
        total=100,
        desc="light",
        unit="%",
        disable=None if shown else True,
        bar_format="{desc:<20}{percentage:3.0f}%|{bar}| {elapsed}",
    ) as bar:

        def tell(stage: str, done: float) -> None:
            start, end = STAGES[stage]
            bar.set_description(stage)
            bar.update(max(0.0, 100 * (start + (end - start) * done) - bar.n))

        yield tell


def key_of(house: House, catalogue: Catalogue, settings: Settings) -> str:
    """What a bake is filed under: another catalogue, model or material makes another bake."""
    return _key(house, looks_of(house_parts(house, catalogue)), settings)


def _key(house: House, looks: str, settings: Settings) -> str:
    return digest("light", light_code(), house.digest, owners(house), looks, dataclasses.asdict(settings))[:24]


def looks_of(parts: Sequence[Part]) -> str:
    """Hex digest of all parts: whose they are, where they stand, and their meshes, finishes and colour maps by content,
    wherever these lie on disk."""
    textures = {p.mesh.finish.texture for p in parts}
    maps = {t: digest(Path(t).read_bytes()) for t in sorted(t for t in textures if t is not None)}
    meshes: dict[int, str] = {}
    for mesh in (p.mesh for p in parts):
        if id(mesh) not in meshes:
            finish = dataclasses.replace(
                mesh.finish, texture=maps.get(mesh.finish.texture or ""), normal_map=None, roughness_map=None
            )
            meshes[id(mesh)] = digest(
                *(np.ascontiguousarray(a).tobytes() for a in (mesh.vertices, mesh.faces, mesh.normals, mesh.uv)),
                repr(finish),
            )
    return digest([(p.owner, p.kind, p.room, p.mesh_key, p.position, p.yaw, meshes[id(p.mesh)]) for p in parts])


def bake(
    house: House,
    catalogue: Catalogue,
    cache: Path,
    settings: Settings | str = "normal",
    *,
    progress: Progress = lambda stage, done: None,
) -> Bake:
    """Light `house`, or open the bake that is already there.

    Args:
      settings: or the name of a quality: 'fast', 'normal', 'high'.
      progress: told the stage's name and how far it is, 0 to 1.

    Raises:
      LightError: Mitsuba or LLVM is missing, or the bake disagrees with the path tracer.
    """
    return bake_all((house,), catalogue, cache, settings, progress=progress)[0]


def bake_all(
    lightings: Sequence[House],
    catalogue: Catalogue,
    cache: Path,
    settings: Settings | str = "normal",
    *,
    progress: Progress = lambda stage, done: None,
) -> tuple[Bake, ...]:
    """`bake` for the same house at several hours: what does not depend on sky and lamps is computed once.

    Args:
      lightings: one house that differs in its sky and lamps alone (`lightings_of`).

    Raises:
      ValueError: they are of different houses.
    """
    settings = settings_of(settings) if isinstance(settings, str) else settings
    if len({_unlit(h).digest for h in lightings}) > 1:
        raise ValueError("bake_all lights one house at several hours; what came differs in more than sky and lamps")
    shared, out = None, []
    parts = house_parts(lightings[0], catalogue)  # which know neither sky nor lamps
    looks = looks_of(parts)
    for house in lightings:
        folder = _folder(cache, house, looks, settings)
        with contextlib.suppress(StaleBake):
            out.append(open_bake(folder, house))
            continue
        with locked(folder, wait=True):
            done = reopened(folder, house)  # whoever held it may have made it
            if done is None:
                if shared is None:
                    several = len(lightings) > 1
                    shared = Shared(house, parts, Path(cache) / "light", settings, several=several, progress=progress)
                done = _make(house, shared, folder, settings, progress)
        out.append(done)
    return tuple(out)


def _unlit(house: House) -> House:
    lights = tuple(dataclasses.replace(x, on=True) for x in house.lights)
    bare = Sky(landscape=house.sky.landscape, season=house.sky.season)  # which the parts know
    return dataclasses.replace(house, sky=bare, lights=lights)


def lightings_of(house: House, count: int) -> tuple[House, ...]:
    """The house as it is, and `count` - 1 other lightings of it: hour, weather and lamps drawn from its seed.

    By day a lamp in four is on, from dusk on three in four; every lighting keeps one lamp or the sun.
    """
    out = [house]
    for k in range(1, count):
        rng = stream(house.seed, "light", "lighting", k)
        hour = round(float(rng.uniform(6.0, 23.0)), 2)
        weather = str(rng.choice(WEATHERS))
        on = rng.random(len(house.lights)) < (0.25 if 7.5 < hour < 17.5 else 0.75)
        if len(on) and not on.any() and not 7.5 < hour < 17.5:
            on[int(rng.integers(len(on)))] = True
        lights = tuple(dataclasses.replace(x, on=bool(o)) for x, o in zip(house.lights, on))
        sky = dataclasses.replace(house.sky, hour=hour, weather=weather)
        out.append(dataclasses.replace(house, sky=sky, lights=lights))
    return tuple(out)


class Shared:
    """What all lightings of a house share: surfaces, and what rays meet."""

    def __init__(
        self,
        house: House,
        parts: Sequence[Part],
        cache: Path,
        settings: Settings,
        *,
        several: bool = False,
        progress: Progress = lambda stage, done: None,
    ) -> None:
        """`cache` holds what belongs to assets alone; `several` keeps what another lighting can use."""
        self.took: dict[str, float] = {}
        clock = _Clock(self.took)
        every = [p for p in parts if len(p.mesh.faces)]
        self.maps, self._house, self._cache, self._sharpness = ColourMaps(cache), house, cache, settings.sharpness
        self._outer = [p for p in every if p.kind == "outdoor"]
        things = things_of(
            [p for p in every if p.kind != "outdoor"],
            density=settings.density,
            budget=settings.budget,
            sharpness=settings.sharpness,
            cache=cache,
            progress=lambda i, n: progress("unwrapping", i / n),
        )
        clock("unwrap")
        self.atlas = atlas_of(coarsened(things, settings.texels))
        self.lux = luxels_of(self.atlas, self.maps)
        self.space = space_of(self.atlas, self.lux.texels)
        clock("luxels")
        self.sites = sites_of(self.lux, settings.every, few=settings.few, things=settings.things)
        self.memory = Memory() if several else None
        clock("sites")

    @functools.cached_property
    def outside(self) -> Outside | None:
        """What the sun and the sky light outside."""
        return outside_of(self._outer, self.atlas, self._cache, self.maps, self._sharpness)

    @functools.cached_property
    def meshes(self) -> tuple[list[LitMesh], list[np.ndarray]]:
        """What renderers draw, and the gloss of its faces."""
        first = len(self.atlas.pages)
        meshes, gloss = _meshes(self.atlas, 0)
        if self.outside is not None:
            more, more_gloss = _meshes(self.outside.atlas, first)
            meshes += [dataclasses.replace(m, kind="outdoor") for m in more]
            gloss += more_gloss
            first += len(self.outside.atlas.pages)
        return [*meshes, dome_mesh(self._house, first)], gloss


def solve_house(
    house: House,
    shared: Shared,
    settings: Settings,
    folder: Path | None = None,
    *,
    progress: Progress = lambda s, d: None,
    took: dict[str, float] | None = None,
) -> Solved:
    """Everything up to the light of every luxel, which is kept in `folder` where one is given."""
    clock = _Clock({} if took is None else took)
    atlas = shared.atlas
    if folder is not None:
        same_atlas(folder, atlas)
    outdoors = outdoors_of(house)
    clock("outdoors")
    space = with_env(shared.space, outdoors.picture)
    lamps = tuple(in_the_open(x, space.scene) for x in lamps_of(house, atlas))
    lux = with_glow(shared.lux, house, atlas, lamps)
    clock("luxels")
    problem = Problem(house, atlas, lux, shared.sites, space, outdoors, lamps, settings, shared.memory)
    light = kept_light(folder, len(lux.position), lambda: solve(problem, progress, clock))
    clock("direct")
    outside = np.median(outdoors.picture[300:540].reshape(-1, 3), axis=0)
    exposure = expose(house, _light_of_rooms(house, atlas, lux, light), outside)
    return Solved(house, atlas, lux, light, outdoors, lamps, exposure, space)


def _make(house: House, shared: Shared, folder: Path, settings: Settings, progress: Progress) -> Bake:
    from embodied.light.check import check

    took, shared.took = shared.took, {}
    start, used = time.perf_counter(), time.process_time()
    s = solve_house(house, shared, settings, folder, progress=progress, took=took)
    clock = _Clock(took)
    dark = [r.id for r, g in zip(house.rooms, _levels(s)) if g < tone.DARKEST]
    if dark and house.sky.hour > 8 and house.sky.hour < 17:
        warn(f"rooms {dark} have neither window nor lamp that lights them; they are shown nearly dark")
    error = check(s, settings.tolerance)
    clock("check")
    composer = Composer(s, settings, shared.maps, shared.memory)
    for i in range(len(s.atlas.pages)):
        progress("pages", i / len(s.atlas.pages))
        if not all((folder / n).exists() for n in page_files(i)):
            one = page_of(i, composer)
            write_page(folder, i, one, settings.jpeg)
    clock("pages")
    first = len(s.atlas.pages)
    pictures = daylit(shared.outside, s.outdoors, s.exposure, settings.sky_rays)
    for i, picture in enumerate(pictures, first):
        write_jpeg(folder / f"page_{i:03d}.jpg", picture, settings.jpeg)
    clock("surroundings")
    meshes, gloss = shared.meshes
    write_meshes(folder, meshes, gloss)
    write_lamps(folder, s.lamps)
    clock("meshes")
    (folder / "stage_light.npz").unlink(missing_ok=True)
    manifest = {
        **facts_of(s, meshes, _probes(s), folder),
        "settings": dataclasses.asdict(settings),
        "pages": first + len(pictures),
        "seconds": {k: round(v, 2) for k, v in took.items()},
        "total_seconds": round(time.perf_counter() - start, 1),
        "processor_seconds": round(time.process_time() - used, 1),
        "check": error,
    }
    write_json(folder / "manifest.json", manifest)
    progress("done", 1.0)
    return Bake(folder, manifest)


class _Clock:
    """Notes the processor seconds between calls under a name."""

    def __init__(self, took: dict[str, float]) -> None:
        self._took, self._last = took, time.process_time()

    def __call__(self, name: str) -> None:
        rest()
        now = time.process_time()
        self._took[name] = self._took.get(name, 0.0) + now - self._last
        self._last = now


def _light_of_rooms(house: House, atlas: Atlas, lux: Luxels, light: Radiosity) -> dict[str, np.ndarray]:
    """85th percentile of e (without the sun's own) on the shell of every room; up to a third more where much is far
    brighter than that (`brightest`)."""
    e = light.soft
    room_of_owner = np.array(
        [[r.id for r in house.rooms].index(r) if r in house.room_by_id else -1 for r in atlas.rooms]
    )
    room = room_of_owner[lux.owner]
    out = {}
    for i, r in enumerate(house.rooms):
        mine = (room == i) & lux.shell & light.good
        full = np.percentile(e[mine], 85, axis=0) if mine.any() else np.zeros(3)
        most = brightest(e[mine]).mean() if mine.any() else 0.0
        out[r.id] = full * np.clip(0.45 * most / max(full.mean(), 1e-9), 1.0, 1.35)
    return out


def brightest(e: np.ndarray) -> np.ndarray:
    """(3,) geometric mean of the 93rd to the 99th percentile of light (n, 3).

    The light of a room with a sunlit sill or a lamp near a wall leaps somewhere in its brightest tenth, from 2 to 14
    times its middle; one percentile falls before or after the leap by chance, and exposure followed it by a fifth.
    """
    tail = np.percentile(e, np.linspace(93, 99, 25), axis=0)
    return np.exp(np.log(np.maximum(tail, 1e-9)).mean(axis=0))


def _levels(s: Solved) -> list[float]:
    light = _light_of_rooms(s.house, s.atlas, s.lux, s.light)
    return [float(light[r.id] @ [0.2126, 0.7152, 0.0722]) for r in s.house.rooms]


def _probes(s: Solved) -> dict[str, list]:
    from embodied.light.probe import ambient_cubes

    return {r.id: cube.round(4).tolist() for r, cube in zip(s.house.rooms, ambient_cubes(s))}


def _meshes(atlas: Atlas, first: int) -> tuple[list[LitMesh], list[np.ndarray]]:
    """One mesh per owner and page, corners welded, thin faces listed twice, and the gloss of its faces.

    Args:
      first: number of the atlas's first page.

    Returns:
      Meshes, and for each (m, 4) uint8: roughness, specular and metallic times 255, and detail (see gloss_of and
      detail_of).
    """
    out, shine = [], []
    for number, page in enumerate(atlas.pages, first):
        uv = page.luxels / np.array([page.width, page.height], np.float32)
        for o in np.unique(page.owner):
            mine = np.nonzero(page.owner == o)[0]
            both = np.concatenate([page.corners[mine], uv[mine]], axis=-1).reshape(-1, 5)
            _, corner, index = np.unique(np.round(both, 5), axis=0, return_index=True, return_inverse=True)
            faces = index.reshape(-1, 3).astype(np.int32)
            thin = page.thin[mine]
            faces = np.concatenate([faces, faces[thin][:, ::-1]])
            real = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
            alpha = (
                min(f.color[3] for f in (page.finishes[k] for k in np.unique(page.finish[mine]))) if page.glass else 1.0
            )
            out.append(
                LitMesh(
                    atlas.owners[o],
                    atlas.kinds[o],
                    atlas.rooms[o],
                    number,
                    both[corner, :3].astype(np.float32),
                    faces[real],
                    both[corner, 3:].astype(np.float32),
                    float(alpha),
                )
            )
            kind = np.array([gloss_of(f) for f in page.finishes], np.uint8)[page.finish[mine]]
            kind = np.column_stack([kind, detail_of(page, mine)])
            area = areas_of(page.corners[mine])
            mean = tuple(((kind[:, :2] * area[:, None]).sum(0) / max(area.sum(), 1e-12) / 255).round(3).tolist())
            out[-1] = dataclasses.replace(out[-1], gloss=mean)
            shine.append(np.concatenate([kind, kind[thin]])[real])
    return out, shine


def gloss_of(finish: Finish) -> tuple[int, int, int]:
    """Roughness, specular and metallic times 255; a mirror is smooth metal."""
    if finish.mirror:
        return 4, 255, 255
    rough, specular, metal = (min(max(x, 0.0), 1.0) for x in (finish.roughness, finish.specular, finish.metallic))
    return round(255 * rough), round(255 * specular), round(255 * metal)


def detail_of(page: Page, faces: np.ndarray) -> np.ndarray:
    """(k,) uint8 of some faces: number of what they show from nearby, from 1 on, and 16 times that of the axis along
    which their texture's u runs, 3 for none; 0 for smooth ones."""
    number = np.array([1 + DETAILS.index(f.detail) if f.detail else 0 for f in page.finishes], np.uint8)
    corners, uv = page.corners[faces], page.uv[faces].astype(np.float64)
    sides, turns = corners[:, 1:] - corners[:, :1], uv[:, 1:] - uv[:, :1]
    area = turns[:, 0, 0] * turns[:, 1, 1] - turns[:, 0, 1] * turns[:, 1, 0]
    along = sides[:, 0] * turns[:, 1, 1, None] - sides[:, 1] * turns[:, 0, 1, None]
    axis = np.where(np.abs(area) > 1e-12, np.abs(along).argmax(1), 3)
    detail = number[page.finish[faces]]
    return np.where(detail > 0, detail + 16 * axis, 0).astype(np.uint8)


def forget(cache: Path, house: House, catalogue: Catalogue, settings: Settings | str) -> None:
    """Delete the bake of `house`, finished or not."""
    settings = settings_of(settings) if isinstance(settings, str) else settings
    shutil.rmtree(_folder(cache, house, looks_of(house_parts(house, catalogue)), settings), ignore_errors=True)


def _folder(cache: Path, house: House, looks: str, settings: Settings) -> Path:
    """Where the bake of `house` is, or will be; its name begins with the quality's. `looks`: of its parts."""
    name = next((name for name, known in QUALITIES.items() if known == settings), "custom")
    return Path(cache) / "light" / f"{name}-{_key(house, looks, settings)}"

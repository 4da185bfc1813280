"""Light a house once: from House to a folder of pages that renderers show and tracers read.

A bake lives in `<cache>/light/<key>`, where the key is made of the house's digest, all its parts with their meshes and
materials, the settings and the code that bakes (`embodied.light.settings.light_code`). Its files are
`embodied.light.pages.files`'; an interrupted bake goes on where it stopped.
"""

import contextlib
import dataclasses
import functools
import logging
import math
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from tqdm import tqdm

from embodied.assets.cache import atomic_path, digest, write_bytes, write_json
from embodied.assets.catalogue import Catalogue
from embodied.assets.decoding import jpeg, load_record, save_record
from embodied.house.house import WEATHERS, House, Sky
from embodied.light.backend import LightingCache, device, free_memory, get_or_compute, warn
from embodied.light.baking.compose import Composer, LightSolution, page_of
from embodied.light.baking.probes import probes_of
from embodied.light.baking.solve import BakeInput, Radiosity, solve
from embodied.light.baking.surroundings import Outside, daylit, dome_mesh, outside_of
from embodied.light.pages import files, tone
from embodied.light.pages.atlas import Atlas, atlas_of, coarsened, meshes_of, things_of
from embodied.light.pages.colours import ColourMaps
from embodied.light.pages.files import Bake, StaleBake
from embodied.light.pages.tone import expose
from embodied.light.settings import QUALITIES, LightSettings, light_code, settings_of
from embodied.light.tracing.emitters import in_the_open, lamps_of, write_lamps
from embodied.light.tracing.luxels import Luxels, luxels_of, with_glow
from embodied.light.tracing.radiosity import scenes_without, space_of, with_env
from embodied.light.tracing.sky import outdoors as outdoors_of
from embodied.locks import locked
from embodied.scene.house_meshes import house_parts, owners
from embodied.scene.lit_pages import LitMesh
from embodied.scene.part import Part
from embodied.seeds import stream
from embodied.software import processors

log = logging.getLogger(__name__)
Progress = Callable[[str, float], None]


SECONDS_PER_SQUARE_METRE = {"fast": 1.0, "normal": 2.5, "high": 8.0}
"""Of one core per square metre of a house, by quality, with furniture that is new to the cache."""
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
"""Begin and end of each stage on the progress bar: its rough share of a bake's time."""
GAINS = ("levels", "gains", "outdoors")
"""Arrays of an `Exposure`."""


def duration(house: House, quality: str) -> str:
    """About how long `bake` takes on this machine, in words."""
    cores = min(processors(), MOST_CORES)
    seconds = house.area * SECONDS_PER_SQUARE_METRE.get(quality, SECONDS_PER_SQUARE_METRE["normal"]) / cores
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


def key_of(house: House, looks: str, settings: LightSettings) -> str:
    """Name of a bake's file: another catalogue, model or material makes another bake. `looks`: of its parts."""
    return digest("light", light_code(), house.digest, owners(house), looks, dataclasses.asdict(settings))[:24]


def looks_of(parts: Sequence[Part]) -> str:
    """Hex digest of all parts: whose they are, where they stand, and their meshes, finishes and colour maps by content,
    wherever these lie on disk."""
    textures = {p.mesh.finish.texture for p in parts}
    maps = {t: digest(Path(t).read_bytes()) for t in sorted(t for t in textures if t is not None)}
    meshes: dict[int, str] = {}
    for mesh in (p.mesh for p in parts):
        if id(mesh) not in meshes:
            finish = dataclasses.replace(mesh.finish, texture=maps.get(mesh.finish.texture or ""))
            meshes[id(mesh)] = digest(
                *(np.ascontiguousarray(a).tobytes() for a in (mesh.vertices, mesh.faces, mesh.normals, mesh.uv)),
                repr(finish),
            )
    return digest([(p.owner, p.kind, p.room, p.mesh_key, p.position, p.yaw, meshes[id(p.mesh)]) for p in parts])


def bake(
    house: House,
    catalogue: Catalogue,
    cache: Path,
    settings: LightSettings | str = "normal",
    *,
    progress: Progress = lambda stage, done: None,
) -> Bake:
    """Light `house`, or open the bake that is already there.

    Args:
      settings: or the name of a quality: 'fast', 'normal', 'high'.
      progress: told the stage's name and how far it is, 0 to 1.

    Raises:
      LightError: Mitsuba, or CUDA and LLVM, are missing, or the bake disagrees with the path tracer.
    """
    return bake_all((house,), catalogue, cache, settings, progress=progress)[0]


def bake_all(
    lightings: Sequence[House],
    catalogue: Catalogue,
    cache: Path,
    settings: LightSettings | str = "normal",
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
    context, out = None, []
    parts = house_parts(lightings[0], catalogue)  # which know neither sky nor lamps
    looks = looks_of(parts)
    for house in lightings:
        folder = _folder(cache, house, looks, settings)
        with contextlib.suppress(StaleBake):
            out.append(files.open_bake(folder, house))
            continue
        with locked(folder, wait=True):
            done = files.reopened(folder, house)  # whoever held it may have made it
            if done is None:
                if context is None:
                    device()  # or LightError, before any work
                    several = len(lightings) > 1
                    how_long = duration(house, _name_of(settings))
                    log.warning("lighting %s, which %s keeps, takes %s", house.name, cache, how_long)
                    context = BakeContext(
                        house, parts, Path(cache) / "light", settings, several=several, progress=progress
                    )
                done = _make(house, context, folder, settings, progress)
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


class BakeContext:
    """All that lightings of a house share: surfaces, and what rays meet."""

    def __init__(
        self,
        house: House,
        parts: Sequence[Part],
        cache: Path,
        settings: LightSettings,
        *,
        several: bool = False,
        progress: Progress = lambda stage, done: None,
    ) -> None:
        """`cache` holds what belongs to assets alone; `several` keeps what another lighting can use."""
        start = time.process_time()
        every = [p for p in parts if len(p.mesh.faces)]
        self.maps, self._house, self._cache, self._sharpness = ColourMaps(), house, cache, settings.sharpness
        self._outer = [p for p in every if p.kind == "outdoor"]
        indoors = [p for p in every if p.kind != "outdoor"]
        things = things_of(indoors, settings, cache, lambda i, n: progress("unwrapping", i / n))
        self.unwrap_seconds = round(time.process_time() - start, 2)
        free_memory()
        self.atlas = atlas_of(coarsened(things, settings.texels))
        self.lux = luxels_of(self.atlas, self.maps)
        self.space = space_of(self.atlas, self.lux.texels)
        self.memory: LightingCache | None = {} if several else None
        free_memory()

    @functools.cached_property
    def outside(self) -> Outside | None:
        """Parts that the sun and the sky light outside."""
        return outside_of(self._outer, self.space.scene, self._cache, self.maps, self._sharpness)

    @functools.cached_property
    def meshes(self) -> tuple[list[LitMesh], list[np.ndarray]]:
        """Meshes that renderers draw, and the gloss of their faces."""
        first = len(self.atlas.pages)
        meshes, gloss = meshes_of(self.atlas, 0)
        if self.outside is not None:
            more, more_gloss = meshes_of(self.outside.atlas, first)
            meshes += [dataclasses.replace(m, kind="outdoor") for m in more]
            gloss += more_gloss
            first += len(self.outside.atlas.pages)
        return [*meshes, dome_mesh(self._house, first)], gloss

    @functools.cached_property
    def meshes_file(self) -> bytes:
        """`meshes` as they are written."""
        return files.packed_meshes(*self.meshes)


def solve_house(
    house: House,
    context: BakeContext,
    settings: LightSettings,
    folder: Path | None = None,
    *,
    progress: Progress = lambda s, d: None,
) -> LightSolution:
    """Everything up to the light of every luxel, which is kept in `folder` where one is given."""
    atlas, outdoors = context.atlas, outdoors_of(house, settings.rows)
    space = with_env(context.space, outdoors.picture)
    lamps = tuple(in_the_open(x, space.scene) for x in lamps_of(house, atlas))
    lux = with_glow(context.lux, house, atlas, lamps)
    bare = tuple(sorted({x.owner for x in lamps if x.owner in atlas.owners}))
    without = get_or_compute(context.memory, ("without", bare), lambda: scenes_without(space, atlas, bare))
    inputs = BakeInput(house, atlas, lux, space, outdoors, lamps, settings, context.memory, without)
    light = _kept_light(folder, len(lux.position), lambda: solve(inputs, progress))
    rows = len(outdoors.picture)
    outside = np.median(outdoors.picture[rows * 300 // 1024 : rows * 540 // 1024].reshape(-1, 3), axis=0)
    light_of_rooms = _light_of_rooms(house, atlas, lux, light)
    dark = [r.id for r in house.rooms if light_of_rooms[r.id] @ [0.2126, 0.7152, 0.0722] < tone.DARKEST]
    if dark and 8 < house.sky.hour < 17:
        warn(f"rooms {dark} have neither window nor lamp that lights them; they are shown nearly dark")
    exposure = expose(house, light_of_rooms, outside)
    return LightSolution(house, atlas, lux, light, outdoors, lamps, exposure, space, without)


def _kept_light(folder: Path | None, n: int, work: Callable[[], Radiosity]) -> Radiosity:
    """Result of `work`, from disk if an interrupted run left it there whole."""
    if folder is None:
        return work()
    path = folder / "stage_light.npz"
    known = load_record(Radiosity, path)
    if known is not None and all(len(a) == n for a in vars(known).values()):
        return known
    if path.exists():
        warn(f"{path} is damaged; the stage is computed again")
    made = work()
    with atomic_path(path) as temporary, open(temporary, "wb") as f:
        np.savez(f, **vars(made))  # quicker to write than what `save_record` packs
    return made


def _make(house: House, context: BakeContext, folder: Path, settings: LightSettings, progress: Progress) -> Bake:
    from embodied.light.baking.check import check

    start, used = time.perf_counter(), time.process_time()
    s = solve_house(house, context, settings, folder, progress=progress)
    error = check(s, settings.tolerance)
    free_memory()
    if not (folder / files.PROBES).exists():
        save_record(probes_of(s, settings, context.memory), folder / files.PROBES)
    free_memory()
    composer = Composer(s, settings, context.maps, context.memory)
    first = len(s.atlas.pages)
    for i in range(first):
        progress("pages", i / first)
        if not all((folder / name).exists() for name in files.page_files(i)):
            files.write_page(folder, i, page_of(i, composer), settings.jpeg, context.memory)
    free_memory()
    pictures = daylit(context.outside, s.outdoors, s.exposure, settings.other_rays)
    for i, picture in enumerate(pictures, first):
        write_bytes(folder / f"page_{i:03d}.jpg", jpeg(picture, settings.jpeg))
    write_bytes(folder / "meshes.npz", context.meshes_file)
    write_lamps(folder / "lamps.npz", s.lamps)
    (folder / "stage_light.npz").unlink(missing_ok=True)
    manifest = {
        **_facts_of(s, context.meshes[0], folder),
        "settings": dataclasses.asdict(settings),
        "pages": first + len(pictures),
        "unwrap_seconds": context.unwrap_seconds,
        "total_seconds": round(time.perf_counter() - start, 1),
        "processor_seconds": round(time.process_time() - used, 1),
        "check": error,
    }
    write_json(folder / "manifest.json", manifest)
    progress("done", 1.0)
    return Bake(folder, manifest)


def _facts_of(s: LightSolution, meshes: Sequence[LitMesh], folder: Path) -> dict[str, object]:
    """Facts of the manifest about a bake whose files are written, but how it was made."""
    written = [p for p in sorted(folder.iterdir()) if p.name != "manifest.json" and not p.name.startswith(".")]
    return {
        "code": light_code(),
        "key": folder.name,
        "house": s.house.digest,
        "device": device(),
        "own_pages": len(s.atlas.pages),
        "owners": list(owners(s.house)),
        "luxels": len(s.lux.position),
        "exposure": {"polygons": s.exposure.polygons, **{k: getattr(s.exposure, k).tolist() for k in GAINS}},
        "meshes": [
            {"owner": m.owner, "kind": m.kind, "room": m.room, "page": m.page, "alpha": m.alpha, "gloss": m.gloss}
            for m in meshes
        ],
        "lamps": [{"id": x.id, "room": x.room, "owner": x.owner} for x in s.lamps],
        "files": {p.name: files.checksum(p) for p in written},
    }


def _light_of_rooms(house: House, atlas: Atlas, lux: Luxels, light: Radiosity) -> dict[str, np.ndarray]:
    """85th percentile of e (without the sun's own) on the shell of every room; up to a third more where much is far
    brighter than that (`brightest`)."""
    e = light.soft
    number = {r.id: i for i, r in enumerate(house.rooms)}
    room = np.array([number.get(r, -1) for r in atlas.rooms])[lux.owner]
    out = {}
    for i, r in enumerate(house.rooms):
        lit = (room == i) & lux.shell & light.good
        full = np.percentile(e[lit], 85, axis=0) if lit.any() else np.zeros(3)
        most = brightest(e[lit]).mean() if lit.any() else 0.0
        out[r.id] = full * np.clip(0.45 * most / max(full.mean(), 1e-9), 1.0, 1.35)
    return out


def brightest(e: np.ndarray) -> np.ndarray:
    """(3,) geometric mean of the 93rd to the 99th percentile of light (n, 3).

    The light of a room with a sunlit sill or a lamp near a wall leaps somewhere in its brightest tenth, from 2 to 14
    times its middle; one percentile falls before or after the leap by chance, and exposure followed it by a fifth.
    """
    tail = np.percentile(e, np.linspace(93, 99, 25), axis=0)
    return np.exp(np.log(np.maximum(tail, 1e-9)).mean(axis=0))


def forget(cache: Path, house: House, catalogue: Catalogue, settings: LightSettings | str) -> None:
    """Delete the bake of `house`, finished or not."""
    settings = settings_of(settings) if isinstance(settings, str) else settings
    shutil.rmtree(_folder(cache, house, looks_of(house_parts(house, catalogue)), settings), ignore_errors=True)


def _folder(cache: Path, house: House, looks: str, settings: LightSettings) -> Path:
    """Folder of the bake of `house`, there or not; its name begins with the quality's. `looks`: of its parts."""
    return Path(cache) / "light" / f"{_name_of(settings)}-{key_of(house, looks, settings)}"


def _name_of(settings: LightSettings) -> str:
    return next((name for name, known in QUALITIES.items() if known == settings), "custom")

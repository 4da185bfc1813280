"""Building a data set: one house is one unit of work, pure, resumable, the same on any number of workers."""

import contextlib
import dataclasses
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import joblib
from joblib.externals.loky import process_executor

from embodied.assets.cache import digest, drafts, sweep, write_bytes, write_json
from embodied.assets.catalogue import GROUPS, Catalogue, load_catalogue
from embodied.assets.closure import code_digest
from embodied.assistants.route_system import WORDINGS, route_paths, worded
from embodied.datasets.scale import quota, scale
from embodied.generate import HouseConfig, generate_house
from embodied.generate.furnish.tables import tables_of
from embodied.generate.novelty import furnishable
from embodied.generate.people import add_people, place_people
from embodied.house.house import House, HouseError
from embodied.interface import Language
from embodied.kinds.splits import DATASET_SCALES, DatasetSize, SplitPlan, Splits
from embodied.kinds.task_kind import TaskInputs, TaskKind, kind_named
from embodied.language import Landmarks, People, PlainLanguage
from embodied.locks import LOCK, locked
from embodied.navigation.connectivity import from_matterport, to_matterport
from embodied.navigation.graph import NavGraph, build_graph
from embodied.records import load_json, read_json, save_lines
from embodied.render.pictures import PictureSettings, parse_pictures
from embodied.seeds import FAMILIAR, NOVEL, stream
from embodied.world import World, open_world

W = TypeVar("W")
VERSION = 1
"""Of the layout and meaning of a data set's files; another version is refused."""
VOICES: Mapping[str, Callable[[str | None], Language]] = {
    "people": lambda novelty: People(novelty=novelty),
    "landmarks": lambda novelty: Landmarks(novelty=novelty),
    "plain": lambda novelty: PlainLanguage(),
}
"""Name to a maker of voices, by the novelty of who speaks."""
GROWTH = 3 * 2**30
"""Bytes by which a worker may grow before it is ended and another one begun."""
LATER: Mapping[str, object] = {"rooms": True, "ood": 0, "own": "", "storeys": 1, "special": ()}
"""Settings that data sets have not always had, with their defaults."""
SEEDS = 12
"""House seeds tried before giving up on a house of the data set."""


@dataclass(frozen=True)
class DatasetConfig:
    """All that a data set depends on.

    Examples:
      >>> config = embodied.DatasetConfig('hanna', 'tiny', seed=4, language='plain')
    """

    kind: str
    """Kind of task: 'find', 'vln', 'vnla', 'hanna', 'hari', or 'module:NAME' of your own."""
    scale: DatasetSize | str = "mini"
    """One of embodied.kinds.splits.DATASET_SCALES, or a size of one's own."""
    seed: int = 0
    area: tuple[float, float] = (150.0, 420.0)
    """Smallest and largest house, square metres."""
    storeys: int | None = 1
    """Of every house, 1 to 3; None: drawn from its seed (HouseConfig)."""
    special: tuple[str, ...] = ()
    """Rooms of every house that are no boxes (HouseConfig)."""
    routes: str = "sampled"
    """'sampled', as in Room-to-Room."""
    people: bool = True
    """Assistants stand in the house as figures (HANNA)."""
    language: str = "people"
    """Who words the routes: 'people' with their habits and landmarks, 'landmarks' of paths on which turns alone lead
    astray, or 'plain' turns and rooms."""
    rooms: bool = True
    """Requests name the room; without (VNLA), any thing of the class in the house will do."""
    ood: int = 0
    """Houses out of distribution, split 'test_ood': of models, looks, speakers and words that occur in no other split
    (embodied.seeds). With any, all other houses are of familiar ones only, so they differ from those without."""
    own: str = ""
    """Digest of the user's own groups.toml files that the houses are furnished by, too; `build_dataset` fills it in."""

    def __post_init__(self) -> None:
        if self.routes != "sampled":
            raise ValueError(f"routes should be 'sampled', got {self.routes!r}")
        if self.language not in VOICES:
            raise ValueError(f"language should be one of {sorted(VOICES)}, got {self.language!r}")
        if self.language == "landmarks" and not self.task_kind.from_routes:
            raise ValueError(f"landmarks word the tasks of vln, not of {self.kind!r}; use people or plain")
        if isinstance(self.scale, str) and self.scale not in DATASET_SCALES:  # as files have it
            try:
                object.__setattr__(self, "scale", DatasetSize.of(self.scale))
            except (TypeError, ValueError) as e:
                raise ValueError(f"unknown scale {self.scale!r}; use one of {DATASET_SCALES}, or a DatasetSize") from e
        if not self.rooms and not self.task_kind.roomless:
            raise ValueError(f"requests of kind {self.kind!r} always name what they name; leave rooms as it is")
        scale(self.scale, self.kind, self.ood)

    @property
    def task_kind(self) -> TaskKind:
        return kind_named(self.kind)

    @property
    def plan(self) -> Splits:
        """Its houses and splits."""
        return scale(self.scale, self.kind, self.ood)

    def novelty_of(self, group: str) -> str | None:
        """Familiar or novel things and speakers for the houses of a group; None for all there is."""
        return (NOVEL if group == "ood" else FAMILIAR) if self.ood else None

    def facts(self) -> dict[str, object]:
        """The settings as they are written; what came later and is at its default is left out, so that data sets
        without it keep their digests."""
        facts = {**dataclasses.asdict(self), "scale": str(self.scale)}
        return {k: v for k, v in facts.items() if k not in LATER or v != LATER[k]}


@dataclass(frozen=True)
class Unit:
    """One house of a data set."""

    group: str
    index: int

    @property
    def name(self) -> str:
        """Name of the house, the same in every data set of the seed: 'train_0003'."""
        return f"{self.group}_{self.index:04d}"


@dataclass(frozen=True)
class UnitFacts:
    """unit.json: what is in a house's folder; its presence says that the folder is whole."""

    version: int
    config: DatasetConfig
    group: str
    index: int
    house_digest: str
    nodes: int
    routes: int
    tasks: Mapping[str, int]
    """SplitPlan to number of tasks."""


DRAWING = ("mitsuba", "drjit", "embreex", "xatlas", "trimesh")
"""Libraries that light and draw houses, which pictures have in their own keys; houses and words do without."""
Watch = Callable[[Iterable[str], int], Iterable[str]]
HouseMaker = Callable[[int, str, HouseConfig, Catalogue], tuple[House, NavGraph]]
"""(seed, name, config, catalogue) -> a house and its graph; tests put their own."""


def units(wanted: Splits) -> tuple[Unit, ...]:
    return tuple(Unit(group, i) for group, n in wanted.houses.items() for i in range(n))


def build_dataset(
    config: DatasetConfig,
    folder: Path,
    cache: Path,
    *,
    workers: int = 1,
    make_house: HouseMaker | None = None,
    watch: Watch | None = None,
    own: tuple[Path, ...] = (),
) -> Path:
    """Build what is missing of the data set in `folder` and write its index; returns the index.

    The same command goes on after an interruption. The files do not depend on `workers`.

    Args:
      watch: wraps the iterator over finished house names, with their number (a progress bar).
      own: folders with a groups.toml of the user's own each (docs/assets.md); without models, which readers would lack.

    Raises:
      ValueError: the folder holds another data set; a folder of `own` has no groups.toml, or a wrong one, or models.
      LockedError: another process builds it.

    Examples:
      >>> index = embodied.build_dataset(config, Path('data/hanna'), embodied.default_cache())
    """
    folder = Path(folder)
    work, own = units(config.plan), tuple(p.resolve() for p in own)
    if own:
        config = dataclasses.replace(config, own=_groups_digest(own, cache))
    arguments = (config, folder.resolve(), Path(cache), make_house or make_dataset_house, own)
    with locked(folder):
        _claim(folder, config)
        for_each_unit(build_unit, work, arguments, workers=workers, watch=watch)
        return write_index(config, folder)


def draw_panoramas(
    config: DatasetConfig,
    folder: Path,
    cache: Path,
    *,
    pictures: PictureSettings | str,
    workers: int = 1,
    watch: Watch | None = None,
) -> None:
    """Draw the panoramas of all houses into their folders, unless they are there; a lit house is lit first.

    A house is a unit of work, and its file is written when it is whole: the same command goes on after an
    interruption. Pictures that were drawn otherwise, or by another version of the program, are drawn again.

    Args:
      pictures: how all of them are drawn, as in embodied.open_world.
      workers, watch: as in `build_dataset`.

    Raises:
      LockedError: another process writes into the folder.

    Examples:
      >>> pictures = embodied.Unlit(size=64)
      >>> embodied.draw_panoramas(config, Path('data/hanna'), embodied.default_cache(), pictures=pictures)
    """
    arguments = (Path(folder).resolve(), Path(cache), parse_pictures(pictures))
    work = units(config.plan)
    with locked(Path(folder)):
        for_each_unit(draw_unit, work, arguments, workers=workers, watch=watch)


def draw_unit(unit: Unit, folder: Path, cache: Path, pictures: PictureSettings) -> str:
    """The panoramas of one house, from its saved files; returns its name."""
    home = folder / "houses" / unit.name
    house, graph = House.load(home / "house.json"), from_matterport(home / "connectivity.json")
    catalogue = load_catalogue(cache)
    path, may = home / "panoramas.pano", ("renderer",)  # another machine may have drawn it
    new = not path.exists()
    with World(house, catalogue, graph, cache, pictures, file=path, ignore_fields=may) as world:
        share(world.cached_path, path)
        world.render_all()
        if new:
            share(path, world.cached_path)
    return unit.name


def share(source: Path, target: Path) -> None:
    """Give the file `source`, where it is there, the name `target`, too, unless that is taken or on another disk.

    So data sets of several kinds over the same houses are drawn once and take the space of one.
    """
    if target.exists():
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    with contextlib.suppress(OSError):  # absent, made meanwhile, or a file system without such names: drawn anew
        os.link(source, target)


def for_each_unit(
    job: Callable[..., str], work: Sequence[W], arguments: tuple, *, workers: int, watch: Watch | None
) -> None:
    """Run job(unit, *arguments) for every unit of work, in processes."""
    done = joblib.Parallel(n_jobs=workers, return_as="generator_unordered")(
        joblib.delayed(_lasting)(job, u, *arguments) for u in work
    )
    for _ in watch(done, len(work)) if watch else done:
        pass


def _lasting(job: Callable[..., str], *arguments: Any) -> str:
    """job(*arguments), in a worker that may grow: joblib ends those that grew by 300 MB, as all that light a house
    do, and the next one imports, unpacks and compiles everything again, which is as much work as a house."""
    process_executor._MAX_MEMORY_LEAK_SIZE = GROWTH
    return job(*arguments)


def build_unit(
    unit: Unit, config: DatasetConfig, folder: Path, cache: Path, make_house: HouseMaker, own: tuple[Path, ...] = ()
) -> str:
    """Build one house's folder unless it is there; returns its name.

    It is made under another name and renamed when whole, so a kill leaves nothing half-built that is later believed.
    """
    home = folder / "houses" / unit.name
    if (home / "unit.json").exists():
        return unit.name
    if home.exists():
        raise ValueError(f"{home} is no house of this data set (it has no unit.json); move it away")
    with whole_folder(home) as draft:
        _write_unit(unit, config, draft, load_catalogue(cache, own=own), cache, make_house)
    return unit.name


@contextlib.contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """A private folder that becomes `folder` when everything is written.

    Raises:
      ValueError: the folder is not empty.
    """
    folder = Path(folder)
    if folder.exists() and any(folder.iterdir()):
        raise ValueError(f"{folder} is not empty; choose another folder")
    folder.parent.mkdir(parents=True, exist_ok=True)
    sweep(folder.parent)
    with drafts(folder.parent) as private:
        draft = private / folder.name
        draft.mkdir()
        yield draft
        if folder.exists():
            folder.rmdir()
        draft.rename(folder)


def make_dataset_house(seed: int, name: str, config: HouseConfig, catalogue: Catalogue) -> tuple[House, NavGraph]:
    """The house `name` of a data set and its graph; a seed that gives no walkable house is passed over.

    Raises:
      HouseError: none of SEEDS seeds gives one.
    """
    problems = []
    for attempt in range(SEEDS):
        house_seed = int(stream(seed, "data set house", name, attempt).integers(2**31))
        try:
            house = generate_house(house_seed, config, catalogue)
            house = dataclasses.replace(house, name=name)
            return house, build_graph(house)
        except HouseError as e:
            problems.append(f"{house_seed}: {e}")
    raise HouseError(f"no house for {name!r} after {SEEDS} seeds; the last said {problems[-1]}")


def with_people(
    house: House, graph: NavGraph, figures: Catalogue, seed: int, house_split: str
) -> tuple[House, list[tuple[int, ...]]]:
    """A house with people at the starts of the routes that they know, and the paths of these routes."""
    met = place_people(house, graph, figures, seed=seed)
    paths = route_paths(graph, house.name, seed=seed, house_split=house_split, starts=met)
    return add_people(house, met, (p[0] for p in paths)), paths


def _write_unit(
    unit: Unit, config: DatasetConfig, home: Path, catalogue: Catalogue, cache: Path, make_house: HouseMaker
) -> None:
    novelty = config.novelty_of(unit.group)
    language = VOICES[config.language](novelty)
    settings = HouseConfig(area=config.area, storeys=config.storeys, special=config.special, novelty=novelty)
    house, graph = make_house(config.seed, unit.name, settings, catalogue)
    house_split = {"extra": "train", "ood": "test"}.get(unit.group, unit.group)
    paths: list[tuple[int, ...]] = []
    kind = config.task_kind
    if kind.people and config.people:
        house, paths = with_people(house, graph, furnishable(catalogue, novelty), config.seed, house_split)
    elif kind.routes:
        paths = route_paths(graph, unit.name, seed=config.seed, house_split=house_split)
    with open_world(house, catalogue, cache, graph=graph) as world:
        routes = worded(world, paths, WORDINGS[house_split], seed=config.seed, language=language)
        inputs = TaskInputs(world, routes, config.seed, language, config.rooms)
        tasks = kind.tasks(inputs, [(s.part, n) for s, n in shares(unit, config)])
    house.save(home / "house.json")
    to_matterport(graph, house, home / "connectivity.json")
    save_lines(home / "routes.jsonl", routes)
    counts = {s.name: save_lines(home / f"tasks_{s.name}.jsonl", tasks[s.part]) for s, _ in shares(unit, config)}
    sizes: dict[str, Any] = {"nodes": len(graph.ids), "routes": len(routes), "tasks": counts}
    save_facts(home, UnitFacts(VERSION, config, unit.group, unit.index, house.digest, **sizes))


def save_facts(home: Path, facts: UnitFacts) -> None:
    """Write unit.json into a house's folder."""
    body = {**dataclasses.asdict(facts), "config": facts.config.facts()}
    write_bytes(home / "unit.json", (json.dumps(body, sort_keys=True, indent=1) + "\n").encode())


def shares(unit: Unit, config: DatasetConfig) -> list[tuple[SplitPlan, int]]:
    """The splits that a house serves, with its even share of their tasks."""
    served = []
    for split in (s for s in config.plan.splits if unit.group in s.all_groups):
        houses = [u for u in units(config.plan) if u.group in split.all_groups]
        served.append((split, quota(split.tasks, len(houses), houses.index(unit))))
    return served


def _claim(folder: Path, config: DatasetConfig) -> None:
    """Write down whose folder it is, or refuse another data set's, or one that another program began."""
    wanted = {"version": VERSION, "config": json.loads(json.dumps(config.facts()))}
    path = folder / "config.json"
    if path.exists():
        stored = read_json(path)
        begun_by = stored.pop("program", None)
        if stored != wanted:
            raise ValueError(f"{folder} holds another data set ({stored}); this one is {wanted}; choose another folder")
        if begun_by != program() and any(missing_units(config, folder)):
            raise ValueError(
                f"{folder} was begun by another version of the program ({begun_by}, this is {program()}), whose houses "
                "and words would not match; finish it with that version, or build it anew in another folder"
            )
    else:
        if any(f.name != LOCK for f in folder.iterdir()):
            raise ValueError(f"{folder} is not empty and holds no data set; choose an empty folder")
        write_bytes(path, (json.dumps({**wanted, "program": program()}, sort_keys=True, indent=1) + "\n").encode())


def _groups_digest(own: Sequence[Path], cache: Path) -> str:
    """
    Raises:
      ValueError: a folder of `own` holds models, no groups.toml, or one that is wrong.
    """
    if foreign := [p for p in own if (p / "catalogue.json").exists() or not (p / GROUPS).is_file()]:
        raise ValueError(
            f"{foreign[0]} should hold a {GROUPS} and no catalogue.json: whoever reads a data set has the furniture "
            "that ships, not your models; leave it out, or use it with `embodied house`, `light` and so on"
        )
    tables_of(load_catalogue(cache, own=own))
    return digest(*((p / GROUPS).read_bytes() for p in own))[:16]


def program() -> str:
    """A digest of the code and the catalogue that make data sets: what one began, only the same one may finish."""
    return code_digest(__name__, without=DRAWING)


def write_index(config: DatasetConfig, folder: Path) -> Path:
    """dataset.json: the table of the splits and a digest of every file; its presence says that all is there."""
    table: dict[str, dict[str, int]] = {}
    files: dict[str, str] = {}
    for unit in units(config.plan):
        home = folder / "houses" / unit.name
        facts = load_json(home / "unit.json", UnitFacts)
        for name, n in facts.tasks.items():
            row = table.setdefault(name, {"houses": 0, "tasks": 0, "routes": 0, "nodes": 0})
            for key, value in (("houses", 1), ("tasks", n), ("routes", facts.routes), ("nodes", facts.nodes)):
                row[key] += value
        for path in sorted(home.iterdir()):
            if path.suffix in (".json", ".jsonl"):
                files[f"{unit.name}/{path.name}"] = digest(path.read_bytes())[:16]
    splits = {s.name: table[s.name] for s in config.plan.splits}
    body = {"version": VERSION, "config": config.facts(), "splits": splits, "digest": digest(files), "files": files}
    path = folder / "dataset.json"
    write_json(path, body, indent=1)
    return path


def missing_units(config: DatasetConfig, folder: Path) -> Iterator[Unit]:
    """The houses that are not built yet."""
    return (u for u in units(config.plan) if not (folder / "houses" / u.name / "unit.json").exists())

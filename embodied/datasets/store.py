"""Reading a data set: its tasks, houses and routes, and the environment to play a split in."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from embodied.datasets.build import missing_units, units
from embodied.datasets.checks import DatasetError, check_episode, read_checked, read_config, read_index
from embodied.datasets.scale import OOD, quota, scale
from embodied.house.house import House
from embodied.interface import Assistant, Episode, Place, Route, Task
from embodied.kinds.splits import SplitPlan
from embodied.kinds.task_kind import EnvInputs, EnvMaker, TaskInputs, TaskKind, kind_named
from embodied.language.people_language import PeoplesWords, Utterance
from embodied.language.plain_language import PlainLanguage
from embodied.navigation.connectivity import from_matterport
from embodied.navigation.graph import NavGraph, with_edge_doors
from embodied.records import read_lines
from embodied.render.pictures import PictureSettings, Unlit, from_recorded, parse_pictures

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.world import World

T = TypeVar("T")
SUBGOALS = "subgoals.jsonl"
"""In a house's folder: sub-goals in people's words (`embodied dataset from-people`)."""
ANNA_SPLIT = {
    "train": "train_seen",
    "val_seen": "train_unseen",
    "test_seen": "train_unseen",
    "val_unseen": "val",
    "test_unseen": "test",
    "test_ood": "test",
}
"""Split of the wordings that are spoken in each split: even in seen houses evaluation hears new ones (4.2.5)."""


@dataclass(frozen=True, eq=False)
class StoredPlace:
    """A house and its graph, without pictures: enough to play, judge and word."""

    house: House
    graph: NavGraph

    @property
    def name(self) -> str:
        return self.house.name


@dataclass(frozen=True, eq=False)
class TaskSet:
    """Tasks of some houses, ready to be played."""

    worlds: Mapping[str, Place]
    """By house name, in the data set's order."""
    tasks: Sequence[Task]
    """House by house."""
    make_env: EnvMaker
    """All that it makes share assistants and caches."""


@dataclass(frozen=True, eq=False)
class SplitData(TaskSet):
    """A split of a data set."""

    name: str


class Dataset:
    """A data set on disk. Houses, graphs and tasks are read when first asked for and kept.

    Examples:
      >>> data = embodied.Dataset(Path('data/hanna'))
      >>> split = data.split('val_seen')
    """

    def __init__(self, folder: Path) -> None:
        """
        Raises:
          DatasetError: no data set, half built, or of another version.
        """
        self.folder = Path(folder)
        self.config = read_config(self.folder)
        self.scale = self.config.plan
        index = self.folder / "dataset.json"
        if not index.exists():
            missing = len(list(missing_units(self.config, self.folder)))
            raise DatasetError(
                f"{folder} is half built: {missing} of {len(units(self.scale))} houses are missing; "
                "run the command that began it once more, it goes on from there"
            )
        self.index = read_index(self.folder, self.config)
        self._places: dict[str, StoredPlace] = {}

    @property
    def kind(self) -> str:
        return self.config.kind

    @property
    def task_kind(self) -> TaskKind:
        return kind_named(self.kind)

    @property
    def digest(self) -> str:
        """Names the content: two data sets with one digest are the same."""
        return self.index.digest

    @property
    def splits(self) -> tuple[str, ...]:
        return tuple(s.name for s in self.scale.splits)

    @property
    def ood(self) -> tuple[str, ...]:
        """The split of houses out of distribution, where there are such: tables of test splits have it last."""
        return tuple(s for s in self.splits if s == OOD)

    def names(self, split: str) -> tuple[str, ...]:
        """Names of the houses of a split."""
        wanted = self._split(split)
        return tuple(u.name for u in units(self.scale) if u.group in wanted.all_groups)

    @property
    def lessons(self) -> Mapping[str, str]:
        """Digests of the houses and tasks to learn from, by file: the same in data sets that differ only in how many
        tasks they evaluate in."""
        files = ("house.json", "tasks_train.jsonl", "tasks_pretrain.jsonl")
        wanted = [f"{name}/{f}" for name in self.names("train") for f in files]
        return {f: self.index.files[f] for f in wanted if f in self.index.files}

    def place(self, name: str) -> StoredPlace:
        """House and graph by name."""
        if name not in self._places:
            home = self.folder / "houses" / name
            for file in ("house.json", "connectivity.json"):
                self._content(name, file)
            house = House.load(home / "house.json")
            self._places[name] = StoredPlace(house, with_edge_doors(from_matterport(home / "connectivity.json"), house))
        return self._places[name]

    def place_of(self, episode: Episode) -> StoredPlace:
        """The house in which an episode was played.

        Raises:
          DatasetError: it was played elsewhere.
        """
        name = episode.task.world
        if f"{name}/house.json" not in self.index.files:
            raise DatasetError(
                f"{self.folder} has no house {name!r}, where {episode.task.id!r} was played; give its own data set"
            )
        check_episode(episode, self.place(name))
        return self.place(name)

    def places(self, split: str) -> dict[str, StoredPlace]:
        return {name: self.place(name) for name in self.names(split)}

    def open_world(
        self,
        name: str,
        catalogue: Catalogue,
        cache: Path,
        pictures: PictureSettings | str = Unlit(),
        *,
        size: int | None = None,
    ) -> World:
        """The world with pictures of one house; `pictures` and `size` as in embodied.world.open_world."""
        from embodied.world import World  # the one part that needs a renderer

        place, how = self.place(name), parse_pictures(pictures, size)
        # what is in a data set is data: whoever reads it has other drivers and, later, another version
        may, file = ("renderer", "code"), self.panoramas(name)
        return World(place.house, catalogue, place.graph, cache, how, file=file, ignore_fields=may)

    def panoramas(self, name: str) -> Path:
        """The file with the panoramas of a house, there or not."""
        return self._path(name, "panoramas.pano")

    def drawn_pictures(self, name: str) -> PictureSettings | None:
        """How the panoramas of a house that the data set holds were drawn; None where it holds none of this house."""
        from embodied.render.panorama_file import PanoramaFile, PanoramaFileError  # decodes pictures

        try:
            with PanoramaFile(self.panoramas(name)) as file:
                made_of = dict(file.meta)
        except (FileNotFoundError, PanoramaFileError):
            return None
        if made_of.get("house") != self.place(name).house.digest:
            return None
        try:
            return from_recorded(made_of)
        except ValueError:  # drawn by a version with other words for it
            return None

    @property
    def pictures(self) -> PictureSettings | None:
        """How the panoramas of the first house that has any were drawn; None where no house has."""
        names = (unit.name for unit in units(self.scale))
        return next((drawn for n in names if (drawn := self.drawn_pictures(n)) is not None), None)

    def routes(self, name: str) -> tuple[Route, ...]:
        """The routes that assistants know in a house.

        Raises:
          DatasetError: changed since they were written.
        """
        return tuple(self._lines(name, "routes.jsonl", Route))

    def _path(self, name: str, file: str) -> Path:
        return self.folder / "houses" / name / file

    def _content(self, name: str, file: str) -> bytes:
        return read_checked(self.folder, name, file, self.index.files)

    def _lines(self, name: str, file: str, kind: type[T]) -> list[T]:
        return list(read_lines(self._content(name, file), kind, self._path(name, file)))

    def tasks(self, split: str) -> tuple[Task, ...]:
        """All tasks of a split, house by house.

        Raises:
          DatasetError: an unknown split, or files that were changed.
        """
        tasks = [t for name in self.names(split) for t in self._lines(name, f"tasks_{split}.jsonl", Task)]
        if (limits := self.task_kind.time_limits) and split != "train":
            tasks = [limits.apply(t, self.place(t.world), self._time_limits) for t in tasks]
        return tuple(tasks)

    def split(
        self,
        name: str,
        *,
        houses: int | None = None,
        worlds: Mapping[str, Place] | None = None,
        rules: Any = None,
        assistant: Assistant | None = None,
    ) -> SplitData:
        """Everything that playing a split needs.

        Args:
          houses: only its first so many houses; all if None.
          worlds: worlds with pictures by house name; without, the tasks play in houses and graphs alone.
          rules: of play, of the type of TaskKind.rules; tasks get the time that they take. The usual ones if None.
          assistant: who answers, instead of the kind's own assistant.

        Raises:
          DatasetError: an unknown split, or files that were lost or changed.
        """
        names = self.names(name)[:houses]
        sentences = self.utterances(names)
        places = {n: self.place(n) if worlds is None else worlds[n] for n in names}
        voice, wording = PeoplesWords(sentences, PlainLanguage()) if sentences else None, ANNA_SPLIT.get(name, "")
        training = lambda: self.places("train").values()
        inputs = EnvInputs(places, self.routes, wording, voice, training, rules, assistant)
        tasks = self.task_kind.tasks_under((t for t in self.tasks(name) if t.world in places), places, rules)
        return SplitData(places, tasks, self.task_kind.environments(inputs), name)

    def utterances(self, names: Iterable[str]) -> tuple[Utterance, ...]:
        """Sub-goals in the words of people who spoke of these houses."""
        spoken = [n for n in names if f"{n}/{SUBGOALS}" in self.index.files]
        return tuple(s for n in spoken for s in self._lines(n, SUBGOALS, Utterance))

    def table(self) -> str:
        """The table of the splits, as Markdown."""
        lines = ["| split | houses | tasks | routes | nodes per house |", "|---|---|---|---|---|"]
        for name, row in self.index.splits.items():
            nodes = row.nodes / row.houses
            lines.append(f"| {name} | {row.houses} | {row.tasks:,} | {row.routes:,} | {nodes:.0f} |")
        return "\n".join(lines) + "\n"

    def _split(self, name: str) -> SplitPlan:
        for split in self.scale.splits:
            if split.name == name:
                return split
        raise DatasetError(f"unknown split {name!r}; {self.folder} has {list(self.splits)}")

    @functools.cached_property
    def _time_limits(self) -> Any:
        limits = self.task_kind.time_limits
        return limits and limits.learn(self.tasks("train"), self.place)


class RouteDataset(Dataset):
    """A data set with routes as one of a kind whose tasks are to follow routes."""

    def __init__(self, folder: Path, kind: str) -> None:
        super().__init__(folder)
        self._kind = kind

    @property
    def kind(self) -> str:
        return self._kind

    def tasks(self, split: str) -> tuple[Task, ...]:
        """As many of a house as a data set of the kind has at this scale."""
        (plan,) = (s for s in scale(self.config.scale, self.kind, self.config.ood).splits if s.name == split)
        names, tasks = self.names(split), list[Task]()
        for k, name in enumerate(names):  # routes have their words already
            inputs = TaskInputs(self.place(name), self.routes(name), self.config.seed, PlainLanguage())
            tasks += self.task_kind.tasks(inputs, [(plan.part, quota(plan.tasks, len(names), k))])[plan.part]
        return tuple(tasks)


def dataset_of(folder: Path, kind: str, *others: str) -> Dataset:
    """The data set in `folder`, for a learner of one kind of task, or of some others that hold what it needs.

    A data set with routes, such as `hanna`, serves as one of a kind whose tasks are routes, such as `vln`.

    Raises:
      DatasetError: it is of another kind, or as Dataset.
    """
    data = Dataset(folder)
    if data.kind != kind and data.task_kind.routes and kind_named(kind).from_routes and not others:
        return RouteDataset(folder, kind)
    if data.kind not in (kind, *others):
        raise DatasetError(
            f"{folder} is a data set of {data.kind!r}, a learner of {kind!r} needs its own: "
            f"`embodied dataset {kind} --out DIR`"
        )
    return data

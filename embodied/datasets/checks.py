"""Checks that files of a data set are those that were written, and that an episode was played in its house."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from embodied.assets.cache import digest
from embodied.datasets.build import VERSION, DatasetConfig
from embodied.interface import Episode, Place
from embodied.records import RecordError, from_plain, read_json

T = TypeVar("T")
REBUILD = "delete {home} and run the command that built {folder} once more, it builds that house again"


class DatasetError(ValueError):
    """A folder that is not a whole data set of this version, or a split it does not have."""


@dataclass(frozen=True)
class SplitCounts:
    """One row of the table of splits."""

    houses: int
    tasks: int
    routes: int
    nodes: int


@dataclass(frozen=True)
class Index:
    """dataset.json: what a whole data set holds."""

    version: int
    config: DatasetConfig
    splits: Mapping[str, SplitCounts]
    digest: str
    """Of `files`; two data sets with one digest are the same."""
    files: Mapping[str, str]
    """'<house>/<file>' to the digest of its content, 16 letters."""


@dataclass(frozen=True)
class _Begun:
    """config.json: whose folder it is."""

    version: int
    config: DatasetConfig
    program: str = ""
    """The code that began it; data sets of the first days do not say."""


def read_config(folder: Path) -> DatasetConfig:
    """The settings of the data set in `folder`.

    Raises:
      DatasetError: none, of another version, or a damaged file.
    """
    path = folder / "config.json"
    if not path.exists():
        raise DatasetError(f"{folder} holds no data set; build one with `embodied dataset hanna --out {folder}`")
    return _read(_Begun, path, folder).config


def read_index(folder: Path, config: DatasetConfig) -> Index:
    """dataset.json of the data set in `folder`, whose settings are `config`.

    Raises:
      DatasetError: damaged, changed, or another data set's.
    """
    path = folder / "dataset.json"
    index = _read(Index, path, folder)
    if index.config != config:
        raise DatasetError(f"{path} is of another data set than {folder / 'config.json'}; build it again")
    if digest(dict(index.files)) != index.digest:
        raise DatasetError(f"{path}: its digest is not that of its files; somebody changed it, build it again")
    return index


def _read(kind: type[T], path: Path, folder: Path) -> T:
    try:
        body = read_json(path)
        if body.get("version") != VERSION:
            raise DatasetError(
                f"{path}: {folder} was built by version {body.get('version')!r:.40} of the format, this is {VERSION}; "
                "build it again"
            )
        return from_plain(kind, body, path.name)
    except RecordError as e:
        where = "" if str(e).startswith(str(path)) else f"{path}: "
        raise DatasetError(f"{where}{e}; build {folder} again") from e


def read_checked(folder: Path, name: str, file: str, files: Mapping[str, str]) -> bytes:
    """The content of one file of the house `name`, if it is the one that was written.

    Raises:
      DatasetError: it is missing, or not the one that dataset.json names.
    """
    home = folder / "houses" / name
    remedy = REBUILD.format(home=home, folder=folder)
    try:
        data = (home / file).read_bytes()
    except FileNotFoundError:
        raise DatasetError(f"{home} has lost its {file}; {remedy}") from None
    if digest(data)[:16] != files.get(f"{name}/{file}"):
        raise DatasetError(
            f"{home / file} was changed since it was written (dataset.json has another digest); {remedy}"
        )
    return data


def check_episode(episode: Episode, place: Place) -> None:
    """Refuse an episode that was played elsewhere.

    Raises:
      DatasetError: in another house of this name, or along nodes that this one does not have.
    """
    name, n = episode.task.id, len(place.graph.ids)
    if episode.house != place.house.digest[:16]:
        raise DatasetError(
            f"the episode of {name!r} was played in another house of the name {episode.task.world!r} (digest "
            f"{episode.house or 'unknown'}, this one has {place.house.digest[:16]}); give the data set that it was "
            "played in, or play it again here"
        )
    named = {*episode.nodes, *episode.task.goal_nodes}
    named.update(v for s in episode.steps for v in (s.pose.node, *s.targets, *s.candidate_nodes))
    if strange := sorted(v for v in named if v >= n):
        raise DatasetError(f"the episode of {name!r} names the nodes {strange[:5]}, its house has 0 to {n - 1}")

"""Data sets as folders for published programs, as Parquet tables, and as questions for models of videos; walks, drives
and episodes with what is seen on the way, for published learners, and goals of `goat` data."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from embodied.agents.options import Encoded
from embodied.cli.common import bar, note, show
from embodied.cli.exports import OfData, register_export
from embodied.datasets.folders import PROGRAMS
from embodied.options import Cached, Count, InputPath, Option, drawn_as, not_negative, video_side
from embodied.render.pictures import PICTURES

if TYPE_CHECKING:
    import numpy as np

    from embodied.datasets.store import Dataset


WIDTH = 2048
"""The length of a feature that the published programs are written for."""


@dataclass(frozen=True, kw_only=True)
class ProgramOptions(OfData, Encoded):
    """A folder to copy into the published program.

    `duet` is for VLN-DUET and HAMT, `r2r` for EnvDrop and Recurrent-VLN-BERT, too; `matterport` holds graphs and
    skyboxes for the Matterport3D simulator. README-embodied.md in the folder says which version, what goes where, and
    which lines a current PyTorch needs changed. `python -m embodied.mattersim` then runs the programs without a
    compiled simulator.
    """

    features: bool = False
    """Also write the features of `embodied features`."""
    pad: Count = WIDTH
    """Pad features with zeros to N numbers, the length that the programs expect."""


def run_program(program: str, args: ProgramOptions) -> None:
    from embodied.datasets.folders import export_folder
    from embodied.datasets.store import Dataset
    from embodied.locks import locked

    data = Dataset(args.data)
    features = feature_rows(data, args) if args.features else None
    if features is None and program != "matterport":
        note("no features are written; the program needs them: add --features")
    with locked(args.out):
        files = export_folder(program, data, args.out, features)
    facts = {"program": program, "files": len(files), "out": str(args.out), "readme": str(files[-1])}
    show(args, facts, f"{len(files)} files for {program} in {args.out}; read {files[-1].name} there")


def feature_rows(data: Dataset, args: ProgramOptions) -> Iterator[tuple[str, str, np.ndarray]]:
    """(house, viewpoint id, (36, D) features in our order) of every viewpoint, filled up to --pad.

    Raises:
      FileNotFoundError: a house has no features of this encoder.
      ValueError: features are longer than --pad.
    """
    import numpy as np

    from embodied.agents.vision.encoder import load_encoder
    from embodied.agents.vision.features import feature_path, load_features
    from embodied.agents.vision.run import pictures_of
    from embodied.datasets.folders import names_of

    encoder = load_encoder(args.encoder)
    drawn = {name: pictures_of(data, name, args.pictures) for name in names_of(data)}
    files = {name: feature_path(data.folder / "features", encoder.digest, name, how) for name, how in drawn.items()}

    def read(name: str) -> tuple[tuple[str, ...], np.ndarray]:
        place, pictures = data.place(name), drawn[name]
        features = load_features(files[name], encoder=encoder.digest, source=place.house.digest, pictures=pictures)
        n = features.shape[2]
        if n > args.pad:
            raise ValueError(f"{files[name]} holds features of {n} numbers, --pad is {args.pad}; raise it")
        return place.graph.ids, np.pad(features.astype(np.float32), ((0, 0), (0, 0), (0, args.pad - n)))

    for name in [n for n, file in files.items() if not file.exists()][:1] or list(files)[:1]:
        read(name)
    return ((name, key, rows) for name in files for key, rows in zip(*read(name), strict=True))


for _name in PROGRAMS:
    register_export(_name, ProgramOptions, functools.partial(run_program, _name))


@dataclass(frozen=True, kw_only=True)
class ParquetOptions(OfData):
    """Houses, tasks, routes and episodes as Parquet tables, with a data-set card."""

    episodes: tuple[InputPath, ...] = ()
    """Episodes (.jsonl) to write as tables, too."""


def run_parquet(args: ParquetOptions) -> None:
    from embodied.datasets.parquet import export_parquet
    from embodied.datasets.store import Dataset
    from embodied.locks import locked

    with locked(args.out):
        files = export_parquet(Dataset(args.data), args.out, args.episodes)
    show(args, {"files": len(files), "out": str(args.out)}, f"{len(files)} files in {args.out}; README.md is its card")


register_export("parquet", ParquetOptions, run_parquet)


@dataclass(frozen=True, kw_only=True)
class VqaExportOptions(OfData):
    """Questions of `embodied dataset vqa` with videos or pictures of their walks, for other programs."""

    form: Annotated[str, Option(words=("vsi", "llava", "sat", "openeqa"))] = "vsi"
    """VSI-Bench's rows as Parquet, with scene facts and a task for lmms-eval (vsi), LLaVA's conversations (llava),
    SAT's rows of pictures (sat), or OpenEQA's questions with episode histories (openeqa)."""


def run_vqa(args: VqaExportOptions) -> None:
    """Write all splits."""
    from embodied.datasets.vqa.build import VqaData
    from embodied.datasets.vqa.formats import FORMATS

    data = VqaData(args.data)
    for split in data.about["counts"]:
        FORMATS[args.form](data, data.questions(split), args.out, split)
    show(args, {"out": str(args.out)}, f"questions as {args.form} in {args.out}")


register_export("vqa", VqaExportOptions, run_vqa)


@dataclass(frozen=True, kw_only=True)
class WalkOptions(OfData, Cached):
    """Continuous walks of an expert in `vln` data: images, actions, instructions."""

    split: str = "train"
    """The split whose tasks are walked."""
    tasks: Count | None = None
    """Walk the first N tasks (default: all)."""
    action_noise: Annotated[float, Option(not_negative, "SHARE")] = 0.0
    """Share of the actions that are random; the stored action is always the expert's, as in DAgger."""
    width: Annotated[int, Option(video_side, "PIXELS")] = 256
    """Width and height of the pictures."""
    depth: bool = False
    """Also write videos of depth (lerobot-vlnce)."""


def run_walks(form: str, args: WalkOptions) -> None:
    from embodied.datasets.habitat import route_episodes
    from embodied.datasets.store import dataset_of
    from embodied.datasets.vlnce import export_walks
    from embodied.envs.continuous import CameraConfig
    from embodied.gym.drive import chosen_worlds

    data = dataset_of(args.data, "vln")
    worlds, _ = chosen_worlds(data=args.data, split=args.split, cache=args.cache)
    walks = route_episodes(data.tasks(args.split), worlds)[: args.tasks]
    how: dict[str, Any] = {"action_noise": args.action_noise, "split": args.split, "depth": args.depth}
    how |= {"seed": data.config.seed, "camera": CameraConfig(args.width, args.width)}
    steps = export_walks(form, args.out, walks, worlds, watch=lambda e: bar(e, "walks", "walk"), **how)
    for world in worlds.values():
        world.close()
    facts = {"walks": len(walks), "steps": steps, "out": str(args.out)}
    show(args, facts, f"{len(walks)} walks, {steps} steps in {args.out}")


@dataclass(frozen=True, kw_only=True)
class GoatOptions(OfData):
    """Tasks of `goat` data as GOAT-Bench's files: sequences of goals with viewpoints, descriptions and images."""

    split: str = "test_unseen"
    """The split that is written."""


def run_goat(args: GoatOptions) -> None:
    from embodied.datasets.habitat import write_goat
    from embodied.datasets.store import dataset_of

    data = dataset_of(args.data, "goat")
    files = write_goat(args.out, args.split, data.tasks(args.split), data.split(args.split).worlds)
    show(args, {"files": len(files), "out": str(args.out)}, f"{len(files)} files in {args.out}")


register_export("goat", GoatOptions, run_goat)
for _form in ("vlnce", "lerobot-vlnce"):
    register_export(_form, WalkOptions, functools.partial(run_walks, _form))


@dataclass(frozen=True, kw_only=True)
class DriveOptions(OfData, Cached):
    """Drives of an expert on wheels to points, as LeRobot data (v3.0), in the houses of any data set."""

    split: str = "train"
    """The split whose houses are driven in."""
    drives: Count = 100
    """Drive N times, as often in each house."""
    action_noise: Annotated[float, Option(not_negative, "SHARE")] = 0.0
    """Share of the commands that are random; the stored command is always the expert's, as in DAgger."""
    pictures: Annotated[str | None, drawn_as(PICTURES)] = None
    """How houses are drawn (default: as the data set's pictures are)."""
    size: Annotated[int, Option(video_side, "PIXELS")] = 128
    """Side of the pictures."""


def run_drives(args: DriveOptions) -> None:
    from embodied.datasets.store import Dataset
    from embodied.gym.drive import make
    from embodied.gym.lerobot import DriveForLeRobot
    from embodied.gym.lerobot.drives import export_drives

    seen: dict[str, Any] = {"height": args.size, "width": args.size, "observations": ("rgb",)}
    houses: dict[str, Any] = {"data": args.data, "split": args.split, "cache": args.cache, "pictures": args.pictures}
    env = DriveForLeRobot(make(**houses, **seen))
    watch = functools.partial(bar, name="drives", unit="drive")
    seed = Dataset(args.data).config.seed
    steps = export_drives(env, args.out, args.drives, seed=seed, action_noise=args.action_noise, watch=watch)
    env.close()
    facts = {"drives": args.drives, "steps": steps, "out": str(args.out)}
    show(args, facts, f"{args.drives} drives, {steps} steps in {args.out}")


register_export("lerobot-drive", DriveOptions, run_drives)


@dataclass(frozen=True, kw_only=True)
class LeRobotOptions(OfData):
    """Episodes as a LeRobot data set (v3.0)."""

    episodes: tuple[InputPath, ...] = ()
    """Episodes (.jsonl) of `embodied evaluate` (default: --agent plays the tasks of --split)."""
    agent: Annotated[str | None, Option(metavar="NAME")] = None
    """Who plays: an agent of `embodied evaluate` that needs no training and no pictures (default: an expert, which asks
    where the kind of task has help)."""
    split: str | None = None
    """The split whose tasks are played (default: train)."""
    tasks: Count | None = None
    """Play the first N tasks (default: all)."""
    size: Annotated[int, Option(video_side, "PIXELS")] = 224
    """Side of the pictures."""
    depth: bool = False
    """Also write videos of depth."""


def run_lerobot(args: LeRobotOptions) -> None:
    from embodied.datasets.lerobot import export_lerobot
    from embodied.datasets.store import Dataset
    from embodied.evaluation.evaluate import play
    from embodied.interface import Episode
    from embodied.kinds.metrics import success
    from embodied.records import load_lines

    data = Dataset(args.data)
    name = args.agent or data.task_kind.expert
    chosen = {"--agent": args.agent, "--split": args.split, "--tasks": args.tasks}
    if args.episodes and (twice := [option for option, value in chosen.items() if value is not None]):
        raise ValueError(f"--episodes says who played which tasks; leave {' and '.join(twice)} out")
    known = [*data.task_kind.baselines]
    if name not in known:
        raise ValueError(
            f"--agent is {name!r}; of {data.kind!r} use one of {known}, or export the --episodes that "
            "`embodied evaluate --out` wrote of any other"
        )
    if args.episodes:
        episodes = [e for path in args.episodes for e in load_lines(path, Episode)]
        for episode in episodes:
            data.place_of(episode)
    else:
        whole_split = data.split(args.split or "train")
        tasks = whole_split.tasks[: args.tasks]
        episodes = play(whole_split.make_env, data.task_kind.agent(name), tasks, seed=data.config.seed, agent=name)

    succeeded = lambda episode: success(episode, data.place(episode.task.world).graph) > 0
    watched, size = bar(episodes, "episodes", "episode"), (args.size, args.size)
    steps = export_lerobot(data, args.out, watched, succeeded=succeeded, size=size, depth=args.depth)
    text = f"{len(episodes)} episodes, {steps} steps in {args.out}: "
    text += f"LeRobotDataset('{args.out.name}', root='{args.out}')"
    show(args, {"episodes": len(episodes), "steps": steps, "out": str(args.out)}, text)


register_export("lerobot", LeRobotOptions, run_lerobot)

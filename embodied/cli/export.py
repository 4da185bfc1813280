"""Export a data set or a house to the formats of other programs.

  hanna, vnla, r2r, iliad-nav   folders to copy into the published programs of these names
  duet                          the same for VLN-DUET and HAMT; EnvDrop and Recurrent-VLN-BERT read r2r
  matterport                    graphs and skyboxes for the Matterport3D simulator
  vlnce, streamvln, uninavid, internnav, lerobot-vlnce
                                continuous walks of an expert in `vln` data: images, actions, instructions
  lerobot-drive                 drives of an expert on wheels, for policies of LeRobot in Drive-v0
  parquet                       tables and a card, for `datasets.load_dataset`
  lerobot                       episodes with video, poses, actions and instructions, for `LeRobotDataset`
  glb, mjcf, usd                a house for web viewers and Blender, for MuJoCo's viewer, for USD programs

Folders for programs contain a README-embodied.md: which version, what goes where, and which lines a current PyTorch
needs changed. `python -m embodied.mattersim` then runs the programs without a compiled simulator.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from embodied.cli.common import Furnished, Printed, bar, catalogue_of, note, show
from embodied.cli.learning import Encoded
from embodied.options import (
    Cached,
    Count,
    HouseFolder,
    InputFolder,
    InputPath,
    Option,
    OutputFolder,
    drawn_as,
    file_ending_in,
    file_to_write,
    not_negative,
    video_side,
)
from embodied.render.pictures import PICTURES

if TYPE_CHECKING:
    import numpy as np

    from embodied.assets.catalogue import Catalogue
    from embodied.datasets.store import Dataset
    from embodied.house.house import House
    from embodied.scene.lit_pages import LitPages

PROGRAMS = ("hanna", "vnla", "r2r", "duet", "iliad-nav", "matterport")
"""As in embodied.datasets.folders, which --help should not import."""
WALKS = {
    "vlnce": "vlnce",
    "streamvln": "streamvln",
    "uninavid": "uninavid",
    "internnav": "streamvln",
    "lerobot-vlnce": "vlnce",
}
"""As embodied.datasets.vlnce.FORMATS, with the preset of body and camera (embodied.gym.continuous) of each."""
WIDTH = 2048
"""The length of a feature that the published programs are written for."""


@dataclass(frozen=True, kw_only=True)
class OfData(Printed):
    data: InputFolder
    """The data set, a folder that `embodied dataset` built."""
    out: OutputFolder
    """Folder to write, made if missing."""


@dataclass(frozen=True, kw_only=True)
class ProgramOptions(OfData, Encoded):
    """A folder to copy into the published program."""

    features: bool = False
    """Also write the features of `embodied features`."""
    pad: Count = WIDTH
    """Pad features with zeros to N numbers, the length that the programs expect."""


@dataclass(frozen=True, kw_only=True)
class ParquetOptions(OfData):
    """Parquet tables of houses, tasks, routes and episodes, with a data-set card."""

    episodes: tuple[InputPath, ...] = ()
    """Episodes (.jsonl) to write as tables, too."""


@dataclass(frozen=True, kw_only=True)
class LeRobotOptions(OfData):
    """Episodes as a LeRobot data set (v3.0)."""

    episodes: tuple[InputPath, ...] = ()
    """Episodes (.jsonl) of `embodied evaluate` (default: --agent plays --split); they say who played which tasks."""
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


@dataclass(frozen=True, kw_only=True)
class WalkOptions(OfData, Cached):
    """Continuous walks of an expert in `vln` data: images, actions, instructions."""

    split: str = "train"
    """The split whose tasks are walked."""
    tasks: Count | None = None
    """Walk the first N tasks (default: all)."""
    wander: Annotated[float, Option(not_negative, "SHARE")] = 0.0
    """Share of the actions that are random; the stored action is always the expert's, as in DAgger."""
    width: Annotated[int | None, Option(video_side, "PIXELS")] = None
    """Width of the pictures (default: that of the program)."""
    depth: bool = False
    """Also write videos of depth (lerobot-vlnce)."""


@dataclass(frozen=True, kw_only=True)
class DriveOptions(OfData, Cached):
    """Drives of an expert on wheels to points, as LeRobot data (v3.0), in houses of any kind of data."""

    split: str = "train"
    """The split whose houses are driven in."""
    drives: Count = 100
    """Drive N times, as often in each house."""
    wander: Annotated[float, Option(not_negative, "SHARE")] = 0.0
    """Share of the commands that are random; the stored command is always the expert's, as in DAgger."""
    pictures: Annotated[str | None, drawn_as(PICTURES)] = None
    """How houses are drawn (default: as the data set's pictures are)."""
    size: Annotated[int, Option(video_side, "PIXELS")] = 128
    """Side of the pictures."""


@dataclass(frozen=True, kw_only=True)
class HouseOptions(Furnished, Printed):
    """The house."""

    house: HouseFolder
    """Folder that `embodied house` wrote."""
    light: Annotated[str, Option(words=("none", "fast", "normal", "high"))] = "normal"
    """Quality of the baked light; none: export the unlit house."""


@dataclass(frozen=True, kw_only=True)
class GlbOptions(HouseOptions):
    """A house as GLB, for web viewers and Blender."""

    out: Annotated[Path, Option(file_ending_in(".glb"), "FILE")]
    """File to write."""
    no_ceilings: bool = False
    """Leave ceilings and roof out, to look in from above."""
    sky: bool = False
    """Keep the backdrop of distant scenery, to look out of the windows."""


@dataclass(frozen=True, kw_only=True)
class MjcfOptions(HouseOptions):
    """A house as MJCF, for MuJoCo's viewer."""

    out: OutputFolder
    """Folder to write."""


@dataclass(frozen=True, kw_only=True)
class UsdOptions(HouseOptions):
    """A house as USDZ, for USD programs."""

    out: Annotated[Path, Option(file_to_write, "FILE")]
    """File to write."""


def run_program(what: str, args: ProgramOptions) -> None:
    from embodied.datasets.folders import export_folder
    from embodied.datasets.store import Dataset
    from embodied.locks import locked

    data = Dataset(args.data)
    features = feature_rows(data, args) if args.features else None
    if features is None and what != "matterport":
        note("no features are written; the program needs them: add --features")
    with locked(args.out):
        files = export_folder(what, data, args.out, features)
    facts = {"program": what, "files": len(files), "out": str(args.out), "readme": str(files[-1])}
    show(args, facts, f"{len(files)} files for {what} in {args.out}; read {files[-1].name} there")


def feature_rows(data: Dataset, args: ProgramOptions) -> Iterator[tuple[str, str, np.ndarray]]:
    """(house, viewpoint id, (36, D) features in our order) of every viewpoint, filled up to --pad.

    Raises:
      FileNotFoundError: a house has no features of this encoder.
      ValueError: features are longer than --pad.
    """
    import numpy as np

    from embodied.agents.vision.drawn import pictures_of
    from embodied.agents.vision.features import feature_path, load_features
    from embodied.agents.vision.run import encoder_of
    from embodied.datasets.folders import names_of

    encoder = encoder_of(args.encoder, args.network)
    drawn = {name: pictures_of(data, name, args.pictures) for name in names_of(data)}
    files = {name: feature_path(data.folder / "features", encoder.digest, name, how) for name, how in drawn.items()}

    def read(name: str) -> tuple[tuple[str, ...], np.ndarray]:
        place, pictures = data.place(name), drawn[name]
        features, _ = load_features(files[name], encoder=encoder.digest, source=place.house.digest, pictures=pictures)
        n = features.shape[2]
        if n > args.pad:
            raise ValueError(f"{files[name]} holds features of {n} numbers, --pad is {args.pad}; raise it")
        return place.graph.ids, np.pad(features.astype(np.float32), ((0, 0), (0, 0), (0, args.pad - n)))

    for name in [n for n, file in files.items() if not file.exists()][:1] or list(files)[:1]:
        read(name)
    return ((name, key, rows) for name in files for key, rows in zip(*read(name), strict=True))


def run_parquet(args: ParquetOptions) -> None:
    from embodied.datasets.parquet import export_parquet
    from embodied.datasets.store import Dataset
    from embodied.locks import locked

    with locked(args.out):
        files = export_parquet(Dataset(args.data), args.out, args.episodes)
    show(args, {"files": len(files), "out": str(args.out)}, f"{len(files)} files in {args.out}; README.md is its card")


def run_lerobot(args: LeRobotOptions) -> None:
    from embodied.datasets.lerobot import RecordedCamera, export_lerobot
    from embodied.datasets.store import Dataset
    from embodied.evaluation.rollout import play
    from embodied.interface import Episode
    from embodied.metrics import success
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
    watched, camera = bar(episodes, "episodes", "episode"), RecordedCamera(args.size, args.size)
    steps = export_lerobot(data, args.out, watched, succeeded=succeeded, camera=camera, depth=args.depth)
    text = (
        f"{len(episodes)} episodes, {steps} steps in {args.out}: LeRobotDataset('{args.out.name}', root='{args.out}')"
    )
    show(args, {"episodes": len(episodes), "steps": steps, "out": str(args.out)}, text)


def run_walks(what: str, args: WalkOptions) -> None:
    from embodied.datasets.habitat import route_excursions
    from embodied.datasets.store import dataset_of
    from embodied.datasets.vlnce import export_walks
    from embodied.gym.continuous import PRESETS
    from embodied.gym.drive import data_worlds
    from embodied.locks import locked

    data = dataset_of(args.data, "vln")
    body, lens = PRESETS[WALKS[what]]
    width = args.width or lens.width
    lens = dataclasses.replace(lens, height=2 * round(lens.height * width / lens.width / 2), width=width)
    whole = what == "lerobot-vlnce"  # written under another name; the others are written file by file
    with contextlib.nullcontext() if whole else locked(args.out):
        worlds = data_worlds(args.data, args.split, args.cache, None)
        walks = route_excursions(data.tasks(args.split), worlds)[: args.tasks]
        how: dict[str, Any] = {"wander": args.wander, "split": args.split, "depth": args.depth}
        how["watch"] = functools.partial(bar, name="walks", unit="walk")
        steps = export_walks(what, args.out, walks, worlds, seed=data.config.seed, body=body, lens=lens, **how)
        for world in worlds.values():
            world.close()
    facts = {"walks": len(walks), "steps": steps, "out": str(args.out)}
    show(args, facts, f"{len(walks)} walks, {steps} steps in {args.out}")


def run_drives(args: DriveOptions) -> None:
    from embodied.datasets.store import Dataset
    from embodied.gym.drive import make
    from embodied.gym.lerobot import DriveForLeRobot
    from embodied.gym.lerobot.drives import export_drives

    seen: dict[str, Any] = {"height": args.size, "width": args.size, "sees": ("rgb",), "pictures": args.pictures}
    env = DriveForLeRobot(make(data=args.data, split=args.split, cache=args.cache, **seen))
    watch = functools.partial(bar, name="drives", unit="drive")
    seed = Dataset(args.data).config.seed
    steps = export_drives(env, args.out, args.drives, seed=seed, wander=args.wander, watch=watch)
    env.close()
    facts = {"drives": args.drives, "steps": steps, "out": str(args.out)}
    show(args, facts, f"{args.drives} drives, {steps} steps in {args.out}")


def run_house(what: str, args: GlbOptions | MjcfOptions | UsdOptions) -> None:
    from embodied.house.lighting import load_lit_house
    from embodied.locks import locked
    from embodied.scene.export import export_mjcf

    if not isinstance(args, MjcfOptions):  # these need trimesh, which a small installation lacks
        from embodied.scene.glb import export_glb
        from embodied.scene.usd import check_usd, export_usd
        from embodied.scene.web import export_lit_glb
    if what == "usd":
        check_usd(args.out)
        if args.light == "none":
            raise ValueError("USD is written of a lit house; leave --light none out")
    catalogue = catalogue_of(args)
    house = load_lit_house(args.house, catalogue)
    lit = light(args, house, catalogue)
    if isinstance(args, MjcfOptions):
        with locked(args.out):
            path = export_mjcf(house, catalogue, args.out, lit=lit)
    elif not isinstance(args, GlbOptions):
        assert lit is not None, "refused above"
        path = export_usd(house, lit, args.out)
    elif lit is None:
        path = export_glb(house, catalogue, args.out, ceilings=not args.no_ceilings)
    else:
        path = export_lit_glb(house, lit, args.out, ceilings=not args.no_ceilings, sky=args.sky)
    facts = {"house": house.digest, "format": what, "light": lit.digest if lit else None, "path": str(path)}
    show(args, facts, f"{house.name} as {what}: {path}, {path.stat().st_size / 1e6:.1f} MB")


def light(args: HouseOptions, house: House, catalogue: Catalogue) -> LitPages | None:
    """The house's baked light, from the cache where it is there; None without."""
    if args.light == "none":
        return None
    from embodied.light import bake, progress_bar

    with progress_bar() as progress:
        return bake(house, catalogue, args.cache, args.light, progress=progress).lit


COMMANDS: Mapping[str, Any] = {
    **{name: (ProgramOptions, functools.partial(run_program, name)) for name in PROGRAMS},
    "parquet": (ParquetOptions, run_parquet),
    "lerobot": (LeRobotOptions, run_lerobot),
    **{name: (WalkOptions, functools.partial(run_walks, name)) for name in WALKS},
    "lerobot-drive": (DriveOptions, run_drives),
    "glb": (GlbOptions, functools.partial(run_house, "glb")),
    "mjcf": (MjcfOptions, functools.partial(run_house, "mjcf")),
    "usd": (UsdOptions, functools.partial(run_house, "usd")),
}

"""Write a data set or a house as others read it: folders of published programs, Parquet, LeRobot, glTF, MJCF, USD.

  hanna, vnla, r2r, iliad-nav   folders to lay over copies of the programs of these names
  duet                          the same for VLN-DUET and HAMT; EnvDrop and Recurrent-VLN-BERT read r2r
  matterport                    graphs and skyboxes for the Matterport3D simulator
  vlnce, streamvln, uninavid, internnav, lerobot-vlnce
                                continuous walks of an expert in `vln` data: images, actions, instructions
  parquet                       tables and a card, for `datasets.load_dataset`
  lerobot                       episodes with video, poses, actions and instructions, for `LeRobotDataset`
  glb, mjcf, usd                a house for web viewers and Blender, for MuJoCo's viewer, for USD programs

Folders of programs come with a README-embodied.md: which version, what goes where, which lines a current PyTorch
needs changed. `python -m embodied.mattersim` then runs the programs without a compiled simulator.
"""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

from embodied.cli.common import add_cache, add_json, add_packs, bar, catalogue_of, note, show
from embodied.cli.options import (
    any_path,
    file_ending_in,
    file_to_write,
    folder_to_write,
    house_folder,
    not_negative,
    video_side,
    whole,
)

if TYPE_CHECKING:
    import numpy as np

    from assets.catalogue import Catalogue
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
FORMATS = ("glb", "mjcf", "usd")
WIDTH = 2048
"""The length of a feature that the published programs are written for."""


def add(parser: argparse.ArgumentParser) -> None:
    from embodied.cli.learning import add_encoder

    what = parser.add_subparsers(dest="what", metavar="WHAT", required=True)
    for name in PROGRAMS:
        sub = what.add_parser(name, help=f"the folder that {name} reads")
        _add_data(sub)
        sub.add_argument("--features", action="store_true", help="also write the features of `embodied features`")
        sub.add_argument(
            "--pad", type=whole(), default=WIDTH, metavar="N",
            help="fill features with zeros up to this length, which the programs count on (default: %(default)s)",
        )  # fmt: skip
        add_encoder(sub)
    sub = what.add_parser("parquet", help="Parquet tables with a card")
    _add_data(sub)
    sub.add_argument(
        "--episodes",
        type=any_path,
        nargs="+",
        default=[],
        metavar="FILE",
        help="episodes (.jsonl) to write as tables, too",
    )
    _add_lerobot(what.add_parser("lerobot", help="episodes as a LeRobot data set (v3.0)"))
    for name in WALKS:
        sub = what.add_parser(name, help=f"continuous walks as {name} trains on them")
        _add_data(sub)
        sub.add_argument("--split", default="train", help="whose tasks are walked (default: %(default)s)")
        sub.add_argument("--tasks", type=whole(), metavar="N", help="walk the first so many tasks (default: all)")
        sub.add_argument(
            "--wander", type=not_negative, default=0.0, metavar="SHARE",
            help="draw this share of the steps and turns instead, and write what the expert does there "
            "(default: %(default)s)",
        )  # fmt: skip
        sub.add_argument(
            "--width", type=video_side, metavar="PIXELS", help="width of pictures (default: that of the program)"
        )
        if name == "lerobot-vlnce":
            sub.add_argument("--depth", action="store_true", help="also write videos of depth")
        add_cache(sub)
    for name in FORMATS:
        sub = what.add_parser(name, help=f"a house as {name}")
        sub.add_argument(
            "--house", type=house_folder, required=True, metavar="DIR", help="folder that `embodied house` wrote"
        )
        place = {"mjcf": folder_to_write, "glb": file_ending_in(".glb"), "usd": file_to_write}[name]
        sub.add_argument("--out", type=place, required=True, metavar="PATH", help="file to write (mjcf: folder)")
        sub.add_argument(
            "--light", choices=("none", "fast", "normal", "high"), default="normal",
            help="bake light of this quality into it, or leave its materials as they are (default: %(default)s)",
        )  # fmt: skip
        if name == "glb":
            sub.add_argument(
                "--no-ceilings", action="store_true", help="leave ceilings and roof out, for a look from above"
            )
            sub.add_argument("--sky", action="store_true", help="keep the dome of far scenery, for a look from inside")
        add_cache(sub)
        add_packs(sub)
        add_json(sub)


def _add_lerobot(parser: argparse.ArgumentParser) -> None:
    _add_data(parser)
    parser.add_argument(
        "--episodes", type=any_path, nargs="+", metavar="FILE",
        help="episodes (.jsonl) of `embodied evaluate` (default: an expert plays --split)",
    )  # fmt: skip
    parser.add_argument("--split", default="train", help="what the expert plays (default: %(default)s)")
    parser.add_argument("--tasks", type=whole(), metavar="N", help="the expert plays the first so many tasks")
    parser.add_argument(
        "--size", type=video_side, default=224, help="side of the picture, pixels (default: %(default)s)"
    )
    parser.add_argument("--depth", action="store_true", help="also write videos of depth")


def _add_data(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--data", type=any_path, required=True, metavar="DIR", help="a data set of `embodied dataset`")
    parser.add_argument(
        "--out", type=folder_to_write, required=True, metavar="DIR", help="folder to write, made if missing"
    )
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    from embodied.locks import locked

    runs = {
        "parquet": run_parquet,
        "lerobot": run_lerobot,
        **dict.fromkeys(PROGRAMS, run_program),
        **dict.fromkeys(WALKS, run_walks),
    }
    with locked(args.out) if args.what in (*PROGRAMS, "parquet", "mjcf") else contextlib.nullcontext():
        return runs.get(args.what, run_house)(args)


def run_program(args: argparse.Namespace) -> int:
    from embodied.datasets.folders import export_folder
    from embodied.datasets.store import Dataset

    data = Dataset(args.data)
    features = feature_rows(data, args) if args.features else None
    if features is None and args.what != "matterport":
        note("no features are written; the program needs them: add --features")
    files = export_folder(args.what, data, args.out, features)
    facts = {"program": args.what, "files": len(files), "out": str(args.out), "readme": str(files[-1])}
    show(args, facts, f"{len(files)} files for {args.what} in {args.out}; read {files[-1].name} there")
    return 0


def feature_rows(data: Dataset, args: argparse.Namespace) -> Iterator[tuple[str, str, np.ndarray]]:
    """(house, viewpoint id, (36, D) features in our order) of every viewpoint, filled up to --pad.

    Raises:
      FileNotFoundError: a house has no features of this encoder.
      ValueError: features are longer than --pad.
    """
    import numpy as np

    from agents.vision.drawn import pictures_of
    from agents.vision.features import feature_path, load_features
    from agents.vision.run import encoder_of
    from embodied.datasets.folders import names_of

    encoder = encoder_of(args.encoder, args.network)
    drawn = {name: pictures_of(data, name, args.pictures) for name in names_of(data)}
    files = {name: feature_path(data.folder / "features", encoder.digest, name, how) for name, how in drawn.items()}

    def read(name: str) -> tuple[tuple[str, ...], np.ndarray]:
        place, pictures = data.place(name), drawn[name]
        features, _ = load_features(files[name], encoder=encoder.digest, source=place.house.digest, pictures=pictures)
        if features.shape[2] > args.pad:
            raise ValueError(
                f"{files[name]} holds features of {features.shape[2]} numbers, --pad is {args.pad}; raise it"
            )
        wide = np.pad(features.astype(np.float32), ((0, 0), (0, 0), (0, args.pad - features.shape[2])))
        return place.graph.ids, wide

    for name in [n for n, file in files.items() if not file.exists()][:1] or list(files)[:1]:
        read(name)
    return ((name, key, rows) for name in files for key, rows in zip(*read(name), strict=True))


def run_parquet(args: argparse.Namespace) -> int:
    from embodied.datasets.parquet import export_parquet
    from embodied.datasets.store import Dataset

    files = export_parquet(Dataset(args.data), args.out, args.episodes)
    show(args, {"files": len(files), "out": str(args.out)}, f"{len(files)} files in {args.out}; README.md is its card")
    return 0


def run_lerobot(args: argparse.Namespace) -> int:
    from embodied.datasets.lerobot import RecordedCamera, export_lerobot
    from embodied.datasets.store import Dataset
    from embodied.evaluation.evaluate import agent
    from embodied.evaluation.metrics import success
    from embodied.evaluation.rollout import play
    from embodied.interface import Episode
    from embodied.records import load_lines

    data = Dataset(args.data)
    if args.episodes:
        episodes = [e for path in args.episodes for e in load_lines(path, Episode)]
        for episode in episodes:
            data.place_of(episode)
    else:
        whole_split = data.split(args.split)
        expert = agent(data.kind, "shortest")
        episodes = play(whole_split.make_env, expert, whole_split.tasks[: args.tasks], seed=data.config.seed)

    def succeeded(episode: Episode) -> bool:
        return success(episode, data.place(episode.task.world).graph) > 0

    steps = export_lerobot(
        data,
        args.out,
        bar(episodes, "episodes", "episode"),
        succeeded=succeeded,
        camera=RecordedCamera(args.size, args.size),
        depth=args.depth,
    )
    show(
        args,
        {"episodes": len(episodes), "steps": steps, "out": str(args.out)},
        f"{len(episodes)} episodes, {steps} steps in {args.out}: LeRobotDataset('{args.out.name}', root='{args.out}')",
    )
    return 0


def run_walks(args: argparse.Namespace) -> int:
    from embodied.datasets.habitat import route_excursions
    from embodied.datasets.store import dataset_of
    from embodied.datasets.vlnce import Shot, export_walks
    from embodied.gym.continuous import PRESETS
    from embodied.gym.drive import data_worlds

    data = dataset_of(args.data, "vln")
    body, lens = PRESETS[WALKS[args.what]]
    width = args.width or lens.width
    shot = Shot(2 * round(lens.height * width / lens.width / 2), width, lens.hfov)
    worlds = data_worlds(args.data, args.split, args.cache, None)
    walks = route_excursions(data.tasks(args.split), worlds)[: args.tasks]
    steps = export_walks(
        args.what,
        args.out,
        walks,
        worlds,
        seed=data.config.seed,
        body=body,
        shot=shot,
        wander=args.wander,
        split=args.split,
        depth=args.what == "lerobot-vlnce" and args.depth,
        watch=lambda episodes: bar(episodes, "walks", "walk"),
    )
    for world in worlds.values():
        world.close()
    facts = {"walks": len(walks), "steps": steps, "out": str(args.out)}
    show(args, facts, f"{len(walks)} walks, {steps} steps in {args.out}")
    return 0


def run_house(args: argparse.Namespace) -> int:
    from embodied.house.validation import load_house
    from embodied.scene.export import export_glb, export_mjcf
    from embodied.scene.usd import check_usd, export_usd
    from embodied.scene.web import export_lit_glb

    if args.what == "usd":
        check_usd(args.out)
        if args.light == "none":
            raise ValueError("USD is written of a lit house; leave --light none out")
    catalogue = catalogue_of(args)
    house = load_house(args.house / "house.json", catalogue)
    lit = light(args, house, catalogue)
    if args.what == "mjcf":
        path = export_mjcf(house, catalogue, args.out, lit=lit)
    elif args.what == "usd" and lit is not None:
        path = export_usd(house, lit, args.out)
    elif lit is None:
        path = export_glb(house, catalogue, args.out, ceilings=not args.no_ceilings)
    else:
        path = export_lit_glb(house, lit, args.out, ceilings=not args.no_ceilings, sky=args.sky)
    facts = {"house": house.digest, "format": args.what, "light": lit.digest if lit else None, "path": str(path)}
    show(args, facts, f"{house.name} as {args.what}: {path}, {path.stat().st_size / 1e6:.1f} MB")
    return 0


def light(args: argparse.Namespace, house: House, catalogue: Catalogue) -> LitPages | None:
    """The house's baked light, from the cache where it is there; None without."""
    if args.light == "none":
        return None
    from embodied.light import bake, progress_bar

    with progress_bar() as progress:
        return bake(house, catalogue, args.cache, args.light, progress=progress).lit

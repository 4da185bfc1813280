"""Look at what happened: open a recording, or the episodes of a run.

RUN is a .rrd file, which opens in the Rerun viewer (with --serve in the browser, with --connect in
a viewer that runs already), or a folder that `embodied evaluate` wrote: its episodes are
listed, --page writes one HTML page about them, and --episode N makes the recording of one (with
--data, the data set its houses come from), and with --video a film. What the agent sees in the
recording is drawn as it was for the agent.
"""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from embodied.cli.common import add_cache, add_json, add_packs, bar, catalogue_of, note, show
from embodied.cli.options import add_pictures, any_path, whole
from embodied.cli.recording import add_sinks, add_video, film, viewers_of
from embodied.render.pictures import DRAWN

if TYPE_CHECKING:
    from agents.vision.config import RenderedInputs
    from assets.catalogue import Catalogue
    from embodied.datasets.store import Dataset
    from embodied.interface import Episode
    from viz.report import Listed
    from viz.sinks import Sinks


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=any_path, metavar="RUN", help="a .rrd file, or a folder with episodes*.jsonl")
    parser.add_argument("--episode", type=whole(0), metavar="N", help="record episode N of the list and open it")
    parser.add_argument("--data", type=any_path, metavar="DIR", help="data set of the run, for --episode")
    parser.add_argument(
        "--page", action="store_true", help="write RUN/index.html: plots, all episodes, links to recordings"
    )
    add_pictures(parser, DRAWN, "unlit", what="how --episode draws the house")
    add_video(parser)
    add_sinks(parser, "RUN/recordings/N.rrd")
    add_cache(parser)
    add_packs(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    if args.folder.suffix == ".rrd":
        return show_file(args)
    from viz.report import load_run, summary_line, write_page

    found = load_run(args.folder)
    if args.episode is not None:
        return record_one(args, found)
    if args.page:
        page = write_page(args.folder, found)
        show(args, {"page": str(page), "episodes": len(found)}, f"wrote {page}")
        return 0
    rows = [summary_line(i, e) for i, e in enumerate(found)]
    show(
        args,
        {"episodes": [{"number": i, "task": e.episode.task.id, "agent": e.agent} for i, e in enumerate(found)]},
        "\n".join(rows),
    )
    return 0


def show_file(args: argparse.Namespace) -> int:
    """Open a .rrd file in a new viewer, in the browser or in a viewer that runs."""
    if not args.folder.exists():
        raise FileNotFoundError(
            f"{args.folder} does not exist; make one with `embodied demo` or `embodied rollout --rrd`"
        )
    from viz.sinks import open_file, send_file

    if args.connect is None:
        return open_file(args.folder, serve=args.serve, bind=args.bind)
    with viewers_of(args) as viewers:
        send_file(args.folder, viewers)
    return 0


def record_one(args: argparse.Namespace, found: Sequence[Listed]) -> int:
    """Draw one episode of a run again, into a recording."""
    from embodied.datasets.store import Dataset
    from viz.sinks import Sinks

    if not 0 <= args.episode < len(found):
        raise ValueError(f"--episode {args.episode} does not exist; this run has the episodes 0 to {len(found) - 1}")
    if args.data is None:
        raise ValueError(
            "--episode needs --data DIR, the data set that the run was made on: its houses are drawn again"
        )
    episode = found[args.episode].episode
    file = args.rrd or args.folder / "recordings" / f"{args.episode}.rrd"
    with viewers_of(args) as viewers:
        record_again(args.folder, Dataset(args.data), episode, Sinks(file, viewers), catalogue_of(args), args)
        show(args, {"recording": str(file)}, f"wrote {file}; open it with: embodied view {file}")
    return 0


def record_again(
    run: Path, data: Dataset, episode: Episode, sinks: Sinks, catalogue: Catalogue, args: argparse.Namespace
) -> None:
    """Record an episode of a run in its house, drawn again as `args.pictures`, and with what its agent saw.

    Raises:
      DatasetError: it was played in a house that is not in the data set.
    """
    from viz.recording import record_episode

    name = episode.task.world
    data.place_of(episode)
    seen = looked_at(run).by(episode.agent, name)
    with contextlib.ExitStack() as stack:
        eyes = None
        if seen is not None:
            from agents.vision.drawn import drawn_world  # loads torch

            eyes = stack.enter_context(drawn_world(data, name, args.cache, seen))
        world = stack.enter_context(data.open_world(name, catalogue, args.cache, args.pictures, size=384))
        watch = lambda steps: bar(steps, "recording", "step")
        record_episode(world, episode, sinks, eyes=eyes, watch=watch)
        if args.video:
            film(world, episode, args.video, tuple(args.video_size))
    note(f"recorded {episode.task.id}")


def looked_at(run: Path) -> RenderedInputs:
    """What the agents of a run looked at; nothing where it does not say.

    Raises:
      RecordError: a damaged run.json.
    """
    from agents.vision.config import RenderedInputs
    from embodied.records import from_plain, read_json

    path = run / "run.json"
    facts = read_json(path) if path.exists() else {}
    return from_plain(RenderedInputs, {k: facts[k] for k in ("looking", "pictures") if k in facts}, str(path))

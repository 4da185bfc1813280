"""Look at the episodes of a run, or at questions about houses.

RUN is a folder that `embodied evaluate` wrote. The command lists its episodes; --episode N with --data records one, and
with --video films it. The recording shows what the agent saw; `rerun FILE.rrd` opens it.
Of a folder of `embodied dataset vqa`, the command lists questions; --episode N draws one with frames and outlines.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from embodied.cli.common import Furnished, Printed, bar, catalogue_of, note, show
from embodied.cli.rollout import Filmed, Viewers, check_viewer, film
from embodied.cli.vqa import look
from embodied.options import InputFolder, Option, OutputRrd, any_path, drawn_as, whole
from embodied.render.pictures import DRAWN

if TYPE_CHECKING:
    from embodied.render.pictures import PictureSettings
    from embodied.viz.episode_log import Listed


@dataclass(frozen=True, kw_only=True)
class ViewOptions(Filmed, Viewers, Furnished, Printed):
    folder: Annotated[Path, Option(any_path, "RUN", name="folder")]
    """A folder with episodes*.jsonl, or with questions."""
    episode: Annotated[int | None, Option(whole(0), "N")] = None
    """Record episode N of the list, or draw question N."""
    data: InputFolder | None = None
    """The data set of the run, for --episode."""
    pictures: Annotated[str, drawn_as(DRAWN)] = "unlit"
    """How --episode draws the house."""
    rrd: OutputRrd | None = None
    """Write the Rerun recording here (default: RUN/recordings/N.rrd)."""


def run(args: ViewOptions) -> None:
    from embodied.viz.episode_log import load_run, summary_line

    if (args.folder / "vqa.json").exists():
        look(args)
        return
    episodes = load_run(args.folder)
    if args.episode is not None:
        record_one(args, episodes, args.episode)
    else:
        facts = [{"number": i, "task": e.episode.task.id, "agent": e.agent} for i, e in enumerate(episodes)]
        show(args, {"episodes": facts}, "\n".join(summary_line(i, e) for i, e in enumerate(episodes)))


def record_one(args: ViewOptions, episodes: Sequence[Listed], number: int) -> None:
    """Record one episode of a run in its house, drawn again, and with what its agent saw.

    Raises:
      DatasetError: it was played in a house that is not in the data set.
    """
    from embodied.datasets.store import Dataset
    from embodied.viz.recording import record_episode
    from embodied.viz.sinks import Sinks

    if not 0 <= number < len(episodes):
        raise ValueError(f"--episode {number} does not exist; this run has the episodes 0 to {len(episodes) - 1}")
    if args.data is None:
        raise ValueError(
            "--episode needs --data DIR, the data set that the run was made on: its houses are drawn again"
        )
    episode, file = episodes[number].episode, args.rrd or args.folder / "recordings" / f"{number}.rrd"
    check_viewer(args)
    sinks, catalogue, data = Sinks(file, args.connect), catalogue_of(args), Dataset(args.data)
    name = episode.task.world
    data.place_of(episode)
    seen = looked_at(args.folder, episode.agent, name)
    with contextlib.ExitStack() as stack:
        eyes = None
        if seen is not None:
            from embodied.agents.vision.run import drawn_world  # loads torch

            eyes = stack.enter_context(drawn_world(data, name, args.cache, seen))
        world = stack.enter_context(data.open_world(name, catalogue, args.cache, args.pictures, size=384))
        record_episode(world, episode, sinks, eyes=eyes, watch=lambda steps: bar(steps, "recording", "step"))
        if args.video:
            film(world, episode, args.video, args.video_size)
    note(f"recorded {episode.task.id}")
    show(args, {"recording": str(file)}, f"wrote {file}; open it with: rerun {file}")


def looked_at(run: Path, agent: str, house: str) -> PictureSettings | None:
    """How the pictures of a house were drawn that an agent of a run looked at; None if it looked at none.

    Raises:
      RecordError: a damaged run.json.
    """
    from embodied.records import RecordError, from_plain, read_json
    from embodied.render.pictures import from_words

    path = run / "run.json"
    facts = read_json(path) if path.exists() else {}
    if agent not in from_plain(tuple[str, ...], facts.get("looking", []), f"looking of {path}"):
        return None
    try:
        words = facts.get("pictures", {}).get(house)
        return None if words is None else from_words(words)
    except (AttributeError, TypeError, ValueError) as e:
        raise RecordError(f"{path} does not say how pictures were drawn ({e}); evaluate again") from e

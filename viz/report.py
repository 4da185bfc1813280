"""The list of the episodes of a run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from embodied.interface import Episode
from embodied.language.detokenize import detokenized
from embodied.records import load_lines


@dataclass(frozen=True)
class Listed:
    """One episode of a run folder."""

    agent: str
    """From the name of its file: 'shortest path'."""
    episode: Episode

    @property
    def arrived(self) -> bool:
        """Tells whether it stopped at a goal node; the tables judge by distance, this is for orientation."""
        return self.episode.nodes[-1] in self.episode.task.goal_nodes


def load_run(folder: Path) -> list[Listed]:
    """All episodes of a run, file by file in the order of their names.

    Raises:
      FileNotFoundError: no episodes there.
    """
    folder = Path(folder)
    files = sorted(folder.glob("episodes*.jsonl"))
    if not files:
        raise FileNotFoundError(
            f"{folder} holds no episodes*.jsonl; make a run with `embodied evaluate --out {folder}`; `rerun FILE.rrd` "
            "opens recordings"
        )
    episodes = []
    for path in files:
        episodes += [Listed(_name(path.name), e) for e in load_lines(path, Episode)]
    return episodes


def _name(file: str) -> str:
    """Split and agent of a file of episodes: 'val seen learned' of 'episodes_val_seen_learned.jsonl'."""
    return Path(file).stem.removeprefix("episodes").strip("_").replace("_", " ") or "agent"


def summary_line(number: int, listed: Listed) -> str:
    """One line of the list."""
    e = listed.episode
    end = "at a goal" if listed.arrived else e.ended
    counts = f"{len(e.steps):3} steps {e.requests:2} requests"
    return f"{number:4}  {end:<10} {counts}  {listed.agent:<28} {e.task.id:<28} {detokenized(e.task.request)}"

"""A run as one HTML page: every episode with its recording."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from embodied.assets.cache import write_bytes
from embodied.interface import Ask, Episode
from embodied.language.detokenize import detokenized
from embodied.records import load_lines

STYLE = """body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:70rem;color:#222}
table{border-collapse:collapse;width:100%}td,th{padding:.3rem .6rem;border-bottom:1px solid #ddd;text-align:left}
.q{color:#555;font-style:italic}.n{text-align:right}"""


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
            f"{folder} holds no episodes*.jsonl; make a run with `embodied evaluate --out {folder}`, or name a .rrd "
            "file"
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


def write_page(folder: Path, episodes: Sequence[Listed]) -> Path:
    """Write folder/index.html; returns its path."""
    rows = []
    for number, x in enumerate(episodes):
        recording = Path("recordings") / f"{number}.rrd"
        link = (
            f'<a href="{recording}">recording</a>'
            if (Path(folder) / recording).exists()
            else f"embodied view … --episode {number}"
        )
        asked = next(
            (
                s.instruction
                for s, before in zip(x.episode.steps[1:], x.episode.steps)
                if isinstance(before.action, Ask)
            ),
            "",
        )
        end = html.escape("at a goal" if x.arrived else x.episode.ended)
        rows.append(
            f"<tr><td class=n>{number}</td><td>{html.escape(x.agent)}</td>"
            f"<td>{html.escape(detokenized(x.episode.task.request))}"
            f"<div class=q>{html.escape(detokenized(asked))}</div></td>"
            f"<td>{end}</td><td class=n>{len(x.episode.steps)}</td><td class=n>{x.episode.requests}</td>"
            f"<td>{link}</td></tr>"
        )
    agents = {x.agent for x in episodes}
    page = (
        f"<!doctype html><meta charset=utf-8><title>{html.escape(Path(folder).name)}</title><style>{STYLE}</style>"
        f"<h1>{html.escape(Path(folder).name)}</h1><p>{len(episodes)} episodes of {len(agents)} agents.</p>"
        "<table><tr><th>#<th>agent<th>request, and the first instruction heard<th>end<th>steps<th>requests<th></tr>"
        + "".join(rows)
        + "</table>"
    )
    path = Path(folder) / "index.html"
    write_bytes(path, page.encode())
    return path

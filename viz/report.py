"""A run as one HTML page: how often, how far, how many requests, and every episode with its recording."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from embodied.assets.cache import write_bytes
from embodied.interface import Ask, Episode
from embodied.language.detokenize import detokenized
from embodied.records import RecordError, episodes_file, load_lines, parse_file

mpl.use("Agg")
STYLE = """body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:70rem;color:#222}
table{border-collapse:collapse;width:100%}td,th{padding:.3rem .6rem;border-bottom:1px solid #ddd;text-align:left}
img{max-width:100%}.q{color:#555;font-style:italic}.n{text-align:right}"""


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
    """Write folder/index.html, plots included; returns its path."""
    agents = sorted({x.agent for x in episodes})
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
    page = (
        f"<!doctype html><meta charset=utf-8><title>{html.escape(Path(folder).name)}</title><style>{STYLE}</style>"
        f"<h1>{html.escape(Path(folder).name)}</h1><p>{len(episodes)} episodes of {len(agents)} agents.</p>"
        '<img alt="steps and requests by agent" '
        f'src="data:image/png;base64,{_plots(episodes, agents, judged(folder))}">'
        "<table><tr><th>#<th>agent<th>request, and the first instruction heard<th>end<th>steps<th>requests<th></tr>"
        + "".join(rows)
        + "</table>"
    )
    path = Path(folder) / "index.html"
    write_bytes(path, page.encode())
    return path


def judged(folder: Path) -> dict[str, tuple[float, float]]:
    """Agent, named as in `Listed`, to success and half its 95 % interval in per cent; empty without a table."""
    table = Path(folder) / "table.json"
    if not table.exists():
        return {}
    rows = parse_file(table)
    if not isinstance(rows, list):
        raise RecordError(f"{table} is no table of `embodied evaluate`; make it again")
    try:
        return {
            _name(episodes_file(r["split"], r["agent"])): (
                100 * float(r["values"]["success"]["mean"]),
                100 * float(r["values"]["success"]["half_width_95"]),
            )
            for r in rows
        }
    except (KeyError, TypeError, AttributeError, ValueError) as e:
        raise RecordError(f"{table} is no table of `embodied evaluate` ({e!r}); make it again") from e


def _plots(episodes: Sequence[Listed], agents: Sequence[str], success: Mapping[str, tuple[float, float]]) -> str:
    """Success, steps and requests per agent, as a PNG in base64."""
    figure = Figure(figsize=(11, 0.6 + 0.45 * len(agents)), layout="constrained")
    axes = figure.subplots(1, 3, sharey=True)
    of = {a: [x for x in episodes if x.agent == a] for a in agents}
    if set(agents) <= set(success):
        axes[0].barh(
            range(len(agents)),
            [success[a][0] for a in agents],
            xerr=[success[a][1] for a in agents],
            color="#2a9d8f",
            ecolor="#555",
        )
        axes[0].set(title="success, % with 95 % interval", xlim=(0, 100))
    else:
        axes[0].barh(
            range(len(agents)), [100 * sum(x.arrived for x in of[a]) / len(of[a]) for a in agents], color="#2a9d8f"
        )
        axes[0].set(title="stopped at a goal node, %", xlim=(0, 100))
    steps = [[len(x.episode.steps) for x in of[a]] for a in agents]
    requests = [[x.episode.requests for x in of[a]] for a in agents]
    for axis, title, counts in ((axes[1], "steps", steps), (axes[2], "requests for help", requests)):
        axis.boxplot(counts, orientation="horizontal", positions=range(len(agents)))
        axis.set(title=title)
    axes[0].set_yticks(range(len(agents)), agents)
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=110)
    return base64.b64encode(data.getvalue()).decode()

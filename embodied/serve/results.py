"""Results of a study: episodes and judgements as JSON Lines, a summary, and how far people agree."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from embodied.interface import Episode
from embodied.records import episodes_file, save_lines, to_json
from embodied.serve.game import Game
from embodied.serve.sessions import Sessions, is_success
from embodied.serve.store import Event

JUDGEMENTS = "judgements.jsonl"


@dataclass(frozen=True)
class Judgement:
    """Stars or words of somebody for an episode."""

    part: str
    unit: str
    """Which of the episodes that the part judges."""
    judge: str
    """Their random id."""
    episode: Episode
    stars: int | None = None
    """1 to 5."""
    text: str = ""
    seconds: float | None = None
    """From the first picture to the answer, as their browser says."""


class ResultsWriter:
    """Keeps the JSON Lines of a study in its folder: written anew from the log at the start, then added to."""

    def __init__(self, folder: Path, sessions: Sessions) -> None:
        self._folder, self._sessions = folder, sessions
        games = defaultdict(list)
        for game in sessions.games.values():
            if game.over and game.broken is None and not game.practice:
                games[game.table.part.name].append(game.episode)
        for part in sessions.study.parts:
            if part.kind == "play":
                save_lines(folder / episodes_file(part.split, part.name), games[part.name])
        save_lines(folder / JUDGEMENTS, [judgement(sessions, e) for e in sessions.judgements])

    def game(self, game: Game) -> None:
        """Add a finished episode."""
        part = game.table.part
        append_line(self._folder / episodes_file(part.split, part.name), game.episode)

    def judged(self, event: Event) -> None:
        """Add a judgement."""
        append_line(self._folder / JUDGEMENTS, judgement(self._sessions, event))


def append_line(path: Path, record: object) -> None:
    """Add one record to a JSON Lines file, in one write."""
    with open(path, "ab", buffering=0) as file:
        file.write((to_json(record) + "\n").encode())


def judgement(sessions: Sessions, event: Event) -> Judgement:
    """The record of a 'judged' event."""
    body = event.body
    episode = sessions.episode_of(body["part"], body["unit"])
    seconds = body.get("seconds")
    seconds = round(float(seconds), 2) if isinstance(seconds, (int, float)) and 0 <= seconds < 1e6 else None
    text = body.get("text") or ""
    return Judgement(body["part"], body["unit"], event.person or "", episode, body.get("stars"), text, seconds)


def agreement(ratings: Iterable[tuple[str, float]]) -> float | None:
    """Krippendorff's alpha for numbers on an interval scale; None where no two people rated the same.

    Args:
      ratings: (what was rated, rating).

    Source: Krippendorff, Computing Krippendorff's Alpha-Reliability (2011), sec. D: 1 minus the mean squared difference
    within units over that among all pairable values.
    """
    units: defaultdict[str, list[float]] = defaultdict(list)
    for unit, value in ratings:
        units[unit].append(value)
    pairable = [np.array(v) for v in units.values() if len(v) > 1]
    if not pairable:
        return None
    every = np.concatenate(pairable)
    n = len(every)
    within = sum(((v[:, None] - v) ** 2).sum() / (len(v) - 1) for v in pairable) / n
    among = ((every[:, None] - every) ** 2).sum() / (n * (n - 1))
    return 1.0 if among == 0 else float(1 - within / among)


def summary(sessions: Sessions) -> dict[str, Any]:
    """The figures of a study so far."""
    people = list(sessions.people.values())
    ends = Counter(p.ended for p in people)
    active = sum(p.connected > 0 and p.ended is None for p in people)
    away = sum(p.connected == 0 and p.ended is None for p in people)
    counts = {"joined": len(people), "agreed": sum(p.consented for p in people), "finished": ends["done"]}
    counts |= {"left": ends["left"], "here now": active, "away, not finished": away}
    dropout = ratio(away + ends["left"], len(people) - active)
    parts = [part_summary(sessions, p.name) for p in sessions.study.parts]
    return {"title": sessions.study.title, "people": counts, "dropout": dropout, "parts": parts}


def part_summary(sessions: Sessions, name: str) -> dict[str, Any]:
    """The figures of one part."""
    part = sessions.part(name)
    if part.kind == "play":
        games = [g for g in sessions.games.values() if g.table.part.name == name and not g.practice]
        whole = [g for g in games if g.over and g.broken is None]
        answers = [s for g in whole for s in g.said if s["who"] == "assistant"]
        facts = {"name": name, "wanted": len(sessions.tables[name].tasks) * part.answers, "done": len(whole)}
        facts |= {"running": sum(not g.over for g in games), "broken off": sum(g.broken is not None for g in games)}
        return {
            **facts,
            "success": ratio(sum(is_success(g) for g in whole), len(whole)),
            "questions per episode": mean([g.env.requests for g in whole]),
            "words per answer": mean([len(a["text"].split()) for a in answers]),
            "seconds per answer": mean([a["seconds"] for a in answers]),
            "minutes per episode": mean([(g.last_change - g.begun) / 60 for g in whole]),
        }
    judged = [e for e in sessions.judgements if e.body["part"] == name]
    facts = {"name": name, "wanted": len(sessions.episodes(part)) * part.answers, "done": len(judged)}
    if part.kind == "describe":
        return {**facts, "words per description": mean([len(e.body["text"].split()) for e in judged])}
    stars = [(e.body["unit"], e.body["stars"]) for e in judged]
    return {**facts, "stars, mean": mean([s for _, s in stars]), "agreement (alpha)": agreement(stars)}


def ratio(a: int, b: int) -> float | None:
    return a / b if b else None


def mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def as_text(facts: Mapping[str, Any]) -> str:
    """A summary for a terminal."""
    lines = [facts["title"], ", ".join(f"{v} {k}" for k, v in facts["people"].items())]
    for part in facts["parts"]:
        figures = [f"{k} {v:.2f}" if isinstance(v, float) else f"{k} {v}" for k, v in part.items() if v is not None]
        lines.append("  " + ", ".join(figures[1:]).join((f"{part['name']}: ", "")))
    return "\n".join(lines)

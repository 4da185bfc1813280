"""Results of a study: episodes and judgements as JSON Lines, a summary, and how far people agree; and a data set with
people's words: what they answered and described, beside or instead of what the data set says.

Learners read it like any other. HANNA's assistants and ILIAD's describers speak the routes that people worded; VNLA's
advisor says a sub-goal as a person did where somebody meant the same actions.
"""

import dataclasses
import shutil
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from embodied.assets.cache import write_bytes
from embodied.assistants.route_system import WORDINGS
from embodied.datasets.build import UnitFacts, save_facts, share, write_index
from embodied.datasets.checks import DatasetError
from embodied.datasets.store import SUBGOALS, Dataset
from embodied.interface import STEP, Episode, Pose, Route, Task
from embodied.kinds.metrics import sdtw, without_repeats
from embodied.kinds.shipped.vln import vln_task
from embodied.kinds.shipped.vnla import HELP_STEPS
from embodied.language.people_language import Utterance
from embodied.language.plain_language import PlainLanguage
from embodied.navigation.graph import nearest
from embodied.records import episodes_file, load_json, load_lines, save_lines, to_json
from embodied.seeds import stream
from embodied.serve.game import Game
from embodied.serve.sessions import Sessions, is_success
from embodied.serve.store import Event
from embodied.serve.talk import PERSON_SUBTASK
from embodied.teachers.vnla import VnlaTeacher

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


@dataclass(frozen=True)
class Worded:
    """Words of a person for a way."""

    world: str
    path: tuple[int, ...]
    turn: int
    """How whoever walks it stands at first, in steps of 30 degrees."""
    text: str


def worded_by_people(folder: Path) -> list[Worded]:
    """Answers and descriptions of people, from the folder of a study; the same words for the same way count once."""
    episodes = (e for path in sorted(folder.glob("episodes*.jsonl")) for e in load_lines(path, Episode))
    worded = [w for e in episodes for w in answers(e)]
    judged = folder / JUDGEMENTS
    for j in load_lines(judged, Judgement) if judged.exists() else ():
        path = without_repeats(j.episode.nodes)
        if j.stars is None and len(path) > 1:
            worded.append(Worded(j.episode.task.world, path, j.episode.task.start.turn, j.text))
    return list(dict.fromkeys(worded))


def answers(episode: Episode) -> Iterator[Worded]:
    """The answers of people in an episode, with the way that was meant; bots' have no such sub-task."""
    for step in episode.steps:
        reply, meant = step.reply, step.reply and step.reply.subtask
        if reply and reply.text and meant and meant.id.startswith(PERSON_SUBTASK) and len(meant.path) > 1:
            yield Worded(episode.task.world, meant.path, step.pose.turn, reply.text)


def rated_by_people(folder: Path, source: Dataset) -> list[tuple[float, int]]:
    """(SDTW of an episode against the shortest way, the stars somebody gave it), of the folder of a study."""
    judged, ratings = folder / JUDGEMENTS, []
    for j in load_lines(judged, Judgement) if judged.exists() else ():
        if j.stars is not None:
            task, graph = j.episode.task, source.place(j.episode.task.world).graph
            way = graph.path(task.start.node, nearest(graph, task.start.node, task.goal_nodes))
            ratings.append((sdtw(without_repeats(j.episode.nodes), way, graph, max(task.radius, 1e-6)), j.stars))
    return ratings


def write_people_dataset(source: Dataset, words: Sequence[Worded], out: Path, *, only: bool = False) -> Dataset:
    """Write the data set `source` with people's words into the new folder `out`.

    In houses to train in, people's words are those of training, and a plain wording of the same way is what is held
    out; in the others, people's words are what agents are judged by.

    Args:
      only: leave out all other routes.

    Raises:
      DatasetError: no words, words of other houses, or a kind that nothing is made for.
    """
    names = {n for s in source.splits for n in source.names(s)}
    if strange := sorted({w.world for w in words} - names):
        raise DatasetError(
            f"people spoke of {strange[:3]}, which {source.folder} has not; name the data set of the study"
        )
    if not source.task_kind.routes and source.task_kind.help != "words":
        raise DatasetError(
            f"{source.folder} is of kind {source.kind!r}; words of people are of use where there are routes or advice, "
            "as in hanna, vln and vnla"
        )
    if not words:
        raise DatasetError("nobody has said or described anything yet")
    if out.exists() and any(out.iterdir()):
        raise DatasetError(f"{out} is not empty; choose another folder")
    of_house = defaultdict(list)
    for w in words:
        of_house[w.world].append(w)
    for name in sorted(names):
        _write_house(source, name, of_house[name], out / "houses" / name, only)
    if (features := source.folder / "features").exists():
        shutil.copytree(features, out / "features", copy_function=lambda a, b: share(Path(a), Path(b)))
    write_bytes(out / "config.json", (source.folder / "config.json").read_bytes())
    write_index(source.config, out)
    return Dataset(out)


def _write_house(source: Dataset, name: str, words: Sequence[Worded], home: Path, only: bool) -> None:
    old = source.folder / "houses" / name
    home.mkdir(parents=True)
    for path in sorted(old.iterdir()):
        if path.suffix in (".json", ".jsonl"):
            shutil.copyfile(path, home / path.name)
    share(old / "panoramas.pano", home / "panoramas.pano")
    facts = load_json(home / "unit.json", UnitFacts)
    if not source.task_kind.routes:
        if subgoals := list(_subgoals(source, words)):
            save_lines(home / SUBGOALS, subgoals)
        return
    split, *_, held_out = WORDINGS[{"extra": "train", "ood": "test"}.get(facts.group, facts.group)]
    spoken = list(_routes(source, name, words, split, held_out))
    kept = [] if only else list(source.routes(name))
    save_lines(home / "routes.jsonl", [*kept, *spoken])
    tasks = dict(facts.tasks)
    if source.task_kind.from_routes:
        for part in tasks:
            heard = held_out if part != "train" and facts.group == "train" else split
            file = home / f"tasks_{part}.jsonl"
            old_tasks = [] if only else list(load_lines(file, Task))
            tasks[part] = save_lines(file, [*old_tasks, *(vln_task(name, r) for r in spoken if r.split == heard)])
    save_facts(home, dataclasses.replace(facts, routes=len(kept) + len(spoken), tasks=tasks))


def _routes(source: Dataset, name: str, words: Sequence[Worded], split: str, held_out: str) -> Iterator[Route]:
    """People's routes and, where another wording of every path is held out, the plain one of each path."""
    place, plain, seen = source.place(name), PlainLanguage(), Counter[tuple[int, ...]]()
    for k, w in enumerate(words):
        yield Route(f"{name}_people_{k}", w.path, w.turn, 0, w.text, split)
        seen[w.path] += 1
        if held_out != split and seen[w.path] == 1:
            rng = stream(0, "plain", name, k)
            text = plain.route(place, w.path, w.turn * STEP, rng=rng)
            yield Route(f"{name}_people_{k}_plain", w.path, w.turn, 0, text, held_out)


def _subgoals(source: Dataset, words: Sequence[Worded]) -> Iterator[Utterance]:
    """Ways of at most HELP_STEPS actions, as the advisor words them, with what people said."""
    teacher = VnlaTeacher()
    for w in words:
        plan = teacher.plan(source.place(w.world))
        actions, end = plan.words(Pose(w.path[0], w.turn), (w.path[-1],), HELP_STEPS)
        if end.node == w.path[-1]:
            yield Utterance(tuple(a for a in actions if a != "stop"), w.text)

"""Episodes of an ILIAD student: the request, what it did, and the description that it learned from.

    embodied show iliad --request "drop every vowel" --word banana
    embodied show iliad
    embodied show iliad STUDY/runs/RUN/best.safetensors --shared STUDY/shared_KEY
    embodied show iliad --world nav --data DATA

FILE is a student of `embodied train iliad` or `embodied study iliad`. A teacher that was trained is in the folder
`shared` beside it. In NAV the student walks through the houses of a data set with features.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from embodied.agents.common.shipped import SHIPPED_STUDENT, SHIPPED_WALKER
from embodied.agents.options import Nav
from embodied.options import AnyFolder, Count, Option, any_path

if TYPE_CHECKING:
    from embodied.agents.common.session import Note


@dataclass(frozen=True, kw_only=True)
class ShowOptions(Nav):
    """Episodes of a student: the request, what it did, and the description that it learned from."""

    student: Annotated[Path | None, Option(any_path, "FILE", name="student")] = None
    """A trained student, best.safetensors (default: the shipped one of its world)."""
    world: Annotated[str, Option(words=("regex", "nav"))] = "regex"
    """Words to change, or houses to walk through."""
    shared: AnyFolder | None = None
    """Folder of the trained teacher of the student's study."""
    episodes: Count = 3
    """Show N episodes."""
    split: Annotated[str, Option(words=("train", "validation", "test"))] = "test"
    """The split that requests come from."""
    seed: int = 0
    """Random seed of the choice of episodes."""
    request: Annotated[str | None, Option(metavar="TEXT")] = None
    """REGEX: a request of your own; nobody describes what the student does."""
    word: str = "banana"
    """The word that your own request is about."""
    json: bool = False
    """Print the result as JSON."""


Episode = dict[str, Any]


def show(args: ShowOptions, *, note: Note) -> tuple[dict[str, Any], str]:
    """Episodes of the student that the options name, or its answer to a request of one's own, as JSON and as text."""
    if args.world == "nav":
        episodes = walks(args, args.student or SHIPPED_WALKER, note)
    elif args.data is not None:
        raise ValueError("--data belongs to --world nav; leave it out, or add --world nav")
    else:
        student = args.student or SHIPPED_STUDENT
        episodes = [own_request(args, student, args.request)] if args.request else rules(args, student, note)
    text = "\n\n".join("\n".join(f"{k:<14}{_plain(v)}" for k, v in episode.items()) for episode in episodes)
    return {"episodes": episodes}, f"{text}\n"


def own_request(args: ShowOptions, file: Path, request: str) -> Episode:
    """The student's rule for the user's words, and its result."""
    from embodied.agents.iliad.regex.data import WordTask
    from embodied.agents.iliad.regex.rules import LETTERS
    from embodied.agents.iliad.regex.run import load_student

    if not args.word or not set(args.word) <= set(LETTERS):
        raise ValueError(f"--word should be lower-case letters, got {args.word!r}")
    student, _ = load_student(file)
    (done,) = student.greedy([WordTask((request,), "", (args.word,), (args.word,))], [request])
    return {"request": request, "words": [args.word], "rule": done.rule, "outputs": done.outputs}


def rules(args: ShowOptions, file: Path, note: Note) -> list[Episode]:
    """Rules that a student of REGEX writes."""
    from embodied.agents.iliad.regex.run import RegexSetup, load_student
    from embodied.agents.iliad.regex.world import RegexWorld

    student, config = load_student(file)
    grounds = RegexSetup(config).prepare(_shared(args, config.teacher), note)
    return [
        {
            "request": task.requests[0],
            "words": task.words,
            "rule": done.rule,
            "outputs": done.outputs,
            "wanted": task.outputs,
            "fulfilled": RegexWorld().success(task, done),
            "description": description,
        }
        for task, done, description in _played(args, student, grounds)
    ]


def walks(args: ShowOptions, file: Path, note: Note) -> list[Episode]:
    """Walks of a student of NAV."""
    from embodied.agents.iliad.nav.run import NavSetup
    from embodied.agents.iliad.nav.stages import config_of, load_follower
    from embodied.agents.iliad.nav.world import NavWorld

    if args.data is None:
        raise ValueError(
            "--world nav wants --data, a folder that `embodied dataset vln` or `hanna` built, with features"
        )
    config = config_of(file)
    setup = NavSetup(config, args.data, args.encoder_digest(), args.pictures, args.cache)
    grounds = setup.prepare(_shared(args, config.teacher), note)
    world, student = NavWorld(grounds.data.eyes.places), load_follower(file, grounds.data.eyes)

    def rooms(trip: Any, nodes: Sequence[int]) -> list[str]:
        of_node = world.graph(trip).room_of_node
        return [room for room, _ in groupby(str(of_node[n]).replace("_", " ") for n in nodes)]

    return [
        {
            "house": trip.world,
            "request": trip.requests[0],
            "path": trip.path,
            "rooms": rooms(trip, trip.path),
            "walked": walk.nodes,
            "through": rooms(trip, walk.nodes),
            "fulfilled": world.success(trip, walk),
            "description": description,
        }
        for trip, walk, description in _played(args, student, grounds)
    ]


def _shared(args: ShowOptions, teacher: str) -> Path:
    if teacher == "learned" and args.shared is None:
        raise ValueError("--shared should be the folder of the teacher that was trained for this student")
    return args.shared or Path()


def _played(args: ShowOptions, student: Any, grounds: Any) -> list[tuple[Any, Any, str | None]]:
    """Some tasks of the split, what the student samples for them, and what the teacher says of it."""
    from embodied.seeds import stream

    rng, tasks = stream(args.seed, "iliad", "shown"), grounds.data.splits[args.split]
    chosen = [tasks[int(i)] for i in rng.permutation(len(tasks))[: args.episodes]]
    done = student.sample(chosen, [task.requests[0] for task in chosen], rng=rng)
    return list(zip(chosen, done, grounds.teacher.describe(chosen, done, rng=rng), strict=True))


def _plain(value: Any) -> str:
    """A part of an episode for people to read."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (list, tuple)):
        return ", ".join(map(str, value))
    return "(nothing)" if value is None else str(value)

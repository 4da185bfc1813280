"""Episodes of an ILIAD student: the request, what it did, and the description that it learned from.

    embodied show iliad --request "drop every vowel" --word banana
    embodied show iliad --shared SHARED
    embodied show iliad STUDY/students/learned/seed_0/adel_0.5/best.safetensors --shared STUDY/shared
    embodied show iliad --world nav --data DATA --rrd walk.rrd

FILE is a student of `embodied train iliad` or `embodied study iliad`, whose data and teacher are in the folder `shared`
beside it. The shipped student's are made in --shared if they are missing. In NAV the student walks through the houses
of a data set with features, and --teacher grammar or people describes its walks without a trained describer.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from embodied.agents.common.shipped import SHIPPED_STUDENT, SHIPPED_WALKER
from embodied.agents.options import Nav
from embodied.options import AnyFolder, Count, Option, OutputRrd, any_path

if TYPE_CHECKING:
    from embodied.agents.common.session import Note
    from embodied.agents.learner import Record


@dataclass(frozen=True, kw_only=True)
class ShowOptions(Nav):
    """Episodes of a student: the request, what it did, and the description that it learned from."""

    student: Annotated[Path | None, Option(any_path, "FILE", name="student")] = None
    """A trained student, best.safetensors (default: the shipped one of its world)."""
    world: Annotated[str, Option(words=("regex", "nav"))] = "regex"
    """Words to change, or houses to walk through."""
    shared: AnyFolder | None = None
    """Folder with data and teacher of the student's study."""
    episodes: Count = 3
    """Show N episodes."""
    split: Annotated[str, Option(words=("train", "validation", "test"))] = "test"
    """The split that requests come from."""
    greedy: bool = False
    """Decode greedily instead of sampling."""
    seed: int = 0
    """Random seed of the choice of episodes and of sampling."""
    request: Annotated[str | None, Option(metavar="TEXT")] = None
    """A request of your own; nobody describes what the student does."""
    word: str = "banana"
    """The word that your own request is about."""
    teacher: Annotated[str | None, Option(words=("learned", "grammar", "people"))] = None
    """NAV: who describes what the student does (default: who taught it)."""
    rrd: OutputRrd | None = None
    """NAV: record the first episode, for Rerun."""
    json: bool = False
    """Print the result as JSON."""


Shown = tuple[dict[str, Any], str]
"""The result as JSON, and as text."""


def show(args: ShowOptions, *, note: Note, record: Record) -> Shown:
    """Episodes of the student that the options name, or its answer to a request of one's own."""
    if args.world == "nav":
        return walks(args, args.student or SHIPPED_WALKER, note, record)
    for name in ("data", "teacher", "rrd"):
        if getattr(args, name) is not None:
            raise ValueError(f"--{name} belongs to --world nav; leave it out, or add --world nav")
    student = args.student or SHIPPED_STUDENT
    return own_request(args, student, args.request) if args.request else episodes(args, student, note)


def own_request(args: ShowOptions, file: Path, request: str) -> Shown:
    """Apply the student's rule to the user's words."""
    from embodied.agents.iliad.regex.data import WordTask
    from embodied.agents.iliad.regex.rules import LETTERS
    from embodied.agents.iliad.regex.run import load_student

    if not args.word or not set(args.word) <= set(LETTERS):
        raise ValueError(f"--word should be lower-case letters, got {args.word!r}")
    student, _ = load_student(file)
    (done,) = student.greedy([WordTask((request,), "", (args.word,), (args.word,))], [request])
    output = done.outputs[0] if done.outputs else None
    body = {"request": request, "word": args.word, "rule": done.rule, "output": output}
    return body, f"{args.word} -> {output or '(no rule)'}   by {done.rule}\n"


def episodes(args: ShowOptions, file: Path, note: Note) -> Shown:
    """Episodes with the student's own teacher."""
    from embodied.agents.iliad.regex.run import load_student, prepare
    from embodied.agents.iliad.regex.showing import lines_of, tell
    from embodied.seeds import stream

    if args.shared is None or not (file == SHIPPED_STUDENT or (args.shared / "data.json").exists()):
        raise ValueError(f"--shared should be a study's folder with data.json, got {args.shared}; or give --request")
    student, config = load_student(file)
    grounds = prepare(config, args.shared, note=note)
    items = grounds.data.splits[args.split]
    chosen = stream(args.seed, "iliad", "shown").permutation(len(items))[: args.episodes]
    episodes = [tell(student, grounds.teacher, items[int(i)], seed=args.seed, sample=not args.greedy) for i in chosen]
    text = "\n\n".join("\n".join(lines_of(t)) for t in episodes)
    return {"episodes": [dataclasses.asdict(t) for t in episodes]}, text + "\n"


def walks(args: ShowOptions, file: Path, note: Note, record: Record) -> Shown:
    """Episodes of NAV with the student's own teacher, or another one."""
    from embodied.agents.iliad.nav.config import NavConfig
    from embodied.agents.iliad.nav.run import NavSource, prepare
    from embodied.agents.iliad.nav.showing import episode_of, lines_of, tell
    from embodied.agents.iliad.nav.stages import config_of, load_follower
    from embodied.agents.vision.drawn import drawn_world, pictures_of
    from embodied.seeds import stream

    if args.data is None:
        raise ValueError(
            "--world nav wants --data, a folder that `embodied dataset vln` or `hanna` built, with features"
        )
    source = NavSource(args.data, args.encoder_digest(), args.pictures, args.cache)
    config: NavConfig = config_of(file)
    teacher = args.teacher or config.teacher
    if teacher == "learned" and args.shared is None:
        raise ValueError("--shared should be the folder of the describer and its executor; or give --teacher grammar")
    shared = args.shared or args.data  # the grammar needs no folder
    more = config.more_paths if teacher == "learned" else 0  # who was taught knows them; the grammar needs none
    grounds = prepare(dataclasses.replace(config, teacher=teacher, more_paths=more), source, shared, note=note)
    student = load_follower(file, grounds.data.eyes)
    trips = grounds.data.splits[args.split]
    order = stream(args.seed, "iliad", "shown").permutation(len(trips))[: args.episodes]
    chosen = [trips[int(i)] for i in order]
    if args.request:
        chosen = [dataclasses.replace(t, requests=(args.request,)) for t in chosen[:1]]
    shown = [tell(student, grounds.teacher, t, seed=args.seed, sample=not args.greedy) for t in chosen]
    if args.rrd:
        data, (first, walk) = grounds.data.source, shown[0]
        with drawn_world(data, chosen[0].world, args.cache, pictures_of(data, chosen[0].world, args.pictures)) as eyes:
            record(eyes, episode_of(student, chosen[0], walk, first.description), args.rrd)
    text = "\n\n".join("\n".join(lines_of(episode)) for episode, _ in shown)
    return {"episodes": [dataclasses.asdict(episode) for episode, _ in shown]}, text + "\n"

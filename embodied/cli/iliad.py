"""Show episodes of a student that learns from descriptions: what was asked, done, said and learned.

    embodied iliad --request "drop every vowel" --word banana
    embodied iliad --shared SHARED
    embodied iliad STUDY/students/learned/seed_0/adel_0.5/best.safetensors --shared STUDY/shared
    embodied iliad --world nav --data DATA --rrd walk.rrd

The student is the shipped one of its world, or one of `embodied train iliad` or `embodied study iliad`, whose
data and teacher are in the folder `shared` beside it. The shipped one's are made there if they are missing.
NAV's student walks through the houses of a data set (`embodied dataset vln` or `hanna`, `embodied features`); --teacher
grammar lets whoever words routes here describe its walks instead of a trained describer.
"""

from __future__ import annotations

import argparse
import dataclasses
from typing import TYPE_CHECKING

from embodied.cli.common import add_json, note, show
from embodied.cli.options import any_folder, any_path, file_ending_in, whole

if TYPE_CHECKING:
    from agents.iliad.nav.showing import NavTold
    from agents.iliad.nav.student import NavStudent
    from agents.iliad.nav.world import NavWalk, Trip
    from embodied.datasets.store import Dataset


def add(parser: argparse.ArgumentParser) -> None:
    from embodied.cli.learning import add_nav_data

    parser.add_argument(
        "student",
        type=any_path,
        nargs="?",
        metavar="FILE",
        help="a trained student, best.safetensors (default: the one of its world that ships)",
    )
    parser.add_argument("--world", choices=("regex", "nav"), default="regex", help="words, or houses (default: regex)")
    parser.add_argument("--shared", type=any_folder, metavar="DIR", help="folder with data and teacher of its study")
    parser.add_argument(
        "--episodes", type=whole(), default=3, metavar="N", help="show N episodes (default: %(default)s)"
    )
    parser.add_argument("--split", choices=("train", "validation", "test"), default="test", help="whose requests")
    parser.add_argument("--greedy", action="store_true", help="the likeliest rule instead of a sampled one")
    parser.add_argument("--seed", type=int, default=0, help="of which episodes, and what is drawn (default: 0)")
    parser.add_argument("--request", metavar="TEXT", help="a request of your own; nobody describes what is done")
    parser.add_argument("--word", default="banana", help="the word it is about (default: %(default)s)")
    add_nav_data(parser, required=False)
    parser.add_argument("--teacher", choices=("learned", "grammar"), help="NAV: who describes (default: who taught it)")
    parser.add_argument(
        "--rrd", type=file_ending_in(".rrd"), metavar="FILE", help="NAV: record the first episode, for Rerun"
    )
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    from agents.common.shipped import SHIPPED_STUDENT, SHIPPED_WALKER

    if args.world == "nav":
        args.student = args.student or SHIPPED_WALKER
        return walks(args)
    args.student = args.student or SHIPPED_STUDENT
    for name in ("data", "teacher", "rrd"):
        if getattr(args, name) is not None:
            raise ValueError(f"--{name} belongs to --world nav; leave it out, or add --world nav")
    return own_request(args) if args.request else episodes(args)


def own_request(args: argparse.Namespace) -> int:
    """What the student makes of the user's words."""
    from agents.iliad.regex.data import WordTask
    from agents.iliad.regex.rules import LETTERS
    from agents.iliad.regex.run import load_student

    if not args.word or not set(args.word) <= set(LETTERS):
        raise ValueError(f"--word should be lower-case letters, got {args.word!r}")
    student, _ = load_student(args.student)
    (done,) = student.greedy([WordTask((args.request,), "", (args.word,), (args.word,))], [args.request])
    output = done.outputs[0] if done.outputs else None
    body = {"request": args.request, "word": args.word, "rule": done.rule, "output": output}
    show(args, body, f"{args.word} -> {output or '(no rule)'}   by {done.rule}\n")
    return 0


def episodes(args: argparse.Namespace) -> int:
    """Episodes with the student's own teacher."""
    from agents.common.shipped import SHIPPED_STUDENT
    from agents.iliad.regex.run import load_student, prepare
    from agents.iliad.regex.showing import lines_of, tell
    from embodied.seeds import stream

    there = args.shared is not None and (args.student == SHIPPED_STUDENT or (args.shared / "data.json").exists())
    if not there:
        raise ValueError(f"--shared should be a study's folder with data.json, got {args.shared}; or give --request")
    student, config = load_student(args.student)
    grounds = prepare(config, args.shared, note=note)
    items = grounds.data.splits[args.split]
    chosen = stream(args.seed, "iliad", "shown").permutation(len(items))[: args.episodes]
    told = [tell(student, grounds.teacher, items[int(i)], seed=args.seed, sample=not args.greedy) for i in chosen]
    text = "\n\n".join("\n".join(lines_of(t)) for t in told)
    show(args, {"episodes": [dataclasses.asdict(t) for t in told]}, text + "\n")
    return 0


def walks(args: argparse.Namespace) -> int:
    """Episodes of NAV with the student's own teacher, or another one."""
    from agents.iliad.nav.config import NavConfig
    from agents.iliad.nav.run import NavSource, prepare
    from agents.iliad.nav.showing import lines_of, tell
    from agents.iliad.nav.stages import config_of, load_follower
    from agents.vision.run import encoder_of
    from embodied.seeds import stream

    if args.data is None:
        raise ValueError(
            "--world nav wants --data, a folder that `embodied dataset vln` or `hanna` built, with features"
        )
    source = NavSource(args.data, encoder_of(args.encoder, args.network).digest, args.pictures, args.cache)
    config: NavConfig = config_of(args.student)
    teacher = args.teacher or config.teacher
    if teacher == "learned" and args.shared is None:
        raise ValueError("--shared should be the folder of the describer and its executor; or give --teacher grammar")
    shared = args.shared or args.data  # the grammar needs no folder
    more = config.more_paths if teacher == "learned" else 0  # who was taught knows them; the grammar needs none
    grounds = prepare(dataclasses.replace(config, teacher=teacher, more_paths=more), source, shared, note=note)
    student, _ = load_follower(args.student, grounds.data.eyes)
    trips = grounds.data.splits[args.split]
    order = stream(args.seed, "iliad", "shown").permutation(len(trips))[: args.episodes]
    chosen = [trips[int(i)] for i in order]
    if args.request:
        chosen = [dataclasses.replace(t, requests=(args.request,)) for t in chosen[:1]]
    shown = [tell(student, grounds.teacher, t, seed=args.seed, sample=not args.greedy) for t in chosen]
    if args.rrd:
        _record(args, grounds.data.source, student, chosen[0], shown[0])
    text = "\n\n".join("\n".join(lines_of(told)) for told, _ in shown)
    show(args, {"episodes": [dataclasses.asdict(told) for told, _ in shown]}, text + "\n")
    return 0


def _record(
    args: argparse.Namespace, data: Dataset, student: NavStudent, trip: Trip, shown: tuple[NavTold, NavWalk]
) -> None:
    """The first episode as a Rerun recording, with what the student saw."""
    from agents.iliad.nav.showing import episode_of
    from agents.vision.drawn import drawn_world, pictures_of
    from viz.recording import record_episode
    from viz.sinks import Sinks

    told, walk = shown
    with drawn_world(data, trip.world, args.cache, pictures_of(data, trip.world, args.pictures)) as eyes:
        record_episode(eyes, episode_of(student, trip, walk, told.description), Sinks(args.rrd), eyes=eyes)

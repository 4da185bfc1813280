"""Show episodes of a student that learns from descriptions: what was asked, done, said and learned.

    embodied iliad --request "drop every vowel" --word banana
    embodied iliad --shared SHARED
    embodied iliad STUDY/students/learned/seed_0/adel_0.5/best.safetensors --shared STUDY/shared

The student is the shipped one, or one of `embodied train iliad regex` or `embodied study iliad`, whose
data and teacher are in the folder `shared` beside it. The shipped one's are made there if they are missing.
"""

from __future__ import annotations

import argparse
import dataclasses

from embodied.cli.common import add_json, note, show
from embodied.cli.options import any_folder, any_path, whole


def add(parser: argparse.ArgumentParser) -> None:
    from agents.shipped import SHIPPED_STUDENT

    parser.add_argument(
        "student",
        type=any_path,
        nargs="?",
        default=SHIPPED_STUDENT,
        metavar="FILE",
        help="a trained student, best.safetensors (default: shipped)",
    )
    parser.add_argument("--shared", type=any_folder, metavar="DIR", help="folder with data and teacher of its study")
    parser.add_argument("--episodes", type=whole(), default=3, metavar="N", help="how many (default: %(default)s)")
    parser.add_argument("--split", choices=("train", "validation", "test"), default="test", help="whose requests")
    parser.add_argument("--greedy", action="store_true", help="the likeliest rule instead of a sampled one")
    parser.add_argument("--seed", type=int, default=0, help="of which episodes, and what is drawn (default: 0)")
    parser.add_argument("--request", metavar="TEXT", help="a request of your own; nobody describes what is done")
    parser.add_argument("--word", default="banana", help="the word it is about (default: %(default)s)")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
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
    from agents.iliad.regex.run import load_student, prepare
    from agents.iliad.regex.showing import lines_of, tell
    from agents.shipped import SHIPPED_STUDENT
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

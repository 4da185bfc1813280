"""Questions about houses (`vqa`): what the commands dataset, evaluate and view do with them."""

from __future__ import annotations

import base64
import itertools
import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np

from embodied.cli.common import bar, check_machine, note, pause, show

if TYPE_CHECKING:
    from embodied.cli.dataset import DatasetOptions
    from embodied.cli.evaluate import EvaluateOptions
    from embodied.cli.view import ViewOptions
    from embodied.datasets.vqa.build import VqaData
    from embodied.datasets.vqa.scoring import VqaQuestion

VQA, DEFAULT_HOUSES, PER_HOUSE, TOGETHER, WRAPPED = "vqa", {"train": 40, "test": 10}, 200, 32, 210
"""Houses of the splits, and questions of a house, unless options say otherwise; questions sent at a time; letters of a
line of a sheet."""
COLOURS = ((40, 40, 255), (60, 200, 60), (255, 120, 30), (0, 210, 255), (230, 60, 230), (255, 255, 0))
"""BGR of the outline of the first thing that a question is about, the second, ..."""


def make(args: DatasetOptions) -> None:
    """`embodied dataset vqa`."""
    from tqdm import tqdm

    from embodied.agents.vision.answers import guessed
    from embodied.datasets.vqa.build import VqaConfig, build_vqa
    from embodied.evaluation.evaluate import read_seeds

    pictures, seeds = args.pictures or "fast", tuple(read_seeds(args.seed_file)) if args.seed_file else ()
    if pictures == "none" or args.scale:
        raise ValueError("questions are about pictures of houses, and --houses says how many: leave --scale out")
    given = {"train": (args.houses, args.tasks), "test": (args.test_houses, args.evaluation_tasks)}
    houses = {split: given[split][0] or n for split, n in DEFAULT_HOUSES.items()}
    if seeds:
        houses, given = {"hidden": len(seeds)}, {"hidden": (None, args.evaluation_tasks)}
    questions = {split: given[split][1] or PER_HOUSE * n for split, n in houses.items()}
    check_machine(pictures)
    watch = lambda jobs, total: tqdm(jobs, "houses", total=total, unit="house", mininterval=pause())
    config = VqaConfig(houses, questions, args.seed, args.area, pictures, seeds, args.storeys or None)
    about = build_vqa(config, args.out, args.cache, guessed, workers=args.workers, watch=watch).about
    lines = [f"{split}: {sum(c.values())} questions of {len(c)} types" for split, c in about["counts"].items()]
    show(args, {"folder": str(args.out), **about}, "\n".join([*lines, f"digest {about['digest'][:16]}, in {args.out}"]))


def evaluate(args: EvaluateOptions) -> None:
    """`embodied evaluate vqa`: a row for every type, a column for every agent, the judge less its twin."""
    from embodied.agents.vision.answers import guessed
    from embodied.assets.cache import write_bytes, write_json
    from embodied.datasets.vqa.build import VqaData
    from embodied.datasets.vqa.scoring import BLIND, chance, cross_judged, score
    from embodied.evaluation.tables import Estimate, Samples, interval, less
    from embodied.records import save_lines

    if args.data is None:
        raise ValueError("questions need --data, a folder that `embodied dataset vqa` built")
    if unknown := sorted({*args.agent} - {"llm", "blind", "judge"}):
        raise ValueError(
            f"unknown agents {unknown}; questions are answered by llm, judge and blind (models without sight)"
        )
    data = VqaData(args.data)
    splits, every = args.split or [[*data.about["counts"]][-1]], [*map(data.questions, data.about["counts"])]
    questions = [q for s in splits for q in data.questions(s)]
    questions = questions[:: -(-len(questions) // args.tasks)] if args.tasks else questions
    of = {t: [q for q in questions if q.type == t] for t in dict.fromkeys(q.type for q in questions)}
    scores, gains = dict[str, dict[str, float]](), list[Estimate]()
    samples = lambda m, qs: Samples(tuple(scores[m][q.id] for q in qs), tuple(q.walk.rpartition("_")[0] for q in qs))
    if "blind" in (args.agent or ("blind",)):
        known = [[q for qs in every for q in qs if q.type == t] for t in sorted({q.type for q in questions})]
        by_id = lambda qs, judged: zip((q.id for q in qs), judged[0].tolist(), strict=True)
        for m in BLIND:
            scores[m] = dict(pair for qs in known for pair in by_id(qs, cross_judged(m, qs, args.seed + 1)))
        scores["network"] = dict(by_id(together := [q for qs in every for q in qs], guessed(together, args.seed + 1)))
    if "judge" in args.agent:
        for m, answer_of in zip(("judge", "judge, blind"), judged(args, data, questions)):
            scores[m] = {q.id: score(q, answer_of[q.id]) for q in questions}
        gains = [
            interval([less(samples("judge", qs), samples("judge, blind", qs))]) for qs in (*of.values(), questions)
        ]
    if "llm" in args.agent:
        answers = [*bar(answered(args, data, questions), "questions", "question", len(questions))]
        scores["llm"] = {q.id: score(q, answer) for q, answer in zip(questions, answers, strict=True)}
        if args.out:
            records = ({"id": q.id, "said": a, "score": scores["llm"][q.id]} for q, a in zip(questions, answers))
            save_lines(args.out / "answers.jsonl", records)
    estimates = {m: [interval([samples(m, qs)]) for qs in of.values()] for m in scores}
    columns = {"chance": [chance(qs) for qs in of.values()], **{m: [e.mean for e in x] for m, x in estimates.items()}}
    half = {m: [e.half for e in x] for m, x in estimates.items()}
    cells = [[f"{100 * v:.1f}" for v in (*c, sum(c) / len(c))] for c in columns.values()]
    for m, row in zip(half, cells[1:]):
        row[:-1] = [f"{text} ± {100 * h:.1f}" for text, h in zip(row, half[m])]
    cells += [[f"{100 * e.mean:+.1f} ± {100 * e.half:.1f}" for e in gains]] if gains else []
    heads = ["type", "n", *columns, *["sight"] * bool(gains)]
    labels = [*((t, len(qs)) for t, qs in of.items()), ("mean of types", len(questions))]
    rows = [heads, ["---"] * len(heads), *([t, str(n), *row] for (t, n), *row in zip(labels, *cells, strict=True))]
    table = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    facts = {"data": data.about["digest"], "split": splits, "types": [*of], "scores": columns, "half": half}
    facts |= {"sight": [[e.mean, e.half] for e in gains], "n": [len(qs) for qs in of.values()]}
    if args.out:
        write_bytes(args.out / "table.md", table.encode())
        write_json(args.out / "table.json", facts, indent=1)
    show(args, facts, table)


def judged(args: EvaluateOptions, data: VqaData, asked: Sequence[VqaQuestion]) -> list[dict[str, str]]:
    """Answers of a network that learns from train (asked about, too: from other houses), and of its blind twin."""
    from embodied.agents.vision.answers import Eyes, answers_of
    from embodied.assets.catalogue import load_catalogue
    from embodied.datasets.vqa.scoring import folds

    learned, of = data.questions("train"), folds(asked, args.seed)
    known = {q.walk for q in learned} & {q.walk for q in asked}
    walks, answers_by = sorted({q.walk for q in (*learned, *asked)}), [dict[str, str](), dict[str, str]()]
    eyes = Eyes(data, bar(walks, "frames", "walk", len(walks)), load_catalogue(args.cache))
    for fold in sorted({*of.tolist()}) if known else [None]:
        part = [q for q, k in zip(asked, of) if fold in (None, k)]
        others = [q for q, k in zip(asked, of) if k != fold] if known else learned
        eyes.learn(q.walk for q in others)
        seen = {q.id: eyes.facts(q) for q in (*others, *part)}
        for answers, facts in zip(answers_by, (seen, {k: x * 0 for k, x in seen.items()})):
            answers |= zip((q.id for q in part), answers_of(others, part, facts, seed=args.seed))
    return answers_by


def answered(args: EvaluateOptions, data: VqaData, questions: Sequence[VqaQuestion]) -> Iterator[str]:
    """Answers of a language model, which is shown --frames frames; what it said where that is no JSON."""
    from embodied.agents.language_models.client import client_of
    from embodied.agents.language_models.completions import object_schema
    from embodied.agents.language_models.prompts import read_prompt
    from embodied.datasets.vqa.scoring import LETTERS

    client, prompt, left = client_of(args), read_prompt("vqa", ("question",), args.prompts), iter(questions)
    plain = 0
    url = lambda file: "data:image/jpeg;base64," + base64.b64encode(file.read_bytes()).decode()
    while group := [*itertools.islice(left, TOGETHER)]:
        asked = []
        for q in group:
            frames = () if args.sees == "nothing" else tuple(map(url, data.frames(q.walk, args.frames)))
            says = {"enum": [*LETTERS[: len(q.options)]]} if q.options else {"maxLength": 20}
            schema = object_schema(answer={"type": "string", **says})
            asked.append((prompt.messages(frames, question=q.prompt), schema))
        for a in client.ask_all(asked):
            plain += a.value is None
            yield a.text if a.value is None else str(a.value["answer"])
    note(f"{client.sent} requests were sent; all other answers were in {args.answers}")
    if plain:
        note(f"{plain} answers of {len(questions)} were no JSON as it was asked for, and are read as they are")


def look(args: ViewOptions) -> None:
    """`embodied view` of a folder of questions: their list, or one of them as a picture."""
    from embodied.datasets.vqa.build import VqaData

    data = VqaData(args.folder)
    questions = [q for split in data.about["counts"] for q in data.questions(split)]
    if args.episode is None:
        facts = [{"number": k, "id": q.id, "answer": q.answer} for k, q in enumerate(questions)]
        show(args, {"questions": facts}, "\n".join(f"{k}: {q.text} {q.answer}" for k, q in enumerate(questions)))
    elif args.episode >= len(questions):
        raise ValueError(f"--episode {args.episode} does not exist; there are questions 0 to {len(questions) - 1}")
    else:
        path = args.folder / "sheets" / f"{args.episode}.png"
        path.parent.mkdir(exist_ok=True)
        cv2.imwrite(str(path), sheet(data, questions[args.episode]))
        show(args, {"picture": str(path)}, f"wrote {path}")


def sheet(data: VqaData, question: VqaQuestion, columns: int = 4, line: int = 24) -> np.ndarray:
    """(h, w, 3) BGR: a question and its answer, above frames of its walk: evenly spaced ones, and the one that shows
    each thing best that it is about, outlined."""
    from embodied.datasets.vqa.walks import read_frame
    from embodied.house.house import House
    from embodied.records import read_json

    files = data.frames(question.walk)
    house = House.load(files[0].parents[1] / "house.json")
    number = {p.id: i + 1 for i, p in enumerate(house.placements)}
    number |= read_json(files[0].with_name("walk.json")).get("inside", {})
    outlined = [(name, number[name], c) for name, c in zip(question.about, COLOURS) if name in number]
    ids = [read_frame(f.with_suffix(".png"), cv2.IMREAD_UNCHANGED) for f in files]
    best = {max(range(len(ids)), key=lambda k: (ids[k] == i).sum()) for _, i, _ in outlined}
    say = lambda on, text, x, y, colour=(0, 0, 0): cv2.putText(on, text, (x, y), 0, 0.5, colour, 1, cv2.LINE_AA)
    pictures = []
    for k in sorted(best | {*np.linspace(0, len(files) - 1, columns).astype(int).tolist()}):
        picture = say(read_frame(files[k]), str(k), 6, 352, (255, 255, 255))
        for _, i, colour in outlined:
            edges, _ = cv2.findContours((ids[k] == i).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
            cv2.drawContours(picture, edges, -1, colour, 2)
        pictures.append(picture)
    pictures += [np.full_like(pictures[0], 255)] * (-len(pictures) % columns)
    options = "   ".join(question.prompt.split("\n")[2:-1])
    texts = (f"{question.id}: {question.text}", options, f"{question.letter}   {question.fact}")
    lines = [part for text in texts for part in textwrap.wrap(text, WRAPPED) or [""]]
    head = np.full(((len(lines) + 1) * line + 8, columns * pictures[0].shape[1], 3), 255, np.uint8)
    for k, text in enumerate(lines, 1):
        say(head, text, 8, line * k)
    for k, (name, _, colour) in enumerate(outlined):
        say(head, name, 8 + 300 * k, (len(lines) + 1) * line, colour)
    return np.vstack([head, *(np.hstack(pictures[i : i + columns]) for i in range(0, len(pictures), columns))])

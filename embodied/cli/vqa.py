"""Questions about houses (`vqa`): what the commands dataset and evaluate do with them."""

from __future__ import annotations

import base64
import itertools
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from embodied.cli.common import bar, check_machine, note, pause, show

if TYPE_CHECKING:
    from embodied.cli.dataset import DatasetOptions
    from embodied.cli.evaluate import EvaluateOptions
    from embodied.datasets.vqa.build import VqaData
    from embodied.datasets.vqa.scoring import VqaQuestion

VQA, DEFAULT_HOUSES, PER_HOUSE, TOGETHER = "vqa", {"train": 40, "test": 10}, 200, 32
"""Houses of the splits, and questions of a house, unless options say otherwise; questions sent at a time."""


def make(args: DatasetOptions) -> None:
    """`embodied dataset vqa`."""
    from tqdm import tqdm

    from embodied.datasets.vqa.build import VqaConfig, build_vqa
    from embodied.evaluation.own_agents import read_seeds

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
    config = VqaConfig(houses, questions, args.seed, args.area, pictures, seeds)
    about = build_vqa(config, args.out, args.cache, workers=args.workers, watch=watch).about
    lines = [f"{split}: {sum(c.values())} questions of {len(c)} types" for split, c in about["counts"].items()]
    show(args, {"folder": str(args.out), **about}, "\n".join([*lines, f"digest {about['digest'][:16]}, in {args.out}"]))


def evaluate(args: EvaluateOptions) -> None:
    """`embodied evaluate vqa`: a row for every type, a column for every agent."""
    from embodied.assets.cache import write_bytes, write_json
    from embodied.datasets.vqa.build import VqaData
    from embodied.datasets.vqa.scoring import BLIND, chance, cross_judged, score
    from embodied.records import save_lines

    if args.data is None:
        raise ValueError("questions need --data, a folder that `embodied dataset vqa` built")
    if unknown := sorted({*args.agent} - {"llm", "blind"}):
        raise ValueError(f"unknown agents {unknown}; questions are answered by llm and blind (models that see nothing)")
    data = VqaData(args.data)
    split = args.split[0] if args.split else [*data.about["counts"]][-1]
    questions = data.questions(split)
    questions = questions[:: -(-len(questions) // args.tasks)] if args.tasks else questions
    of = {t: [q for q in questions if q.type == t] for t in dict.fromkeys(q.type for q in questions)}
    columns = {"chance": [chance(qs) for qs in of.values()]}
    if "blind" in (args.agent or ("blind",)):
        columns |= {m: [float(cross_judged(m, qs, args.seed + 1)[0].mean()) for qs in of.values()] for m in BLIND}
    if "llm" in args.agent:
        answers = [*bar(answered(args, data, questions), "questions", "question", len(questions))]
        scores = {q.id: score(q, answer) for q, answer in zip(questions, answers, strict=True)}
        columns["llm"] = [sum(scores[q.id] for q in qs) / len(qs) for qs in of.values()]
        if args.out:
            records = ({"id": q.id, "said": a, "score": scores[q.id]} for q, a in zip(questions, answers))
            save_lines(args.out / "answers.jsonl", records)
    rows = [(t, len(qs), values) for (t, qs), *values in zip(of.items(), *columns.values())]
    rows.append(("mean of types", len(questions), [sum(c) / len(c) for c in columns.values()]))
    table = f"| type | n | {' | '.join(columns)} |\n|---|{'---|' * (len(columns) + 1)}\n"
    table += "".join(f"| {t} | {n} | {' | '.join(f'{100 * v:.1f}' for v in values)} |\n" for t, n, values in rows)
    facts = {"data": data.about["digest"], "split": split, "types": [*of], "scores": columns}
    if args.out:
        write_bytes(args.out / "table.md", table.encode())
        write_json(args.out / "table.json", facts, indent=1)
    show(args, facts, table)


def answered(args: EvaluateOptions, data: VqaData, questions: Sequence[VqaQuestion]) -> Iterator[str]:
    """Answers of a language model, which is shown --frames frames; '' where its answer is none."""
    from embodied.agents.language_models.client import client_of
    from embodied.agents.language_models.completions import object_schema
    from embodied.agents.language_models.prompts import read_prompt
    from embodied.datasets.vqa.scoring import LETTERS

    client, prompt, left = client_of(args), read_prompt("vqa", ("question",), args.prompts), iter(questions)
    url = lambda file: "data:image/jpeg;base64," + base64.b64encode(file.read_bytes()).decode()
    while group := [*itertools.islice(left, TOGETHER)]:
        asked = []
        for q in group:
            frames = () if args.sees == "nothing" else tuple(map(url, data.frames(q.walk, args.frames)))
            says = {"enum": [*LETTERS[: len(q.options)]]} if q.options else {"maxLength": 20}
            schema = object_schema(answer={"type": "string", **says})
            asked.append((prompt.messages(frames, question=q.prompt), schema))
        yield from ("" if a.value is None else str(a.value["answer"]) for a in client.ask_all(asked))
    note(f"{client.sent} requests were sent; all other answers were in {args.answers}")

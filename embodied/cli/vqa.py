"""Questions about houses (`vqa`): what the commands dataset and evaluate do with them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from embodied.cli.common import check_machine, pause, show

if TYPE_CHECKING:
    from embodied.cli.dataset import DatasetOptions
    from embodied.cli.evaluate import EvaluateOptions

VQA, DEFAULT_HOUSES, PER_HOUSE = "vqa", {"train": 40, "test": 10}, 200
"""Houses of the splits, and questions of a house, unless options say otherwise."""


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
    from embodied.datasets.vqa.scoring import BLIND, chance, cross_judged

    if args.data is None:
        raise ValueError("questions need --data, a folder that `embodied dataset vqa` built")
    if unknown := sorted({*args.agent} - {"blind"}):
        raise ValueError(f"unknown agents {unknown}; questions are answered by blind (models that see nothing)")
    data = VqaData(args.data)
    split = args.split[0] if args.split else [*data.about["counts"]][-1]
    questions = data.questions(split)
    questions = questions[:: -(-len(questions) // args.tasks)] if args.tasks else questions
    of = {t: [q for q in questions if q.type == t] for t in dict.fromkeys(q.type for q in questions)}
    columns = {"chance": [chance(qs) for qs in of.values()]}
    columns |= {m: [float(cross_judged(m, qs, args.seed + 1)[0].mean()) for qs in of.values()] for m in BLIND}
    rows = [(t, len(qs), values) for (t, qs), *values in zip(of.items(), *columns.values())]
    rows.append(("mean of types", len(questions), [sum(c) / len(c) for c in columns.values()]))
    table = f"| type | n | {' | '.join(columns)} |\n|---|{'---|' * (len(columns) + 1)}\n"
    table += "".join(f"| {t} | {n} | {' | '.join(f'{100 * v:.1f}' for v in values)} |\n" for t, n, values in rows)
    facts = {"data": data.about["digest"], "split": split, "types": [*of], "scores": columns}
    if args.out:
        write_bytes(args.out / "table.md", table.encode())
        write_json(args.out / "table.json", facts, indent=1)
    show(args, facts, table)

"""All baselines of Ask-v0 in houses never seen: one table with intervals, and curves of success against price.

embodied study ask --out docs            # writes ask.json, ask_table.md and figure_ask.png
embodied study ask --out docs --draw     # only draws the figure from ask.json again
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from agents.ask.foresight import CHOICES, Foresight
from agents.ask.learned import LearnedAsker, facts, train
from assets.cache import atomic_path, write_bytes
from assets.catalogue import Catalogue, load_catalogue
from embodied.datasets.build import make_dataset_house
from embodied.datasets.store import StoredPlace
from embodied.envs.make import ask_environment_maker, look_of
from embodied.evaluation.ask import COLUMNS, ask_row, ask_split
from embodied.evaluation.evaluate import spread
from embodied.evaluation.rollout import play
from embodied.evaluation.tables import Row, as_json, markdown
from embodied.generate import HouseConfig
from embodied.interface import Action, Agent, Ask, Detection, Episode, Intention, Observation, Task
from embodied.policies.ask import Asker, AskRule, Mind, baselines, between, first
from embodied.tasks.ask import Look

AREA = (90.0, 140.0)
"""Square metres of the houses."""
SEEDS = (0, 1, 2)
"""Of the learned asker."""


@dataclass(frozen=True)
class StudySize:
    """How large the study is."""

    train_houses: int = 8
    train_tasks: int = 8
    """Per house."""
    test_houses: int = 8
    test_tasks: int = 15
    foresight: int = 40
    """Tasks of the test that the oracle of asking plays: every house's first five, of which three are ambiguous."""


def after(steps: int, rule: AskRule) -> AskRule:
    """Asks for the way once so many steps have passed, and again when it has been walked; before, another rule."""

    def late(o: Observation, thing: Detection | None, trail: Mind) -> Action | None:
        return Ask(Intention.ROUTE) if o.advised is None and o.time >= steps else rule(o, thing, trail)

    return late


def families() -> dict[str, list[Agent]]:
    """Curves: rules with one number that says how readily they ask."""
    levels = ((0.75, 0.75), (0.7, 0.85), (0.6, 0.85), (0.5, 0.95), (0.4, 2.0))
    sure = between(0.55, 0.75)
    return {
        "thresholds on the score": [Asker(between(low, high)) for low, high in levels],
        "region, then thresholds": [Asker(first(Intention.REGION, between(low, high))) for low, high in levels],
        "route after some steps": [Asker(after(n, sure)) for n in (50, 30, 20, 10, 0)],
    }


def houses(seeds: Sequence[int], name: str, catalogue: Catalogue) -> dict[str, StoredPlace]:
    """Houses never seen anywhere else: their names are drawn from, too."""
    made = (make_dataset_house(s, f"{name}_{k}", HouseConfig(area=AREA), catalogue) for k, s in enumerate(seeds))
    return {house.name: StoredPlace(house, graph) for house, graph in made}


def lessons(places: dict[str, StoredPlace], look: Look, tasks: Sequence[Task]) -> tuple[np.ndarray, np.ndarray]:
    """The oracle's decisions: (n, d) what was known, (n,) what it chose."""
    known: list[np.ndarray] = []
    chosen: list[int] = []

    def note(o: Observation, trail: Mind, choice: int) -> None:
        known.append(facts(o, trail))
        chosen.append(choice)

    make_env = ask_environment_maker(places, look)
    play(make_env, Foresight(make_env, note, doubts=True), tasks, seed=0)
    return np.stack(known), np.array(chosen, dtype=np.int64)


def run(out: Path, plan: StudySize, cache: Path) -> None:
    """Everything: lessons, training, judging, table and figure."""
    catalogue = load_catalogue(cache)
    look = look_of(catalogue)
    school = houses(range(100, 100 + plan.train_houses), "ask_train", catalogue)
    inputs, labels = lessons(school, look, ask_split(school, look, plan.train_tasks, seed=100, unseen=False))
    print(f"{len(labels)} decisions: {dict(zip(map(str, CHOICES), np.bincount(labels, minlength=len(CHOICES))))}")
    nets = [train(inputs, labels, seed=s) for s in SEEDS]
    test = houses(range(plan.test_houses), "ask_test", catalogue)
    make_env, rows, curves = ask_environment_maker(test, look), [], {}
    for split, unseen in (("unseen houses", False), ("unseen houses and classes", True)):
        tasks = ask_split(test, look, plan.test_tasks, seed=0, unseen=unseen)

        def judged(name: str, agents: Sequence[Agent], tasks: Sequence[Task] = tasks, split: str = split) -> Row:
            episodes: list[Episode] = []
            for agent in agents:
                episodes += play(make_env, agent, tasks, seed=0, batch=8, agent=name)
            return ask_row(name, split, episodes, test, seed=0)

        for name, agent in baselines().items():
            rows.append(judged(name, [agent]))
        rows.append(judged("learned asker (3 seeds)", [LearnedAsker(n) for n in nets]))
        rows.append(judged("oracle of asking", [Foresight(make_env)], spread(tasks, plan.foresight)))
        if not unseen:
            for name, agents in families().items():
                curves[name] = [_point(judged(name, [a])) for a in agents]
            reserves = (4.0, 2.0, 1.0, 0.0, -1.0)
            learned = [judged("learned", [LearnedAsker(n, r) for n in nets]) for r in reserves]
            curves["learned asker"] = [_point(r) for r in learned]
    body = {"plan": vars(plan), "rows": json.loads(as_json(rows)), "curves": curves}
    write_bytes(out / "ask.json", (json.dumps(body, indent=1) + "\n").encode())
    write_bytes(out / "ask_table.md", markdown(rows, COLUMNS).encode())
    print(markdown(rows, COLUMNS))
    draw(out)


def _point(row: Row) -> list[float]:
    """(mean price, success, half width of its interval)."""
    found = row.values["success"]
    return [round(x, 4) for x in (row.values["price"].mean, found.mean, found.half)]


def draw(out: Path) -> None:
    """The figure, from ask.json."""
    body = json.loads((out / "ask.json").read_text())
    figure = Figure(figsize=(7.2, 4.6), dpi=120, layout="constrained")
    axes = figure.subplots()
    for name, points in body["curves"].items():
        x, y, half = np.array(points).T
        axes.errorbar(x, 100 * y, 100 * half, marker="o", markersize=4, capsize=2, linewidth=1.2, label=name)
    marks = {"never ask": "v", "always route": "s", "oracle": "*", "oracle of asking": "P"}
    for row in body["rows"]:
        if row["agent"] in marks and row["split"] == "unseen houses":
            v = row["values"]
            mark = marks[row["agent"]]
            axes.plot(v["price"]["mean"], 100 * v["success"]["mean"], mark, color="black", label=row["agent"])
    axes.set(xlabel="mean price of the questions of an episode", ylabel="success (%)", ylim=(0, 104))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="lower right")
    with atomic_path(out / "figure_ask.png") as path:
        figure.savefig(path, metadata={"Software": None})

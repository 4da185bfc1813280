"""Ask-v0's tables as data for the engine: all agents in houses never seen, and success against the moment of asking."""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.ask.learned import Decisions, Foresight, LearnedAsker, load_asker, shown, train
from embodied.agents.common.session import Note
from embodied.agents.common.weights import save_weights
from embodied.agents.learners.ask import AskerConfig, AskEvaluation
from embodied.agents.studies.engine import Measured, StudyLearner
from embodied.agents.studies.tables import Figure, StudyRow, StudyTable
from embodied.assets.catalogue import load_catalogue
from embodied.datasets.build import make_dataset_house
from embodied.datasets.store import StoredPlace
from embodied.envs.base import HelpEnv
from embodied.evaluation.evaluate import late_env, play, spread
from embodied.evaluation.tables import measured
from embodied.generate import HouseConfig
from embodied.interface import Agent, Task
from embodied.kinds import metrics
from embodied.kinds.shipped.ask import ASK, ask_environments
from embodied.records import Identity, identity_of, save_lines
from embodied.tasks.ask import ask_split, look_of

AREA = (90.0, 140.0)
"""Square metres of the houses."""
FIRST = 100
"""Seed of the first training house."""
TEST = 1000
"""Seed of the first test house. Thresholds and network were chosen while looking at those from 0 on, which nothing is
evaluated in any more."""
ASK_SPLITS = ("unseen houses", "unseen houses and classes")
MODEL, FORESIGHT = "language model", "oracle of asking"
Places = Mapping[str, StoredPlace]
ModelMaker = Callable[[Places], Agent]


MOMENTS = (0.0, 0.1, 0.3, 0.5, 1.0)
"""Shares of an episode's steps before which nobody can be asked."""


def _rule(name: str) -> StudyRow:
    return StudyRow(name, None, {"rule": name})


def _moments() -> tuple[StudyRow, ...]:
    rules = ("confirm on sight", "region first", "appearance, then confirm", "collect, then split", "always route")
    late = [
        dataclasses.replace(
            r, label=f"{r.label}, from {100 * m:g} %", judge={**r.judge, "late": m}, x=100 * m, series=r.label
        )
        for r in (*map(_rule, rules), StudyRow("learned asker", {}))
        for m in MOMENTS
    ]
    return tuple(late)


@dataclass(frozen=True)
class AskStudy(StudyLearner):
    """Who asks when, and what it is worth."""

    cache: Path
    config: AskerConfig
    evaluation: AskEvaluation
    repeats: tuple[int, ...]
    """Training seeds of the learned asker."""
    threads: int = 1
    model: ModelMaker | None = None
    """Makes the agent of a language model; None where none takes part."""
    model_about: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    """All that its answers depend on."""

    name = "ask"

    def tables(self) -> Mapping[str, StudyTable]:
        model, columns = (_rule(MODEL),) if self.model else (), (*ASK.columns, *ASK.metrics, *metrics.USAGE)
        differences = (
            StudyRow(f"learned asker minus {other}", {}, minus=_rule(other))
            for other in ("confirm on sight", "always route")
        )
        rows = (*map(_rule, ASK.baselines), StudyRow("learned asker", {}), _rule(FORESIGHT), *model, *differences)
        figure = Figure(("success_",), "first question possible after so many per cent of the steps", "success (%)")
        return {
            "houses": StudyTable("Ask-v0 in unseen houses", rows, columns, ASK_SPLITS[:1]),
            "classes": StudyTable("Ask-v0 in unseen houses with unseen classes", rows, columns, ASK_SPLITS[1:]),
            "moments": StudyTable(
                "Ask-v0: success against the moment of the first question",
                _moments(),
                ("success", "weighted success", "requests", "question precision", "blockers cleared", "ask F1"),
                ASK_SPLITS[:1],
                figure=figure,
            ),
        }

    def trained(self, train: Mapping[str, Any], seed: int, folder: Path) -> Identity:
        return identity_of("embodied.agents.ask.learned", settings=dataclasses.replace(self.config, seed=seed))

    def train(self, train_: Mapping[str, Any], seed: int, folder: Path, home: Path, note: Note) -> Path:
        config = dataclasses.replace(self.config, seed=seed)
        first, rounds, make_env = training_decisions(
            config.houses, config.tasks, config.rounds, config.round_tasks, self.cache
        )
        net = train(make_env, first, rounds, config, note)
        identity = self.trained(train_, seed, folder)
        save_weights(home / "best.safetensors", "asker", net.state_dict(), config, identity)
        return home / "best.safetensors"

    def judged(self, row: StudyRow, split: str) -> Mapping[str, object]:
        model = self.model_about if row.judge.get("rule") == MODEL else {}
        return {"evaluation": self.evaluation, "model": model}

    def judge(self, weights: Path | None, row: StudyRow, split: str, seed: int, folder: Path, keep: Path) -> Measured:
        e, rule = self.evaluation, row.judge.get("rule")
        places, make_env, look = houses("ask_test", TEST, e.test_houses, self.cache)
        tasks: Sequence[Task] = ask_split(places, look, e.test_tasks, seed=TEST, unseen=split == ASK_SPLITS[1])
        tasks = spread(tasks, {MODEL: e.model_tasks, FORESIGHT: e.oracle_tasks}.get(str(rule)))
        player = self._player(weights, row.judge, places, make_env)
        late = functools.partial(late_env, make_env, row.judge.get("late", 0.0))
        episodes = play(late, player, tasks, seed=TEST, batch=8, agent=row.label)
        save_lines(keep.with_name(f"{keep.name}.jsonl"), episodes)
        return measured(episodes, {name: place.graph for name, place in places.items()})

    def _player(
        self, weights: Path | None, judge: Mapping[str, Any], places: Places, make_env: Callable[[], HelpEnv]
    ) -> Agent:
        if weights is not None:
            return LearnedAsker(load_asker(weights))
        rule = judge["rule"]
        if rule == MODEL:
            assert self.model is not None, "the row is there where a model is"
            return self.model(places)
        return Foresight(make_env) if rule == FORESIGHT else ASK.agent(rule)

    def about(self) -> str:
        c, e = self.config, self.evaluation
        return (
            f"{e.test_houses} houses of 90 to 140 m² that nobody learned in, {e.test_tasks} tasks in each; the oracle "
            f"of asking plays {e.oracle_tasks} of them. The learned asker imitates it in {c.houses} houses: "
            f"{c.houses * c.tasks} tasks that the oracle plays, then {c.rounds} rounds of {c.houses * c.round_tasks} "
            f"that the learner plays (DAgger); training seeds {', '.join(map(str, self.repeats))}."
        ) + (f" {MODEL.capitalize()}: {self.model_about['model']}, {e.model_tasks} tasks." if self.model else "")


@functools.cache
def houses(name: str, seed: int, count: int, cache: Path) -> tuple[dict[str, StoredPlace], Callable[[], HelpEnv], Any]:
    """So many houses with seeds from `seed` on, what makes environments in them, and the looks of things."""
    catalogue = load_catalogue(cache)
    made = (make_dataset_house(seed + k, f"{name}_{k}", HouseConfig(area=AREA), catalogue) for k in range(count))
    places = {house.name: StoredPlace(house, graph) for house, graph in made}
    look = look_of(catalogue)
    return places, ask_environments(places, look), look


@functools.cache
def training_decisions(
    count: int, tasks: int, rounds: int, round_tasks: int, cache: Path
) -> tuple[Decisions, list[list[Task]], Callable[[], HelpEnv]]:
    """Data that all training seeds share: the oracle's own decisions, and the tasks of the further rounds."""
    places, make_env, look = houses("ask_train", FIRST, count, cache)
    first = shown(make_env, ask_split(places, look, tasks, seed=FIRST, unseen=False), seed=0)
    further = [ask_split(places, look, round_tasks, seed=FIRST + 1 + k, unseen=False) for k in range(rounds)]
    return first, further, make_env

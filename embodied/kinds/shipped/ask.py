"""Ask: find one described object among its like; questions have prices (Ask-v0, docs/ask.md)."""

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np

from embodied.action_spaces import PanoramicMoves
from embodied.assistants.ask import QUESTIONS, AskAssistant
from embodied.assistants.descriptions import DESCRIPTION_ROWS, Describer, description_rows
from embodied.envs.ask import AskEnv, AskSettings
from embodied.interface import Assistant, Episode, Observation, Place, Stop
from embodied.kinds import task_kind
from embodied.kinds.metrics import asked, success
from embodied.navigation.graph import NavGraph
from embodied.policies.ask import ASKER_RULES, Asker, CollectThenSplit
from embodied.policies.baselines import Shortest
from embodied.tasks.ask import Look, ask_pool, ask_tasks, look_of

AS_USUAL = AskSettings()
UNSEEN_CLASSES = "unseen_classes"
"""Tasks of the classes that are kept from training."""
QUESTION_LIMITS = range(1, 6)


def tasks(inputs: task_kind.TaskInputs, parts: task_kind.Parts) -> task_kind.PartTasks:
    """The same of all parts, but for the classes that are kept from training."""
    look = look_of(getattr(inputs.world, "catalogue", None))
    pool = lambda unseen: ask_pool(inputs.world, look, seed=inputs.seed, unseen=unseen)
    return {n: ask_tasks(pool(n == UNSEEN_CLASSES or None), count, seed=inputs.seed) for n, count in parts}


def environments(inputs: task_kind.EnvInputs) -> task_kind.EnvMaker:
    catalogues = (getattr(w, "catalogue", None) for w in inputs.worlds.values())
    return ask_environments(inputs.worlds, look_of(next(catalogues, None)), inputs.rules, inputs.assistant)


def ask_environments(
    worlds: Mapping[str, Place], look: Look, rules: AskSettings = AS_USUAL, assistant: Assistant | None = None
) -> task_kind.EnvMaker:
    """A maker of environments.

    Args:
      look: words of colour and material of things.
      assistant: who answers, instead of AskAssistant.
    """
    answering, moves, describer = assistant or AskAssistant(look), PanoramicMoves(), Describer(())
    return lambda: AskEnv(worlds, answering, moves, rules, describer)


def price(episode: Episode, graph: NavGraph) -> float:
    """Price of the questions."""
    return float(sum(s.cost for s in episode.steps))


def weighted_success(episode: Episode, graph: NavGraph) -> float:
    """Success less the price of the questions, never below 0."""
    return success(episode, graph) * max(0.0, 1.0 - price(episode, graph))


def success_progress(episode: Episode, graph: NavGraph) -> float:
    """Mean over the limits of 1 to 5 questions of succeeding within the limit.

    After the Mean Success Progress of VL-LN Bench, which runs every limit by itself; here the questions that were
    asked are counted.
    """
    kept = sum(episode.requests <= limit for limit in QUESTION_LIMITS)
    return success(episode, graph) * kept / len(QUESTION_LIMITS)


DETECTIONS = 16
"""Most detections that are shown; the best."""
NO_GOALS = 3
"""Empty rows for goals, which this kind has none of."""


def specs(candidates: int, rules: AskSettings) -> dict[str, task_kind.ArraySpec]:
    """'detections' hold sin and cos of bearing, metres and score; 'advised' is the number of an action plus one, 0 for
    none; 'state' has feature sets as rows (assistants.description_arrays); 'goals' is empty."""
    return {
        "detections": task_kind.ArraySpec((DETECTIONS, 4), -1.0, task_kind.UNBOUNDED),
        "advised": task_kind.ArraySpec((), 0, candidates + 1, "int64"),
        "state": task_kind.ArraySpec((DESCRIPTION_ROWS, 5), 0, task_kind.UNBOUNDED),
        "goals": task_kind.ArraySpec((NO_GOALS, DESCRIPTION_ROWS, 5), 0, task_kind.UNBOUNDED),
    }


def encode(o: Observation, specs: Mapping[str, task_kind.ArraySpec]) -> dict[str, Any]:
    rows, go = np.zeros(specs["detections"].shape, dtype=np.float32), o.extras.advised
    for i, seen in enumerate(o.extras.detections[:DETECTIONS]):
        rows[i] = np.sin(seen.bearing), np.cos(seen.bearing), seen.distance, seen.score
    advised = 0 if go is None else int(specs["advised"].high) if isinstance(go, Stop) else 1 + go.candidate
    return {
        "detections": rows,
        "advised": np.int64(advised),
        "state": description_rows(o.extras.state_description),
        "goals": np.zeros(specs["goals"].shape, dtype=np.float32),
    }


ASK = task_kind.register_kind(
    task_kind.TaskKind(
        name="ask",
        title="Ask",
        tasks=tasks,
        environment=environments,
        rules=AS_USUAL,
        help="words",
        baselines={
            **{name: functools.partial(Asker, rule) for name, rule in ASKER_RULES.items()},
            "collect, then split": CollectThenSplit,
            "oracle": Shortest,
        },
        metrics={
            "weighted success": task_kind.Metric(weighted_success, percent=True),
            "success progress": task_kind.Metric(success_progress, percent=True),
            "price": task_kind.Metric(price),
            **{f"asks {q.value}": task_kind.Metric(asked(q)) for q in QUESTIONS},
            "price per success": task_kind.Metric(price, per=success),
        },
        columns=(
            *("success", "spl", "weighted success", "success progress"),
            *("price", "price per success", "requests", "ask F1"),
        ),
        expert="oracle",
        splits=None,
        intentions=QUESTIONS,
        extras=task_kind.ExtraArrays(specs, encode),
    )
)

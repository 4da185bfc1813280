"""EQA: walk to find something out, then answer one of several options (embodied question answering).

After Das et al. 2018 (arXiv 1711.11543). Answers are from a closed set, so no model judges them. They are grounded if
what they rest on was in view, as in EXPRESS-Bench (Jiang et al. 2025, arXiv 2503.11117).
"""

import dataclasses
import functools
import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from embodied.action_spaces import Reach
from embodied.envs.base import HelpEnv
from embodied.interface import (
    TURNS,
    Action,
    AnswerQuestion,
    Candidates,
    Episode,
    Move,
    Observation,
    Place,
    Pose,
    SeenPlace,
    Situation,
    Stop,
    Task,
)
from embodied.kinds.metrics import oracle_success
from embodied.kinds.task_kind import Metric, Parts, PartTasks, StoryStyle, TaskInputs, TaskKind, register_kind
from embodied.navigation.graph import NavGraph
from embodied.policies.baselines import PerEpisodePolicy, RecognisingExplorer, Shortest
from embodied.seeds import stream

FEWEST_PIXELS = 60
"""Of the 24576 around a node: a thing that shows as many is in view."""
FEWEST_HOPS = 2
"""Edges between a start and the nearest place from where the answer is seen."""
FEWEST_WRONG, MOST_OPTIONS, EQA_STEPS = 2, 4, 40
ANYWHERE, ALIKE = 0.15, 4 / 3
"""Weight of a model in rooms that its row does not name, as the generator has it; weights of options that are alike."""
FORMS = {"colours": "which colour has {}?", "materials": "what is {} made of?"}
"""Fields of an asset, and what is asked of its first word."""


def facts(world: SeenPlace) -> Iterator[tuple[str, AnswerQuestion]]:
    """Questions about things that are the only ones of their class in the only room of its kind; the first option is
    right, and the others are about as likely there. Where things are would be guessed too often."""
    house, assets = world.house, world.catalogue.assets
    kinds, number = Counter(r.kind for r in house.rooms), Counter((p.object_class, p.room) for p in house.placements)
    for p, kind in ((p, house.room_by_id[p.room].kind) for p in house.placements if p.asset in assets):
        if kinds[kind] > 1 or number[p.object_class, p.room] > 1:
            continue
        for form, question in FORMS.items():
            own: tuple[str, ...] = getattr(assets[p.asset], form)
            often: dict[str, float] = {}
            for a in (a for a in assets.values() if a.object_class == p.object_class):
                for word in getattr(a, form)[:1]:
                    often[word] = often.get(word, 0.0) + ANYWHERE + a.rooms.get(kind, 0.0)
            right = often[own[0]] if own else math.inf
            rest = [w for w, n in sorted(often.items()) if w not in own and right / ALIKE <= n <= right * ALIKE]
            if len(rest) >= FEWEST_WRONG:
                where = f"the {p.object_class} in the {kind.replace('_', ' ')}"
                yield question.format(where), AnswerQuestion(form, p.object_class, (own[0], *rest), 0, (p.id,))


def tasks(inputs: TaskInputs, parts: Parts) -> PartTasks:
    """The questions of a house in a drawn order; the same of all parts."""
    world: Any = inputs.world  # it can be seen
    known, name = [*facts(world)], world.house.name
    order = stream(inputs.seed, "pool", "eqa", name).permutation(len(known))
    made = (_task(world, known[i], f"{name}/eqa/{k}", inputs.seed) for k, i in enumerate(order))
    pool = [*itertools.islice((t for t in made if t), max(n for _, n in parts))]
    return {part: pool[:n] for part, n in parts}


def _task(world: SeenPlace, asked: tuple[str, AnswerQuestion], name: str, seed: int) -> Task | None:
    """A question, whose goals are the places from where its answer is seen; None without any, or without a start."""
    (question, fact), rng = asked, stream(seed, "task", name)
    shows = lambda v: any(x.placement in fact.placements and x.pixels >= FEWEST_PIXELS for x in world.sightings(v))
    goals = [v for v in range(len(world.graph.positions)) if shows(v)]
    far = [v for v, hops in enumerate(world.graph.hops) if goals and hops[goals].min() >= FEWEST_HOPS]
    if not far:
        return None
    some = [0, *(1 + rng.permutation(len(fact.options) - 1)[: MOST_OPTIONS - 1])]
    options = tuple(fact.options[i] for i in rng.permutation(some))
    goal = dataclasses.replace(fact, options=options, answer=options.index(fact.options[0]))
    start, request = Pose(int(rng.choice(far)), int(rng.integers(TURNS))), f"{question} {', '.join(options)}"
    return Task(name, "eqa", world.house.name, start, goal, tuple(goals), request, 0.0, EQA_STEPS)


@dataclass(frozen=True)
class _Answers:
    """The answers, as an action space."""

    words: tuple[str, ...]

    def at(self, world: Place, pose: Pose) -> Reach:
        n, zeros = len(self.words), np.zeros(len(self.words), dtype=np.float32)
        return Candidates(zeros, zeros, np.full(n, pose.view), np.ones(n, dtype=bool), self.words), (pose,) * n


class EqaEnv(HelpEnv):
    """Stopping ends the walk; then the candidates are the answers, and choosing one ends the episode."""

    def _begin(self) -> None:
        self._walking = getattr(self, "_walking", self.moves)
        self.moves = self._walking

    def _stopped(self) -> None:
        assert isinstance(self.task.goal, AnswerQuestion), "tasks of this kind"
        if self.moves is self._walking:
            self.moves = _Answers(tuple(f"answer {option}" for option in self.task.goal.options))
            self.time_on_task = 0
        else:
            self.ended = "stop"

    def _moved(self) -> None:
        self.ended = None if self.moves is self._walking else "stop"


def right_answer(episode: Episode, graph: NavGraph) -> float:
    """1 for the right answer."""
    goal, last = episode.task.goal, [s.action for s in episode.steps[-1:]]
    return float(episode.ended == "stop" and isinstance(goal, AnswerQuestion) and last == [Move(goal.answer)])


def grounded(episode: Episode, graph: NavGraph) -> float:
    """1 for the right answer of an agent that had in view what it rests on."""
    return right_answer(episode, graph) * oracle_success(episode, graph)


class Answerer(PerEpisodePolicy):
    """Walks as another agent does and answers rightly, if what that rests on was in view; else it guesses."""

    def __init__(self, walker: PerEpisodePolicy | None = None, worlds: Mapping[str, SeenPlace] | None = None) -> None:
        """
        Args:
          walker: None answers where it begins.
          worlds: it guesses what is commonest in those where it is not; None guesses evenly.
        """
        self._walker, known = walker, {} if worlds is None else {n: [*facts(w)] for n, w in worlds.items()}
        counts = {n: Counter((x.form, x.noun, x.options[0]) for _, x in some) for n, some in known.items()}
        self._elsewhere = {n: sum((c for other, c in counts.items() if other != n), Counter()) for n in counts}

    def new_memory(self) -> Any:
        return self._walker.new_memory() if self._walker else None

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        if not o.candidates.words:
            return self._walker.act_one(o, s, memory, rng) if self._walker else Stop()
        goal, elsewhere = s.task.goal, self._elsewhere.get(s.task.world, Counter())
        assert isinstance(goal, AnswerQuestion), "tasks of this kind"
        if {*s.trail} & {*s.task.goal_nodes}:
            return Move(goal.answer)
        likely = np.array([elsewhere[goal.form, goal.noun, option] for option in goal.options])
        return Move(int(rng.choice(np.flatnonzero(likely == likely.max()))))


EQA = register_kind(
    TaskKind(
        name="eqa",
        title="EQA",
        tasks=tasks,
        environment=lambda inputs: functools.partial(EqaEnv, inputs.worlds),
        baselines={
            "random": Answerer,
            "explores": lambda: Answerer(RecognisingExplorer(remembers=True)),
            "shortest": lambda: Answerer(Shortest()),
        },
        looking={"majority": lambda worlds: Answerer(worlds=worlds)},
        success=right_answer,
        shortest=lambda e, g: float(np.asarray(g.distance)[e.task.start.node, list(e.task.goal_nodes)].min()),
        needs_stop=True,
        metrics={
            "grounded": Metric(grounded, percent=True, share=True),
            "evidence seen": Metric(oracle_success, percent=True, share=True),
        },
        columns=("success", "grounded", "evidence seen", "path length", "steps"),
        splits=None,
        story=StoryStyle(dialogue=False),
    )
)
